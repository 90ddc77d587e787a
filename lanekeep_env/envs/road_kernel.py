"""The compiled step of every environment on a road: one kernel for one car and for thousands.

A step runs command -> actuator and vehicle (sub-steps) -> path coordinates -> reward -> observation ->
reset, block by block, so that a block's rows stay in the first-level cache. Loops over a block's rows
become SIMD code; what differs from lane to lane (crossing a segment, starting an episode) is scalar.
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
from lanekeep_env.envs.road_start import cross_segments, set_speeds, start_drive, start_lane
from lanekeep_env.physics.integrate import DRIVEN, PACED, named
from lanekeep_env.physics.models import CarModel
from lanekeep_env.physics.numeric import clip, larger, like, smaller
from lanekeep_env.physics.powertrain import pull
from lanekeep_env.sensing.camera import edge_distance
from lanekeep_env.sensing.measure import measure
from lanekeep_env.tasks.divergence import DIVERGED, are_finite
from lanekeep_env.tasks.driving import happen, move_on, wanted_speed
from lanekeep_env.tasks.lane_keeping import judge

#: Code of `lanekeep_env.Termination` where the car ahead was met.
MET = 2.0
#: Rows that follow from the state or that it follows from.
STATE_ROWS = (
    at.ALONG,
    at.LATERAL,
    at.HEADING,
    at.SIDESLIP,
    at.YAW_RATE,
    at.SPEED,
    at.STEER,
    at.MOTOR,
    at.ACCELERATION,
    at.PULL,
    at.LEAD_GAP,
    at.STOP_GAP,
)


@helper
def _command(k, lanes, counters, settings, action):
    """Turn the actions into commands that enter the actuator, count what had to be clipped; return the sub-steps."""
    first = k * lanes.shape[2]
    n = min(lanes.shape[2], action.shape[0] - first)
    limit, scale = settings[at.COMMAND_LIMIT], settings[at.ACTION_SCALE]
    one, zero = like(limit, 1.0), like(limit, 0.0)
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    as_rate = settings[at.ACTION_KIND] > zero
    block, clipped_ = lanes[k], counters[at.CLIPPED]
    command_, before_, steer_, done_ = block[at.COMMAND], block[at.STEER_BEFORE], block[at.STEER], block[at.DONE]
    for i in range(n):
        given = like(limit, action[first + i])
        clipped_[first + i] += (abs(given) > one) and done_[i] == zero
        wish = clip(given, -one, one) * scale
        integrated = command_[i] + wish * seconds
        command_[i] = clip(integrated if as_rate else wish, -limit, limit)
        before_[i] = steer_[i]
    if settings[at.DELAY_DEPTH] > zero:
        delay_commands(block, settings, at.COMMAND)
    return np.int64(settings[at.SUBSTEPS])


@helper
def _command_drive(k, lanes, counters, settings, action):
    """The same for cars with a pedal as second action."""
    first, block = k * lanes.shape[2], lanes[k]
    total = counters.shape[1]
    limit, scale = settings[at.COMMAND_LIMIT], settings[at.ACTION_SCALE]
    one, zero = like(limit, 1.0), like(limit, 0.0)
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    as_rate = settings[at.ACTION_KIND] > zero
    for i in range(min(lanes.shape[2], total - first)):
        alive = block[at.DONE, i] == zero
        given, pedal = like(limit, action[2 * (first + i)]), like(limit, action[2 * (first + i) + 1])
        counters[at.CLIPPED, first + i] += ((abs(given) > one) or (abs(pedal) > one)) and alive
        wish = clip(given, -one, one) * scale
        block[at.COMMAND, i] = clip(block[at.COMMAND, i] + wish * seconds if as_rate else wish, -limit, limit)
        block[at.PEDAL, i] = clip(pedal, -one, one)
        block[at.STEER_BEFORE, i] = block[at.STEER, i]
        block[at.WAY, i] = zero
    if settings[at.DELAY_DEPTH] > zero:
        delay_commands(block, settings, at.COMMAND)
    return np.int64(settings[at.SUBSTEPS])


@helper
def _surroundings(k, lanes, counters, settings, timelines):
    """What a control step begins with around the cars of block ``k``: the events that are due."""
    first, block = k * lanes.shape[2], lanes[k]
    for i in range(min(lanes.shape[2], counters.shape[1] - first)):
        happen(i, block, timelines[counters[at.TIMELINE, first + i]], settings)


@helper
def _pull(k, lanes, counters, settings, numbers):
    """Longitudinal acceleration of the cars of block ``k`` in the sub-step to come."""
    first, block = k * lanes.shape[2], lanes[k]
    for i in range(min(lanes.shape[2], counters.shape[1] - first)):
        pull(i, block, settings, numbers)


@helper
def _judge_drive(n, lanes, settings, reward_, terminated_, cost_):
    """Add the speed error to the reward of a block; a lead car that is met ends the episode."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    cap, horizon, reference = settings[at.COST_CAP], settings[at.HORIZON], settings[at.SPEED_REFERENCE]
    ends = settings[at.DEPARTURE] == at.TERMINATE
    zero, one = like(seconds, 0.0), like(seconds, 1.0)
    for i in range(n):
        move_on(i, lanes[at.WAY, i], seconds, lanes)
        wanted = wanted_speed(lanes[at.SET_SPEED, i], lanes[at.LEAD_GAP, i], lanes[at.STOP_GAP, i])
        error = (lanes[at.SPEED, i] - wanted) / reference
        if cost_[i] == zero:  # a departure has been charged for all that follows
            reward_[i] = -smaller(error * error * seconds - reward_[i], cap * seconds)
        if lanes[at.LEAD_GAP, i] <= zero:
            cost_[i] = one
            lanes[at.DEPARTED, i] = one
            lanes[at.LEAD_GAP, i] = zero
            left = horizon - lanes[at.STEP, i]
            reward_[i] = -cap * seconds * (one + (left if left > zero else zero) if ends else one)
            terminated_[i] = like(seconds, MET) if ends else zero


@helper
def _judge(n, lanes, settings, reward_, terminated_, truncated_, rate_, cost_):
    """Reward and flags of a block."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    half_lane, cap = settings[at.HALF_LANE], settings[at.COST_CAP]
    horizon = settings[at.HORIZON]
    last_step = smaller(horizon, settings[at.MAX_STEPS])
    weight, lateral, reference = settings[at.COST_WEIGHT], settings[at.COST_LATERAL], settings[at.COST_RATE]
    ends = settings[at.DEPARTURE] == at.TERMINATE
    ignores = settings[at.DEPARTURE] == at.OFF
    d_, steer_, before_ = lanes[at.LATERAL], lanes[at.STEER], lanes[at.STEER_BEFORE]
    step_, departed_ = lanes[at.STEP], lanes[at.DEPARTED]
    zero, one = like(seconds, 0.0), like(seconds, 1.0)
    for i in range(n):
        step_[i] += one
        rate = (steer_[i] - before_[i]) / seconds
        reward, outside, terminated = judge(
            d_[i], rate, horizon - step_[i], seconds, half_lane, lateral, weight, reference, cap, ends, ignores
        )
        departed = departed_[i]
        departed_[i] = one if outside > zero else departed
        reward_[i] = reward
        terminated_[i] = terminated
        truncated_[i] = one if step_[i] >= last_step else zero
        rate_[i] = rate
        cost_[i] = outside


@helper
def _end_diverged(n, lanes, settings, reward_, terminated_, rate_, cost_):
    """End the episodes of a block whose state is no number any more, as failures; nothing of it is shown."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    zero, one = like(seconds, 0.0), like(seconds, 1.0)
    along_, d_, theta_, beta_ = lanes[at.ALONG], lanes[at.LATERAL], lanes[at.HEADING], lanes[at.SIDESLIP]
    r_, v_, a_ = lanes[at.YAW_RATE], lanes[at.SPEED], lanes[at.ACCELERATION]
    count = 0
    for i in range(n):
        count += 0 if are_finite(along_[i], d_[i], theta_[i], beta_[i], r_[i], v_[i], rate_[i], a_[i]) else 1
    for i in range(n if count > 0 else 0):
        if not are_finite(along_[i], d_[i], theta_[i], beta_[i], r_[i], v_[i], rate_[i], a_[i]):
            for row in STATE_ROWS:
                lanes[row, i] = zero
            left = settings[at.HORIZON] - lanes[at.STEP, i]
            reward_[i] = -settings[at.COST_CAP] * seconds * (one + (left if left > zero else zero))
            terminated_[i] = like(seconds, DIVERGED)
            rate_[i] = zero
            cost_[i] = one
            lanes[at.DEPARTED, i] = one


@helper
def _report(first, last, lanes, outcome):
    """Copy the truth that a state decides; lane i of the block is column i of ``outcome``."""
    for i in range(first, last):
        outcome[at.O_LATERAL_ERROR, i] = lanes[at.LATERAL, i]
        outcome[at.O_HEADING_ERROR, i] = lanes[at.HEADING, i]
        outcome[at.O_LATERAL_ACCELERATION, i] = lanes[at.ACCELERATION, i]
        outcome[at.O_SPEED, i] = lanes[at.SPEED, i]
        outcome[at.O_ARC_LENGTH, i] = lanes[at.STATION, i] + lanes[at.ALONG, i]
        outcome[at.O_SUCCESS, i] = like(lanes[0, 0], 1.0) - lanes[at.DEPARTED, i]


@helper
def _preview(first, last, samples, lanes, counters, road, settings, observation):
    """Write curvature at the car and ahead of it, along the road at the present speed or at fixed distances."""
    column = np.int64(settings[at.FIRST_PREVIEW])
    place = at.CHANNELS + 2 * column
    low, high = settings[place], settings[place + 1]
    rows = road.shape[0]
    for i in range(first, last):
        segment = counters[at.SEGMENT, i]
        zero = like(low, 0.0)
        along = larger(lanes[at.ALONG, i], zero)
        spacing = lanes[at.SPEED, i] * settings[at.PREVIEW_TIME] + settings[at.PREVIEW_DISTANCE]
        for k in range(samples):
            for _ in range(rows):
                if not along >= road[segment, at.R_LENGTH]:
                    break
                along -= road[segment, at.R_LENGTH]
                segment = np.int64(road[segment, at.R_NEXT])
            for _ in range(rows):
                if not (along < zero and road[segment, at.R_PREVIOUS] >= zero):  # a car that backs up
                    break
                segment = np.int64(road[segment, at.R_PREVIOUS])
                along += road[segment, at.R_LENGTH]
            kappa = road[segment, at.R_CURVATURE] + road[segment, at.R_CURVATURE_SLOPE] * larger(along, zero)
            observation[i, column + k] = clip(kappa, low, high)
            along += spacing


@helper
def _observe(first, last, lanes, counters, road, settings, sensors, camera, observation):
    """Write the observations of lanes: what their rows hold, the road ahead, and what sensors make of it."""
    # None or not is decided when the kernel is compiled, by the type of the argument.
    if camera is not None:
        for i in range(first, last):
            lanes[at.EDGE, i] = edge_distance(i, lanes, counters, road, camera)
    if settings[at.FULL] > like(settings[0], 0.0):
        for i in range(first, last):
            along = larger(lanes[at.ALONG, i], like(lanes[0, 0], 0.0))
            lanes[at.CURVATURE_HERE, i] = lanes[at.CURVATURE, i] + lanes[at.CURVATURE_SLOPE, i] * along
    gather(first, last, lanes, settings, observation)
    samples = np.int64(settings[at.PREVIEW])
    if samples > 0:
        _preview(first, last, samples, lanes, counters, road, settings, observation)
    if sensors is not None:
        for i in range(first, last):
            measure(i, lanes, counters, settings, sensors, observation)


@helper
def _start(
    i,
    lateral,
    heading,
    station,
    road_index,
    lanes,
    counters,
    road,
    roads,
    settings,
    sensors,
    camera,
    drive,
    timelines,
    observation,
    outcome,
):
    """Start the next episode of a lane: state, truth and observation."""
    counters[at.EPISODE, i] += 1
    if drive is not None:
        counters[at.TIMELINE, i] = start_drive(i, lanes, counters, settings, drive, timelines)
    start_lane(i, lateral, heading, station, road_index, lanes, counters, road, roads, settings)
    zero = like(lanes[0, 0], 0.0)
    outcome[at.O_STEERING_RATE, i] = zero
    outcome[at.O_COST, i] = zero
    _report(i, i + 1, lanes, outcome)
    _observe(i, i + 1, lanes, counters, road, settings, sensors, camera, observation)


@helper
def _restart(n, lanes, counters, road, roads, settings, sensors, camera, drive, timelines, observation, outcome):
    """Start new episodes where the autoreset mode says so."""
    mode = np.int64(settings[at.AUTORESET])
    zero, one, nan = like(lanes[0, 0], 0.0), like(lanes[0, 0], 1.0), np.nan
    for i in range(n):
        starts = False
        if mode == at.NEXT_STEP and lanes[at.DONE, i] > zero:
            # This step only starts the new episode; what it integrated is thrown away.
            outcome[at.O_REWARD, i] = zero
            outcome[at.O_TERMINATED, i] = zero
            outcome[at.O_TRUNCATED, i] = zero
            starts = True
        elif lanes[at.DONE, i] > zero:
            outcome[at.O_REWARD, i] = zero  # the episode is over; its end was paid for
        elif outcome[at.O_TERMINATED, i] + outcome[at.O_TRUNCATED, i] > zero:
            lanes[at.DONE, i] = one
            if mode == at.SAME_STEP:
                for row in range(at.OUTCOME_ROWS):
                    outcome[at.OUTCOME_ROWS + row, i] = outcome[row, i]
                for channel in range(observation.shape[1]):
                    outcome[2 * at.OUTCOME_ROWS + channel, i] = observation[i, channel]
                starts = True
        if starts:
            _start(
                i,
                nan,
                nan,
                nan,
                nan,
                lanes,
                counters,
                road,
                roads,
                settings,
                sensors,
                camera,
                drive,
                timelines,
                observation,
                outcome,
            )


@helper
def _finish(k, lanes, counters, road, roads, settings, sensors, camera, drive, timelines, observation, outcome):
    """Judge the step of block ``k``, tell its truth and observations, start the next episodes."""
    first = k * lanes.shape[2]
    last = min(first + lanes.shape[2], counters.shape[1])
    n, block, counted, told, seen = (
        last - first,
        lanes[k],
        counters[:, first:last],
        outcome[:, first:last],
        observation[first:last],
    )
    _judge(
        n,
        block,
        settings,
        outcome[at.O_REWARD][first:last],
        outcome[at.O_TERMINATED][first:last],
        outcome[at.O_TRUNCATED][first:last],
        outcome[at.O_STEERING_RATE][first:last],
        outcome[at.O_COST][first:last],
    )
    if drive is not None:
        reward_, terminated_ = outcome[at.O_REWARD][first:last], outcome[at.O_TERMINATED][first:last]
        _judge_drive(n, block, settings, reward_, terminated_, outcome[at.O_COST][first:last])
    _end_diverged(
        n,
        block,
        settings,
        outcome[at.O_REWARD][first:last],
        outcome[at.O_TERMINATED][first:last],
        outcome[at.O_STEERING_RATE][first:last],
        outcome[at.O_COST][first:last],
    )
    begin = np.int64(0)  # a literal would be a type of its own and compile both functions twice
    _report(begin, n, block, told)
    _observe(begin, n, block, counted, road, settings, sensors, camera, seen)
    _restart(n, block, counted, road, roads, settings, sensors, camera, drive, timelines, seen, told)


@functools.cache
def step_kernels(model: CarModel) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return the kernels of one control step of a vehicle model, on one thread and on several.

    They step the blocks ``begin`` to ``end``. ``equipment`` is (sensors, gear, slip-speed floor, camera, drive,
    timelines), each None where the scenario has none, or the usual one: what it lacks is then no part of the kernel.
    (One tuple, since numba takes a tenth of a microsecond to tell the type of a None.)
    """
    advance, show, paced, driven = model.advance, model.show, model.pace == PACED, model.pace == DRIVEN

    @kernel()
    @named(model.name)
    def step(begin, end, lanes, counters, road, roads, settings, equipment, action, observation, outcome):
        sensors, gear, floor, camera, drive, timelines = equipment
        for k in range(begin, end):
            if paced:
                set_speeds(k, lanes, counters, settings)
            if driven:
                _surroundings(k, lanes, counters, settings, timelines)
                substeps = _command_drive(k, lanes, counters, settings, action)
            else:
                substeps = _command(k, lanes, counters, settings, action)
            for substep in range(substeps):
                if driven:
                    _pull(k, lanes, counters, settings, drive)
                advance(lanes[k], acting_row(substep, lanes[k], settings, at.COMMAND), settings, gear, floor)
                cross_segments(k, lanes, counters, road)
            show(lanes[k], floor)
            _finish(
                k,
                lanes,
                counters,
                road,
                roads,
                settings,
                sensors,
                camera,
                drive,
                timelines,
                observation,
                outcome,
            )

    @kernel(parallel=True)
    @named(model.name)
    def step_parallel(begin, end, lanes, counters, road, roads, settings, equipment, action, observation, outcome):
        for k in prange(begin, end):
            step(k, k + 1, lanes, counters, road, roads, settings, equipment, action, observation, outcome)

    return step, step_parallel


@kernel()
def reset(mask, start, lanes, counters, road, roads, settings, equipment, observation, outcome):
    """Start the next episode where ``mask`` is set; ``start`` (4, n) fixes what is not NaN."""
    size = lanes.shape[2]
    sensors, _, _, camera, drive, timelines = equipment
    for k in range(mask.shape[0]):
        if mask[k]:
            first = k // size * size
            last = first + size
            for row in (at.O_REWARD, at.O_TERMINATED, at.O_TRUNCATED):
                outcome[row, k] = like(outcome[0, 0], 0.0)
            _start(
                k - first,
                start[0, k],
                start[1, k],
                start[2, k],
                start[3, k],
                lanes[k // size],
                counters[:, first:last],
                road,
                roads,
                settings,
                sensors,
                camera,
                drive,
                timelines,
                observation[first:last],
                outcome[:, first:last],
            )
