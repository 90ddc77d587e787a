"""How episodes on a road start: somewhere on it, in steady driving, with what happens around the car."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.engine.episode import DRAW_HEADING, DRAW_LATERAL, DRAW_PLACE, DRAW_STATION, draw_car, set_speed
from lanekeep_env.families.road.segments import load_segment
from lanekeep_env.physics.integrate import LARGEST_SIDESLIP, LARGEST_SPEED
from lanekeep_env.physics.numeric import clip, like
from lanekeep_env.physics.powertrain import choose_gear, engage
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.tasks.driving import happen, sight
from lanekeep_env.tasks.lane_keeping import steady_turning

#: Counters of the draws of a powertrain's episode, behind those of the car.
DRAW_TIMELINE, DRAW_SLOPE, DRAW_WIND = np.int64(80), np.int64(81), np.int64(82)
#: What such a car starts without.
_AT_REST = (
    *(at.PULL, at.PULL_BEFORE, at.PEDAL, at.THROTTLE, at.BRAKE, at.SHIFT, at.SHIFTED, at.WAY),
    *(
        at.EVENT,
        at.AVOIDABLE,
        at.ENDING,
        at.FAILED,
        at.SET_SPEED,
        at.LEAD_SPEED,
        at.LEAD_TARGET,
        at.LEAD_RATE,
        at.LEAD_SEEN,
        at.POSITION_SPEED,
        at.POSITION_PULL,
        at.POSITION_TARGET,
        at.POSITION_RATE,
    ),
)


@helper
def start_on_road(place, wanted, cars, counters, world, settings, equipment):
    """Set the state of a car to the start of its episode; what is NaN in ``wanted`` is drawn from the episode's key.

    ``wanted`` is lateral error (m), heading error (rad), arc length (m) and index of the road. The car starts in
    steady driving along the road.
    """
    k, i = place
    block, counted = cars[k], counters[:, k * cars.shape[2] :]
    drive, timelines = equipment[4], equipment[5]
    key = derive(np.uint64(counted[at.KEY, i]), counted[at.EPISODE, i])
    draw_car(i, key, block, settings)
    start_drive(i, key, block, counted, settings, drive, timelines)
    along = _find_place(i, key, wanted, block, counted, world, settings)
    steer, beta, r, forward = _steady(i, key, along, block, settings)
    lateral, heading, _, _ = wanted
    if np.isnan(lateral):
        lateral = (2.0 * uniform(key, DRAW_LATERAL) - 1.0) * settings[at.START_LATERAL]
    if np.isnan(heading):
        heading = (2.0 * uniform(key, DRAW_HEADING) - 1.0) * settings[at.START_HEADING] - beta
    beta = clip(beta, -LARGEST_SIDESLIP, LARGEST_SIDESLIP)  # of tyres too soft for the curve
    block[at.ALONG, i] = along
    block[at.LATERAL, i] = lateral
    block[at.HEADING, i] = heading
    block[at.SIDESLIP, i] = beta
    block[at.YAW_RATE, i] = r
    block[at.ACCELERATION, i] = forward * r
    for row in (at.STEER, at.STEER_BEFORE, at.COMMAND, at.MOTOR):  # the motor in the middle of the gap
        block[row, i] = steer
    for row in range(np.int64(settings[at.DELAY_DEPTH])):
        block[at.CAR_ROWS + row, i] = steer
    for row in (at.STEP, at.DONE, at.DEPARTED):
        block[row, i] = like(settings[0], 0.0)
    see_first(i, block, counted, timelines)


@helper
def _find_place(i, key, wanted, block, counted, world, settings):
    """Set road and segment of car i; return how far along the segment it starts, m."""
    road, roads = world
    _, _, station, road_index = wanted
    which = np.int64(uniform(key, DRAW_PLACE) * roads.shape[0]) if np.isnan(road_index) else np.int64(road_index)
    counted[at.ROAD, i] = which
    first = np.int64(roads[which, at.S_FIRST])
    s = uniform(key, DRAW_STATION) * roads[which, at.S_LATEST_START]
    if settings[at.BACKWARDS] > 0.0:
        s = roads[which, at.S_LENGTH] - s
    s = s if np.isnan(station) else station
    low, high = first, first + np.int64(roads[which, at.S_COUNT])
    while high - low > 1:
        middle = (low + high) // 2
        if road[middle, at.R_STATION] <= s:
            low = middle
        else:
            high = middle
    load_segment(i, low, block, counted, road)
    return s - road[low, at.R_STATION]


@helper
def _steady(i, key, along, block, settings):
    """Set the speeds of car i; return its steering angle (rad), sideslip (rad), yaw rate (rad/s) and way per second."""
    squared = np.float64(block[at.SPEED_SQUARED, i]) + block[at.SPEED_SQUARED_SLOPE, i] * along
    v = target = np.sqrt(max(squared, 0.0))
    if settings[at.SPEED_HIGH] > 0.0:
        target = set_speed(i, key, np.int64(0), block, settings)
        v = min(target, v)
    if settings[at.POWERED] > 0.0:
        v = np.float64(block[at.SET_SPEED, i])
        target = LARGEST_SPEED if v >= 0.0 else -LARGEST_SPEED
    block[at.SPEED, i] = v
    block[at.SPEED_TARGET, i] = target
    steer, beta, r = steady_turning(
        v,
        np.float64(block[at.CURVATURE, i]) + block[at.CURVATURE_SLOPE, i] * along,
        np.float64(block[at.CG_TO_FRONT, i]),
        np.float64(block[at.CG_TO_REAR, i]),
        1.0 / np.float64(block[at.INVERSE_MASS, i]),
        np.float64(block[at.FRONT_STIFFNESS, i]),
        np.float64(block[at.REAR_STIFFNESS, i]),
        settings[at.SLIPS] == 0.0,
    )
    steer = clip(steer, -np.float64(settings[at.COMMAND_LIMIT]), np.float64(settings[at.COMMAND_LIMIT]))
    forward = v
    if settings[at.FRONT_SPEED] > 0.0:  # v is the front wheels'
        wheelbase = np.float64(block[at.CG_TO_FRONT, i] + block[at.CG_TO_REAR, i])
        forward, r = v * np.cos(steer), v * np.sin(steer) / wheelbase
    return steer, beta, r, forward


@helper
def start_drive(i, key, block, counted, settings, drive, timelines):
    """Set pedals, gear and surroundings of car i to the start of its episode, where it has a powertrain.

    The car starts at the speed that is set at first, in a gear that suits it.
    """
    if timelines is not None:
        if settings[at.LANES] == 0.0:  # among traffic each car has its own
            counted[at.TIMELINE, i] = np.int64(uniform(key, DRAW_TIMELINE) * timelines.shape[0])
        which = counted[at.TIMELINE, i]
        for row in _AT_REST:
            block[row, i] = like(settings[0], 0.0)
        block[at.STEP, i] = like(settings[0], 0.0)  # the time of the first events
        block[at.LEAD_GAP, i] = at.NOWHERE
        block[at.STOP_GAP, i] = at.FAR
        block[at.POSITION_GAP, i] = at.NOWHERE
        block[at.FRONT_GRIP, i] = block[at.FRONT_PEAK, i]
        block[at.REAR_GRIP, i] = block[at.REAR_PEAK, i]
        low, high = np.float64(settings[at.SLOPE_LOW]), np.float64(settings[at.SLOPE_HIGH])
        block[at.SLOPE, i] = low + (high - low) * uniform(key, DRAW_SLOPE)
        low, high = np.float64(settings[at.WIND_LOW]), np.float64(settings[at.WIND_HIGH])
        block[at.WIND, i] = low + (high - low) * uniform(key, DRAW_WIND)
        happen(i, block, counted, timelines[which], settings)
        block[at.LEAD_SEEN, i] = block[at.LEAD_SPEED, i]
        backwards = block[at.SET_SPEED, i] < 0.0
        engage(i, np.int64(-1) if backwards else choose_gear(block[at.SET_SPEED, i], drive), block, drive)


@helper
def see_first(i, block, counted, timelines):
    """Write what car i sees at its start of what is there already; the observation of the reset shows it."""
    if timelines is not None:
        if block[at.LEAD_GAP, i] < at.NOWHERE:
            _see(i, at.LEAD_SIGHT, block, counted)
        if block[at.STOP_GAP, i] < at.FAR:
            _see(i, at.STOP_SIGHT, block, counted)


@inline
def _see(i, row, block, counted):
    sight(i, row, block[row + at.SIGHT_GAP, i], block[row + at.SIGHT_EVENT, i], block, counted)
    block[row + at.SIGHT_STEP, i] = -1.0
