"""Whether a contact or an overrun could have been avoided: what full braking had done.

Of a car that came ahead, or a stop point, counts the first observation that showed it. From the step behind it on the
brake is pressed fully: it comes with its lag, within the circle of the friction that the road's bends leave, against
slope, wind and resistances, while the car ahead drives as its timeline says. Braking from any later time on ends
farther ahead; so what this does not avoid, no braking does. (Cars ahead and stop points are seen without fault, so that
the sensors' delay is that one control step.)
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import clip, like
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.powertrain import resistance
from lanekeep_env.tasks.driving import TOLERANCE, grip_of, lead_after

#: Longest braking that is looked at, s.
LONGEST = 300.0


@inline
def _curvature(segment, along, road):
    """Return segment, place on it, m, and curvature there, 1/m, of a place behind the start of a segment."""
    for _ in range(road.shape[0]):
        if not along >= road[segment, at.R_LENGTH]:
            break
        along -= road[segment, at.R_LENGTH]
        segment = np.int64(road[segment, at.R_NEXT])
    return segment, along, road[segment, at.R_CURVATURE] + road[segment, at.R_CURVATURE_SLOPE] * along


@inline
def _braking(limit, circle, lateral):
    """Return the deceleration that tyres give beside a lateral acceleration, m/s²."""
    if circle == 0.0:
        return limit
    return min(circle * limit, np.sqrt(max(limit * limit - lateral * lateral, 0.0)))


@helper
def could_avoid(i, row, block, timeline, road, settings, drive):
    """Return whether car i, braking fully once it saw what the rows from ``row`` on tell of, had kept clear of it."""
    h = np.float64(settings[at.STEP_TIME])
    step = h * settings[at.SUBSTEPS]
    leads = row == at.LEAD_SIGHT
    seen = block[row + at.SIGHT_STEP, i]
    time, brakes_from = max(seen, 0.0) * step, (seen + 1.0) * step
    gap, v = np.float64(block[row + at.SIGHT_GAP, i]), np.float64(block[row + at.SIGHT_SPEED, i])
    segment, along = np.int64(block[row + at.SIGHT_SEGMENT, i]), np.float64(block[row + at.SIGHT_ALONG, i])
    way = 1.0 if block[at.SPEED_TARGET, i] > 0.0 else -1.0
    slope, wind = way * block[at.SLOPE, i], way * block[at.WIND, i]
    inverse, limit, share = block[at.INVERSE_MASS, i], grip_of(i, block), drive[at.D_PEDAL_SHARE]
    event = np.int64(block[row + at.SIGHT_EVENT, i])
    lead = target = timeline[event, at.E_SECOND] if leads else 0.0
    rate, brake = 0.0, 0.0
    drives = block[row + at.SIGHT_PULL, i] + GRAVITY * slope + resistance(v, wind, drive, inverse)
    for _ in range(np.int64(LONGEST / h)):
        if v <= 0.0:
            break
        while leads and event + 1 < timeline.shape[0] and timeline[event + 1, at.E_TIME] <= time + 1e-6:
            event += 1
            if timeline[event, at.E_KIND] == at.LEAD_GONE:
                return True
            if timeline[event, at.E_KIND] == at.LEAD_SPEED_EVENT:
                target, rate = timeline[event, at.E_FIRST], min(timeline[event, at.E_SECOND], limit)
        if time >= brakes_from - 1e-6:
            brake += (1.0 - brake) * share
            drives -= drives * share
        segment, along, kappa = _curvature(segment, along, road)
        most = _braking(limit, settings[at.CIRCLE], v * v * kappa)
        a = (
            clip(drives - brake * drive[at.D_BRAKE], -most, most)
            - GRAVITY * slope
            - resistance(v, wind, drive, inverse)
        )
        before, ahead = v, lead
        v, lead = max(v + a * h, 0.0), lead_after(lead, target, rate, h)
        driven = 0.5 * (before + v) * h
        along += way * driven
        gap += (0.5 * (ahead + lead) * h if leads else 0.0) - driven
        time += h
        if gap <= 0.0 and (leads or gap < -TOLERANCE):
            return False
    return True


@inline
def avoided(i, row, block, timeline, road, settings, drive):
    """The same as a number, 1 or 0, of the simulation's precision."""
    return like(block[0, 0], 1.0 if could_avoid(i, row, block, timeline, road, settings, drive) else 0.0)
