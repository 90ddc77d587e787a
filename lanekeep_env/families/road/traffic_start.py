"""How episodes among traffic start: the car in a lane, the others around it, and what some of them will do."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.engine.episode import DRAW_LATERAL
from lanekeep_env.families.road.start import start_on_road
from lanekeep_env.families.road.traffic_lead import see_traffic
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.tasks.driving import grip_of, sight
from lanekeep_env.traffic.drive import find_lane

#: Counters of the draws, behind those of a powertrain's episode: a key of its own, and what it is for.
DRAW_TRAFFIC = np.int64(83)
_WISH, _LANE, _SIDE, _GAP, _SPEED, _TIME, _BRAKE, _LASTS, _END = (np.int64(k) for k in range(9))
_FIRST_LANE, _FIRST_CAR, _DRAWS_A_CAR = np.int64(16), np.int64(64), np.int64(8)
#: Room ahead in the lanes in which something is to happen, m.
_CLEARED = 110.0


@inline
def _between(key, which, low, high):
    return low + (high - low) * uniform(key, which)


@helper
def start_in_traffic(place, wanted, cars, counters, world, settings, equipment):
    """Set the state of a car, and of those around it, to the start of its episode; as `start_on_road`.

    A lateral error that is wanted counts from the middle of the right-most lane.
    """
    k, i = place
    column = k * cars.shape[2] + i
    block, counted = cars[k], counters[:, k * cars.shape[2] :]
    timeline, traffic, streets = equipment[5][column], equipment[6][column], equipment[7][column]
    key = derive(np.uint64(counted[at.KEY, i]), counted[at.EPISODE, i])
    draws = derive(key, DRAW_TRAFFIC)
    counted[at.TIMELINE, i] = column
    timeline[:, at.E_TIME] = np.inf
    timeline[0, at.E_TIME], timeline[0, at.E_KIND] = 0.0, at.SPEED_EVENT
    timeline[0, at.E_FIRST] = _between(draws, _WISH, np.float64(settings[at.WISH_LOW]), settings[at.WISH_HIGH])
    lanes, width = np.int64(settings[at.LANES]), np.float64(settings[at.LANE_WIDTH])
    merges = settings[at.SITUATION] == at.MERGES
    lateral, heading, station, which = wanted
    if np.isnan(lateral):
        lane = np.int64(0) if merges else np.int64(uniform(draws, _LANE) * lanes)
        lateral = lane * width + (2.0 * uniform(key, DRAW_LATERAL) - 1.0) * settings[at.START_LATERAL]
    start_on_road(place, (lateral, heading, station, which), cars, counters, world, settings, equipment)
    block[at.PLACE_BEFORE, i] = block[at.STATION, i] + block[at.ALONG, i]
    block[at.LEAD_NUMBER, i] = block[at.LEAD_OURS, i] = block[at.LANE_SINCE, i] = 0.0
    block[at.LANE_END, i] = _between(draws, _END, 150.0, 300.0) if merges else at.NOWHERE
    streets[at.T_LANES], streets[at.T_LANE_WIDTH], streets[at.T_SPEED_LIMIT] = lanes, width, np.inf
    streets[at.T_FIRST_LANE] = 1.0 if merges else 0.0
    streets[at.T_GRIP] = grip_of(i, block)
    lane = min(max(np.floor(lateral / width + 0.5), 0.0), lanes - 1.0)
    _place(draws, lane, traffic, streets, settings)
    _tell(draws, lane, np.float64(block[at.SET_SPEED, i]), traffic, streets, settings)
    for j in range(1, traffic.shape[1]):
        find_lane(j, traffic, streets)
    traffic[:, 0] = 0.0
    see_traffic(i, np.float64(0.0), block, counted, timeline, traffic, streets, settings)
    block[at.LEAD_SIGHT + at.SIGHT_STEP, i] = -1.0
    if merges:
        sight(i, at.STOP_SIGHT, block[at.LANE_END, i], 0.0, block, counted)
        block[at.STOP_SIGHT + at.SIGHT_STEP, i] = -1.0


@helper
def _place(draws, lane, traffic, streets, settings):
    """Put the others on the lanes, a third of them behind the car, and none beside it in its own lane."""
    first, spacing = streets[at.T_FIRST_LANE], np.float64(settings[at.SPACING])
    used = np.int64(streets[at.T_LANES] - first)
    happens = settings[at.SITUATION] == at.LEAD_BRAKES or settings[at.SITUATION] == at.CUTS_IN
    traffic[:, :] = 0.0
    for j in range(1, traffic.shape[1]):
        slot, its = (j - 1) // used, first + (j - 1) % used
        behind = (traffic.shape[1] - 1) // used // 3
        own = its == lane
        shift = (1.0 if slot >= behind else 0.0) if own else uniform(draws, _FIRST_LANE + np.int64(its))
        key = derive(draws, _FIRST_CAR + j)
        x = (slot - behind + shift + 0.4 * uniform(key, np.int64(0)) - 0.2) * spacing
        if happens and slot >= behind:
            x += _CLEARED
        traffic[at.T_X, j], traffic[at.T_Y, j] = x, its * streets[at.T_LANE_WIDTH]
        traffic[at.T_LANE, j] = traffic[at.T_TARGET, j] = its
        wish = _between(key, np.int64(1), np.float64(settings[at.FLOW_LOW]), np.float64(settings[at.FLOW_HIGH]))
        traffic[at.T_WISH, j] = traffic[at.T_SPEED, j] = wish
        traffic[at.T_EXPONENT, j] = _between(key, np.int64(2), 3.5, 4.5)
        traffic[at.T_TIMER, j] = uniform(key, np.int64(3))
        traffic[at.T_BRAKES_AT, j] = np.inf


@helper
def _tell(draws, lane, speed, traffic, streets, settings):
    """Let car 1 brake ahead of a car at ``speed``, or come in front of it from beside, where the situation asks it."""
    if settings[at.SITUATION] != at.LEAD_BRAKES and settings[at.SITUATION] != at.CUTS_IN:
        return
    traffic[at.T_TIMER, 1] = -np.inf  # it changes lanes when it is told to
    if settings[at.SITUATION] == at.LEAD_BRAKES:
        its = lane
        traffic[at.T_X, 1] = 10.0 + _between(draws, _GAP, 0.8, 2.0) * speed
        traffic[at.T_WISH, 1] = speed
        traffic[at.T_BRAKES_AT, 1] = _between(draws, _TIME, 1.0, 6.0)
        traffic[at.T_BRAKES_UNTIL, 1] = traffic[at.T_BRAKES_AT, 1] + _between(draws, _LASTS, 1.0, 5.0)
        traffic[at.T_BRAKE, 1] = _between(draws, _BRAKE, 4.0, 9.0)
    else:
        its = lane + (1.0 if uniform(draws, _SIDE) < 0.5 else -1.0)
        if its < 0.0 or its >= streets[at.T_LANES]:
            its = 2.0 * lane - its
        traffic[at.T_X, 1] = 10.0 + _between(draws, _GAP, 1.0, 2.5) * speed
        traffic[at.T_WISH, 1] = _between(draws, _SPEED, 0.7, 0.95) * speed
        traffic[at.T_CUTS_IN, 1] = _between(draws, _TIME, 0.3, 1.3) * speed
    traffic[at.T_LANE, 1] = traffic[at.T_TARGET, 1] = its
    traffic[at.T_Y, 1] = its * streets[at.T_LANE_WIDTH]
    traffic[at.T_SPEED, 1] = traffic[at.T_WISH, 1]
