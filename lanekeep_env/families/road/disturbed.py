"""Families of roads on which something disturbs the cars: what it adds to each place of a step."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.disturbances import blow, changes_now, draw_disturbances, dress, hold, lean, tell, told
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.engine.step import Family
from lanekeep_env.physics.integrate import named


# Many lines, for they are the four places of a step, each a function that must know the family.
@functools.cache
def disturbed(family: Family, axle_rows: tuple[int, int], asked_rows: tuple[int, ...]) -> Family:
    """Return a family with all that may disturb cars on roads; which of it a scenario has, its settings say.

    Args:
        family: on roads.
        axle_rows: hold the largest forces of the axles, before a powertrain takes its share.
        asked_rows: hold the steering angle that is asked for, however it comes about.
    """
    row, own_begin, own_act, own_before, own_start = (
        family.command_row,
        family.begin,
        family.act,
        family.before_substep,
        family.start,
    )

    @helper
    @named(family.name)
    def begin_disturbed(k, cars, counters, settings, equipment):
        own_begin(k, cars, counters, settings, equipment)
        block, counted = cars[k], counters[:, k * cars.shape[2] :]
        if settings[at.CHANGE_TO] >= 0.0:
            for i in range(cars_in(k, cars, counters)):
                if changes_now(i, block):
                    dress(i, block[at.STEP, i], block, counted, settings)
                    hold(i, axle_rows, block, counted, settings)
        if settings[at.GUSTS] > 0.0:
            blow(k, cars, counters, settings)

    @helper
    @named(family.name)
    def act_disturbed(k, cars, counters, settings, equipment):
        own_act(k, cars, counters, settings, equipment)
        told(k, row, cars, counters)

    @helper
    @named(family.name)
    def before_substep_disturbed(k, cars, counters, settings, equipment):
        if settings[at.PATCH_EVERY] > 0.0:
            for i in range(cars_in(k, cars, counters)):
                hold(i, axle_rows, cars[k], counters[:, k * cars.shape[2] :], settings)
        own_before(k, cars, counters, settings, equipment)

    @helper
    @named(family.name)
    def start_disturbed(place, wanted, cars, counters, world, settings, equipment):
        """Start in steady driving with what disturbs the car; the course that is drawn counts as ever."""
        own_start(place, wanted, cars, counters, world, settings, equipment)
        k, i = place
        block, counted = cars[k], counters[:, k * cars.shape[2] :]
        draw_disturbances(i, block, counted, settings)
        dress(i, block[at.STEP, i], block, counted, settings)
        hold(i, axle_rows, block, counted, settings)
        if settings[at.SLIPS] > 0.0:
            steer, beta = lean(i, np.float64(block[at.SPEED, i]), block)
            block[at.STEER, i] += steer
            block[at.SIDESLIP, i] += beta
            block[at.HEADING, i] -= beta if np.isnan(wanted[1]) else 0.0
        tell(i, asked_rows, block, settings)

    return replace(
        family,
        name=f"{family.name}_disturbed",
        command_row=at.TOLD,
        begin=begin_disturbed,
        act=act_disturbed,
        before_substep=before_substep_disturbed,
        start=start_disturbed,
    )
