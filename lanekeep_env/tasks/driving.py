"""Driving with throttle and brake: what happens around the car, and what a step costs."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import larger, like, select, smaller, sqrt

#: Gap of a standing car (m) and time gap (s) of the speed that the cost asks for, and its braking, m/s².
STANDING_GAP, TIME_GAP, BRAKING = 4.0, 1.5, 1.7


@helper
def happen(i, block, timeline, settings):
    """Let the events of a timeline happen whose time has come in car i."""
    time = np.float64(block[at.STEP, i]) * np.float64(settings[at.STEP_TIME]) * np.float64(settings[at.SUBSTEPS])
    time += 1e-6 + 1e-7 * time  # a single-precision step time is that much off
    event = np.int64(block[at.EVENT, i])
    while event < timeline.shape[0] and timeline[event, at.E_TIME] <= time:
        kind, first, second = timeline[event, at.E_KIND], timeline[event, at.E_FIRST], timeline[event, at.E_SECOND]
        if kind == at.SPEED_EVENT:
            block[at.SET_SPEED, i] = first
        elif kind == at.LEAD_EVENT:
            block[at.LEAD_GAP, i] = first
            block[at.LEAD_SPEED, i] = second
        elif kind == at.LEAD_GONE:
            block[at.LEAD_GAP, i] = at.FAR
            block[at.LEAD_SPEED, i] = 0.0
        elif kind == at.STOP_EVENT:
            block[at.STOP_GAP, i] = first
        else:
            block[at.STOP_GAP, i] = at.FAR
        event += 1
    block[at.EVENT, i] = event


@helper
def move_on(i, way, seconds, block):
    """Move lead car and stop point of car i relative to a car that drove ``way`` metres."""
    far = like(way, at.FAR)
    if block[at.LEAD_GAP, i] < far:
        gap = block[at.LEAD_GAP, i] + block[at.LEAD_SPEED, i] * seconds - way
        block[at.LEAD_GAP, i] = smaller(gap, like(way, at.FAR - 1e-3))
    if block[at.STOP_GAP, i] < far:
        block[at.STOP_GAP, i] -= way


@inline
def wanted_speed(set_speed, gap, stop):
    """Return the speed that the cost asks for, m/s: the set one, a time gap to the lead car, even braking to a stop."""
    zero, far = like(gap, 0.0), like(gap, at.FAR)
    follow = larger((gap - like(gap, STANDING_GAP)) / like(gap, TIME_GAP), zero)
    wanted = select(gap < far, smaller(set_speed, follow), set_speed)
    brake = sqrt(like(gap, 2.0 * BRAKING) * larger(stop, zero))
    return select(stop < far, smaller(wanted, brake), wanted)
