"""What environments between walls do in a step: servo, contact, progress along the centre line, reward, observation.

The vehicle models are those of roads, on a straight path: x and y stand for arc length and lateral error. They run
as SIMD code over the cars of a block; rays, cones and contact as SIMD code over the walls of one car.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.engine.observe import gather
from lanekeep_env.engine.step import Family
from lanekeep_env.families.wall.line import follow
from lanekeep_env.families.wall.sensors import look_around, measure_clearance, read_encoder, touch
from lanekeep_env.families.wall.start import servo_angle, start_between_walls
from lanekeep_env.physics.numeric import like, sin_cos, smaller, wrapped
from lanekeep_env.sensing.measure import measure
from lanekeep_env.sensing.scan import take_scan
from lanekeep_env.sensing.ultrasonic import FARTHEST
from lanekeep_env.tasks.wall_driving import judge_circuit, judge_following

# The ground is (walls, centre lines, starts, scratch), ``equipment`` (sensors, gear, slip-speed floor, servo, and
# five arrays of the scan), all but the first None where the scenario has none.


@helper
def _act(k, cars, counters, settings, equipment):
    _turn_servo(k, cars, counters, settings, equipment[3])


@helper
def _turn_servo(k, cars, counters, settings, servo):
    """Turn commands into angles of the servo; keep pose and speed at the step's begin."""
    block, limit = cars[k], settings[at.COMMAND_LIMIT]
    for i in range(cars_in(k, cars, counters)):
        angle = block[at.COMMAND, i]
        if servo is not None:
            angle = like(limit, servo_angle(np.float64(angle), np.float64(limit), servo))
        block[at.SERVO, i] = angle * block[at.STEER_FACTOR, i] + block[at.STEER_OFFSET, i]
        block[at.BEFORE_X, i] = block[at.ALONG, i]
        block[at.BEFORE_Y, i] = block[at.LATERAL, i]
        block[at.BEFORE_HEADING, i] = block[at.HEADING, i]
        block[at.BEFORE_SPEED, i] = block[at.SPEED, i]


@helper
def _still(i, block):
    """A car that has diverged stands where it was before the control step."""
    zero = like(block[0, 0], 0.0)
    for row, before in ((at.ALONG, at.BEFORE_X), (at.LATERAL, at.BEFORE_Y), (at.HEADING, at.BEFORE_HEADING)):
        block[before, i] = block[before, i] if np.isfinite(block[before, i]) else zero
        block[row, i] = block[before, i]
    for row in (at.SIDESLIP, at.YAW_RATE, at.SPEED, at.BEFORE_SPEED, at.STEER):
        block[row, i] = zero
    for row in (at.STEER_BEFORE, at.MOTOR, at.ACCELERATION):
        block[row, i] = zero


@helper
def _follow_line(i, block, counted, world, settings):
    """Move car i along the centre line and write its errors; return its progress, m.

    Following a wall the lateral error is that of the side sensor's distance; without a centre line the heading counts
    from the x axis.
    """
    (_, line, _, _), index = world
    which = counted[at.ROAD, i]
    points = index[which, at.I_POINTS]
    zero = like(block[0, 0], 0.0)
    progress = lateral = zero
    heading = block[at.HEADING, i]
    if points > 1:
        closed = index[which, at.I_CLOSED] > 0
        segment, station, aside, cosine, sine = follow(
            np.float64(block[at.ALONG, i]),
            np.float64(block[at.LATERAL, i]),
            line,
            index[which, at.I_LINE],
            points,
            closed,
            counted[at.SEGMENT, i],
        )
        counted[at.SEGMENT, i] = segment
        step = station - np.float64(block[at.STATION, i])
        if closed:
            length = line[2, index[which, at.I_LINE] + points - 1]
            step -= length * np.floor(step / length + 0.5)
        block[at.STATION, i] = station
        progress, lateral = like(zero, step), like(zero, aside)
        heading = wrapped(heading - like(zero, np.arctan2(sine, cosine)))
    if settings[at.TASK] == at.WALL_FOLLOW:
        right = like(zero, FARTHEST) if np.isnan(block[at.RIGHT, i]) else block[at.RIGHT, i]
        lateral = right - settings[at.SET_DISTANCE]
    block[at.ERROR, i], block[at.TURNED, i] = lateral, heading
    return progress


@helper
def _lap(i, progress, block, counted, world, settings):
    """Count progress and laps of car i; return whether the last lap is done."""
    (_, line, _, _), index = world
    which = counted[at.ROAD, i]
    points = index[which, at.I_POINTS]
    if points < 2:
        return False
    length = like(progress, line[2, index[which, at.I_LINE] + points - 1])
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    before = block[at.PROGRESS, i]
    block[at.PROGRESS, i] = before + progress
    laps = np.floor(block[at.PROGRESS, i] / length)
    if index[which, at.I_CLOSED] == 0:  # stations end with the line: sums of progress reach its length by chance
        laps = like(progress, 1.0 if block[at.STATION, i] >= length * like(progress, 1.0 - 1e-6) else 0.0)
    if progress > 0.0 and laps > block[at.LAPS_DONE, i]:  # a line that is crossed back and forth counts once
        block[at.LAPS_DONE, i] = laps
        share = smaller((laps * length - before) / progress, like(progress, 1.0))
        now = (block[at.STEP, i] - like(progress, 1.0) + share) * seconds
        block[at.LAP_TIME, i] = now - block[at.LAP_BEGAN, i]
        block[at.LAP_BEGAN, i] = now
        return laps >= settings[at.LAPS]
    return False


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    first = k * cars.shape[2]
    last = first + cars_in(k, cars, counters)
    for i in range(last - first):
        judge_car(i, cars[k], counters[:, first:last], world, settings, outcome[:, first:last], world[0][3][k])


@helper
def judge_car(i, block, counted, world, settings, outcome, scratch):
    """Contact, progress, sensors' truth, reward and flags of car i after its sub-steps."""
    (walls, _, _, _), index = world
    which = counted[at.ROAD, i]
    span = index[which, at.I_FIRST], index[which, at.I_END]
    zero, one = like(settings[0], 0.0), like(settings[0], 1.0)
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    ends, ignored = settings[at.DEPARTURE] == at.TERMINATE, settings[at.DEPARTURE] == at.OFF
    block[at.STEP, i] += one
    touched = touch(i, block, walls, span, settings, scratch)
    if touched and not ends:  # a wall holds the car where it was
        block[at.ALONG, i], block[at.LATERAL, i] = block[at.BEFORE_X, i], block[at.BEFORE_Y, i]
        block[at.HEADING, i] = block[at.BEFORE_HEADING, i]
        block[at.SPEED, i] = block[at.YAW_RATE, i] = block[at.SIDESLIP, i] = block[at.ACCELERATION, i] = zero
        measure_clearance(i, block, walls, span, settings, scratch)
    read_encoder(i, block, settings)
    look_around(i, block, walls, span, settings, scratch)
    progress = _follow_line(i, block, counted, world, settings)
    counts = touched and not ignored
    rate = (block[at.STEER, i] - block[at.STEER_BEFORE, i]) / seconds
    horizon = settings[at.HORIZON]
    left = horizon - block[at.STEP, i]
    if settings[at.TASK] == at.WALL_FOLLOW:
        reward, ended = judge_following(
            block[at.ERROR, i],
            rate,
            left,
            seconds,
            counts,
            settings[at.COST_LATERAL],
            settings[at.COST_WEIGHT],
            settings[at.COST_RATE],
            settings[at.COST_CAP],
            ends,
        )
    else:
        done = _lap(i, progress, block, counted, world, settings) and not counts
        reward, ended = judge_circuit(progress, left, seconds, counts, done, settings[at.LARGEST_SPEED], ends)
    block[at.DEPARTED, i] = one if counts else block[at.DEPARTED, i]
    outcome[at.O_REWARD, i] = reward
    outcome[at.O_TERMINATED, i] = ended
    outcome[at.O_TRUNCATED, i] = one if block[at.STEP, i] >= smaller(horizon, settings[at.MAX_STEPS]) else zero
    outcome[at.O_STEERING_RATE, i] = rate
    outcome[at.O_COST, i] = one if counts else zero


@helper
def report_cars(k, first, last, cars, settings, outcome):
    """Copy the truth that a state decides; on a circuit a success is a lap, or as many as are asked for."""
    block, told = cars[k], outcome[:, k * cars.shape[2] :]
    zero, one, far = like(settings[0], 0.0), like(settings[0], 1.0), like(settings[0], FARTHEST)
    for i in range(first, last):
        told[at.O_LATERAL_ERROR, i] = block[at.ERROR, i]
        told[at.O_HEADING_ERROR, i] = block[at.TURNED, i]
        told[at.O_LATERAL_ACCELERATION, i] = block[at.ACCELERATION, i]
        told[at.O_SPEED, i] = block[at.SPEED, i]
        told[at.O_ARC_LENGTH, i] = block[at.STATION, i]
        misses = settings[at.TASK] == at.CIRCUIT and block[at.LAPS_DONE, i] < settings[at.LAPS]
        misses |= settings[at.TASK] == at.PARKING and block[at.PARKED, i] < settings[at.LAPS]
        told[at.O_SUCCESS, i] = zero if misses else one - block[at.DEPARTED, i]
        told[at.O_X, i] = block[at.ALONG, i]
        told[at.O_Y, i] = block[at.LATERAL, i]
        told[at.O_DISTANCE, i] = far if np.isnan(block[at.RIGHT, i]) else block[at.RIGHT, i]
        told[at.O_CLEARANCE, i] = block[at.CLEARANCE, i]
        told[at.O_LAP_TIME, i] = block[at.LAP_TIME, i]


@helper
def _observe(span, cars, counters, world, settings, equipment, observation):
    """Write what the rows of cars hold, and what sensors make of it."""
    k, first, last = span
    begin = k * cars.shape[2]
    block, counted, seen = cars[k], counters[:, begin:], observation[begin:]
    sensors, numbers = equipment[0], equipment[4]
    _see_walls(span, cars, counters, world, settings, numbers, equipment[4:9], observation)
    gather(first, last, block, settings, seen)
    for i in range(first, last):
        measure(i, block, counted, settings, sensors, seen)


@helper
def _see_walls(span, cars, counters, world, settings, numbers, scan, observation):
    """Take the scans whose time has come and show the last; ``numbers`` is None without a scan."""
    if numbers is not None:
        k, begin, end = span
        (walls, _, _, _), index = world
        block, held, channel = cars[k], scan[4], np.int64(settings[at.FIRST_PREVIEW])
        for i in range(begin, end):
            column = k * cars.shape[2] + i
            which = counters[at.ROAD, column]
            sine, cosine = sin_cos(block[at.HEADING, i])
            x = block[at.ALONG, i] + settings[at.FRONT_ARM] * cosine
            y = block[at.LATERAL, i] + settings[at.FRONT_ARM] * sine
            seen = index[which, at.I_FIRST], index[which, at.I_GLASS]
            renewed = take_scan((k, i), (x, y, cosine, sine), cars, counters, walls, seen, scan)
            block[at.SCAN_NEW, i] = like(settings[0], 1.0 if renewed else 0.0)
            for beam in range(held.shape[1]):
                observation[column, channel + beam] = held[column, beam]


@helper
def start_car(place, wanted, cars, counters, world, settings, equipment):
    start_between_walls(place, wanted, cars, counters, world, settings, equipment)
    k, i = place
    _follow_line(i, cars[k], counters[:, k * cars.shape[2] :], world, settings)


BETWEEN_WALLS = Family(
    name="between_walls",
    command_row=at.SERVO,
    outcome_rows=at.WALL_OUTCOME_ROWS,
    act=_act,
    still=_still,
    judge=_judge,
    report=report_cars,
    observe=_observe,
    start=start_car,
)
