"""What cars with a powertrain add to those on a road: pedals, traffic, and how that is judged."""

from __future__ import annotations

from dataclasses import replace

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.families.road.kernel import ON_ROADS, lane_judge, report
from lanekeep_env.physics.numeric import like, magnitude, select, smaller
from lanekeep_env.physics.powertrain import change_gear, find_due, pull
from lanekeep_env.tasks.avoidable import avoided
from lanekeep_env.tasks.driving import AT_THE_STOP, happen, lead_on, move_on, wanted_speed
from lanekeep_env.tasks.termination import CONTACT, STOP_PASSED

# Behind sensors, gear, floor and camera the equipment holds the powertrain's numbers and the timelines.
_DRIVE, _TIMELINES = 4, 5

_judge_lane = lane_judge(at.LATERAL)


@helper
def begin(k, cars, counters, settings, equipment):
    """What a control step begins with: the events that are due, no way driven."""
    timelines, first, block = equipment[_TIMELINES], k * cars.shape[2], cars[k]
    counted, n = counters[:, first:], cars_in(k, cars, counters)
    find_due(n, block, equipment[_DRIVE])
    due_, way_, pull_, before_ = block[at.DUE], block[at.WAY], block[at.PULL], block[at.PULL_BEFORE]
    for i in range(n):
        if due_[i] > like(due_[i], 0.0):
            if block[at.STEP, i] >= block[at.EVENT_STEP, i]:
                happen(i, block, counted, timelines[counted[at.TIMELINE, i]], settings)
            change_gear(i, block, equipment[_DRIVE])
    for i in range(n):
        way_[i] = like(way_[i], 0.0)
        before_[i] = pull_[i]


@helper
def before_substep(k, cars, counters, settings, equipment):
    pull(cars_in(k, cars, counters), cars[k], settings, equipment[_DRIVE])


@helper
def _charge_speed(n, begin, block, settings, outcome):
    """Add the speed error to the reward; a departure has been charged for all that follows."""
    reward_, cost_ = outcome[at.O_REWARD], outcome[at.O_COST]
    v_, set_, gap_, stop_ = block[at.SPEED], block[at.SET_SPEED], block[at.LEAD_GAP], block[at.STOP_GAP]
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    zero, scale = like(seconds, 0.0), like(seconds, 1.0) / settings[at.SPEED_REFERENCE]
    most = settings[at.COST_CAP] * seconds
    for i in range(n):
        error = (v_[i] - wanted_speed(set_[i], gap_[i], stop_[i])) * scale
        reward = reward_[begin + i]
        both = -smaller(error * error * seconds - reward, most)
        reward_[begin + i] = select(cost_[begin + i] == zero, both, reward)


@helper
def _find_avoidable(n, block, counted, road, settings, equipment):
    """Say of the endings that are new whether they were avoidable."""
    zero = like(block[0, 0], 0.0)
    for i in range(n):
        end = block[at.ENDING, i]
        if end > zero and block[at.AVOIDABLE, i] > zero:
            row = at.LEAD_SIGHT if end == like(end, CONTACT) else at.STOP_SIGHT
            timeline = equipment[_TIMELINES][counted[at.TIMELINE, i]]
            block[at.AVOIDABLE, i] = avoided(i, row, block, timeline, road, settings, equipment[_DRIVE])


@helper
def end(n, block, settings, outcome):
    """Let a car that is met, or a stop point that is passed, end the episode."""
    reward_, terminated_, cost_ = outcome[at.O_REWARD], outcome[at.O_TERMINATED], outcome[at.O_COST]
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    worst, horizon = settings[at.COST_CAP] * seconds, settings[at.HORIZON]
    ends = settings[at.DEPARTURE] == at.TERMINATE
    zero, one = like(seconds, 0.0), like(seconds, 1.0)
    for i in range(n):
        ending = block[at.ENDING, i]
        if ending > zero:
            block[at.FAILED, i] = ending
            block[at.DEPARTED, i] = one
            cost_[i] = one
            left = horizon - block[at.STEP, i]
            reward_[i] = -worst * (one + (left if left > zero else zero) if ends else one)
            terminated_[i] = ending if ends else zero


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    first = k * cars.shape[2]
    n = cars_in(k, cars, counters)
    block, told = cars[k], outcome[:, first : first + n]
    _judge_lane(n, block, settings, told)
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    endings = move_on(n, seconds, block)
    if settings[at.TRACKS] > like(seconds, 0.0):
        lead_on(n, seconds, block)
    _charge_speed(n, first, block, settings, outcome)
    if endings > 0:
        _find_avoidable(n, block, counters[:, first:], world[0], settings, equipment)
        end(n, block, settings, told)


@helper
def report_drive(k, first, last, cars, settings, outcome):
    """Copy the truth that a state decides, with gaps, errors and jerk."""
    report(k, first, last, cars, settings, outcome)
    # Whole rows, whose numbers lie side by side: those of a part of the columns make no SIMD code.
    block, begin = cars[k], k * cars.shape[2]
    gap_, lead_, stop_, v_ = block[at.LEAD_GAP], block[at.LEAD_SPEED], block[at.STOP_GAP], block[at.SPEED]
    pull_, before_, set_ = block[at.PULL], block[at.PULL_BEFORE], block[at.SET_SPEED]
    ending_, avoidable_ = block[at.ENDING], block[at.AVOIDABLE]
    gaps, times, stops = outcome[at.O_GAP], outcome[at.O_TIME_TO_COLLISION], outcome[at.O_STOP_ERROR]
    errors, jerks, contacts, overruns = (
        outcome[at.O_SPEED_ERROR],
        outcome[at.O_JERK],
        outcome[at.O_CONTACT],
        outcome[at.O_OVERRUN],
    )
    met, passed = outcome[at.O_AVOIDABLE_CONTACT], outcome[at.O_AVOIDABLE_OVERRUN]
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    none, zero, one = like(seconds, at.NOWHERE), like(seconds, 0.0), like(seconds, 1.0)
    rate = one / seconds
    contact, overrun, near = like(seconds, CONTACT), like(seconds, STOP_PASSED), like(seconds, AT_THE_STOP)
    for i in range(first, last):
        gap, stop, speed, ending = gap_[i], stop_[i], magnitude(v_[i]), ending_[i]
        there, closing = gap < like(gap, 0.5 * at.NOWHERE), speed - lead_[i]
        comes = there & (closing > zero)
        gaps[begin + i] = select(there, gap, none)
        times[begin + i] = select(comes, smaller(gap / select(comes, closing, one), none), none)
        stops[begin + i] = select((stop < zero) | ((stop < near) & (speed == zero)), stop, zero)
        errors[begin + i] = v_[i] - wanted_speed(set_[i], gap, stop)
        jerks[begin + i] = (pull_[i] - before_[i]) * rate
        contacts[begin + i] = select(ending == contact, one, zero)
        overruns[begin + i] = select(ending == overrun, one, zero)
        met[begin + i] = select(ending == contact, avoidable_[i], zero)
        passed[begin + i] = select(ending == overrun, avoidable_[i], zero)


DRIVING = replace(
    ON_ROADS,
    name="driving",
    outcome_rows=at.DRIVE_OUTCOME_ROWS,
    begin=begin,
    before_substep=before_substep,
    judge=_judge,
    report=report_drive,
)
