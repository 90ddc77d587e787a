"""Where the lanes are between walls: along the centre line, before their sensors, at the start of an episode."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.envs.road_start import (
    DRAW_CAR,
    DRAW_HEADING,
    DRAW_LATERAL,
    DRAW_ROAD,
    DRAW_STATION,
    draw_car,
    set_speed,
)
from lanekeep_env.physics.numeric import like, sin_cos
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.sensing.ultrasonic import cone_distance
from lanekeep_env.walls.contact import sweeps, touches

#: Counter of the steering offset's draw, behind those of the car.
DRAW_OFFSET = np.int64(64)
#: Ultrasonics: range, m, and tangent of half the cone's angle (22.5 degrees).
NEAREST, FARTHEST, TANGENT = 0.03, 6.0, 0.41421356237309503


@helper
def locate(x, y, line, first, count, closed, begin, end):
    """Return (segment, station, lateral, cosine, sine) of the nearest place on segments begin..end-1 of a line.

    Segments count from the line's first point and wrap round a closed line; lateral is positive to the left.
    """
    best, found = np.inf, np.int64(0)
    station = lateral = 0.0
    cosine, sine = 1.0, 0.0
    segments = count - 1
    for k in range(begin, end):
        segment = k
        if closed:
            segment = k % segments
        elif k < 0 or k >= segments:
            continue
        a = first + segment
        ex, ey = line[0, a + 1] - line[0, a], line[1, a + 1] - line[1, a]
        length = np.sqrt(ex * ex + ey * ey)
        ex, ey = ex / length, ey / length
        dx, dy = x - line[0, a], y - line[1, a]
        along = min(max(dx * ex + dy * ey, 0.0), length)
        ox, oy = dx - along * ex, dy - along * ey
        distance = ox * ox + oy * oy
        if distance < best:
            best, found = distance, segment
            station, lateral = line[2, a] + along, ex * dy - ey * dx
            cosine, sine = ex, ey
    return found, station, lateral, cosine, sine


@helper
def follow(x, y, line, first, count, closed, segment):
    """`locate` near the segment where a car was last; further off as long as it is nearest at the search's edge."""
    reach = np.int64(8)
    found, station, lateral, cosine, sine = locate(
        x, y, line, first, count, closed, segment - reach, segment + reach + 1
    )
    while reach < count:
        if closed:
            moved = (found - segment) % (count - 1)
            moved = min(moved, count - 1 - moved)
        else:
            moved = abs(found - segment)
        if moved < reach:
            break
        reach *= 2
        found, station, lateral, cosine, sine = locate(
            x, y, line, first, count, closed, segment - reach, segment + reach + 1
        )
    return found, station, lateral, cosine, sine


@helper
def look_around(i, lanes, walls, first, last, settings, scratch):
    """Write the distances that the three ultrasonics would tell without a fault, m, NaN for no echo."""
    sine, cosine = sin_cos(lanes[at.HEADING, i])
    x, y = lanes[at.ALONG, i], lanes[at.LATERAL, i]
    tangent, nearest, farthest = like(x, TANGENT), like(x, NEAREST), like(x, FARTHEST)
    side, front = settings[at.SIDE_ARM], settings[at.FRONT_ARM]
    sx, sy = x + side * cosine, y + side * sine
    fx, fy = x + front * cosine, y + front * sine
    lanes[at.RIGHT, i] = cone_distance(sx, sy, sine, -cosine, tangent, nearest, farthest, walls, first, last, scratch)
    lanes[at.LEFT, i] = cone_distance(sx, sy, -sine, cosine, tangent, nearest, farthest, walls, first, last, scratch)
    lanes[at.FRONT, i] = cone_distance(fx, fy, cosine, sine, tangent, nearest, farthest, walls, first, last, scratch)


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
def start_between_walls(i, lateral, heading, start, world, lanes, counters, worlds, settings, servo, block):
    """Set the state of lane i to the start of the episode ``counters[EPISODE, i]``; NaN arguments are drawn."""
    walls, index, line, starts, scratch_ = worlds
    scratch = scratch_[block]
    key = derive(np.uint64(counters[at.KEY, i]), counters[at.EPISODE, i])
    draw_car(i, key, lanes, settings)
    which = np.int64(uniform(key, DRAW_ROAD) * index.shape[0]) if np.isnan(world) else np.int64(world)
    counters[at.ROAD, i] = which
    first, last = index[which, at.I_FIRST], index[which, at.I_END]
    places = index[which, at.I_STARTS]
    place = np.int64(uniform(key, DRAW_STATION) * places) if np.isnan(start) else np.int64(start) % places
    place += index[which, at.I_START]
    if np.isnan(lateral):
        lateral = (2.0 * uniform(key, DRAW_LATERAL) - 1.0) * settings[at.START_LATERAL]
    if np.isnan(heading):
        heading = (2.0 * uniform(key, DRAW_HEADING) - 1.0) * settings[at.START_HEADING]
    zero = like(lanes[0, 0], 0.0)
    x, y, direction = starts[0, place], starts[1, place], starts[2, place]
    lanes[at.ALONG, i] = x
    lanes[at.LATERAL, i] = y
    lanes[at.HEADING, i] = direction
    if settings[at.TASK] == at.WALL_FOLLOW:
        # The side sensor is what shall be at the distance, whatever the heading. In a narrow cone: in the sensor's
        # own there may be another wall nearer than the one on the right, or none in its range.
        sine, cosine = sin_cos(lanes[at.HEADING, i])
        none, far = like(sine, 0.0), like(sine, np.inf)
        right = np.float64(
            cone_distance(
                lanes[at.ALONG, i],
                lanes[at.LATERAL, i],
                sine,
                -cosine,
                like(sine, 0.01),
                none,
                far,
                walls,
                first,
                last,
                scratch,
            )
        )
        lateral += settings[at.SET_DISTANCE] - (FARTHEST if np.isinf(right) else right)
        lateral -= settings[at.SIDE_ARM] * np.sin(heading)
    x, y = x - lateral * np.sin(direction), y + lateral * np.cos(direction)
    angle = direction + heading
    middle = np.float64(settings[at.BODY])
    sine, cosine = np.sin(angle), np.cos(angle)
    blocked = touches(
        like(lanes[0, 0], x + middle * cosine),
        like(lanes[0, 0], y + middle * sine),
        like(lanes[0, 0], cosine),
        like(lanes[0, 0], sine),
        settings[at.BODY + 1],
        settings[at.BODY + 2],
        walls,
        first,
        last,
    )
    # Nor may a wall stand between it and the world's own start: beyond it lies another room, or none.
    blocked = blocked or sweeps(
        like(zero, starts[0, place]),
        like(zero, starts[1, place]),
        like(zero, cosine),
        like(zero, sine),
        like(zero, x),
        like(zero, y),
        like(zero, cosine),
        like(zero, sine),
        zero,
        zero,
        walls,
        first,
        last,
        scratch,
    )
    lanes[at.BLOCKED, i] = like(zero, 1.0) if blocked else zero
    if not blocked:  # else the start of the world itself, which is free
        lanes[at.ALONG, i] = x
        lanes[at.LATERAL, i] = y
        lanes[at.HEADING, i] = angle - 6.283185307179586 * np.floor(angle / 6.283185307179586 + 0.5)
    look_around(i, lanes, walls, first, last, settings, scratch)
    v = 0.0
    if settings[at.LARGEST_SPEED] == 0.0:
        v = set_speed(i, key, np.int64(0), lanes, settings)
    low, high = np.float64(settings[at.OFFSETS]), np.float64(settings[at.OFFSETS + 1])
    offset = low + (high - low) * uniform(key, DRAW_CAR + DRAW_OFFSET)
    lanes[at.STEER_OFFSET, i] = offset
    steer = offset
    if servo is not None:
        steer = offset + servo_angle(0.0, np.float64(settings[at.COMMAND_LIMIT]), servo)
    lanes[at.SPEED_SQUARED, i] = np.inf
    lanes[at.SPEED, i] = v
    lanes[at.SPEED_TARGET, i] = v
    lanes[at.WHEEL_SPEED, i] = v
    for row in (at.STEER, at.STEER_BEFORE, at.SERVO, at.MOTOR):
        lanes[row, i] = steer
    for row in range(np.int64(settings[at.DELAY_DEPTH])):
        lanes[at.LANE_ROWS + row, i] = steer
    for row in (at.COMMAND, at.SIDESLIP, at.STEP, at.DONE, at.DEPARTED, at.WAY, at.TICKS, at.PROGRESS):
        lanes[row, i] = zero
    for row in (at.LAP_BEGAN, at.LAP_TIME, at.LAPS_DONE):
        lanes[row, i] = zero
    yaw_rate = v * np.tan(steer) / np.float64(lanes[at.CAR, i] + lanes[at.CAR + 1, i])
    lanes[at.YAW_RATE, i] = yaw_rate
    lanes[at.ACCELERATION, i] = v * yaw_rate
    for row, source in ((0, at.ALONG), (1, at.LATERAL), (2, at.HEADING), (3, at.SPEED)):
        lanes[at.BEFORE + row, i] = lanes[source, i]
    points = index[which, at.I_POINTS]
    counters[at.SEGMENT, i] = 0
    lanes[at.STATION, i] = zero
    if points > 1:
        segment, station, _, _, _ = locate(
            np.float64(lanes[at.ALONG, i]),
            np.float64(lanes[at.LATERAL, i]),
            line,
            index[which, at.I_LINE],
            points,
            index[which, at.I_CLOSED] > 0,
            np.int64(0),
            points - 1,
        )
        counters[at.SEGMENT, i] = segment
        lanes[at.STATION, i] = station
