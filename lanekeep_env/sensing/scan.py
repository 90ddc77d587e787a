"""A depth camera's scan of the walls, with its faults."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.sensing.measure import FIRST_STEP, normal
from lanekeep_env.walls.raycast import cast

#: Counter of the scan's first draw in a control step, behind those of the scalar sensors; three a beam.
FIRST_DRAW = np.int64(1024)
DRAWS = np.int64(4)
#: Difference of the ranges of neighbours that is a jump, m.
JUMP = 0.3


@helper
def take_scan(place, pose, cars, counters, walls, span, scan):
    """Renew the scan of the car at ``place`` = (block, column of it) if its time has come; return whether it has.

    ``pose`` is (x, y, cosine, sine) of the camera, m; it sees the walls of ``span`` (first, last). The result is the
    car's row of ``scan``'s last array, m, 0 for beams that show nothing.
    """
    (k, i), (x, y, cosine, sine) = place, pose
    numbers, beams, scratch, fan, held = scan
    column = k * cars.shape[2] + i
    step = np.int64(cars[k, at.STEP, i])
    if step % np.int64(numbers[at.SCAN_PERIOD]) != 0:
        return False
    turn_cos, turn_sin = np.cos(numbers[at.SCAN_FIRST]), np.sin(numbers[at.SCAN_FIRST])
    ranges = held[column]
    first_beam = cosine * turn_cos - sine * turn_sin, sine * turn_cos + cosine * turn_sin
    optics = numbers[at.SCAN_STEP], numbers[at.SCAN_FARTHEST], beams
    cast((x, y, *first_beam), optics, walls, span, scratch[k], fan[k], ranges)
    count = ranges.shape[0]
    nearest, farthest = numbers[at.SCAN_NEAREST], numbers[at.SCAN_FARTHEST]
    noise, jump = numbers[at.SCAN_NOISE], numbers[at.SCAN_JUMP]
    every, rim = np.int64(numbers[at.SCAN_EVERY]), np.int64(numbers[at.SCAN_RIM])
    faulty = noise > 0.0 or jump > 0.0
    key = np.uint64(0)
    if faulty:
        key = derive(derive(np.uint64(counters[at.KEY, column]), counters[at.EPISODE, column]), FIRST_STEP + step)
    for beam in range(count):
        reading = ranges[beam]
        nothing = reading >= farthest or reading < nearest
        if faulty:
            draw = FIRST_DRAW + DRAWS * np.int64(beam)
            beside = jump > 0.0 and beam + 1 < count and abs(ranges[beam + 1] - reading) > JUMP
            if beside and uniform(key, draw + np.int64(2)) < jump:
                reading += (ranges[beam + 1] - reading) * uniform(key, draw + np.int64(3))
            if noise > 0.0:
                reading += noise * reading * reading * normal(key, draw)
            nothing = nothing or reading >= farthest or reading < nearest
        missing = beam < rim or beam >= count - rim or (every > 0 and beam % every == every - 1)
        ranges[beam] = 0.0 if nothing or missing else reading
    return True
