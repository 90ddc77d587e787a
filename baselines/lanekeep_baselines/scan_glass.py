"""Glass, which a depth camera does not see, found with the ultrasonic sensors (the KnightRiders' wish).

An ultrasonic that hears something nearer than all that the scan shows there hears glass. Ranges are raw, (n, beams), 0
or NaN where a beam shows nothing; distances are m, (n,), 0 or NaN where a sensor hears nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_classes import NOTHING, WALL, Perception, Seen

#: Decisions: how much nearer an ultrasonic hears what the scan does not show, m, and beams towards a side, from which
#: angle on, that tell the distance of its wall.
NEARER, SIDEWARDS = 0.15, float(np.deg2rad(20.0))


def shown_ahead(ranges: ArrayLike, angles: ArrayLike, half_cone: float) -> Floats:
    """Return the nearest range inside the front ultrasonic's cone, m, inf where all beams show nothing."""
    inside = np.abs(angles) <= half_cone
    known = np.asarray(ranges, dtype=np.float64)
    return np.where(inside & (known > 0.0), known, np.inf).min(axis=1)


def shown_beside(ranges: ArrayLike, angles: ArrayLike, side: float) -> Floats:
    """Return the least distance across to points towards a side (1 left, -1 right), m, inf where none is shown."""
    known = np.asarray(ranges, dtype=np.float64)
    towards = (side * np.asarray(angles) >= SIDEWARDS) & (known > 0.0)
    return np.where(towards, np.where(towards, known, 0.0) * np.abs(np.sin(angles)), np.inf).min(axis=1)


def echo_of_side(beside: ArrayLike, half_cone: float) -> Floats:
    """Return how far off the front ultrasonic hears a wall that a side one hears ``beside`` the car, m, inf without.

    Glass beside the car is none ahead: the front sensor's cone meets a wall along the car at its rim.
    """
    distance = np.asarray(beside, dtype=np.float64)
    return np.where(distance > 0.0, distance / np.sin(half_cone), np.inf)


def is_glass(heard: ArrayLike, shown: Floats) -> NDArray[np.bool_]:
    """Return whether an ultrasonic hears something that is `NEARER` than what the scan shows."""
    distance = np.asarray(heard, dtype=np.float64)
    return (distance > 0.0) & (distance < shown - NEARER)


def with_glass(seen: Seen, glass: NDArray[np.bool_], heard: ArrayLike, rule: Perception) -> Seen:
    """Return what is ahead, with a wall where nothing was seen and glass is heard inside the detection box.

    Decision: its direction is not known; it counts as straight across, and the car turns left.
    """
    there = glass & (seen.kind == NOTHING) & (np.asarray(heard) <= rule.box_ahead)
    return seen._replace(kind=np.where(there, WALL, seen.kind), angle=np.where(there, 0.5 * np.pi, seen.angle))
