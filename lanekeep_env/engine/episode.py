"""What an episode draws, on roads as between walls: its car, its set speeds."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.randomisation import FRICTION_SHARE, Randomisation
from lanekeep_env.randomness import derive, uniform

# Counters of an episode's random draws: the order is part of an environment's version. (Typed, because
# numba compiles a function anew for every literal it is called with.)
DRAW_PLACE, DRAW_STATION, DRAW_LATERAL, DRAW_HEADING = np.int64(0), np.int64(1), np.int64(2), np.int64(3)
DRAW_CAR = np.int64(4)  # and the following, one a randomised number
#: Numbers of the randomised numbers: their place among the fields of `Randomisation`.
MASS, FRICTION, FRONT_STIFFNESS, REAR_STIFFNESS, CG_SHIFT, SPEED, LAG, DELAY, GAIN, OFFSET = (
    np.int64([field.name for field in fields(Randomisation)].index(name))
    for name in (
        "mass",
        "friction",
        "front_cornering_stiffness",
        "rear_cornering_stiffness",
        "cg_shift",
        "speed",
        "steering_lag",
        "steering_delay",
        "steering_gain",
        "steering_offset",
    )
)
#: Counter of the first set speed of an episode; one a control step from there.
FIRST_SET_SPEED = np.int64(1 << 33)


@inline
def cars_in(k, cars, counters):
    """How many cars block ``k`` holds; the last one may not be full."""
    return min(cars.shape[2], counters.shape[1] - k * cars.shape[2])


@inline
def drawn(key, which, settings):
    """Draw the randomised number ``which`` (typed, see above) between its bounds; equal bounds give it exactly."""
    low = np.float64(settings[at.RANGES + 2 * which])
    high = np.float64(settings[at.RANGES + 2 * which + 1])
    return low + (high - low) * uniform(key, DRAW_CAR + which)


@inline
def set_lag(i, lag, block, settings):
    """Give the actuator of car i a lag, s."""
    half = 0.5 * settings[at.STEP_TIME]
    block[at.STEER_RESPONSE, i] = 1.0 - np.exp(-half / lag) if lag > 0.0 else 1.0
    block[at.STEER_GAIN, i] = min(half / lag, 1.0) if lag > 0.0 else 1.0


@helper
def draw_car(i, key, block, settings):
    """Write the car of the episode ``key``: the nominal one with the randomised numbers of `Randomisation`.

    Yaw inertia scales with the mass; the axle loads, and with them the saturating tyres' peaks, follow
    mass, friction and centre of gravity. The speed profile is slowed down where it would use more
    than `FRICTION_SHARE` of the friction, so that every episode can be driven.
    """
    mass_factor, shift = drawn(key, MASS, settings), drawn(key, CG_SHIFT, settings)
    if settings[at.NOMINAL_REAR] == 0.0:
        shift = 0.0  # the reference point is the rear axle
    mass = settings[at.MASS] * mass_factor
    front, rear = settings[at.NOMINAL_FRONT] - shift, settings[at.NOMINAL_REAR] + shift
    friction = settings[at.FRICTION] * drawn(key, FRICTION, settings)
    load = friction * mass * GRAVITY / (front + rear)
    block[at.CG_TO_FRONT, i] = front
    block[at.CG_TO_REAR, i] = rear
    block[at.INVERSE_MASS, i] = 1.0 / mass
    block[at.INVERSE_INERTIA, i] = 1.0 / (settings[at.INERTIA] * mass_factor)
    block[at.FRONT_STIFFNESS, i] = settings[at.NOMINAL_FRONT_STIFFNESS] * drawn(key, FRONT_STIFFNESS, settings)
    block[at.REAR_STIFFNESS, i] = settings[at.NOMINAL_REAR_STIFFNESS] * drawn(key, REAR_STIFFNESS, settings)
    block[at.FRONT_PEAK, i] = load * rear
    block[at.REAR_PEAK, i] = load * front
    set_lag(i, settings[at.LAG] * drawn(key, LAG, settings), block, settings)
    block[at.STEER_CHANGE, i] = settings[at.RATE_LIMIT] * 0.5 * settings[at.STEP_TIME]
    delay = settings[at.NOMINAL_DELAY] + drawn(key, DELAY, settings)
    block[at.DELAY, i] = np.floor(delay / settings[at.STEP_TIME] + 0.5)
    speed = drawn(key, SPEED, settings)
    factor = speed * speed
    demand = settings[at.LATERAL_LIMIT] * factor
    grip = FRICTION_SHARE * friction * GRAVITY
    if settings[at.SATURATES] > 0.0 and demand > grip:
        factor *= grip / demand
    block[at.SPEED_FACTOR, i] = factor


@inline
def set_speed(i, episode, step, block, settings):
    """Draw the set speed (m/s) that holds from control step ``step`` of the episode on."""
    key = derive(episode, FIRST_SET_SPEED + step)
    low, high = np.float64(settings[at.SPEED_LOW]), np.float64(settings[at.SPEED_HIGH])
    speed = (low + (high - low) * uniform(key, np.int64(0))) * np.sqrt(np.float64(block[at.SPEED_FACTOR, i]))
    speed = -speed if settings[at.BACKWARDS] > 0.0 else speed
    return 0.0 if uniform(key, np.int64(1)) < settings[at.STANDSTILL] else speed


@helper
def set_speeds(k, cars, counters, settings):
    """Draw new set speeds for the cars of block ``k`` whose time has come."""
    first, block = k * cars.shape[2], cars[k]
    hold = settings[at.SPEED_HOLD]
    for i in range(cars_in(k, cars, counters)):
        step = block[at.STEP, i]
        if step > 0.0 and step % hold == 0.0:
            episode = derive(np.uint64(counters[at.KEY, first + i]), counters[at.EPISODE, first + i])
            block[at.SPEED_TARGET, i] = set_speed(i, episode, np.int64(step), block, settings)
