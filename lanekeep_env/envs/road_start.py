"""Where the lanes are on their road: segments crossed, episodes started."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import clip, like
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.tasks.lane_keeping import steady_turning

# Counters of an episode's random draws: the order is part of an environment's version. (Typed, because
# numba compiles a function anew for every literal it is called with.)
DRAW_ROAD, DRAW_STATION, DRAW_LATERAL, DRAW_HEADING = np.int64(0), np.int64(1), np.int64(2), np.int64(3)


@helper
def load_segment(i, segment, lanes, counters, road):
    """Copy row ``segment`` of the road into the rows of lane i."""
    counters[at.SEGMENT, i] = segment
    lanes[at.SEGMENT_LENGTH, i] = road[segment, at.R_LENGTH]
    lanes[at.CURVATURE, i] = road[segment, at.R_CURVATURE]
    lanes[at.CURVATURE_SLOPE, i] = road[segment, at.R_CURVATURE_SLOPE]
    lanes[at.SPEED_SQUARED, i] = road[segment, at.R_SPEED_SQUARED]
    lanes[at.SPEED_SQUARED_SLOPE, i] = road[segment, at.R_SPEED_SQUARED_SLOPE]
    lanes[at.STATION, i] = road[segment, at.R_STATION]


@helper
def cross_segments(k, lanes, counters, road):
    """Move lanes of block ``k`` that ran past the end of their segment into the next one.

    The sub-step ran on with the old segment's curvature for ``over`` metres; the difference to the new
    one is put back in closed form, so headings stay exact over any number of jumps.
    """
    first, block = k * lanes.shape[2], lanes[k]
    along, length = block[at.ALONG], block[at.SEGMENT_LENGTH]
    for i in range(block.shape[1]):
        while along[i] >= length[i]:
            over = along[i] - length[i]
            slope = block[at.CURVATURE_SLOPE, i]
            old = block[at.CURVATURE, i] + slope * length[i]
            load_segment(
                i, np.int64(road[counters[at.SEGMENT, first + i], at.R_NEXT]), block, counters[:, first:], road
            )
            new = block[at.CURVATURE, i]
            jump = old - new
            bend = (slope - block[at.CURVATURE_SLOPE, i]) * over * like(over, 0.5)
            d = block[at.LATERAL, i]
            one = like(over, 1.0)
            block[at.LATERAL, i] = d + over * over * (jump * like(over, 0.5) + bend * like(over, 1.0 / 3.0))
            block[at.HEADING, i] += over * (jump + bend)
            along[i] = over * (one - d * old) / (one - d * new)


@helper
def start_lane(i, lateral, heading, station, road_index, lanes, counters, road, roads, settings):
    """Set the state of lane i to the start of the episode ``counters[EPISODE, i]``.

    NaN arguments are drawn from the episode's key. The car starts in steady driving along the road.
    """
    key = derive(np.uint64(counters[at.KEY, i]), counters[at.EPISODE, i])
    which = np.int64(uniform(key, DRAW_ROAD) * roads.shape[0]) if np.isnan(road_index) else np.int64(road_index)
    first = np.int64(roads[which, at.S_FIRST])
    s = uniform(key, DRAW_STATION) * roads[which, at.S_LATEST_START] if np.isnan(station) else station
    low, high = first, first + np.int64(roads[which, at.S_COUNT])
    while high - low > 1:
        middle = (low + high) // 2
        if road[middle, at.R_STATION] <= s:
            low = middle
        else:
            high = middle
    load_segment(i, low, lanes, counters, road)
    along = s - road[low, at.R_STATION]
    squared = np.float64(lanes[at.SPEED_SQUARED, i]) + lanes[at.SPEED_SQUARED_SLOPE, i] * along
    v = np.sqrt(max(squared, 0.0))
    steer, beta, r = steady_turning(
        v,
        np.float64(lanes[at.CURVATURE, i]) + lanes[at.CURVATURE_SLOPE, i] * along,
        np.float64(lanes[at.CAR, i]),
        np.float64(lanes[at.CAR + 1, i]),
        np.float64(settings[at.MASS]),
        np.float64(lanes[at.CAR + 4, i]),
        np.float64(lanes[at.CAR + 5, i]),
        settings[at.MODEL] == at.KINEMATIC,
    )
    steer = clip(steer, -np.float64(settings[at.COMMAND_LIMIT]), np.float64(settings[at.COMMAND_LIMIT]))
    if np.isnan(lateral):
        lateral = (2.0 * uniform(key, DRAW_LATERAL) - 1.0) * settings[at.START_LATERAL]
    if np.isnan(heading):
        heading = (2.0 * uniform(key, DRAW_HEADING) - 1.0) * settings[at.START_HEADING] - beta
    lanes[at.ALONG, i] = along
    lanes[at.LATERAL, i] = lateral
    lanes[at.HEADING, i] = heading
    lanes[at.SIDESLIP, i] = beta
    lanes[at.YAW_RATE, i] = r
    lanes[at.SPEED, i] = v
    lanes[at.ACCELERATION, i] = v * r
    lanes[at.STEER, i] = steer
    lanes[at.STEER_BEFORE, i] = steer
    lanes[at.COMMAND, i] = steer
    for row in range(at.HISTORY, lanes.shape[0]):
        lanes[row, i] = steer
    zero = like(lanes[0, 0], 0.0)
    lanes[at.STEP, i] = zero
    lanes[at.DONE, i] = zero
    lanes[at.DEPARTED, i] = zero
    counters[at.ROAD, i] = which
