"""A suite of one's own road: a whole pass of a centre line from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lanekeep_benchmarks.suites.records import Suite, SuiteScenario
from lanekeep_env import LaneKeepScenario
from lanekeep_env.checks import shown_path
from lanekeep_env.roads import lap_time, read_road, road_set

#: How the names of suites of one's own roads begin.
OWN_ROAD = "road-"


def road_suite(file: Path, smoothing: float | None = None) -> Suite:
    """Suite of one scenario: a whole pass of the centre line in ``file``, from its first point, small start errors.

    The lane is as wide as the file says at its narrowest, else 3.5 m. ``smoothing``: by how much the points scatter, m;
    None to estimate it.

    Raises:
        ValueError, OSError: the file is missing or is not a drivable road; the message says why.
    """
    try:
        found = file.is_file()
    except OSError as error:
        raise ValueError(f"--road {shown_path(file)} cannot be read: {error.strerror}") from None
    if not found:
        raise ValueError(f"--road {shown_path(file)}: no such file; allowed: a CSV file with the columns x, y in m")
    road_file: dict[str, Any] = {"kind": "file", "path": str(file)}
    if smoothing is not None:
        road_file["smoothing"] = smoothing
    keywords: dict[str, Any] = {"road": road_file, "preview": 12, "departure": "cost"}
    beside = read_road(file, smoothing=smoothing).beside
    if beside is not None and np.isfinite(beside[:, 1:3]).any():
        keywords["lane_width"] = "file"
    definition = LaneKeepScenario.from_keywords(**keywords, episode_steps="lap")
    ((road, speed),) = road_set(definition.road, definition.speed)
    seconds, steps = lap_time(road, speed), definition.episode_steps
    keywords |= {"max_steering_angle": definition.max_steering_angle, "episode_steps": steps}
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
