"""What cars with a powertrain add to those on a road: pedals, traffic, and how that is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.families.road.kernel import ON_ROADS, judge_lane, report
from lanekeep_env.physics.numeric import like, smaller
from lanekeep_env.physics.powertrain import pull
from lanekeep_env.tasks.avoidable import avoided
from lanekeep_env.tasks.driving import TOLERANCE, happen, move_on, wanted_speed
from lanekeep_env.tasks.termination import CONTACT, STOP_PASSED

# Behind sensors, gear, floor and camera the equipment holds the powertrain's numbers and the timelines.
_DRIVE, _TIMELINES = 4, 5


@helper
def _begin(k, cars, counters, settings, equipment):
    """What a control step begins with: the events that are due, no way driven."""
    timelines, first, block = equipment[_TIMELINES], k * cars.shape[2], cars[k]
    counted = counters[:, first:]
    for i in range(cars_in(k, cars, counters)):
        happen(i, block, counted, timelines[counted[at.TIMELINE, i]], settings)
        block[at.WAY, i] = like(settings[0], 0.0)
        block[at.PULL_BEFORE, i] = block[at.PULL, i]


@helper
def _before_substep(k, cars, counters, settings, equipment):
    for i in range(cars_in(k, cars, counters)):
        pull(i, cars[k], settings, equipment[_DRIVE])


@helper
def _wanted(i, block):
    return wanted_speed(block[at.SET_SPEED, i], block[at.LEAD_GAP, i], block[at.STOP_GAP, i])


@helper
def _meets(i, block, counted, road, settings, equipment):
    """Move what is around car i; return how its episode would end by it, 0 for not."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    zero, beyond = like(seconds, 0.0), like(seconds, -TOLERANCE)
    gap, stop = block[at.LEAD_GAP, i], block[at.STOP_GAP, i]
    move_on(i, block[at.WAY, i], seconds, block)
    met, passed = block[at.LEAD_GAP, i] <= zero, block[at.STOP_GAP, i] < beyond
    block[at.AVOIDABLE, i] = zero
    if (met and gap > zero) or (passed and stop >= beyond):
        row = at.LEAD_SIGHT if met and gap > zero else at.STOP_SIGHT
        timeline = equipment[_TIMELINES][counted[at.TIMELINE, i]]
        block[at.AVOIDABLE, i] = avoided(i, row, block, timeline, road, settings, equipment[_DRIVE])
    block[at.LEAD_GAP, i] = zero if met else block[at.LEAD_GAP, i]
    end = like(seconds, CONTACT if met else (STOP_PASSED if passed else 0.0))
    block[at.FAILED, i] = end if end > zero else block[at.FAILED, i]
    return end


@helper
def _judge_drive(n, block, counted, road, settings, equipment, outcome):
    """Add the speed error to the reward; a car ahead that is met and a stop point that is passed end the episode."""
    reward_, terminated_, cost_ = outcome[at.O_REWARD], outcome[at.O_TERMINATED], outcome[at.O_COST]
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    cap, horizon, reference = settings[at.COST_CAP], settings[at.HORIZON], settings[at.SPEED_REFERENCE]
    ends = settings[at.DEPARTURE] == at.TERMINATE
    zero, one = like(seconds, 0.0), like(seconds, 1.0)
    for i in range(n):
        end = _meets(i, block, counted, road, settings, equipment)
        error = (block[at.SPEED, i] - _wanted(i, block)) / reference
        if cost_[i] == zero:  # a departure has been charged for all that follows
            reward_[i] = -smaller(error * error * seconds - reward_[i], cap * seconds)
        if end > zero:
            cost_[i] = one
            block[at.DEPARTED, i] = one
            left = horizon - block[at.STEP, i]
            reward_[i] = -cap * seconds * (one + (left if left > zero else zero) if ends else one)
            terminated_[i] = end if ends else zero


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    first = k * cars.shape[2]
    n = cars_in(k, cars, counters)
    told = outcome[:, first : first + n]
    judge_lane(n, cars[k], settings, told)
    _judge_drive(n, cars[k], counters[:, first:], world[0], settings, equipment, told)


@helper
def _report(k, first, last, cars, settings, outcome):
    """Copy the truth that a state decides, with gaps, errors and jerk."""
    report(k, first, last, cars, settings, outcome)
    block, told = cars[k], outcome[:, k * cars.shape[2] :]
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    none = like(seconds, np.inf)
    for i in range(first, last):
        gap, stop, v = block[at.LEAD_GAP, i], block[at.STOP_GAP, i], block[at.SPEED, i]
        there, closing = gap < like(gap, 0.5 * at.NOWHERE), abs(v) - block[at.LEAD_SPEED, i]
        told[at.O_LEAD_GAP, i] = gap if there else none
        told[at.O_TIME_TO_COLLISION, i] = gap / closing if there and closing > like(gap, 0.0) else none
        told[at.O_STOP_ERROR, i] = stop if stop < like(gap, at.FAR) else none
        told[at.O_SPEED_ERROR, i] = v - _wanted(i, block)
        told[at.O_JERK, i] = (block[at.PULL, i] - block[at.PULL_BEFORE, i]) / seconds
        told[at.O_AVOIDABLE, i] = block[at.AVOIDABLE, i]


DRIVING = replace(
    ON_ROADS,
    name="driving",
    outcome_rows=at.DRIVE_OUTCOME_ROWS,
    begin=_begin,
    before_substep=_before_substep,
    judge=_judge,
    report=_report,
)
