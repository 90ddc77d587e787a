"""How a car of the traffic follows: the Intelligent Driver Model along the road, a cascade across it.

IDM: Treiber, Hennecke, Helbing, "Congested traffic states in empirical observations and microscopic simulations",
Phys. Rev. E 62 (2000). Numbers, limits and the law of steering are those of highway-env 1.12's `IDMVehicle` and
`ControlledVehicle`, operation by operation, so that its cars and these drive the same way.
"""

from __future__ import annotations

import math

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import inline_as_written
from lanekeep_env.physics.numeric import clip

#: A car's body, m.
LENGTH, WIDTH = 5.0, 2.0
#: Acceleration that a car likes and the braking, m/s²; gap of standing cars from middle to middle, m; time gap, s.
ACCELERATION, BRAKING, STANDING, TIME_GAP = 3.0, 5.0, 5.0 + LENGTH, 1.5
#: Time constants of the lateral error and of the heading, s; largest angle of the wheels, rad.
LATERAL_TIME, HEADING_TIME, LARGEST_ANGLE = 0.6, 0.2, math.pi / 3
#: Acceleration that a car has at the most, m/s²; speed that it does not pass, m/s.
LARGEST_PULL, LARGEST_SPEED = 6.0, 40.0
_TURN, _HALF_TURN, _LARGEST_COURSE = 2.0 * math.pi, math.pi, math.pi / 4
_GAP_OVER_SPEEDS = 2.0 * math.sqrt(ACCELERATION * BRAKING)


@inline_as_written
def not_zero(x):
    """Return x, or 0.01 of its sign where it is smaller than that."""
    if abs(x) > 1e-2:
        return x
    return 1e-2 if x >= 0.0 else -1e-2


@inline_as_written
def desired_gap(j, front, cars):
    """Return the way from car j's middle to that of the one in front that IDM asks for, m."""
    v, cosine, sine = cars[at.T_SPEED, j], cars[at.T_COSINE, j], cars[at.T_SINE, j]
    ahead = v * cosine - cars[at.T_SPEED, front] * cars[at.T_COSINE, front]
    across = v * sine - cars[at.T_SPEED, front] * cars[at.T_SINE, front]
    closing = ahead * cosine + across * sine
    return STANDING + v * TIME_GAP + v * closing / _GAP_OVER_SPEEDS


@inline_as_written
def free_acceleration(j, exponent, speed_limit, cars):
    """Return IDM's acceleration of car j on a free road, m/s²."""
    wish = clip(cars[at.T_WISH, j], 0.0, speed_limit)
    share = max(cars[at.T_SPEED, j], 0.0) / abs(not_zero(wish))
    return ACCELERATION * (1.0 - np.power(share, exponent))


@inline_as_written
def acceleration(j, front, exponent, speed_limit, cars):
    """Return IDM's acceleration of car j behind car ``front``, m/s²; either is -1 where there is none."""
    if j < 0:
        return 0.0
    pull = free_acceleration(j, exponent, speed_limit, cars)
    if front >= 0:
        ratio = desired_gap(j, front, cars) / not_zero(cars[at.T_X, front] - cars[at.T_X, j])
        pull -= ACCELERATION * (ratio * ratio)
    return pull


@inline_as_written
def steering(j, left, cars):
    """Return the wheel angle by which car j, so far left of the middle of its target lane (m), steers there, rad."""
    v = cars[at.T_SPEED, j]
    course = np.arcsin(clip(-left / LATERAL_TIME / not_zero(v), -1.0, 1.0))
    turned = clip(course, -_LARGEST_COURSE, _LARGEST_COURSE) - cars[at.T_HEADING, j]
    rate = ((turned + _HALF_TURN) % _TURN - _HALF_TURN) / HEADING_TIME
    slip = np.arcsin(clip(LENGTH / 2 / not_zero(v) * rate, -1.0, 1.0))
    return clip(np.arctan(2.0 * np.tan(slip)), -LARGEST_ANGLE, LARGEST_ANGLE)
