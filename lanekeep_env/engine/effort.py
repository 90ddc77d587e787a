"""Steering that costs what its motor turns: inside the gear's gap it moves while the road wheel rests."""

from __future__ import annotations

import functools
from dataclasses import replace

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.engine.step import Family
from lanekeep_env.physics.integrate import named


@functools.cache
def by_motor(family: Family) -> Family:
    """Return a family whose rewards count the motor's way as the road wheel's; what it tells stays the road wheel's."""
    own_begin, own_judge = family.begin, family.judge

    @helper
    @named(family.name)
    def begin_by_motor(k, cars, counters, settings, equipment):
        own_begin(k, cars, counters, settings, equipment)
        motor_, before_ = cars[k][at.MOTOR], cars[k][at.MOTOR_BEFORE]
        for i in range(motor_.shape[0]):
            before_[i] = motor_[i]

    @helper
    @named(family.name)
    def judge_by_motor(k, cars, counters, world, settings, equipment, outcome):
        block, first, n = cars[k], k * cars.shape[2], cars_in(k, cars, counters)
        steer_, before_, kept_ = block[at.STEER], block[at.STEER_BEFORE], block[at.WHEEL_BEFORE]
        motor_, motor_before_ = block[at.MOTOR], block[at.MOTOR_BEFORE]
        for i in range(n):
            kept_[i] = before_[i]
            before_[i] = steer_[i] - (motor_[i] - motor_before_[i])
        own_judge(k, cars, counters, world, settings, equipment, outcome)
        rate_, seconds = outcome[at.O_STEERING_RATE], settings[at.STEP_TIME] * settings[at.SUBSTEPS]
        for i in range(n):
            before_[i] = kept_[i]
            rate_[first + i] = (steer_[i] - before_[i]) / seconds

    return replace(family, name=f"{family.name}_by_motor", begin=begin_by_motor, judge=judge_by_motor)
