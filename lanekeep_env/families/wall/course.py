"""What courses add to circuits: modes that follow each other, and parking spaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.families.wall.kernel import BETWEEN_WALLS, judge_car, report_cars, start_car
from lanekeep_env.physics.numeric import like, sin_cos, wrapped
from lanekeep_env.sensing.ultrasonic import FARTHEST
from lanekeep_env.tasks.parking import judge_parking, share_inside
from lanekeep_env.tasks.termination import FINISHED

# Behind the equipment of circuits come the course's numbers, its spaces and their index.
_NUMBERS, _SPACES, _INDEX = 9, 10, 11


@helper
def _set_mode(i, block, numbers):
    """Write the mode of car i at its present step; return whether it begins there, and whether it is the last."""
    count, step = np.int64(numbers[at.C_MODES]), block[at.STEP, i]
    now = 0
    for k in range(1, count):
        now = k if numbers[at.C_MODES + 1 + 2 * k] <= step else now
    block[at.MODE, i] = numbers[at.C_MODES + 2 + 2 * now]
    return numbers[at.C_MODES + 1 + 2 * now] == step, now + 1 == count


@helper
def _from_space(x, y, spaces, which):
    """Return the place of a point from a space's rear corner at the kerb: ahead, to the left, m."""
    sine, cosine = sin_cos(spaces[at.S_HEADING, which])
    dx, dy = x - spaces[at.S_X, which], y - spaces[at.S_Y, which]
    return cosine * dx + sine * dy, cosine * dy - sine * dx


@helper
def _see_space(i, block, which, settings, equipment):
    """Write where car i is in the space that holds most of it, and where the longest is; return whether it is in."""
    numbers, spaces, index = equipment[_NUMBERS], equipment[_SPACES], equipment[_INDEX]
    zero = like(settings[0], 0.0)
    sine, cosine = sin_cos(block[at.HEADING, i])
    x = block[at.ALONG, i] + settings[at.BODY_MIDDLE] * cosine
    y = block[at.LATERAL, i] + settings[at.BODY_MIDDLE] * sine
    most, kerb, inside = zero, like(zero, FARTHEST), False
    for space in range(index[which, 0], index[which, 1]):
        ahead, left = _from_space(x, y, spaces, space)
        turned = wrapped(block[at.HEADING, i] - spaces[at.S_HEADING, space])
        s, c = sin_cos(turned)
        share, distance, fits = share_inside(
            ahead,
            left,
            c,
            s,
            settings[at.BODY_HALF_LENGTH],
            settings[at.BODY_HALF_WIDTH],
            spaces[at.S_LONG, space],
            numbers[at.C_KERB],
        )
        if share > most:
            most, kerb = share, distance
            inside = fits and abs(turned) <= numbers[at.C_TURNED]
    block[at.SHARE, i], block[at.KERB_DISTANCE, i] = most, kerb
    longest = index[which, 2]
    block[at.SPACE_AHEAD, i] = block[at.SPACE_LEFT, i] = block[at.SPACE_TURNED, i] = block[at.SPACE_LENGTH, i] = zero
    if longest >= 0:
        ahead, left = _from_space(x, y, spaces, longest)
        half = like(zero, 0.5)
        block[at.SPACE_AHEAD, i] = half * spaces[at.S_LONG, longest] - ahead
        block[at.SPACE_LEFT, i] = half * spaces[at.S_DEEP, longest] - left
        block[at.SPACE_TURNED, i] = wrapped(block[at.HEADING, i] - spaces[at.S_HEADING, longest])
        block[at.SPACE_LENGTH, i] = spaces[at.S_LONG, longest]
    return inside


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    first = k * cars.shape[2]
    n = cars_in(k, cars, counters)
    counted, told = counters[:, first : first + n], outcome[:, first : first + n]
    block, numbers = cars[k], equipment[_NUMBERS]
    zero, one = like(settings[0], 0.0), like(settings[0], 1.0)
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    ends = settings[at.DEPARTURE] == at.TERMINATE
    for i in range(n):
        parks = block[at.MODE, i] == at.PARK  # until now
        judge_car(i, block, counted, world, settings, told, world[0][3][k])
        touched = told[at.O_COST, i] > zero
        inside = _see_space(i, block, counted[at.ROAD, i], settings, equipment)
        stands = inside and parks and not touched and abs(block[at.SPEED, i]) < numbers[at.C_SPEED]
        block[at.PARKED, i] = block[at.PARKED, i] + one if stands else zero
        begins, last = _set_mode(i, block, numbers)
        if parks:
            reward, ended = judge_parking(
                block[at.SHARE, i],
                block[at.PARKED, i] >= numbers[at.C_STEPS],
                block[at.STEP, i],
                settings[at.HORIZON],
                seconds,
                touched,
                ends,
                settings[at.LARGEST_COST],
            )
            told[at.O_REWARD, i] = reward
            told[at.O_TERMINATED, i] = ended
            if ended == like(zero, FINISHED):
                block[at.LAP_TIME, i] = block[at.STEP, i] * seconds
        # What was done in a mode counts for none that follows.
        if (begins or not last) and told[at.O_TERMINATED, i] == like(zero, FINISHED):
            told[at.O_TERMINATED, i] = zero
        block[at.PARKED, i] = zero if begins else block[at.PARKED, i]


@helper
def _report(k, first, last, cars, settings, outcome):
    report_cars(k, first, last, cars, settings, outcome)
    block, told = cars[k], outcome[:, k * cars.shape[2] :]
    for i in range(first, last):
        told[at.O_MODE, i] = block[at.MODE, i]
        told[at.O_SHARE, i] = block[at.SHARE, i]
        told[at.O_KERB_DISTANCE, i] = block[at.KERB_DISTANCE, i]


@helper
def _start(place, wanted, cars, counters, world, settings, equipment):
    start_car(place, wanted, cars, counters, world, settings, equipment)
    k, i = place
    block = cars[k]
    block[at.PARKED, i] = like(settings[0], 0.0)
    _set_mode(i, block, equipment[_NUMBERS])
    _see_space(i, block, counters[at.ROAD, k * cars.shape[2] + i], settings, equipment)


ON_COURSES = replace(
    BETWEEN_WALLS, name="on_courses", outcome_rows=at.COURSE_OUTCOME_ROWS, judge=_judge, report=_report, start=_start
)
