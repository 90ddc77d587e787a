"""How episodes between walls start: at one of the world's starts, moved and turned as far as the walls allow."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.disturbances import draw_gain
from lanekeep_env.engine.episode import (
    DRAW_CAR,
    DRAW_HEADING,
    DRAW_LATERAL,
    DRAW_PLACE,
    DRAW_STATION,
    draw_car,
    set_speed,
)
from lanekeep_env.families.wall.line import locate
from lanekeep_env.families.wall.sensors import look_around, measure_clearance
from lanekeep_env.physics.numeric import like, sin_cos
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.sensing.ultrasonic import FARTHEST, cone_distance
from lanekeep_env.walls.contact import sweeps, touches

#: Counter of the steering offset's draw, behind those of the car.
DRAW_OFFSET = np.int64(64)


@helper
def servo_angle(command, limit, servo):
    """Return the road-wheel angle that a servo makes of a command in [-limit, limit], rad."""
    quantum, last = servo[0], servo.shape[0] - 2
    share = command / limit
    if quantum > 0.0:
        share = quantum * np.floor(share / quantum + 0.5)
    place = (share + 1.0) * 0.5 * last
    index = min(max(np.int64(place), 0), last - 1)
    part = place - index
    return servo[1 + index] * (1.0 - part) + servo[2 + index] * part


@helper
def start_between_walls(place, wanted, cars, counters, world, settings, equipment):
    """Set the state of a car to the start of its episode; what is NaN in ``wanted`` is drawn from the episode's key.

    ``wanted`` is lateral error (m), heading error (rad), index of the start and of the world.
    """
    k, i = place
    block, counted = cars[k], counters[:, k * cars.shape[2] :]
    (walls, line, _, scratch_), index = world
    scratch = scratch_[k]
    key = derive(np.uint64(counted[at.KEY, i]), counted[at.EPISODE, i])
    draw_car(i, key, block, settings)
    which = np.int64(uniform(key, DRAW_PLACE) * index.shape[0]) if np.isnan(wanted[3]) else np.int64(wanted[3])
    counted[at.ROAD, i] = which
    _place(i, key, which, wanted, block, world, settings, scratch)
    span = index[which, at.I_FIRST], index[which, at.I_END]
    look_around(i, block, walls, span, settings, scratch)
    _set_off(i, key, block, settings, equipment[3])
    measure_clearance(i, block, walls, span, settings, scratch)
    points = index[which, at.I_POINTS]
    counted[at.SEGMENT, i] = 0
    block[at.STATION, i] = like(settings[0], 0.0)
    if points > 1:
        segment, station, _, _, _ = locate(
            np.float64(block[at.ALONG, i]),
            np.float64(block[at.LATERAL, i]),
            line,
            index[which, at.I_LINE],
            points,
            index[which, at.I_CLOSED] > 0,
            np.int64(0),
            points - 1,
        )
        counted[at.SEGMENT, i] = segment
        block[at.STATION, i] = station


@helper
def _place(i, key, which, wanted, block, world, settings, scratch):
    """Set the pose of car i: the start asked for or drawn, moved and turned, or as it is where that is blocked."""
    (_, _, starts, _), index = world
    lateral, heading, start, _ = wanted
    places = index[which, at.I_STARTS]
    place = np.int64(uniform(key, DRAW_STATION) * places) if np.isnan(start) else np.int64(start) % places
    place += index[which, at.I_START]
    if np.isnan(lateral):
        lateral = (2.0 * uniform(key, DRAW_LATERAL) - 1.0) * settings[at.START_LATERAL]
    if np.isnan(heading):
        heading = (2.0 * uniform(key, DRAW_HEADING) - 1.0) * settings[at.START_HEADING]
    x, y, direction = starts[0, place], starts[1, place], starts[2, place]
    block[at.ALONG, i] = x
    block[at.LATERAL, i] = y
    block[at.HEADING, i] = direction
    if settings[at.TASK] == at.WALL_FOLLOW:
        lateral += settings[at.SET_DISTANCE] - _distance_right(i, which, block, world, scratch)
        lateral -= settings[at.SIDE_ARM] * np.sin(heading)
    x, y = x - lateral * np.sin(direction), y + lateral * np.cos(direction)
    angle = direction + heading
    zero = like(settings[0], 0.0)
    blocked = _blocked((starts[0, place], starts[1, place]), (x, y, angle), which, world, settings, scratch)
    block[at.BLOCKED, i] = like(zero, 1.0) if blocked else zero
    if not blocked:  # else the start of the world itself, which is free
        block[at.ALONG, i] = x
        block[at.LATERAL, i] = y
        block[at.HEADING, i] = angle - 6.283185307179586 * np.floor(angle / 6.283185307179586 + 0.5)


@helper
def _distance_right(i, which, block, world, scratch):
    """How far the wall is to the right of car i's axis, m.

    The side sensor is what shall be at the distance, whatever the heading. In a narrow cone: in the sensor's own
    there may be another wall nearer than the one on the right, or none in its range.
    """
    (walls, _, _, _), index = world
    span = index[which, at.I_FIRST], index[which, at.I_END]
    sine, cosine = sin_cos(block[at.HEADING, i])
    narrow = like(sine, 0.01), like(sine, 0.0), like(sine, np.inf)
    pose = block[at.ALONG, i], block[at.LATERAL, i], sine, -cosine
    right = np.float64(cone_distance(pose, narrow, walls, span, scratch))
    return FARTHEST if np.isinf(right) else right


@helper
def _blocked(begin, pose, which, world, settings, scratch):
    """Whether a car cannot stand at a pose (x, y, heading), or a wall is between it and the world's own start."""
    (walls, _, _, _), index = world
    span = index[which, at.I_FIRST], index[which, at.I_END]
    x, y, angle = pose
    middle, sine, cosine = np.float64(settings[at.BODY_MIDDLE]), np.sin(angle), np.cos(angle)
    zero = like(settings[0], 0.0)
    body = like(zero, x + middle * cosine), like(zero, y + middle * sine), like(zero, cosine), like(zero, sine)
    blocked = touches(body, (settings[at.BODY_HALF_LENGTH], settings[at.BODY_HALF_WIDTH]), walls, span)
    # Beyond a wall lies another room, or none.
    own = like(zero, begin[0]), like(zero, begin[1]), like(zero, cosine), like(zero, sine)
    there = like(zero, x), like(zero, y), like(zero, cosine), like(zero, sine)
    return blocked or sweeps(own, there, (zero, zero), walls, span, scratch)


@helper
def _set_off(i, key, block, settings, servo):
    """Set speed, steering and counters of car i to the start of its episode."""
    v = 0.0
    if settings[at.LARGEST_SPEED] == 0.0:
        v = set_speed(i, key, np.int64(0), block, settings)
    low, high = np.float64(settings[at.OFFSET_LOW]), np.float64(settings[at.OFFSET_HIGH])
    offset = low + (high - low) * uniform(key, DRAW_CAR + DRAW_OFFSET)
    block[at.STEER_OFFSET, i] = offset
    draw_gain(i, key, block, settings)
    steer = offset
    if servo is not None:
        angle = servo_angle(0.0, np.float64(settings[at.COMMAND_LIMIT]), servo)
        steer = offset + angle * np.float64(block[at.STEER_FACTOR, i])
    block[at.SPEED_SQUARED, i] = np.inf
    for row in (at.SPEED, at.SPEED_TARGET, at.WHEEL_SPEED):
        block[row, i] = v
    for row in (at.STEER, at.STEER_BEFORE, at.SERVO, at.MOTOR):
        block[row, i] = steer
    for row in range(np.int64(settings[at.DELAY_DEPTH])):
        block[at.CAR_ROWS + row, i] = steer
    for row in (at.COMMAND, at.SIDESLIP, at.STEP, at.DONE, at.DEPARTED, at.WAY, at.TICKS, at.PROGRESS):
        block[row, i] = like(settings[0], 0.0)
    for row in (at.LAP_BEGAN, at.LAP_TIME, at.LAPS_DONE):
        block[row, i] = like(settings[0], 0.0)
    yaw_rate = v * np.tan(steer) / np.float64(block[at.CG_TO_FRONT, i] + block[at.CG_TO_REAR, i])
    block[at.YAW_RATE, i] = yaw_rate
    block[at.ACCELERATION, i] = v * yaw_rate
    block[at.BEFORE_X, i], block[at.BEFORE_Y, i] = block[at.ALONG, i], block[at.LATERAL, i]
    block[at.BEFORE_HEADING, i], block[at.BEFORE_SPEED, i] = block[at.HEADING, i], block[at.SPEED, i]
