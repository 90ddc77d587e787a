"""Traffic as arrays: each car decides, then all move.

``cars`` is float64, (`layout.T_ROWS`, cars), ``road`` float64, (`layout.T_ROAD_SIZE`,): lanes side by side along the x
axis, or along a road in its coordinates; lane 0 is the right-most one, its middle at y = 0. highway-env's first lane
is its left-most, seen from below: the equations are the same.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper_as_written, kernel
from lanekeep_env.physics.numeric import clip
from lanekeep_env.traffic.change_lane import choose_lane, neighbours
from lanekeep_env.traffic.collide import collide
from lanekeep_env.traffic.follow import LARGEST_PULL, LARGEST_SPEED, LENGTH, acceleration, steering


@helper_as_written
def find_lane(j, cars, road):
    """Note the lane of car j, the nearest one, and the direction that it points in."""
    heading = cars[at.T_HEADING, j]
    cars[at.T_COSINE, j], cars[at.T_SINE, j] = np.cos(heading), np.sin(heading)
    nearest, turned = np.inf, abs((heading + np.pi) % (2.0 * np.pi) - np.pi)
    for lane in range(np.int64(road[at.T_LANES])):
        distance = abs(cars[at.T_Y, j] - lane * road[at.T_LANE_WIDTH]) + turned
        if distance < nearest:
            nearest = distance
            cars[at.T_LANE, j] = lane


@helper_as_written
def decide(first, cars, road):
    """Choose lane, wheel angle and acceleration of the cars from number ``first`` on."""
    limit, most = road[at.T_SPEED_LIMIT], min(LARGEST_PULL, road[at.T_GRIP])
    for j in range(first, cars.shape[1]):
        if cars[at.T_CRASHED, j] > 0.0:
            continue
        choose_lane(j, cars, road)
        lane, target, exponent = cars[at.T_LANE, j], cars[at.T_TARGET, j], cars[at.T_EXPONENT, j]
        cars[at.T_STEER, j] = steering(j, cars[at.T_Y, j] - target * road[at.T_LANE_WIDTH], cars)
        front, _ = neighbours(j, np.int64(lane), cars, road)
        pull = acceleration(j, front, exponent, limit, cars)
        if lane != target:
            front, _ = neighbours(j, np.int64(target), cars, road)
            pull = min(pull, acceleration(j, front, exponent, limit, cars))
        cars[at.T_PULL, j] = clip(pull, -most, most)


@helper_as_written
def move(first, seconds, cars, road):
    """Move the cars from number ``first`` on by a step, as what they decided asks for."""
    for j in range(first, cars.shape[1]):
        v, heading, steer, pull = cars[at.T_SPEED, j], cars[at.T_HEADING, j], cars[at.T_STEER, j], cars[at.T_PULL, j]
        if cars[at.T_CRASHED, j] > 0.0:
            steer, pull = 0.0, -v
        pull = min(pull, LARGEST_SPEED - v) if v > LARGEST_SPEED else pull
        pull = max(pull, -LARGEST_SPEED - v) if v < -LARGEST_SPEED else pull
        sideslip = np.arctan(0.5 * np.tan(steer))
        cars[at.T_X, j] += v * np.cos(heading + sideslip) * seconds
        cars[at.T_Y, j] += v * np.sin(heading + sideslip) * seconds
        if cars[at.T_PUSHED, j] > 0.0:
            cars[at.T_X, j] += cars[at.T_PUSH_X, j]
            cars[at.T_Y, j] += cars[at.T_PUSH_Y, j]
            cars[at.T_PUSHED, j] = 0.0
            cars[at.T_CRASHED, j] = 1.0
        cars[at.T_HEADING, j] = heading + v * np.sin(sideslip) / (LENGTH / 2) * seconds
        cars[at.T_SPEED, j] = v + pull * seconds
        cars[at.T_STEER, j], cars[at.T_PULL, j] = steer, pull
        cars[at.T_TIMER, j] += seconds
        find_lane(j, cars, road)
    collide(first, seconds, cars)


@kernel()
def drive(steps, seconds, cars, road):
    """Let traffic drive so many steps of ``seconds``; ``cars`` are as they were started, and as they then are."""
    for j in range(cars.shape[1]):
        find_lane(j, cars, road)
    for _ in range(steps):
        decide(0, cars, road)
        move(0, seconds, cars, road)
