"""What happens to cars of the traffic that meet each other: they are pushed apart and come to a stop.

The separating axes of two rectangles, and of what they become within the step, as highway-env 1.12 has it.
"""

from __future__ import annotations

import math

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper_as_written, inline_as_written
from lanekeep_env.traffic.follow import LENGTH, WIDTH

_DIAGONAL = math.hypot(LENGTH, WIDTH)


@inline_as_written
def _corner(j, which, cars):
    """Return corner 0 to 3 of car j, anticlockwise or not as they come."""
    along = -LENGTH / 2 if which < 2 else LENGTH / 2
    across = WIDTH / 2 if which == 1 or which == 2 else -WIDTH / 2
    cosine, sine = cars[at.T_COSINE, j], cars[at.T_SINE, j]
    return cars[at.T_X, j] + cosine * along - sine * across, cars[at.T_Y, j] + sine * along + cosine * across


@inline_as_written
def _shadow(j, normal_x, normal_y, cars):
    """Return the ends of car j's shadow on an axis, m."""
    low, high = np.inf, -np.inf
    for which in range(4):
        x, y = _corner(j, which, cars)
        place = x * normal_x + y * normal_y
        low, high = min(low, place), max(high, place)
    return low, high


@inline_as_written
def _apart(low, high, other_low, other_high):
    """Return how far two shadows are apart, m, negative where they overlap."""
    return other_low - high if low < other_low else low - other_high


@helper_as_written
def _push(a, b, seconds, cars):
    """Return (whether cars a and b overlap, whether they will, the push that parts a from b, x and y, m)."""
    overlap = will = True
    least, push_x, push_y = np.inf, 0.0, 0.0
    way_x = cars[at.T_SPEED, a] * cars[at.T_COSINE, a] - cars[at.T_SPEED, b] * cars[at.T_COSINE, b]
    way_y = cars[at.T_SPEED, a] * cars[at.T_SINE, a] - cars[at.T_SPEED, b] * cars[at.T_SINE, b]
    for edge in range(8):
        j, which = (a, edge) if edge < 4 else (b, edge - 4)
        x, y = _corner(j, which, cars)
        next_x, next_y = _corner(j, (which + 1) % 4, cars)
        length = np.sqrt((next_x - x) * (next_x - x) + (next_y - y) * (next_y - y))
        normal_x, normal_y = (y - next_y) / length, (next_x - x) / length
        low, high = _shadow(a, normal_x, normal_y, cars)
        other_low, other_high = _shadow(b, normal_x, normal_y, cars)
        overlap = overlap and not _apart(low, high, other_low, other_high) > 0.0
        way = (normal_x * way_x + normal_y * way_y) * seconds
        low, high = (low + way, high) if way < 0.0 else (low, high + way)
        distance = _apart(low, high, other_low, other_high)
        will = will and not distance > 0.0
        if not overlap and not will:
            break
        if abs(distance) < least:
            least = abs(distance)
            towards = (cars[at.T_X, a] - cars[at.T_X, b]) * normal_x + (cars[at.T_Y, a] - cars[at.T_Y, b]) * normal_y
            sign = 1.0 if towards > 0.0 else -1.0
            push_x, push_y = sign * least * normal_x, sign * least * normal_y
    return overlap, will, push_x, push_y


@helper_as_written
def collide(first, seconds, cars):
    """Mark the cars from number ``first`` on that meet each other, and note how far they are pushed."""
    for a in range(first, cars.shape[1]):
        for b in range(a + 1, cars.shape[1]):
            across, along = cars[at.T_Y, b] - cars[at.T_Y, a], cars[at.T_X, b] - cars[at.T_X, a]
            if np.sqrt(along * along + across * across) > _DIAGONAL + cars[at.T_SPEED, a] * seconds:
                continue
            overlap, will, push_x, push_y = _push(a, b, seconds, cars)
            if will:
                for j, half in ((a, 0.5), (b, -0.5)):
                    cars[at.T_PUSHED, j] = 1.0
                    cars[at.T_PUSH_X, j] = half * push_x
                    cars[at.T_PUSH_Y, j] = half * push_y
            if overlap:
                cars[at.T_CRASHED, a] = 1.0
                cars[at.T_CRASHED, b] = 1.0
