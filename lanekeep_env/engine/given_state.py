"""States that are handed in: those are refused that would lead a kernel out of its tables, or on for ever."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lanekeep_env import layout as at

#: What a car of either kind may have in these rows, far beyond any drive.
_ROWS: dict[int, tuple[str, float, float]] = {
    at.ALONG: ("along", -1e7, 1e7),
    at.LATERAL: ("lateral", -1e7, 1e7),
    at.HEADING: ("heading", -1e7, 1e7),
    at.YAW_RATE: ("yaw rate", -1e7, 1e7),
    at.SPEED: ("speed", -1e4, 1e4),
    at.STEER: ("steering angle", -1e4, 1e4),
    at.COMMAND: ("command", -1e4, 1e4),
    at.STEP: ("step", 0.0, 1e9),
}
_COUNTERS = {at.SEGMENT: "segment", at.ROAD: "road or world", at.TIMELINE: "timeline"}


def row_of(cars: np.ndarray, row: int, count: int) -> np.ndarray:
    """Return one row of the ``count`` cars, (count,)."""
    values: np.ndarray = cars[:, row].reshape(-1)[:count]
    return values


def check_state(
    state: Mapping[str, np.ndarray],
    settings: np.ndarray,
    sizes: Mapping[int, np.ndarray | int],
    further: Mapping[int, tuple[str, float, float]],
) -> None:
    """Raise ValueError for numbers that no car has.

    Args:
        state: of shapes and types that fit.
        settings: the scenario's.
        sizes: of the table that each counter points into, by the counter's row, for all cars or for each.
        further: rows of the cars, each with its name and bounds, beside those that all cars share.
    """
    counters, cars = state["counters"], state["cars"]
    for row, size in sizes.items():
        wrong = (counters[row] < 0) | (counters[row] >= size)
        if wrong.any():
            raise ValueError(f"state: {_COUNTERS[row]} {counters[row][wrong][0]} does not exist")
    longest = max(0.0, float((settings[at.DELAY_DEPTH] - 1.0) * settings[at.SUBSTEPS]))
    for row, (name, low, high) in {**_ROWS, at.DELAY: ("delay", 0.0, longest), **further}.items():
        values = row_of(cars, row, counters.shape[1])
        wrong = ~((values >= low) & (values <= high))
        if wrong.any():
            raise ValueError(f"state: {name} {values[wrong][0]:g} is not allowed: it must be from {low:g} to {high:g}")
