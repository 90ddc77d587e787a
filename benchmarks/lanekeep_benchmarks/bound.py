"""What nobody can beat: episodes driven as well as the whole road and the true car allow, as result lines.

They are a run of their own in the folder ``bound`` of a benchmark's results, whose tables then show them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
import lanekeep_env
from lanekeep_agents.optimum import Optimiser, best
from lanekeep_agents.teacher import why_not
from lanekeep_baselines.lq import LqPreview
from lanekeep_benchmarks.evaluate import Batch, Driver, Policy, episode_seed, make_cars
from lanekeep_benchmarks.lines import EpisodeResult, Place
from lanekeep_benchmarks.made import make_definitions
from lanekeep_benchmarks.results import ResultFolder, default_folder
from lanekeep_benchmarks.run_record import MOST_EPISODES, RunRecord, code_hash
from lanekeep_benchmarks.suites import ENDING, Suite, SuiteScenario, find_suite
from lanekeep_env.checks import require, shown, shown_path
from lanekeep_env.randomisation import Randomisation

#: Names in result lines: the optimum, and `lq-preview` made for the true car and sensors.
BOUND, TOLD = "bound", "lq-told-the-truth"
#: Folder of the run, in that of the benchmark's results.
FOLDER = "bound"
#: Episodes that are improved side by side.
CARS = 64
#: What the optimum starts from, those of them that can drive; where none can, all that can.
STARTS = ("lq-preview-offset-free", "lq-preview", "lqg", "stanley", "yin-lqr-feedforward", "pure-pursuit")


@dataclass
class BoundPlan:
    """A run of bounds; ``results`` fill while it is driven. ``unknown`` says why scenarios have no bound."""

    suite: Suite
    episodes: int
    seed: int
    record: RunRecord
    definitions: Mapping[str, Any]
    unknown: Mapping[str, str]
    results: list[EpisodeResult] = field(default_factory=list)

    @property
    def total(self) -> int:
        """Number of episodes to bound."""
        return self.episodes * (len(self.suite.scenarios) - len(self.unknown))


def open_bound(
    suite: str | None, episodes: int | None, seed: int | None, out: Path | None, overwrite: bool, resume: bool
) -> tuple[BoundPlan, ResultFolder, Path]:
    """Read the options; return the plan, the open folder of its run and that of the benchmark's results.

    What is left out is as in the benchmark's run in ``out``, where there is one.

    Raises:
        ValueError, OSError: an unknown suite, one without any scenario that has a bound, numbers that are not allowed,
            another suite than the run's, or a folder that holds other bounds.
    """
    require("--episodes", episodes, "", at_least=1, at_most=MOST_EPISODES, whole=True, optional=True)
    require("--seed", seed, "", at_least=0, whole=True, optional=True)
    run = None if out is None else RunRecord.read(out)
    if run is None and out is not None and resume and suite is None:
        run = RunRecord.read(out / FOLDER)
    if run is not None:
        if run.road is not None:
            raise ValueError(f"--out {out} holds a run on --road {run.road}, of which no bound is known")
        given = run.suite_file or run.suite
        if suite not in (None, given):
            raise ValueError(f"--out {out} holds a run of the suite {shown(given)}; leave SUITE out, or give that one")
        suite = given
        episodes = run.episodes if episodes is None else episodes
        seed = run.seed if seed is None else seed
    if suite is None:
        raise ValueError("SUITE is missing, e.g. lanekeep bound learned, or --out with the results of lanekeep bench")
    chosen, seed = find_suite(suite), seed or 0
    made = make_definitions(chosen, f"suite {shown_path(suite)}")
    unknown = {scenario.name: why for scenario in chosen.scenarios if (why := no_bound(scenario))}
    if len(unknown) == len(chosen.scenarios):
        raise ValueError(
            f"suite {shown(chosen.name)} has no scenario of which a bound is known: {unknown.popitem()[1]}"
        )
    known = [scenario for scenario in chosen.scenarios if scenario.name not in unknown]
    record = RunRecord(
        version=lanekeep_env.__version__,
        code=code_hash(),
        suite=chosen.name,
        road=None,
        policies=[BOUND, TOLD],
        episodes=episodes or chosen.episodes,
        seed=seed,
        scenario_hash={one.name: one.hash(made[one.name].definition.hash) for one in known},
        metrics={one.name: list(made[one.name].metrics) for one in known},
        suite_file=suite if suite.endswith(ENDING) else None,
    )
    definitions = {name: one.definition for name, one in made.items()}
    plan = BoundPlan(chosen, record.episodes, seed, record, definitions, unknown)
    above = out or default_folder(chosen.name)
    folder = ResultFolder(above / FOLDER, record, overwrite, resume)
    plan.results += folder.earlier
    return plan, folder, above


def no_bound(scenario: SuiteScenario) -> str:
    """Return why no bound of a scenario is known, "" where one is."""
    env = make_cars(scenario, 1)
    why = why_not(getattr(env.unwrapped, "_core", None))
    env.close()
    return why


def drive_bounds(plan: BoundPlan, folder: ResultFolder) -> Iterator[tuple[str, int]]:
    """Bound what has no result yet; yield (scenario, episodes) when they are on disk."""
    done = {line.place for line in plan.results}
    for scenario in plan.suite.scenarios:
        if scenario.name in plan.unknown:
            continue
        for first in range(0, plan.episodes, CARS):
            numbers = range(first, min(first + CARS, plan.episodes))
            if all((scenario.name, BOUND, number) in done for number in numbers):
                continue
            lines = _lines(plan, scenario, numbers, done)
            folder.append(lines)
            plan.results += lines
            yield scenario.name, sum(line.policy == BOUND for line in lines)


def _lines(plan: BoundPlan, scenario: SuiteScenario, numbers: range, done: set[Place]) -> list[EpisodeResult]:
    """The lines of both names that are not there yet, measured as every policy's: the optimum drives once more."""
    seeds = [episode_seed(plan.suite.name, scenario.name, number, plan.seed) for number in numbers]
    definition = plan.definitions[scenario.name]
    drivers: dict[str, Policy] = {}
    if (truth := told_the_truth(definition)) is not None:
        drivers[TOLD] = LqPreview(truth, LqPreview.weights)  # the least cost: without a reserve for margins
    # Last: a chunk whose optimum is on disk is done.
    drivers[BOUND] = Replay(_optimal_actions(scenario, seeds, scenario.policies_scenario(definition)))
    driver = Driver(plan.suite.name, plan.seed, lambda name, _: drivers[name])
    lines = []
    for name in drivers:
        missing = frozenset(number for number in numbers if (scenario.name, name, number) not in done)
        lines += driver.drive(Batch(scenario, name, numbers, missing)).results
    driver.close()
    return lines


def _optimal_actions(scenario: SuiteScenario, seeds: Sequence[int], told: Any) -> NDArray[np.float64]:
    steps = scenario.max_episode_steps
    optimiser = Optimiser(scenario.env_id, scenario.keywords, seeds, scenario.options, steps)
    able = lanekeep_baselines.names(told)
    starts = [lanekeep_baselines.make(name, told) for name in STARTS if name in able]
    starts = starts or [lanekeep_baselines.make(name, told) for name in able]
    saturates = getattr(told, "tyre", "") == "magic_formula"
    return best(optimiser, starts, starts=2 if saturates else 1).actions


class Replay:
    """Drives actions that are known, (steps, n), and straight on behind their end."""

    def __init__(self, actions: NDArray[np.float64]) -> None:
        self._actions = actions.astype(np.float32)

    def predict(
        self, observation: Any, state: int | None = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], int]:
        """Return the actions (n, 1) of the step whose number the state is."""
        step = state or 0
        return self._actions[min(step, len(self._actions) - 1)][:, None], step + 1


def told_the_truth(definition: Any) -> Any | None:
    """Return the scenario with the true car as its nominal one where all episodes have the same, else None.

    What `lq-preview` made for it loses to the bound is the road beyond the preview and what is not linear.
    """
    if "lq-preview" not in lanekeep_baselines.names(definition):
        return None
    drawn = {name: getattr(definition.randomisation, name) for name in Randomisation.__dataclass_fields__}
    if any(low != high for low, high in drawn.values()):
        return None
    car, factor = definition.vehicle, {name: low for name, (low, _) in drawn.items()}
    steering = replace(
        car.steering,
        lag=car.steering.lag * factor["steering_lag"],
        delay=car.steering.delay + factor["steering_delay"],
    )
    vehicle = replace(
        car,
        mass=car.mass * factor["mass"],
        yaw_inertia=car.yaw_inertia * factor["mass"],
        front_cornering_stiffness=car.front_cornering_stiffness * factor["front_cornering_stiffness"],
        rear_cornering_stiffness=car.rear_cornering_stiffness * factor["rear_cornering_stiffness"],
        cg_to_front_axle=car.cg_to_front_axle - factor["cg_shift"],
        cg_to_rear_axle=car.cg_to_rear_axle + factor["cg_shift"],
        steering=steering,
    )
    return replace(definition, vehicle=vehicle, randomisation="nominal")
