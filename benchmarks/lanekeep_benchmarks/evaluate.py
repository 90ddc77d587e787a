"""Paired evaluation: every policy drives the same episodes, whatever the order, the chunks and the other policies.

An episode's seed is a hash of (suite, scenario, episode, seed) and of nothing else. Episodes run as cars of one vector
environment; a car depends on its own seed only, so the number of cars changes no result. All metrics are computed
from `info`, the truth, never from observations.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Protocol

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_env
from lanekeep_benchmarks.suites import OWN_ROAD, Suite, SuiteScenario
from lanekeep_benchmarks.traces import Trace
from lanekeep_env.checks import choose, from_mapping, require, shown
from lanekeep_env.plain import parse_json

CARS = 256
#: Metrics of every scenario, and those that come first on roads and on circuits.
EFFORT = ("rms_steering_rate", "peak_lateral_acceleration", "return")
ERRORS, LAP = ("rms_lateral_error", "peak_lateral_error"), ("lap_time",)
#: A metric that is read may be as large: sums of fourth powers are still finite.
LARGEST_METRIC = 1e50
_KINDS: dict[Any, tuple[type, str]] = {
    "str": (str, "a text"),
    "int": (int, "a whole number"),
    "bool": (bool, "true or false"),
}


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
Place = tuple[str, str, int]
KeepTrace = Callable[[Trace, str, str, NDArray[np.int64], NDArray[np.bool_]], None]


@dataclass(frozen=True)
class EpisodeResult:
    """One line of episodes.jsonl.

    ``metrics``: rms_lateral_error and peak_lateral_error in m, rms_steering_rate in rad/s at the road wheel,
    peak_lateral_acceleration in m/s², return; over the steps driven; on circuits lap_time in s instead of the errors.
    ``failed``: the car left the lane, touched a wall or did not finish its lap.
    """

    suite: str
    scenario: str
    scenario_hash: str
    policy: str
    episode: int
    seed: int
    episode_seed: int
    failed: bool
    steps: int
    metrics: Mapping[str, float]
    version: str

    def to_json(self) -> str:
        """One line of JSON, without the line end."""
        return json.dumps(asdict(self), allow_nan=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> EpisodeResult:
        """Read a line; ValueError or TypeError, which name the field, where it is not one."""
        values = parse_json(text)
        require_mapping("result line", values)
        line = from_mapping(cls, values, "result line")
        check_kinds(line)
        require("steps", line.steps, "", at_least=1, at_most=1_000_000_000)
        require_mapping("metrics", line.metrics)
        for name, value in line.metrics.items():
            choose("metrics", name, (*LAP, *ERRORS, *EFFORT))
            require(f"metrics.{name}", value, "", at_least=-LARGEST_METRIC, at_most=LARGEST_METRIC)
        return line

    @property
    def place(self) -> Place:
        """What tells the line from the others of its run."""
        return self.scenario, self.policy, self.episode


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


def check_kinds(record: Any) -> None:
    """Raise ValueError unless the fields of a record that are declared as texts, int or bool are just that."""
    for field in fields(record):
        kind, words = _KINDS.get(field.type, (object, ""))
        value = getattr(record, field.name)
        if kind is not object and type(value) is not kind:
            raise ValueError(f"{field.name}={shown(value)} is not allowed: it must be {words}")


def require_mapping(name: str, value: Any) -> None:
    """Raise ValueError unless ``value`` is a mapping."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be a mapping of names to values")


def metric_names(laps: bool) -> tuple[str, ...]:
    """Names of the metrics of a scenario, in which laps are driven or not."""
    return (*(LAP if laps else ERRORS), *EFFORT)


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


def measure(
    steps: Iterator[Step], cars: int, lap_limit: float | None = None
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.bool_], NDArray]:
    """Reduce steps to (metrics by name, failed, steps driven), arrays of shape (cars,).

    Where laps are driven, the lap time takes the place of the errors; a lap that was not done has failed and counts as
    ``lap_limit``, the length of an episode in s.
    """
    squared_error, peak_error, squared_rate, peak_acceleration, total, lap = np.zeros((6, cars))
    failed = np.zeros(cars, dtype=bool)
    count = np.zeros(cars, dtype=np.int64)
    for step in steps:
        alive, info = step.alive, step.info
        error = np.abs(np.asarray(info["lateral_error"], dtype=np.float64))
        rate = np.asarray(info["steering_rate"], dtype=np.float64)
        acceleration = np.abs(np.asarray(info["lateral_acceleration"], dtype=np.float64))
        np.add(squared_error, error**2, out=squared_error, where=alive)
        np.add(squared_rate, rate**2, out=squared_rate, where=alive)
        np.add(total, step.reward, out=total, where=alive)
        np.maximum(peak_error, error, out=peak_error, where=alive)
        np.maximum(peak_acceleration, acceleration, out=peak_acceleration, where=alive)
        succeeds = np.asarray(info["is_success"], dtype=bool)
        if lap_limit is None:
            failed |= alive & ~succeeds
        else:  # a success is at the end
            np.copyto(failed, ~succeeds, where=alive)
            np.copyto(lap, info["lap_time"], where=alive)
        count += alive
    errors = [np.sqrt(squared_error / count), peak_error]
    first = errors if lap_limit is None else [np.where(failed, lap_limit, lap)]
    values = [*first, np.sqrt(squared_rate / count), peak_acceleration, total]
    return dict(zip(metric_names(lap_limit is not None), values, strict=True)), failed, count


def evaluate(
    suite: Suite,
    policies: Sequence[str],
    make_policy: MakePolicy,
    *,
    episodes: int,
    seed: int,
    cars: int = CARS,
    done: Collection[Place] = frozenset(),
    keep_trace: KeepTrace | None = None,
) -> Iterator[list[EpisodeResult]]:
    """Yield the results scenario by scenario, chunk by chunk of episodes, policy by policy, as they finish.

    ``keep_trace`` gets the trace of each chunk before its results come, scenario, policy, the numbers of the episodes
    and which of them failed, (n,) each.

    Episodes in ``done`` are left out. A chunk of which some are done is driven whole all the same: with the same
    neighbours the result is the same even where a policy's rows are not independent to the last bit.
    """
    for scenario in suite.scenarios:
        for first in range(0, episodes, cars):
            numbers = range(first, min(first + cars, episodes))
            missing = {name: {n for n in numbers if (scenario.name, name, n) not in done} for name in policies}
            if not any(missing.values()):
                continue
            seeds = [episode_seed(suite.name, scenario.name, number, seed) for number in numbers]
            env = make_cars(scenario, len(seeds))
            definition = env.unwrapped.scenario
            scenario_hash = scenario.hash(definition.hash)
            for name in filter(missing.get, policies):
                policy = make_policy(name, scenario.policies_scenario(definition))
                limit = definition.episode_steps * definition.control_step if hasattr(definition, "laps") else None
                steps = drive(env, policy, seeds, scenario.options)
                trace = Trace([channel.name for channel in definition.channels])
                metrics, failed, count = measure(trace.watch(steps) if keep_trace else steps, len(seeds), limit)
                if keep_trace is not None:
                    keep_trace(trace, scenario.name, name, np.array(numbers), failed)
                yield [
                    EpisodeResult(
                        suite=suite.name,
                        scenario=scenario.name,
                        scenario_hash=scenario_hash,
                        policy=name,
                        episode=number,
                        seed=seed,
                        episode_seed=seeds[car],
                        failed=bool(failed[car]),
                        steps=int(count[car]),
                        metrics={key: float(values[car]) for key, values in metrics.items()},
                        version=lanekeep_env.__version__,
                    )
                    for car, number in enumerate(numbers)
                    if number in missing[name]
                ]
            env.close()


def record(scenario: SuiteScenario, policy: Policy, seed: int) -> dict[str, NDArray[np.float64]]:
    """Drive one episode and keep it: truth from `info` and the observation's channels by name, (steps,) each."""
    env = make_cars(scenario, 1)
    channels = [channel.name for channel in env.unwrapped.scenario.channels]
    rows: list[dict[str, float]] = []
    for step in drive(env, policy, [seed], scenario.options):
        row = dict(zip(channels, step.observation[0].tolist(), strict=True))
        row |= {key: float(value[0]) for key, value in step.info.items() if not key.startswith("_")}
        rows.append(row)
    env.close()
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}
