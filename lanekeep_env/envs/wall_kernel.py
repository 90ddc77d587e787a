"""The compiled step of every environment between walls: one kernel for one car and for thousands.

A step: command -> servo, vehicle (sub-steps) -> contact -> progress -> sensors -> reward -> observation -> reset.
The vehicle models are those of roads, on a straight path: x and y stand for arc length and lateral error. They run
as SIMD code over the lanes of a block; rays, cones and contact as SIMD code over the walls of one lane.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import prange

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, kernel
from lanekeep_env.envs.delay import acting_row, delay_commands
from lanekeep_env.envs.observe import gather
from lanekeep_env.envs.road_start import set_speeds
from lanekeep_env.envs.wall_start import follow, look_around, servo_angle, start_between_walls
from lanekeep_env.physics.integrate import named
from lanekeep_env.physics.models import CarModel
from lanekeep_env.physics.numeric import clip, like, sin_cos, smaller, wrapped
from lanekeep_env.sensing.measure import measure
from lanekeep_env.sensing.scan import take_scan
from lanekeep_env.tasks.divergence import DIVERGED, are_finite
from lanekeep_env.tasks.wall_driving import judge_circuit, judge_following
from lanekeep_env.walls.contact import clearance, sweeps

#: Of ultrasonics, m, where there is no echo.
NO_ECHO = 6.0


@helper
def _command(k, lanes, counters, settings, servo, action):
    """Turn the actions into servo angles and set speeds; count what had to be clipped; return the sub-steps."""
    first = k * lanes.shape[2]
    total = counters.shape[1]
    stride = action.shape[0] // total
    limit, scale = settings[at.COMMAND_LIMIT], settings[at.ACTION_SCALE]
    one, zero = like(limit, 1.0), like(limit, 0.0)
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    as_rate = settings[at.ACTION_KIND] > zero
    slowest = zero if settings[at.SLIPS] > zero else -one  # the dynamic car does not know backwards
    block = lanes[k]
    for i in range(min(lanes.shape[2], total - first)):
        alive = block[at.DONE, i] == zero
        given = like(limit, action[(first + i) * stride])
        counters[at.CLIPPED, first + i] += (abs(given) > one) and alive
        wish = clip(given, -one, one) * scale
        block[at.COMMAND, i] = clip(block[at.COMMAND, i] + wish * seconds if as_rate else wish, -limit, limit)
        angle = block[at.COMMAND, i]
        if servo is not None:
            angle = like(limit, servo_angle(np.float64(angle), np.float64(limit), servo))
        block[at.SERVO, i] = angle + block[at.STEER_OFFSET, i]
        block[at.STEER_BEFORE, i] = block[at.STEER, i]
        if stride > 1:
            given = like(limit, action[(first + i) * stride + 1])
            counters[at.CLIPPED, first + i] += (abs(given) > one) and alive
            block[at.SPEED_TARGET, i] = clip(given, slowest, one) * settings[at.LARGEST_SPEED]
        block[at.BEFORE, i] = block[at.ALONG, i]
        block[at.BEFORE + 1, i] = block[at.LATERAL, i]
        block[at.BEFORE + 2, i] = block[at.HEADING, i]
        block[at.BEFORE + 3, i] = block[at.SPEED, i]
    if settings[at.DELAY_DEPTH] > zero:
        delay_commands(block, settings, at.SERVO)
    return np.int64(settings[at.SUBSTEPS])


@helper
def _measure_clearance(i, lanes, walls, first, last, settings, scratch):
    """Write how far lane i's body is from the nearest wall."""
    middle, half_length, half_width = settings[at.BODY], settings[at.BODY + 1], settings[at.BODY + 2]
    sine, cosine = sin_cos(lanes[at.HEADING, i])
    x, y = lanes[at.ALONG, i] + middle * cosine, lanes[at.LATERAL, i] + middle * sine
    lanes[at.CLEARANCE, i] = clearance(x, y, cosine, sine, half_length, half_width, walls, first, last, scratch)


@helper
def _touch(i, lanes, walls, first, last, settings, scratch):
    """Whether lane i's body touched a wall in this control step; writes its clearance."""
    _measure_clearance(i, lanes, walls, first, last, settings, scratch)
    middle, half_length, half_width = settings[at.BODY], settings[at.BODY + 1], settings[at.BODY + 2]
    sine0, cosine0 = sin_cos(lanes[at.BEFORE + 2, i])
    sine, cosine = sin_cos(lanes[at.HEADING, i])
    x0, y0 = lanes[at.BEFORE, i] + middle * cosine0, lanes[at.BEFORE + 1, i] + middle * sine0
    x, y = lanes[at.ALONG, i] + middle * cosine, lanes[at.LATERAL, i] + middle * sine
    return sweeps(x0, y0, cosine0, sine0, x, y, cosine, sine, half_length, half_width, walls, first, last, scratch)


@helper
def _count(i, lanes, settings):
    """Turn the wheels by the way of this control step and read the encoder."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    half = like(seconds, 0.5)
    v, tick = lanes[at.SPEED, i], settings[at.TICK]
    signless = settings[at.SIGNLESS] > 0.0
    speed = v
    if tick > 0.0:
        # The speed rose or fell evenly, and then stood for the rest of the step.
        before, change = lanes[at.BEFORE + 3, i], settings[at.SPEED_CHANGE]
        ramp = abs(v - before) * settings[at.STEP_TIME] / (change if change > 0.0 else like(change, 1.0))
        way = lanes[at.WAY, i] + v * seconds - half * (v - before) * smaller(ramp, seconds)
        # Counted in ticks of the present wheel's turn, so that float32 stays exact on long ways.
        ticks = np.floor(way / tick)
        speed = (ticks - lanes[at.TICKS, i]) * tick / seconds
        turns = np.floor(ticks * like(tick, 1.0 / 1024.0))
        lanes[at.WAY, i] = way - turns * like(tick, 1024.0) * tick
        lanes[at.TICKS, i] = ticks - turns * like(tick, 1024.0)
    lanes[at.WHEEL_SPEED, i] = abs(speed) if signless else speed


@helper
def _report(i, lateral, heading, lanes, settings, outcome):
    """Copy the truth that a state decides; on a circuit a success is a lap, or as many as are asked for."""
    lanes[at.ERROR, i] = outcome[at.O_LATERAL_ERROR, i] = lateral
    lanes[at.TURNED, i] = outcome[at.O_HEADING_ERROR, i] = heading
    outcome[at.O_LATERAL_ACCELERATION, i] = lanes[at.ACCELERATION, i]
    outcome[at.O_SPEED, i] = lanes[at.SPEED, i]
    outcome[at.O_ARC_LENGTH, i] = lanes[at.STATION, i]
    zero, one = like(lanes[0, 0], 0.0), like(lanes[0, 0], 1.0)
    misses = settings[at.TASK] == at.CIRCUIT and lanes[at.LAPS_DONE, i] < settings[at.LAPS]
    outcome[at.O_SUCCESS, i] = zero if misses else one - lanes[at.DEPARTED, i]
    outcome[at.O_X, i] = lanes[at.ALONG, i]
    outcome[at.O_Y, i] = lanes[at.LATERAL, i]
    outcome[at.O_DISTANCE, i] = like(lanes[0, 0], NO_ECHO) if np.isnan(lanes[at.RIGHT, i]) else lanes[at.RIGHT, i]
    outcome[at.O_CLEARANCE, i] = lanes[at.CLEARANCE, i]
    outcome[at.O_LAP_TIME, i] = lanes[at.LAP_TIME, i]


@helper
def _follow_line(i, lanes, counters, worlds, settings):
    """Move lane i along the centre line; return (progress, lateral error, heading error), m and rad.

    Following a wall the lateral error is that of the side sensor's distance; without a centre line the heading counts
    from the x axis.
    """
    _, index, line, _, _ = worlds
    which = counters[at.ROAD, i]
    points = index[which, at.I_POINTS]
    zero = like(lanes[0, 0], 0.0)
    progress = lateral = zero
    heading = lanes[at.HEADING, i]
    if points > 1:
        closed = index[which, at.I_CLOSED] > 0
        segment, station, aside, cosine, sine = follow(
            np.float64(lanes[at.ALONG, i]),
            np.float64(lanes[at.LATERAL, i]),
            line,
            index[which, at.I_LINE],
            points,
            closed,
            counters[at.SEGMENT, i],
        )
        counters[at.SEGMENT, i] = segment
        step = station - np.float64(lanes[at.STATION, i])
        if closed:
            length = line[2, index[which, at.I_LINE] + points - 1]
            step -= length * np.floor(step / length + 0.5)
        lanes[at.STATION, i] = station
        progress, lateral = like(zero, step), like(zero, aside)
        heading = wrapped(heading - like(zero, np.arctan2(sine, cosine)))
    if settings[at.TASK] == at.WALL_FOLLOW:
        right = like(zero, NO_ECHO) if np.isnan(lanes[at.RIGHT, i]) else lanes[at.RIGHT, i]
        lateral = right - settings[at.SET_DISTANCE]
    return progress, lateral, heading


@helper
def _lap(i, progress, lanes, counters, worlds, settings):
    """Count progress and laps of lane i; return whether the last lap is done."""
    _, index, line, _, _ = worlds
    which = counters[at.ROAD, i]
    points = index[which, at.I_POINTS]
    if points < 2:
        return False
    length = like(progress, line[2, index[which, at.I_LINE] + points - 1])
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    before = lanes[at.PROGRESS, i]
    lanes[at.PROGRESS, i] = before + progress
    laps = np.floor(lanes[at.PROGRESS, i] / length)
    if index[which, at.I_CLOSED] == 0:  # stations end with the line: sums of progress reach its length by chance
        laps = like(progress, 1.0 if lanes[at.STATION, i] >= length * like(progress, 1.0 - 1e-6) else 0.0)
    if progress > 0.0 and laps > lanes[at.LAPS_DONE, i]:  # a line that is crossed back and forth counts once
        lanes[at.LAPS_DONE, i] = laps
        share = smaller((laps * length - before) / progress, like(progress, 1.0))
        now = (lanes[at.STEP, i] - like(progress, 1.0) + share) * seconds
        lanes[at.LAP_TIME, i] = now - lanes[at.LAP_BEGAN, i]
        lanes[at.LAP_BEGAN, i] = now
        return laps >= settings[at.LAPS]
    return False


@helper
def _diverged(i, lanes):
    """Whether row i's state is no number any more; it then stands where it was before the control step."""
    if are_finite(
        lanes[at.ALONG, i],
        lanes[at.LATERAL, i],
        lanes[at.HEADING, i],
        lanes[at.SIDESLIP, i],
        lanes[at.YAW_RATE, i],
        lanes[at.SPEED, i],
        lanes[at.STEER, i] - lanes[at.STEER_BEFORE, i],
        lanes[at.ACCELERATION, i],
    ):
        return False
    zero = like(lanes[0, 0], 0.0)
    for row, before in ((at.ALONG, at.BEFORE), (at.LATERAL, at.BEFORE + 1), (at.HEADING, at.BEFORE + 2)):
        lanes[before, i] = lanes[before, i] if np.isfinite(lanes[before, i]) else zero
        lanes[row, i] = lanes[before, i]
    for row in (
        at.SIDESLIP,
        at.YAW_RATE,
        at.SPEED,
        at.BEFORE + 3,
        at.STEER,
        at.STEER_BEFORE,
        at.MOTOR,
        at.ACCELERATION,
    ):
        lanes[row, i] = zero
    return True


@helper
def _drive(i, lanes, counters, worlds, settings, outcome, block):
    """Contact, progress, sensors' truth, reward and flags of lane i after its sub-steps."""
    walls, index, _, _, scratch_ = worlds
    scratch = scratch_[block]
    which = counters[at.ROAD, i]
    first, last = index[which, at.I_FIRST], index[which, at.I_END]
    zero, one = like(lanes[0, 0], 0.0), like(lanes[0, 0], 1.0)
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    ends, ignored = settings[at.DEPARTURE] == at.TERMINATE, settings[at.DEPARTURE] == at.OFF
    lanes[at.STEP, i] += one
    diverged = _diverged(i, lanes)
    touched = _touch(i, lanes, walls, first, last, settings, scratch)
    if touched and not ends:  # a wall holds the car where it was
        lanes[at.ALONG, i], lanes[at.LATERAL, i] = lanes[at.BEFORE, i], lanes[at.BEFORE + 1, i]
        lanes[at.HEADING, i] = lanes[at.BEFORE + 2, i]
        lanes[at.SPEED, i] = lanes[at.YAW_RATE, i] = lanes[at.SIDESLIP, i] = lanes[at.ACCELERATION, i] = zero
        _measure_clearance(i, lanes, walls, first, last, settings, scratch)
    _count(i, lanes, settings)
    look_around(i, lanes, walls, first, last, settings, scratch)
    progress, lateral, heading = _follow_line(i, lanes, counters, worlds, settings)
    counts = touched and not ignored
    rate = (lanes[at.STEER, i] - lanes[at.STEER_BEFORE, i]) / seconds
    horizon = settings[at.HORIZON]
    left = horizon - lanes[at.STEP, i]
    if settings[at.TASK] == at.WALL_FOLLOW:
        reward, ended = judge_following(
            lateral,
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
        done = _lap(i, progress, lanes, counters, worlds, settings) and not counts
        reward, ended = judge_circuit(progress, left, seconds, counts, done, settings[at.LARGEST_SPEED], ends)
    if diverged:
        counts = True
        worst = settings[at.COST_CAP] if settings[at.TASK] == at.WALL_FOLLOW else like(zero, at.LARGEST_CIRCUIT_COST)
        reward = -worst * seconds * (one + (left if left > zero else zero))
        ended = like(zero, DIVERGED)
    lanes[at.DEPARTED, i] = one if counts else lanes[at.DEPARTED, i]
    outcome[at.O_REWARD, i] = reward
    outcome[at.O_TERMINATED, i] = ended
    outcome[at.O_TRUNCATED, i] = one if lanes[at.STEP, i] >= smaller(horizon, settings[at.MAX_STEPS]) else zero
    outcome[at.O_STEERING_RATE, i] = rate
    outcome[at.O_COST, i] = one if counts else zero
    _report(i, lateral, heading, lanes, settings, outcome)


@helper
def _observe(i, lane, lanes, counters, worlds, settings, sensors, numbers, scan, observation, block):
    """Write the observation of lane i, ``lane`` in the environment.

    ``numbers`` is the scan's first array, or None without a scan: known when this is compiled.
    """
    walls, index, _, _, _ = worlds
    if numbers is not None:
        which = counters[at.ROAD, i]
        sine, cosine = sin_cos(lanes[at.HEADING, i])
        x = lanes[at.ALONG, i] + settings[at.FRONT_ARM] * cosine
        y = lanes[at.LATERAL, i] + settings[at.FRONT_ARM] * sine
        first, glass = index[which, at.I_FIRST], index[which, at.I_GLASS]
        renewed = take_scan(i, lane, x, y, cosine, sine, lanes, counters, walls, first, glass, scan, block)
        lanes[at.SCAN_NEW, i] = like(lanes[0, 0], 1.0 if renewed else 0.0)
        held, column = scan[4][lane], np.int64(settings[at.FIRST_PREVIEW])
        for beam in range(held.shape[0]):
            observation[i, column + beam] = held[beam]
    gather(i, i + 1, lanes, settings, observation)
    measure(i, lanes, counters, settings, sensors, observation)


@helper
def _start(
    i, lane, lateral, heading, place, world, lanes, counters, worlds, settings, equipment, observation, outcome, block
):
    """Start the next episode of a lane: state, truth and observation."""
    sensors, _, _, servo, numbers, beams, rows, fan, held = equipment
    walls, index, _, _, scratch = worlds
    counters[at.EPISODE, i] += 1
    start_between_walls(i, lateral, heading, place, world, lanes, counters, worlds, settings, servo, block)
    which = counters[at.ROAD, i]
    first, last = index[which, at.I_FIRST], index[which, at.I_END]
    _touch(i, lanes, walls, first, last, settings, scratch[block])
    zero = like(lanes[0, 0], 0.0)
    outcome[at.O_STEERING_RATE, i] = zero
    outcome[at.O_COST, i] = zero
    _, aside, turned = _follow_line(i, lanes, counters, worlds, settings)
    _report(i, aside, turned, lanes, settings, outcome)
    scan = (numbers, beams, rows, fan, held)
    _observe(i, lane, lanes, counters, worlds, settings, sensors, numbers, scan, observation, block)


@helper
def _finish(k, lanes, counters, worlds, settings, equipment, observation, outcome):
    """Everything behind the sub-steps of block ``k``, lane by lane; next episodes where the autoreset mode says so."""
    begin = k * lanes.shape[2]
    end = min(begin + lanes.shape[2], counters.shape[1])
    block, counted, told, seen = lanes[k], counters[:, begin:end], outcome[:, begin:end], observation[begin:end]
    sensors, _, _, _, numbers, beams, rows, fan, held = equipment
    scan = (numbers, beams, rows, fan, held)
    mode = np.int64(settings[at.AUTORESET])
    zero, one, nan = like(block[0, 0], 0.0), like(block[0, 0], 1.0), np.nan
    for i in range(end - begin):
        _drive(i, block, counted, worlds, settings, told, k)
        over = block[at.DONE, i] > zero
        if mode != at.NEXT_STEP or not over:
            _observe(i, begin + i, block, counted, worlds, settings, sensors, numbers, scan, seen, k)
        starts = False
        if over:
            told[at.O_REWARD, i] = zero  # the episode is over; its end was paid for
            if mode == at.NEXT_STEP:  # this step only starts the new episode; what it integrated is thrown away
                told[at.O_TERMINATED, i] = zero
                told[at.O_TRUNCATED, i] = zero
                starts = True
        elif told[at.O_TERMINATED, i] + told[at.O_TRUNCATED, i] > zero:
            block[at.DONE, i] = one
            if mode == at.SAME_STEP:
                for row in range(at.WALL_OUTCOME_ROWS):
                    told[at.WALL_OUTCOME_ROWS + row, i] = told[row, i]
                for channel in range(seen.shape[1]):
                    told[2 * at.WALL_OUTCOME_ROWS + channel, i] = seen[i, channel]
                starts = True
        if starts:
            _start(i, begin + i, nan, nan, nan, nan, block, counted, worlds, settings, equipment, seen, told, k)


@functools.cache
def step_kernels(model: CarModel) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the kernels of one control step of a vehicle model, on one thread and on several.

    ``worlds`` is (walls, index, centre lines, starts, scratch), ``equipment`` (sensors, gear, slip-speed floor, servo,
    and five arrays of the scan), all but the first None where the scenario has none; flat, since numba's threads take
    no tuple within a tuple.
    """
    advance, show = model.advance, model.show

    @kernel()
    @named(model.name)
    def step_between_walls(begin, end, lanes, counters, worlds, settings, equipment, action, observation, outcome):
        gear, floor, servo = equipment[1], equipment[2], equipment[3]
        for k in range(begin, end):
            set_speeds(k, lanes, counters, settings)
            for substep in range(_command(k, lanes, counters, settings, servo, action)):
                advance(lanes[k], acting_row(substep, lanes[k], settings, at.SERVO), settings, gear, floor)
            show(lanes[k], floor)
            _finish(k, lanes, counters, worlds, settings, equipment, observation, outcome)

    @kernel(parallel=True)
    @named(model.name)
    def step_between_walls_parallel(
        begin, end, lanes, counters, worlds, settings, equipment, action, observation, outcome
    ):
        for k in prange(begin, end):
            step_between_walls(k, k + 1, lanes, counters, worlds, settings, equipment, action, observation, outcome)

    return step_between_walls, step_between_walls_parallel


@kernel()
def reset(mask, start, lanes, counters, worlds, settings, equipment, observation, outcome):
    """Start the next episode where ``mask`` is set; ``start`` (4, n) fixes what is not NaN."""
    size = lanes.shape[2]
    for lane in range(mask.shape[0]):
        if mask[lane]:
            block = lane // size
            first = block * size
            last = min(first + size, mask.shape[0])
            for row in (at.O_REWARD, at.O_TERMINATED, at.O_TRUNCATED):
                outcome[row, lane] = like(outcome[0, 0], 0.0)
            _start(
                lane - first,
                lane,
                start[0, lane],
                start[1, lane],
                start[2, lane],
                start[3, lane],
                lanes[block],
                counters[:, first:last],
                worlds,
                settings,
                equipment,
                observation[first:last],
                outcome[:, first:last],
                block,
            )
