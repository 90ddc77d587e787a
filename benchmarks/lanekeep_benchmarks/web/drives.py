"""The episodes that a report shows step by step: which they are, what happened in them, and where."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_benchmarks.evaluate import Policy, drive, make_cars
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.suites import SuiteScenario
from lanekeep_benchmarks.traces import is_beam
from lanekeep_env import layout as at
from lanekeep_env.traffic.follow import LENGTH

#: Failed episodes of a policy that are shown, and episodes of others that the reference drives beside them.
FAILURES, MOST_BESIDE = 5, 100
QUANTILES = (0.0, 0.25, 0.5, 0.75, 1.0)

Floats = NDArray[np.float64]


def chosen(lines: Mapping[str, Sequence[EpisodeResult]], more_is_better: bool) -> dict[str, list[int]]:
    """Numbers of the episodes that are shown of each policy of a scenario.

    The first that failed, and those at five quantiles of the first metric, failures the worst; everyone those quantiles
    of the reference, the first policy, and the reference what the others show, so that courses can be compared.
    """
    failed = {name: [line.episode for line in of if line.failed][:FAILURES] for name, of in lines.items()}
    middle = {name: _quantiles(of, more_is_better) for name, of in lines.items()}
    reference = next(iter(lines))
    others = [episode for shown in (failed, middle) for of in shown.values() for episode in of]
    beside = list(dict.fromkeys(others))[:MOST_BESIDE]
    return {
        name: sorted({*failed[name], *middle[name], *middle[reference], *(beside if name == reference else ())})
        for name in lines
    }


def _quantiles(lines: Sequence[EpisodeResult], more_is_better: bool) -> list[int]:
    def rank(line: EpisodeResult) -> tuple[bool, float, int]:
        value = next(iter(line.metrics.values()))
        return line.failed, -value if more_is_better else value, line.episode

    ranked = sorted(lines, key=rank)
    return [ranked[round(q * (len(ranked) - 1))].episode for q in QUANTILES]


def recorded(scenario: SuiteScenario, policy: Policy, seeds: Sequence[int]) -> list[dict[str, Any]]:
    """Drive episodes once more; return what happened in each.

    Returns:
        truth from `info` and what the observation shows, by name, (steps,) each; x and y of the car, m, and of the car
        ahead (lead_x, lead_y; NaN without one), where the environment tells; ``ground``, the number of the road or
        world it was driven on.
    """
    env = make_cars(scenario, len(seeds))
    names = [channel.name for channel in env.unwrapped.scenario.channels]
    shown = [(place, name) for place, name in enumerate(names) if not is_beam(name)]
    columns: dict[str, list[Floats]] = {}
    alive: list[NDArray[np.bool_]] = []
    ground = np.zeros(len(seeds), dtype=int)
    for step in drive(env, policy, seeds, scenario.options):
        if not alive and hasattr(env.unwrapped, "get_state"):
            ground = env.unwrapped.get_state()["counters"][at.ROAD].copy()
        alive.append(step.alive)
        seen = {name: step.observation[:, place] for place, name in shown}
        for name, values in {**seen, **_numbers(step.info)}.items():
            columns.setdefault(name, []).append(np.array(values, dtype=np.float64))
    steps = np.array(alive).sum(axis=0)
    tables = {name: np.array(rows) for name, rows in columns.items()}
    found = []
    for car, count in enumerate(steps):
        one: dict[str, Any] = {name: table[:count, car] for name, table in tables.items()}
        _place(env.unwrapped, one, int(ground[car]))
        found.append(one | {"ground": int(ground[car])})
    env.close()
    return found


def _numbers(info: Mapping[str, Any]) -> dict[str, Any]:
    return {key: values for key, values in info.items() if not key.startswith("_")}


def _place(env: Any, one: dict[str, Any], ground: int) -> None:
    """Add x and y, of the car and of the one ahead."""
    if "x" in one or not hasattr(env, "road_set"):
        return
    road = env.road_set()[ground][0]
    one["x"], one["y"] = road.position(one["arc_length"], one["lateral_error"]).T
    if "gap" in one and (one["gap"] < at.NOWHERE).any():
        ahead = one["arc_length"] + one["gap"] + LENGTH
        place = road.position(np.minimum(ahead, one["arc_length"] + at.FAR), one["lateral_error"] * 0.0)
        one["lead_x"], one["lead_y"] = np.where(one["gap"] < at.FAR, place.T, np.nan)


def ground(env: Any, number: int, points: int) -> list[Floats]:
    """The edges of a road, or the walls of a world, as lines (n, 2), m, of so many points at the most."""
    if hasattr(env, "road_set"):
        road = env.road_set()[number][0]
        s = np.linspace(0.0, road.length, points)
        return [road.position(s, edge) for edge in env.scenario.edges]
    if hasattr(env, "world_set"):
        return list(_joined(env.world_set()[number].segments))
    return []


def _joined(segments: Floats) -> Iterable[Floats]:
    """Walls that follow each other as one line each."""
    breaks = np.flatnonzero((segments[1:, :2] != segments[:-1, 2:]).any(axis=1)) + 1
    for part in np.split(segments, breaks):
        yield np.vstack([part[:, :2], part[-1:, 2:]])
