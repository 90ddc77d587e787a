"""Paired evaluation: every policy drives the same episodes, whatever the order, the chunks and the other policies.

An episode's seed is a hash of (suite, scenario, episode, seed) and of nothing else. Episodes run as cars of one vector
environment; a car depends on its own seed only, so the number of cars changes no result. All metrics are computed
from `info`, the truth, never from observations.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_env
from lanekeep_benchmarks.lines import EpisodeResult, Place
from lanekeep_benchmarks.metrics import Measured, metrics_of
from lanekeep_benchmarks.suites import OWN_ROAD, Suite, SuiteScenario
from lanekeep_benchmarks.traces import Trace, file_name

#: Episodes that are driven side by side.
CARS = 256


class Policy(Protocol):
    """What is evaluated: as in SB3, batched over cars, pure."""

    def predict(
        self,
        observation: NDArray[np.float32],
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return the actions (n, 1) for observations (n, channels) and the next state."""
        ...


MakePolicy = Callable[[str, Any], Policy]


@dataclass(frozen=True)
class Step:
    """What one control step of all cars brought; ``alive`` (n,) marks cars whose episode it belongs to.

    ``seen`` is what the action was computed from, ``observation`` what came after it, with reward and info.
    """

    alive: NDArray[np.bool_]
    seen: NDArray[np.float32]
    observation: NDArray[np.float32]
    action: NDArray[np.float32]
    reward: NDArray[np.float64]
    info: Mapping[str, Any]


def episode_seed(suite: str, scenario: str, episode: int, seed: int) -> int:
    """Seed of one episode: 53 bits, so that readers which keep numbers as doubles see it exactly."""
    if suite.startswith(OWN_ROAD):  # named after the user's file, whose name must not change what is driven
        suite = scenario = OWN_ROAD
    text = json.dumps([suite, scenario, episode, seed])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") >> 11


def make_cars(scenario: SuiteScenario, cars: int) -> Any:
    """Vector environment of a scenario, one car an episode (untyped: Gymnasium's type does not know it)."""
    keywords = dict(scenario.keywords)
    if scenario.max_episode_steps is not None:
        keywords["max_episode_steps"] = scenario.max_episode_steps
    return gym.make_vec(
        scenario.env_id, num_envs=cars, vectorization_mode="vector_entry_point", autoreset_mode="next_step", **keywords
    )


def drive(env: Any, policy: Policy, seeds: Sequence[int], options: Mapping[str, Any]) -> Iterator[Step]:
    """Yield the steps of one episode a car, until the last one has ended."""
    observation, _ = env.reset(seed=list(seeds), options=dict(options) or None)
    state = None
    start = np.ones(len(seeds), dtype=bool)
    alive = start.copy()
    while alive.any():
        action, state = policy.predict(observation, state, start)
        seen = observation
        observation, reward, terminated, truncated, info = env.step(action)
        yield Step(alive, seen, observation, action, reward, info)
        start = np.zeros_like(start)
        # A car whose episode has ended starts another episode by itself; that is driven on, but not counted.
        alive = alive & ~(terminated | truncated)


@dataclass(frozen=True)
class Batch:
    """Episodes of one policy on one scenario that are driven side by side; of ``numbers`` those are ``missing``."""

    scenario: SuiteScenario
    policy: str
    numbers: Sequence[int]
    missing: frozenset[int]

    @property
    def place(self) -> Place:
        """What tells the batch from the others of its run: that of its first episode."""
        return self.scenario.name, self.policy, self.numbers[0]


class Driven(NamedTuple):
    """What became of a batch: its missing lines, and the name and content of a file of steps where some are kept.

    The content is computed when it is called for, and takes as long as the drive.
    """

    results: list[EpisodeResult]
    trace: tuple[str, Callable[[], bytes]] | None = None


def batches(
    suite: Suite,
    drivers: Mapping[str, Sequence[str]],
    episodes: int,
    done: Collection[Place] = frozenset(),
    cars: int | None = None,
) -> Iterator[Batch]:
    """Yield what has to be driven, scenario by scenario, chunk by chunk of episodes, policy by policy.

    ``drivers`` has the policies of each scenario. Episodes in ``done`` are left out. A chunk of which some are done is
    driven whole all the same: with the same neighbours the result is the same even where a policy's rows are not
    independent to the last bit.
    """
    cars = cars or CARS
    for scenario in suite.scenarios:
        for first in range(0, episodes, cars):
            numbers = range(first, min(first + cars, episodes))
            for name in drivers[scenario.name]:
                missing = frozenset(n for n in numbers if (scenario.name, name, n) not in done)
                if missing:
                    yield Batch(scenario, name, numbers, missing)


class Driver:
    """Drives batches of a suite; the cars of one scenario serve all policies.

    Args:
        suite: its name, part of the episodes' seeds.
        seed: of the run.
        make_policy: takes a policy's name and the scenario that it is made for.
        kept: "all" keeps the steps of all episodes, "failed" those of failures, "none" none.
    """

    def __init__(self, suite: str, seed: int, make_policy: MakePolicy, kept: str = "none") -> None:
        self._suite, self._seed, self._make_policy, self._kept = suite, seed, make_policy, kept
        self._cars: Any = None
        self._of: tuple[SuiteScenario, int] | None = None

    def close(self) -> None:
        """Let the cars go."""
        if self._cars is not None:
            self._cars.close()
        self._cars = self._of = None

    def drive(self, batch: Batch) -> Driven:
        """Drive a batch."""
        scenario, seeds = (
            batch.scenario,
            [episode_seed(self._suite, batch.scenario.name, number, self._seed) for number in batch.numbers],
        )
        if self._of != (scenario, len(seeds)):
            self.close()
            self._cars, self._of = make_cars(scenario, len(seeds)), (scenario, len(seeds))
        definition = self._cars.unwrapped.scenario
        policy = self._make_policy(batch.policy, scenario.policies_scenario(definition))
        measured = Measured(
            metrics_of(scenario.env_id, self._cars.unwrapped.truth, scenario.metrics),
            len(seeds),
            scenario.max_episode_steps or definition.episode_steps,
            definition.control_step,
            hasattr(definition, "laps"),
        )
        steps = drive(self._cars, policy, seeds, scenario.options)
        if self._kept == "none":
            measured.watch(steps)
            return Driven(self._lines(batch, seeds, definition, measured))
        trace = Trace([channel.name for channel in definition.channels])
        measured.watch(trace.watch(steps))
        kept = np.ones(len(seeds), dtype=bool) if self._kept == "all" else measured.failed
        lines = self._lines(batch, seeds, definition, measured)
        if not kept.any():
            return Driven(lines)
        name = file_name(scenario.name, batch.policy, batch.numbers[0])
        return Driven(lines, (name, lambda: trace.parquet(scenario.name, batch.policy, np.array(batch.numbers), kept)))

    def _lines(self, batch: Batch, seeds: Sequence[int], definition: Any, measured: Measured) -> list[EpisodeResult]:
        metrics = measured.results()
        return [
            EpisodeResult(
                suite=self._suite,
                scenario=batch.scenario.name,
                scenario_hash=batch.scenario.hash(definition.hash),
                policy=batch.policy,
                episode=number,
                seed=self._seed,
                episode_seed=seeds[car],
                failed=bool(measured.failed[car]),
                steps=int(measured.count[car]),
                metrics={key: float(values[car]) for key, values in metrics.items()},
                version=lanekeep_env.__version__,
            )
            for car, number in enumerate(batch.numbers)
            if number in batch.missing
        ]


def evaluate(
    suite: Suite,
    policies: Sequence[str],
    make_policy: MakePolicy,
    *,
    episodes: int,
    seed: int,
    cars: int | None = None,
    done: Collection[Place] = frozenset(),
) -> Iterator[list[EpisodeResult]]:
    """Yield the results of batch after batch (`batches`), as they finish."""
    driver = Driver(suite.name, seed, make_policy)
    drivers = {scenario.name: policies for scenario in suite.scenarios}
    for batch in batches(suite, drivers, episodes, done, cars):
        yield driver.drive(batch).results
    driver.close()
