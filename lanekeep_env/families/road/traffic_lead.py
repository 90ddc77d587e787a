"""Where a car is among traffic: its lane, the car ahead, since when that is ahead, and how it drives since then.

What it does is written down as the events of a timeline, so that the function that judges the contacts of
`lanekeep/Drive-v0` judges these as well.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import like
from lanekeep_env.tasks.avoidable import avoided
from lanekeep_env.tasks.driving import sight
from lanekeep_env.traffic.change_lane import MARGIN, neighbours
from lanekeep_env.traffic.drive import find_lane
from lanekeep_env.traffic.follow import LENGTH

#: Events of a car's timeline: its set speed, the car ahead, and that one's speeds, one each so many control steps.
EVENTS, PERIOD = 128, 5
#: A car that was that long in its lane, s, is no more at fault for who comes from behind.
SETTLED = 5.0


@helper
def see_traffic(i, time, block, counted, timeline, traffic, streets, settings):
    """Note where car i is among the others: its lane, the car ahead, the end of its lane."""
    heading, wide = np.float64(block[at.HEADING, i]), np.float64(settings[at.LANE_WIDTH])
    traffic[at.T_HEADING, 0], traffic[at.T_SPEED, 0] = heading, block[at.SPEED, i]
    traffic[at.T_WISH, 0] = block[at.SET_SPEED, i]
    traffic[at.T_Y, 0] = block[at.LATERAL, i] + settings[at.BODY_MIDDLE] * np.sin(heading)
    find_lane(0, traffic, streets)
    lane = min(max(np.floor(block[at.LATERAL, i] / wide + 0.5), 0.0), settings[at.LANES] - 1.0)
    if block[at.LANE, i] != lane:
        block[at.LANE_SINCE, i] = block[at.STEP, i]
    block[at.LANE, i] = lane
    block[at.LANE_OFFSET, i] = block[at.LATERAL, i] - lane * wide
    traffic[at.T_LANE, 0] = traffic[at.T_TARGET, 0] = lane
    _find_lead(i, time, block, counted, timeline, traffic, streets, settings)
    ends = lane == 0.0 and block[at.LANE_END, i] < at.FAR
    block[at.STOP_GAP, i] = block[at.LANE_END, i] if ends else like(block[0, 0], at.FAR)


@helper
def _find_lead(i, time, block, counted, timeline, traffic, streets, settings):
    """Note the car ahead of car i in its lane, what was seen of it first, and how fast it has been since."""
    front, _ = neighbours(np.int64(0), np.int64(block[at.LANE, i]), traffic, streets)
    gap = at.NOWHERE
    if front >= 0:
        gap = traffic[at.T_X, front] - traffic[at.T_X, 0] - LENGTH / 2 - settings[at.BODY_HALF_LENGTH]
    if gap >= at.FAR:
        block[at.LEAD_NUMBER, i] = block[at.LEAD_SPEED, i] = block[at.LEAD_SEEN, i] = like(block[0, 0], 0.0)
        block[at.LEAD_GAP, i] = at.NOWHERE
        return
    speed = traffic[at.T_SPEED, front] * traffic[at.T_COSINE, front]
    block[at.LEAD_GAP, i] = max(gap, 0.0)
    block[at.LEAD_SPEED, i] = block[at.LEAD_SEEN, i] = max(speed, 0.0)
    if block[at.LEAD_NUMBER, i] != front:
        block[at.LEAD_NUMBER, i] = front
        block[at.LEAD_OURS, i] = 1.0 if block[at.LANE_SINCE, i] == block[at.STEP, i] > 0.0 else 0.0
        timeline[1:, at.E_TIME] = np.inf
        _write(1, time, at.LEAD_EVENT, gap, speed, timeline)
        sight(i, at.LEAD_SIGHT, gap, 1.0, block, counted)
    else:
        _record(i, time, speed, block, timeline, settings)


@helper
def _write(event, time, kind, first, second, timeline):
    timeline[event, at.E_TIME], timeline[event, at.E_KIND] = time, kind
    timeline[event, at.E_FIRST], timeline[event, at.E_SECOND] = first, second


@helper
def _since(i, block):
    """Return for how many control steps car i has seen the car ahead."""
    return np.int64(block[at.STEP, i] - max(block[at.LEAD_SIGHT + at.SIGHT_STEP, i], 0.0))


@helper
def _record(i, time, speed, block, timeline, settings):
    """Write down the speed of the car ahead: steady changes between those that are."""
    since = _since(i, block)
    event = 1 + since // PERIOD
    if since % PERIOD == 0 and 1 < event < EVENTS - 1:
        seconds = PERIOD * np.float64(settings[at.STEP_TIME]) * settings[at.SUBSTEPS]
        before = timeline[event - 1, at.E_SECOND if event == 2 else at.E_FIRST]
        _write(event, time - seconds, at.LEAD_SPEED_EVENT, speed, abs(speed - before) / seconds, timeline)


@helper
def _expect(i, time, block, timeline, traffic):
    """Write down what the car ahead would have done further: a brake that it was told to press, or a crash, goes on."""
    lead = np.int64(block[at.LEAD_NUMBER, i])
    speed, brake = max(traffic[at.T_SPEED, lead], 0.0), max(-traffic[at.T_PULL, lead], 0.0)
    left = traffic[at.T_BRAKES_UNTIL, lead] - time
    target = 0.0 if traffic[at.T_CRASHED, lead] > 0.0 else max(speed - brake * max(left, 0.0), 0.0)
    event = min(max(2 + _since(i, block) // PERIOD, 2), EVENTS - 1)
    _write(event, time, at.LEAD_SPEED_EVENT, target, brake, timeline)


@helper
def is_avoidable(i, met, time, block, timeline, traffic, road, settings, drive):
    """Return 1 where car i could have avoided to touch car ``met``, else 0.

    The one ahead, by braking, as `could_avoid` has it, from the first observation that showed it in the lane on; who
    went to its lane could have stayed where it was. So could who touches a car in another lane, or is hit from behind
    soon after it came.
    """
    own = np.int64(block[at.LANE, i]) * np.float64(settings[at.LANE_WIDTH])
    seconds = np.float64(settings[at.STEP_TIME]) * settings[at.SUBSTEPS]
    ours = block[at.LANE_SINCE, i] > 0.0 and (block[at.STEP, i] - block[at.LANE_SINCE, i]) * seconds < SETTLED
    yes, no = like(block[0, 0], 1.0), like(block[0, 0], 0.0)
    if met == block[at.LEAD_NUMBER, i]:
        if block[at.LEAD_OURS, i] > 0.0:
            return yes
        _expect(i, time, block, timeline, traffic)
        return avoided(i, at.LEAD_SIGHT, block, timeline, road, settings, drive)
    if abs(traffic[at.T_Y, met] - own) <= 0.5 * settings[at.LANE_WIDTH] + MARGIN and not ours:
        return no
    return yes
