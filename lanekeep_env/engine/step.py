"""One control step, on roads as between walls: command, sub-steps, judgement, observation, next episodes.

It goes block by block, so that a block's rows stay in the first-level cache. Loops over a block's rows become SIMD
code; what differs from car to car is scalar. A family of environments fills in what differs between its worlds.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import prange

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, kernel
from lanekeep_env.engine.delay import acting_row, delay_commands
from lanekeep_env.engine.episode import cars_in, set_speeds
from lanekeep_env.engine.packed import unpack
from lanekeep_env.engine.subnormals import flush_subnormals, restore_subnormals
from lanekeep_env.physics.integrate import PACED, named
from lanekeep_env.physics.models import CarModel
from lanekeep_env.physics.numeric import clip, like
from lanekeep_env.tasks.divergence import are_finite
from lanekeep_env.tasks.termination import DIVERGED


@helper
def _nothing(k, cars, counters, settings, equipment):
    """What most worlds do at most of a step's places."""


@helper
def _nothing_after(k, cars, counters, world):
    """The same behind a sub-step."""


@dataclass(frozen=True, eq=False)
class Family:
    """What environments of one kind of world do in a step, each a compiled function; ``k`` is a block.

    All take the arrays of the kernel. ``world`` is (ground, index): the worlds of a set, and a row for each of them.

    Attributes:
        name: of its compiled functions.
        command_row: what the actuator is told.
        outcome_rows: rows of ``outcome`` that a step writes.
        still: (i, block), where car i stands that has diverged.
        judge: (k, cars, counters, world, settings, equipment, outcome), reward and flags.
        report: (k, first, last, cars, settings, outcome), the truth of cars ``first`` to ``last`` of a block.
        observe: (span, cars, counters, world, settings, equipment, observation); ``span`` is (k, first, last).
        start: (place, wanted, cars, counters, world, settings, equipment), the next episode's state of the car at
            ``place`` = (k, i); ``wanted`` are the four start rows of ``reset``, NaN where they are drawn.
        begin: (k, cars, counters, settings, equipment), what a control step begins with around the cars.
        act: (k, cars, counters, settings, equipment), from the commands to what the actuator is told.
        before_substep: (k, cars, counters, settings, equipment).
        after_substep: (k, cars, counters, world).
    """

    name: str
    command_row: int
    outcome_rows: int
    still: Callable[..., Any]
    judge: Callable[..., Any]
    report: Callable[..., Any]
    observe: Callable[..., Any]
    start: Callable[..., Any]
    begin: Callable[..., Any] = _nothing
    act: Callable[..., Any] = _nothing
    before_substep: Callable[..., Any] = _nothing
    after_substep: Callable[..., Any] = _nothing_after


@functools.cache
def _taker(stride: int) -> Callable[..., Any]:
    """Return the compiled function that takes ``stride`` numbers an action."""

    @helper
    @named(str(stride))
    def take_actions(k, cars, counters, settings, action):
        """Turn actions into commands and what second actions ask for; count those that had to be clipped."""
        first = k * cars.shape[2]
        n = cars_in(k, cars, counters)
        limit, scale = settings[at.COMMAND_LIMIT], settings[at.ACTION_SCALE]
        one, zero = like(limit, 1.0), like(limit, 0.0)
        seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
        as_rate = settings[at.ACTION_KIND] > zero
        block, clipped_ = cars[k], counters[at.CLIPPED]
        command_, before_, steer_, done_ = block[at.COMMAND], block[at.STEER_BEFORE], block[at.STEER], block[at.DONE]
        for i in range(n):
            given = like(limit, action[(first + i) * stride])
            clipped_[first + i] += (abs(given) > one) and done_[i] == zero
            wish = clip(given, -one, one) * scale
            integrated = command_[i] + wish * seconds
            command_[i] = clip(integrated if as_rate else wish, -limit, limit)
            before_[i] = steer_[i]
        if stride > 1:
            low, factor, second_ = (
                settings[at.SECOND_LOW],
                settings[at.SECOND_SCALE],
                block[np.int64(settings[at.SECOND])],
            )
            for i in range(n):
                steering = like(limit, action[(first + i) * stride])
                given = like(limit, action[(first + i) * stride + 1])
                # An action counts once, whatever of it had to be clipped.
                clipped_[first + i] += abs(given) > one and not abs(steering) > one and done_[i] == zero
                second_[i] = clip(given, low, one) * factor

    return take_actions


@helper
def _find_diverged(n, block):
    """Mark the cars whose state is no number any more in the row DIVERGED; return how many there are."""
    x_, d_, theta_, beta_ = block[at.ALONG], block[at.LATERAL], block[at.HEADING], block[at.SIDESLIP]
    r_, v_, a_ = block[at.YAW_RATE], block[at.SPEED], block[at.ACCELERATION]
    steer_, before_ = block[at.STEER], block[at.STEER_BEFORE]
    count = 0
    for i in range(n):
        steered = steer_[i] - before_[i]
        count += 0 if are_finite(x_[i], d_[i], theta_[i], beta_[i], r_[i], v_[i], steered, a_[i]) else 1
    for i in range(n if count > 0 else 0):
        steered = steer_[i] - before_[i]
        finite = are_finite(x_[i], d_[i], theta_[i], beta_[i], r_[i], v_[i], steered, a_[i])
        block[at.DIVERGED, i] = like(x_[i], 0.0 if finite else 1.0)
    return count


@helper
def _end_diverged(n, block, settings, outcome):
    """End the episodes of the cars that have diverged, as failures."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    zero, one = like(seconds, 0.0), like(seconds, 1.0)
    for i in range(n):
        if block[at.DIVERGED, i] > zero:
            left = settings[at.HORIZON] - block[at.STEP, i]
            outcome[at.O_REWARD, i] = -settings[at.LARGEST_COST] * seconds * (one + (left if left > zero else zero))
            outcome[at.O_TERMINATED, i] = like(seconds, DIVERGED)
            outcome[at.O_STEERING_RATE, i] = zero
            outcome[at.O_COST, i] = one
            block[at.DEPARTED, i] = one


@functools.cache
def _starter(family: Family) -> Callable[..., Any]:
    """Return the compiled function that starts a car's next episode: state, truth and observation."""
    begin_state, report, observe = family.start, family.report, family.observe

    @helper
    @named(family.name)
    def start(place, wanted, cars, counters, world, settings, equipment, told):
        k, i = place
        column = k * cars.shape[2] + i
        counters[at.EPISODE, column] += 1
        begin_state(place, wanted, cars, counters, world, settings, equipment)
        observation, outcome = told
        zero = like(settings[0], 0.0)
        outcome[at.O_STEERING_RATE, column] = zero
        outcome[at.O_COST, column] = zero
        report(k, i, i + 1, cars, settings, outcome)
        observe((k, i, i + 1), cars, counters, world, settings, equipment, observation)

    return start


@functools.cache
def _finisher(family: Family) -> Callable[..., Any]:
    """Return the compiled function of all that comes after a block's sub-steps."""
    still, judge, report, observe, start = family.still, family.judge, family.report, family.observe, _starter(family)
    rows = family.outcome_rows

    @helper
    @named(family.name)
    def restart(k, cars, counters, world, settings, equipment, told):
        """Start new episodes where the autoreset mode says so."""
        observation, outcome = told
        mode, nan, block = np.int64(settings[at.AUTORESET]), np.nan, cars[k]
        zero, one = like(settings[0], 0.0), like(settings[0], 1.0)
        first = k * cars.shape[2]
        for i in range(cars_in(k, cars, counters)):
            column, starts = first + i, False
            if block[at.DONE, i] > zero:
                outcome[at.O_REWARD, column] = zero  # the episode is over; its end was paid for
                if mode == at.NEXT_STEP:  # this step only starts the new one; what it integrated is thrown away
                    outcome[at.O_TERMINATED, column] = zero
                    outcome[at.O_TRUNCATED, column] = zero
                    starts = True
            elif outcome[at.O_TERMINATED, column] + outcome[at.O_TRUNCATED, column] > zero:
                block[at.DONE, i] = one
                if mode == at.SAME_STEP:
                    for row in range(rows):
                        outcome[rows + row, column] = outcome[row, column]
                    for channel in range(observation.shape[1]):
                        outcome[2 * rows + channel, column] = observation[column, channel]
                    starts = True
            if starts:
                start((k, i), (nan, nan, nan, nan), cars, counters, world, settings, equipment, told)

    @helper
    @named(family.name)
    def finish(k, cars, counters, world, settings, equipment, told):
        observation, outcome = told
        first, block = k * cars.shape[2], cars[k]
        n = cars_in(k, cars, counters)
        diverged = _find_diverged(n, block)
        for i in range(n if diverged > 0 else 0):
            if block[at.DIVERGED, i] > like(settings[0], 0.0):
                still(i, block)
        judge(k, cars, counters, world, settings, equipment, outcome)
        if diverged > 0:
            _end_diverged(n, block, settings, outcome[:, first : first + n])
        begin = np.int64(0)  # a literal would be a type of its own and compile both functions twice
        report(k, begin, n, cars, settings, outcome)
        observe((k, begin, n), cars, counters, world, settings, equipment, observation)
        restart(k, cars, counters, world, settings, equipment, told)

    return finish


@functools.cache
def _resetter(family: Family) -> Callable[..., Any]:
    """Return the compiled function that starts next episodes where ``wanted`` = (`Cars.starting`, `Cars.start`) says.

    What is NaN in ``start`` (`layout.START_ROWS`, n) is drawn.
    """
    begin = _starter(family)

    @helper
    @named(family.name)
    def reset(wanted, cars, counters, world, settings, equipment, told):
        (mask, start), (_, outcome) = wanted, told
        for column in range(mask.shape[0]):
            if mask[column]:
                for row in (at.O_REWARD, at.O_TERMINATED, at.O_TRUNCATED):
                    outcome[row, column] = like(settings[0], 0.0)
                place = column // cars.shape[2], column % cars.shape[2]
                fixed = start[0, column], start[1, column], start[2, column], start[3, column]
                begin(place, fixed, cars, counters, world, settings, equipment, told)

    return reset


@functools.cache
def step_kernels(model: CarModel, family: Family, num_actions: int) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the kernels of one control step of a vehicle model in a family, on one thread and on several.

    They step the blocks ``begin`` to ``end``; where there are none, the first one starts the next episodes of the cars
    in `Cars.starting`: a kernel of its own would compile all of a start once more. What is packed is `Cars.packed`,
    whose ``equipment`` begins with (sensors, gear, slip-speed floor), each None where the scenario has none, or the
    usual one: what it lacks is then no part of the kernel.
    """
    advance, show, paced, finish = model.advance, model.show, model.pace == PACED, _finisher(family)
    begin_step, act, command_row = family.begin, family.act, family.command_row
    before_substep, after_substep = family.before_substep, family.after_substep
    take_actions, reset = _taker(num_actions), _resetter(family)
    name = f"{family.name}_{model.name}_{num_actions}"

    @kernel()
    @named(name)
    def step(packed, begin, end, outcome):
        cars, counters, ground, index, settings, equipment, wanted, action, observation = unpack(packed)
        gear, floor, world, told = equipment[1], equipment[2], (ground, index), (observation, outcome)
        before = flush_subnormals(settings[0])
        if begin == end:
            reset(wanted, cars, counters, world, settings, equipment, told)
        for k in range(begin, end):
            block = cars[k]
            if paced:
                set_speeds(k, cars, counters, settings)
            begin_step(k, cars, counters, settings, equipment)
            take_actions(k, cars, counters, settings, action)
            act(k, cars, counters, settings, equipment)
            if settings[at.DELAY_DEPTH] > like(settings[0], 0.0):
                delay_commands(block, settings, command_row)
            for substep in range(np.int64(settings[at.SUBSTEPS])):
                before_substep(k, cars, counters, settings, equipment)
                advance(block, acting_row(substep, block, settings, command_row), settings, gear, floor)
                after_substep(k, cars, counters, world)
            show(block, settings, floor)
            finish(k, cars, counters, world, settings, equipment, told)
        restore_subnormals(settings[0], before)

    @kernel(parallel=True)
    @named(name)
    def step_parallel(packed, begin, end, outcome):
        for k in prange(begin, end):
            step(packed, k, k + 1, outcome)

    return step, step_parallel
