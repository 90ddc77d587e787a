"""What environments on a road do in a step: crossing segments, reward, observation."""

from __future__ import annotations

import functools
from collections.abc import Callable

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.engine.observe import gather
from lanekeep_env.engine.step import Family
from lanekeep_env.families.road.segments import cross_segments, look_ahead
from lanekeep_env.families.road.start import start_on_road
from lanekeep_env.physics.integrate import named
from lanekeep_env.physics.numeric import larger, like, smaller
from lanekeep_env.sensing.camera import edge_distance
from lanekeep_env.sensing.measure import measure
from lanekeep_env.tasks.lane_keeping import judge

#: Rows that follow from the state or that it follows from.
STATE_ROWS = (
    at.ALONG,
    at.LATERAL,
    at.HEADING,
    at.SIDESLIP,
    at.YAW_RATE,
    at.SPEED,
    at.STEER,
    at.STEER_BEFORE,
    at.MOTOR,
    at.ACCELERATION,
    at.PULL,
    at.WAY,
    at.LEAD_GAP,
    at.STOP_GAP,
    at.POSITION_GAP,
)

# The ground is the table of segments, ``equipment`` (sensors, gear, slip-speed floor, camera, drive, timelines).
# None or not is decided when a function is compiled, by the type of an argument: what may be None is handed on as one.


@helper
def after_substep(k, cars, counters, world):
    cross_segments(k, cars, counters, world[0])


@helper
def still(i, block):
    """A car that has diverged stands at the start of its segment: nothing of its state is shown."""
    for row in STATE_ROWS:
        block[row, i] = like(block[0, 0], 0.0)


@functools.cache
def lane_judge(error_row: int) -> Callable[..., None]:
    """Return the compiled function of reward and flags of a block's first ``n`` cars, by a row of lateral errors.

    It writes ``outcome`` column by column. The row is a constant of its code: as an argument it cost a single car 5 %.
    """

    @helper
    @named(str(error_row))
    def judge_lane(n, block, settings, outcome):
        seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
        half_lane, cap = settings[at.HALF_LANE], settings[at.COST_CAP]
        horizon = settings[at.HORIZON]
        last_step = smaller(horizon, settings[at.MAX_STEPS])
        weight, lateral, reference = settings[at.COST_WEIGHT], settings[at.COST_LATERAL], settings[at.COST_RATE]
        ends = settings[at.DEPARTURE] == at.TERMINATE
        ignores = settings[at.DEPARTURE] == at.OFF
        d_, steer_, before_ = block[error_row], block[at.STEER], block[at.STEER_BEFORE]
        reward_, terminated_, truncated_ = outcome[at.O_REWARD], outcome[at.O_TERMINATED], outcome[at.O_TRUNCATED]
        rate_, cost_ = outcome[at.O_STEERING_RATE], outcome[at.O_COST]
        step_, departed_ = block[at.STEP], block[at.DEPARTED]
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

    return judge_lane


_judge_lane = lane_judge(at.LATERAL)


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    first = k * cars.shape[2]
    n = cars_in(k, cars, counters)
    _judge_lane(n, cars[k], settings, outcome[:, first : first + n])


@helper
def report(k, first, last, cars, settings, outcome):
    """Copy the truth that a state decides."""
    block, told = cars[k], outcome[:, k * cars.shape[2] :]
    for i in range(first, last):
        told[at.O_LATERAL_ERROR, i] = block[at.LATERAL, i]
        told[at.O_HEADING_ERROR, i] = block[at.HEADING, i]
        told[at.O_LATERAL_ACCELERATION, i] = block[at.ACCELERATION, i]
        told[at.O_SPEED, i] = block[at.SPEED, i]
        told[at.O_ARC_LENGTH, i] = block[at.STATION, i] + block[at.ALONG, i]
        told[at.O_SUCCESS, i] = like(settings[0], 1.0) - block[at.DEPARTED, i]


@helper
def observe(span, cars, counters, world, settings, equipment, observation):
    """Write what the rows of cars hold, the road ahead, and what sensors make of it."""
    k, first, last = span
    begin = k * cars.shape[2]
    block, counted, seen = cars[k], counters[:, begin:], observation[begin:]
    _see_edge(first, last, block, counted, world[0], equipment[3])
    if settings[at.FULL] > like(settings[0], 0.0):
        for i in range(first, last):
            along = larger(block[at.ALONG, i], like(settings[0], 0.0))
            block[at.CURVATURE_HERE, i] = block[at.CURVATURE, i] + block[at.CURVATURE_SLOPE, i] * along
    gather(first, last, block, settings, seen)
    look_ahead(first, last, block, counted, world[0], settings, seen)
    _measure(first, last, block, counted, settings, equipment[0], seen)


@helper
def _see_edge(first, last, block, counted, road, camera):
    if camera is not None:
        for i in range(first, last):
            block[at.EDGE, i] = edge_distance(i, block, counted, road, camera)


@helper
def _measure(first, last, block, counted, settings, sensors, seen):
    if sensors is not None:
        for i in range(first, last):
            measure(i, block, counted, settings, sensors, seen)


ON_ROADS = Family(
    name="on_roads",
    command_row=at.COMMAND,
    outcome_rows=at.OUTCOME_ROWS,
    after_substep=after_substep,
    still=still,
    judge=_judge,
    report=report,
    observe=observe,
    start=start_on_road,
)
