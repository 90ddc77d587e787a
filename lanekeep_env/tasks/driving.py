"""Driving with throttle and brake: what happens around the car, and what a step costs."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import clip, larger, like, magnitude, select, sin_cos, smaller, sqrt
from lanekeep_env.tasks.termination import CONTACT, STOP_PASSED

#: Gap of a standing car (m) and time gap (s) of the speed that the cost asks for, and its braking, m/s².
STANDING_GAP, TIME_GAP, BRAKING = 4.0, 1.5, 1.7
#: A stop point is passed when the car is farther beyond it, m.
TOLERANCE = 0.05
#: A car that stands nearer than this to a stop point stopped for it, m.
AT_THE_STOP = 5.0
#: In which a set position is to be reached: the set speed is its own and its distance over this, s.
APPROACH_TIME = 1.0


@helper
def happen(i, block, counted, timeline, settings):
    """Let the events of a timeline happen whose time has come in car i; note at which control step the next is due."""
    step = np.float64(settings[at.STEP_TIME]) * np.float64(settings[at.SUBSTEPS])
    time = np.float64(block[at.STEP, i]) * step
    time += 1e-6 + 1e-7 * time  # a single-precision step time is that much off
    event = np.int64(block[at.EVENT, i])
    while event < timeline.shape[0] and timeline[event, at.E_TIME] <= time:
        kind, first, second = timeline[event, at.E_KIND], timeline[event, at.E_FIRST], timeline[event, at.E_SECOND]
        if kind == at.SPEED_EVENT:
            block[at.SET_SPEED, i] = first
        elif kind == at.LEAD_EVENT:
            block[at.LEAD_GAP, i] = first
            block[at.LEAD_SPEED, i] = block[at.LEAD_TARGET, i] = second
            sight(i, at.LEAD_SIGHT, first, event, block, counted)
        elif kind == at.LEAD_SPEED_EVENT:
            block[at.LEAD_TARGET, i] = first
            block[at.LEAD_RATE, i] = second
        elif kind == at.LEAD_GONE:
            block[at.LEAD_GAP, i] = at.NOWHERE
            block[at.LEAD_SPEED, i] = block[at.LEAD_TARGET, i] = 0.0
        elif kind == at.POSITION_EVENT:
            block[at.POSITION_GAP, i] = first
            block[at.POSITION_SPEED, i] = block[at.POSITION_TARGET, i] = second
            block[at.POSITION_PULL, i] = 0.0
        elif kind == at.POSITION_SPEED_EVENT:
            block[at.POSITION_TARGET, i] = first
            block[at.POSITION_RATE, i] = second
        elif kind == at.POSITION_GONE:
            block[at.POSITION_GAP, i] = at.NOWHERE
            block[at.POSITION_SPEED, i] = block[at.POSITION_TARGET, i] = block[at.POSITION_PULL, i] = 0.0
        elif kind == at.STOP_EVENT:
            block[at.STOP_GAP, i] = first
            sight(i, at.STOP_SIGHT, first, event, block, counted)
        else:
            block[at.STOP_GAP, i] = at.FAR
        event += 1
    block[at.EVENT, i] = event
    following = timeline[event, at.E_TIME] if event < timeline.shape[0] else np.inf
    block[at.EVENT_STEP, i] = (following - 1e-6) / (1.0 + 1e-7) / step - 1e-3


@inline
def sight(i, row, gap, event, block, counted):
    """Write in the rows from ``row`` on what car i sees first of what ``event`` brings ``gap`` metres ahead."""
    block[row + at.SIGHT_STEP, i] = block[at.STEP, i]
    block[row + at.SIGHT_GAP, i] = gap
    block[row + at.SIGHT_SPEED, i] = abs(block[at.SPEED, i])
    block[row + at.SIGHT_PULL, i] = block[at.PULL, i] if block[at.SPEED_TARGET, i] > 0.0 else -block[at.PULL, i]
    block[row + at.SIGHT_SEGMENT, i] = counted[at.SEGMENT, i]
    block[row + at.SIGHT_ALONG, i] = block[at.ALONG, i]
    block[row + at.SIGHT_EVENT, i] = event


@inline
def lead_after(speed, target, rate, seconds):
    """Return the speed of the car ahead after so many seconds, m/s: towards ``target`` with ``rate`` m/s²."""
    change = rate * seconds
    return speed + clip(target - speed, -change, change)


@inline
def grip_of(i, block):
    """Return the largest acceleration that the tyres of car i give, m/s²; those of the car ahead give no more."""
    return (block[at.FRONT_GRIP, i] + block[at.REAR_GRIP, i]) * block[at.INVERSE_MASS, i]


@helper
def move_on(n, seconds, block):
    """Move lead car and stop point relative to a block's first ``n`` cars, which drove their row WAY; count endings.

    ENDING says how each car's episode would end by them; AVOIDABLE is 1 where that is new and still to be judged.
    """
    gap_, lead_, target_, rate_ = block[at.LEAD_GAP], block[at.LEAD_SPEED], block[at.LEAD_TARGET], block[at.LEAD_RATE]
    seen_, stop_, way_, inverse_ = block[at.LEAD_SEEN], block[at.STOP_GAP], block[at.WAY], block[at.INVERSE_MASS]
    front_, rear_, ending_, new_ = block[at.FRONT_GRIP], block[at.REAR_GRIP], block[at.ENDING], block[at.AVOIDABLE]
    zero, one, half = like(seconds, 0.0), like(seconds, 1.0), like(seconds, 0.5)
    far, nowhere, beyond = like(seconds, at.FAR), like(seconds, 0.5 * at.NOWHERE), like(seconds, -TOLERANCE)
    contact, overrun = like(seconds, CONTACT), like(seconds, STOP_PASSED)
    count = 0
    for i in range(n):
        before, gap, stop, way = lead_[i], gap_[i], stop_[i], way_[i]
        after = lead_after(before, target_[i], smaller(rate_[i], (front_[i] + rear_[i]) * inverse_[i]), seconds)
        lead_[i] = after
        now = select(gap < nowhere, gap + half * (before + after) * seconds - way, gap)
        left = select(stop < far, stop - way, stop)
        met, passed = now <= zero, left < beyond
        gap_[i] = select(met, zero, now)
        stop_[i] = left
        seen_[i] = select(now < far, after, zero)
        new_[i] = select((met & (gap > zero)) | (passed & (stop >= beyond)), one, zero)
        ending_[i] = select(met, contact, select(passed, overrun, zero))
        count += 1 if met | passed else 0
    return count


@helper
def lead_on(n, seconds, block):
    """Move the set positions of a block's first ``n`` cars, and set the speed that leads there; others keep theirs."""
    gap_, speed_, pull_, set_ = (
        block[at.POSITION_GAP],
        block[at.POSITION_SPEED],
        block[at.POSITION_PULL],
        block[at.SET_SPEED],
    )
    target_, rate_, way_ = block[at.POSITION_TARGET], block[at.POSITION_RATE], block[at.WAY]
    engaged_ = block[at.SPEED_TARGET]
    d_, theta_, beta_ = block[at.LATERAL], block[at.HEADING], block[at.SIDESLIP]
    along_, curvature_, slope_ = block[at.ALONG], block[at.CURVATURE], block[at.CURVATURE_SLOPE]
    zero, one, half = like(seconds, 0.0), like(seconds, 1.0), like(seconds, 0.5)
    nowhere, time, least = like(seconds, 0.5 * at.NOWHERE), like(seconds, APPROACH_TIME), like(seconds, 0.1)
    for i in range(n):
        gap, before = gap_[i], speed_[i]
        after = lead_after(before, target_[i], rate_[i], seconds)
        kappa = curvature_[i] + slope_[i] * larger(along_[i], zero)
        _, cosine = sin_cos(theta_[i] + beta_[i])
        way = select(engaged_[i] < zero, -way_[i], way_[i])  # in reverse away from it
        ahead = way * cosine / larger(one - d_[i] * kappa, least)
        there, now = gap < nowhere, gap + half * (before + after) * seconds - ahead
        speed_[i], pull_[i] = after, (after - before) / seconds
        gap_[i] = select(there, now, gap)
        set_[i] = select(there, larger(after + now / time, zero), set_[i])


@inline
def wanted_speed(set_speed, gap, stop):
    """Return the speed that the cost asks for, m/s: the set one, a time gap to the lead car, even braking to a stop.

    Backwards it is negative, as the set one is; cars and stop points are those in the way.
    """
    zero, far = like(gap, 0.0), like(gap, at.FAR)
    wanted = magnitude(set_speed)
    follow = larger((gap - like(gap, STANDING_GAP)) * like(gap, 1.0 / TIME_GAP), zero)
    wanted = select(gap < far, smaller(wanted, follow), wanted)
    brake = sqrt(like(gap, 2.0 * BRAKING) * larger(stop, zero))
    wanted = select(stop < far, smaller(wanted, brake), wanted)
    return select(set_speed < zero, -wanted, wanted)
