"""Where the lanes are on their road: segments crossed, episodes started on a car of their own."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.integrate import LARGEST_SIDESLIP
from lanekeep_env.physics.numeric import clip, larger, like
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.powertrain import choose_gear
from lanekeep_env.physics.single_track import SMALLEST_PATH_SCALE
from lanekeep_env.randomisation import FRICTION_SHARE
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.tasks.driving import happen
from lanekeep_env.tasks.lane_keeping import steady_turning

# Counters of an episode's random draws: the order is part of an environment's version. (Typed, because
# numba compiles a function anew for every literal it is called with.)
DRAW_ROAD, DRAW_STATION, DRAW_LATERAL, DRAW_HEADING = np.int64(0), np.int64(1), np.int64(2), np.int64(3)
DRAW_CAR = np.int64(4)  # and the following, one a randomised number
#: Counters of the draws of a powertrain's episode, behind those of the car.
DRAW_TIMELINE, DRAW_SLOPE, DRAW_WIND = np.int64(80), np.int64(81), np.int64(82)
#: Counter of the first set speed of an episode; one a control step from there.
FIRST_SET_SPEED = np.int64(1 << 33)


@helper
def load_segment(i, segment, lanes, counters, road):
    """Copy row ``segment`` of the road into the rows of lane i."""
    counters[at.SEGMENT, i] = segment
    lanes[at.SEGMENT_LENGTH, i] = road[segment, at.R_LENGTH]
    lanes[at.CURVATURE, i] = road[segment, at.R_CURVATURE]
    lanes[at.CURVATURE_SLOPE, i] = road[segment, at.R_CURVATURE_SLOPE]
    lanes[at.SPEED_SQUARED, i] = road[segment, at.R_SPEED_SQUARED] * lanes[at.SPEED_FACTOR, i]
    lanes[at.SPEED_SQUARED_SLOPE, i] = road[segment, at.R_SPEED_SQUARED_SLOPE] * lanes[at.SPEED_FACTOR, i]
    lanes[at.STATION, i] = road[segment, at.R_STATION]


@helper
def cross_segments(k, lanes, counters, road):
    """Move lanes of block ``k`` that left their segment, forwards or backwards, into the neighbour.

    The sub-step ran on with the old segment's curvature for ``over`` metres; the turn that the new one
    would have given over the same way is put in its place, so headings stay right over any number of jumps. What is
    left after as many segments as there are goes on in the next sub-step: not even inf is looped over for ever.
    """
    first, block = k * lanes.shape[2], lanes[k]
    along, length = block[at.ALONG], block[at.SEGMENT_LENGTH]
    zero, half, one = like(along[0], 0.0), like(along[0], 0.5), like(along[0], 1.0)
    least = like(along[0], SMALLEST_PATH_SCALE)
    for i in range(block.shape[1]):
        if not (along[i] >= length[i] or along[i] < zero):
            continue  # two loops set up for nothing cost 3 % of a step
        for _ in range(road.shape[0]):
            if not along[i] >= length[i]:
                break
            over = along[i] - length[i]
            slope = block[at.CURVATURE_SLOPE, i]
            old = block[at.CURVATURE, i] + slope * length[i]
            following = np.int64(road[counters[at.SEGMENT, first + i], at.R_NEXT])
            load_segment(i, following, block, counters[:, first:], road)
            new = block[at.CURVATURE, i]
            d = block[at.LATERAL, i]
            way = over * larger(one - d * old, least)  # driven beside the centre line
            after = way / larger(one - d * new, least)
            turned = (old + half * slope * over) * over
            turn = turned - (new + half * block[at.CURVATURE_SLOPE, i] * after) * after
            block[at.HEADING, i] += turn
            block[at.LATERAL, i] = d + half * turn * way
            along[i] = after
        for _ in range(road.shape[0]):
            if not (along[i] < zero and road[counters[at.SEGMENT, first + i], at.R_PREVIOUS] >= zero):
                break
            # Backwards the old segment's start curvature was held: no turn but by that.
            over = along[i]
            old = block[at.CURVATURE, i]
            before = np.int64(road[counters[at.SEGMENT, first + i], at.R_PREVIOUS])
            load_segment(i, before, block, counters[:, first:], road)
            new = block[at.CURVATURE, i] + block[at.CURVATURE_SLOPE, i] * length[i]
            d = block[at.LATERAL, i]
            after = over * larger(one - d * old, least) / larger(one - d * new, least)
            block[at.HEADING, i] += old * over - new * after
            along[i] = length[i] + after


@inline
def _within(key, which, settings):
    """Draw the randomised number ``which`` (typed, see above) between its bounds; equal bounds give it exactly."""
    low = np.float64(settings[at.RANGES + 2 * which])
    high = np.float64(settings[at.RANGES + 2 * which + 1])
    return low + (high - low) * uniform(key, DRAW_CAR + which)


@helper
def draw_car(i, key, lanes, settings):
    """Write the car of the episode ``key``: the nominal one with the randomised numbers of `Randomisation`.

    Yaw inertia scales with the mass; the axle loads, and with them the saturating tyres' peaks, follow
    mass, friction and centre of gravity. The speed profile is slowed down where it would use more
    than `FRICTION_SHARE` of the friction, so that every episode can be driven.
    """
    mass_factor, shift = _within(key, np.int64(0), settings), _within(key, np.int64(4), settings)
    if settings[at.NOMINAL + 3] == 0.0:
        shift = 0.0  # the reference point is the rear axle
    mass = settings[at.NOMINAL] * mass_factor
    front, rear = settings[at.NOMINAL + 2] - shift, settings[at.NOMINAL + 3] + shift
    friction = settings[at.NOMINAL + 6] * _within(key, np.int64(1), settings)
    load = friction * mass * GRAVITY / (front + rear)
    lanes[at.CAR, i] = front
    lanes[at.CAR + 1, i] = rear
    lanes[at.CAR + 2, i] = 1.0 / mass
    lanes[at.CAR + 3, i] = 1.0 / (settings[at.NOMINAL + 1] * mass_factor)
    lanes[at.CAR + 4, i] = settings[at.NOMINAL + 4] * _within(key, np.int64(2), settings)
    lanes[at.CAR + 5, i] = settings[at.NOMINAL + 5] * _within(key, np.int64(3), settings)
    lanes[at.CAR + 6, i] = load * rear
    lanes[at.CAR + 7, i] = load * front
    lag = settings[at.NOMINAL + 7] * _within(key, np.int64(6), settings)
    half = 0.5 * settings[at.STEP_TIME]
    lanes[at.STEER_RESPONSE, i] = 1.0 - np.exp(-half / lag) if lag > 0.0 else 1.0
    lanes[at.STEER_GAIN, i] = min(half / lag, 1.0) if lag > 0.0 else 1.0
    lanes[at.STEER_CHANGE, i] = settings[at.NOMINAL + 8] * half
    delay = settings[at.NOMINAL + 9] + _within(key, np.int64(7), settings)
    lanes[at.DELAY, i] = np.floor(delay / settings[at.STEP_TIME] + 0.5)
    speed = _within(key, np.int64(5), settings)
    factor = speed * speed
    demand = settings[at.LATERAL_LIMIT] * factor
    grip = FRICTION_SHARE * friction * GRAVITY
    if settings[at.SATURATES] > 0.0 and demand > grip:
        factor *= grip / demand
    lanes[at.SPEED_FACTOR, i] = factor


@inline
def set_speed(i, episode, step, lanes, settings):
    """Draw the set speed (m/s) that holds from control step ``step`` of the episode on."""
    key = derive(episode, FIRST_SET_SPEED + step)
    low, high = np.float64(settings[at.SPEED_LOW]), np.float64(settings[at.SPEED_HIGH])
    speed = (low + (high - low) * uniform(key, np.int64(0))) * np.sqrt(np.float64(lanes[at.SPEED_FACTOR, i]))
    speed = -speed if settings[at.BACKWARDS] > 0.0 else speed
    return 0.0 if uniform(key, np.int64(1)) < settings[at.STANDSTILL] else speed


@helper
def set_speeds(k, lanes, counters, settings):
    """Draw new set speeds for the lanes of block ``k`` whose time has come."""
    first, block = k * lanes.shape[2], lanes[k]
    hold = settings[at.SPEED_HOLD]
    for i in range(min(block.shape[1], counters.shape[1] - first)):
        step = block[at.STEP, i]
        if step > 0.0 and step % hold == 0.0:
            episode = derive(np.uint64(counters[at.KEY, first + i]), counters[at.EPISODE, first + i])
            block[at.SPEED_TARGET, i] = set_speed(i, episode, np.int64(step), block, settings)


@helper
def start_lane(i, lateral, heading, station, road_index, lanes, counters, road, roads, settings):
    """Set the state of lane i to the start of the episode ``counters[EPISODE, i]``.

    NaN arguments are drawn from the episode's key. The car starts in steady driving along the road.
    """
    key = derive(np.uint64(counters[at.KEY, i]), counters[at.EPISODE, i])
    draw_car(i, key, lanes, settings)
    which = np.int64(uniform(key, DRAW_ROAD) * roads.shape[0]) if np.isnan(road_index) else np.int64(road_index)
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
    load_segment(i, low, lanes, counters, road)
    along = s - road[low, at.R_STATION]
    squared = np.float64(lanes[at.SPEED_SQUARED, i]) + lanes[at.SPEED_SQUARED_SLOPE, i] * along
    v = target = np.sqrt(max(squared, 0.0))
    if settings[at.SPEED_HIGH] > 0.0:
        target = set_speed(i, key, np.int64(0), lanes, settings)
        v = min(target, v)
    if settings[at.POWERED] > 0.0:
        v = target = np.float64(lanes[at.SET_SPEED, i])  # of `start_drive`
    steer, beta, r = steady_turning(
        v,
        np.float64(lanes[at.CURVATURE, i]) + lanes[at.CURVATURE_SLOPE, i] * along,
        np.float64(lanes[at.CAR, i]),
        np.float64(lanes[at.CAR + 1, i]),
        1.0 / np.float64(lanes[at.CAR + 2, i]),
        np.float64(lanes[at.CAR + 4, i]),
        np.float64(lanes[at.CAR + 5, i]),
        settings[at.SLIPS] == 0.0,
    )
    steer = clip(steer, -np.float64(settings[at.COMMAND_LIMIT]), np.float64(settings[at.COMMAND_LIMIT]))
    forward = v
    if settings[at.FRONT_SPEED] > 0.0:  # v is the front wheels'
        forward, r = v * np.cos(steer), v * np.sin(steer) / np.float64(lanes[at.CAR, i] + lanes[at.CAR + 1, i])
    if np.isnan(lateral):
        lateral = (2.0 * uniform(key, DRAW_LATERAL) - 1.0) * settings[at.START_LATERAL]
    if np.isnan(heading):
        heading = (2.0 * uniform(key, DRAW_HEADING) - 1.0) * settings[at.START_HEADING] - beta
    beta = clip(beta, -LARGEST_SIDESLIP, LARGEST_SIDESLIP)  # of tyres too soft for the curve
    lanes[at.ALONG, i] = along
    lanes[at.LATERAL, i] = lateral
    lanes[at.HEADING, i] = heading
    lanes[at.SIDESLIP, i] = beta
    lanes[at.YAW_RATE, i] = r
    lanes[at.SPEED, i] = v
    lanes[at.SPEED_TARGET, i] = target
    lanes[at.ACCELERATION, i] = forward * r
    lanes[at.STEER, i] = steer
    lanes[at.STEER_BEFORE, i] = steer
    lanes[at.COMMAND, i] = steer
    lanes[at.MOTOR, i] = steer  # in the middle of the gap
    for row in range(np.int64(settings[at.DELAY_DEPTH])):
        lanes[at.LANE_ROWS + row, i] = steer
    zero = like(lanes[0, 0], 0.0)
    lanes[at.STEP, i] = zero
    lanes[at.DONE, i] = zero
    lanes[at.DEPARTED, i] = zero
    counters[at.ROAD, i] = which


@helper
def start_drive(i, lanes, counters, settings, drive, timelines):
    """Set pedals, gear and surroundings of lane i to the start of its episode; return its timeline.

    The car starts at the speed that is set at first, in a gear that suits it; `start_lane`, which follows, takes it
    from there.
    """
    key = derive(np.uint64(counters[at.KEY, i]), counters[at.EPISODE, i])
    which = np.int64(uniform(key, DRAW_TIMELINE) * timelines.shape[0])
    zero, far = like(lanes[0, 0], 0.0), like(lanes[0, 0], at.FAR)
    for row in (at.PULL, at.PEDAL, at.THROTTLE, at.BRAKE, at.SHIFT, at.SET_SPEED, at.LEAD_SPEED, at.EVENT, at.WAY):
        lanes[row, i] = zero
    lanes[at.STEP, i] = zero  # the time of the first events
    lanes[at.LEAD_GAP, i] = far
    lanes[at.STOP_GAP, i] = far
    low, high = np.float64(settings[at.SLOPES]), np.float64(settings[at.SLOPES + 1])
    lanes[at.SLOPE, i] = low + (high - low) * uniform(key, DRAW_SLOPE)
    low, high = np.float64(settings[at.WINDS]), np.float64(settings[at.WINDS + 1])
    lanes[at.WIND, i] = low + (high - low) * uniform(key, DRAW_WIND)
    happen(i, lanes, timelines[which], settings)
    lanes[at.GEAR, i] = choose_gear(lanes[at.SET_SPEED, i], drive)
    return which
