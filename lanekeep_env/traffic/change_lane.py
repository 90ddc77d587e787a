"""When a car of the traffic changes lanes: MOBIL, and its end where another one is quicker.

MOBIL: Kesting, Treiber, Helbing, "General lane-changing model MOBIL for car-following models", Transportation Research
Record 1999 (2007), with no politeness, as highway-env 1.12 has it, cars in the same order: the later one sees the lane
that the earlier one has just chosen.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper_as_written, inline_as_written
from lanekeep_env.traffic.follow import acceleration, desired_gap

#: Gain that a change takes and the braking that it may ask of the car behind, m/s²; time between decisions, s; speed
#: below which a car stays in its lane, m/s.
GAIN, IMPOSED, DELAY, SLOWEST = 0.2, 2.0, 1.0, 1.0
#: A car is in a lane as far as its middle is that far beyond the edge, m.
MARGIN = 1.0


@inline_as_written
def neighbours(j, lane, cars, road):
    """Return the numbers of the cars ahead of and behind car j in a lane, -1 for none."""
    x, middle, reach = cars[at.T_X, j], lane * road[at.T_LANE_WIDTH], road[at.T_LANE_WIDTH] / 2 + MARGIN
    front, rear, nearest, last = np.int64(-1), np.int64(-1), np.inf, -np.inf
    for other in range(cars.shape[1]):
        if other == j or not abs(cars[at.T_Y, other] - middle) <= reach:
            continue
        place = cars[at.T_X, other]
        if x <= place <= nearest:
            front, nearest = other, place
        elif last < place < x:
            rear, last = other, place
    return front, rear


@helper_as_written
def gains(j, lane, cars, road):
    """Return whether MOBIL wants car j in a lane beside its own."""
    exponent, limit = cars[at.T_EXPONENT, j], road[at.T_SPEED_LIMIT]
    front, rear = neighbours(j, lane, cars, road)
    if acceleration(rear, j, exponent, limit, cars) < -IMPOSED:
        return False
    old_front, _ = neighbours(j, np.int64(cars[at.T_LANE, j]), cars, road)
    there = acceleration(j, front, exponent, limit, cars)
    return there - acceleration(j, old_front, exponent, limit, cars) >= GAIN


@helper_as_written
def choose_lane(j, cars, road):
    """Decide the lane that car j goes to."""
    lane, target = cars[at.T_LANE, j], cars[at.T_TARGET, j]
    if lane != target:
        for other in range(cars.shape[1]):
            if other != j and cars[at.T_LANE, other] != target and cars[at.T_TARGET, other] == target:
                ahead = cars[at.T_X, other] - cars[at.T_X, j]
                if 0.0 < ahead < desired_gap(j, other, cars):
                    cars[at.T_TARGET, j] = lane
                    break
        return
    if not cars[at.T_TIMER, j] > DELAY:
        return
    cars[at.T_TIMER, j] = 0.0
    if abs(cars[at.T_SPEED, j]) < SLOWEST:
        return
    for side in (lane - 1.0, lane + 1.0):
        reachable = abs(cars[at.T_Y, j] - side * road[at.T_LANE_WIDTH]) <= 2 * road[at.T_LANE_WIDTH]
        if road[at.T_FIRST_LANE] <= side < road[at.T_LANES] and reachable and gains(j, np.int64(side), cars, road):
            cars[at.T_TARGET, j] = side
