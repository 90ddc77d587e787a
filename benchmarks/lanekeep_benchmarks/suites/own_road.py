"""A suite of one's own road: a whole pass of a centre line from a file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from lanekeep_benchmarks.suites.records import Suite, SuiteScenario
from lanekeep_env import LaneKeepScenario
from lanekeep_env.checks import shown_path
from lanekeep_env.roads import Road, build_roads

#: How the names of suites of one's own roads begin.
OWN_ROAD = "road-"


def lap_time(road: Road, speed: np.ndarray) -> float:
    """Seconds for one pass of ``road`` at the node speeds (n + 1,) in m/s, v² linear in between."""
    return float(np.sum(2 * np.asarray(road.lengths) / (speed[:-1] + speed[1:])))


def road_suite(file: Path) -> Suite:
    """Suite of one scenario: a whole pass of the centre line in ``file``, from its first point, small start errors.

    Raises:
        ValueError, OSError: the file is missing or is not a drivable road; the message says why.
    """
    try:
        found = file.is_file()
    except OSError as error:
        raise ValueError(f"--road {shown_path(file)} cannot be read: {error.strerror}") from None
    if not found:
        raise ValueError(f"--road {shown_path(file)}: no such file; allowed: a CSV file with the columns x, y in m")
    keywords: dict[str, Any] = {"road": {"kind": "file", "path": str(file)}, "preview": 12, "departure": "cost"}
    definition = LaneKeepScenario.from_keywords(**keywords)
    ((road, speed),) = build_roads(definition.road, definition.speed)
    # Hairpins need more steering than a country road: half as much again as the tightest curve asks for.
    tightest = math.atan(definition.vehicle.wheelbase * road.peak_curvature)
    keywords["max_steering_angle"] = round(max(definition.max_steering_angle, min(1.5 * tightest, 1.2)), 3)
    seconds = lap_time(road, speed)
    # A car outside its lane's centre in curves needs longer; on a closed road it gets the time to finish its lap.
    margin = 1.03 if road.closed else 1.0
    steps = math.ceil(margin * seconds / definition.control_step)
    keywords["episode_steps"] = steps
    scenario = SuiteScenario(
        file.stem,
        f"{file.stem}: {road.length:.0f} m, {seconds:.0f} s, road fitted to {100 * road.fit_error:.1f} cm",
        keywords,
        options={"arc_length": 0.0},
        max_episode_steps=steps,
    )
    return Suite(
        name=f"{OWN_ROAD}{file.stem}", description=f"one pass of {file.name}", scenarios=(scenario,), episodes=16
    )
