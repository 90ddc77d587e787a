"""What environments on a road do in a step: crossing segments, traffic, reward, observation."""

from __future__ import annotations

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.engine.observe import gather
from lanekeep_env.engine.step import Family
from lanekeep_env.families.road.segments import cross_segments, look_ahead
from lanekeep_env.families.road.start import start_on_road
from lanekeep_env.physics.numeric import larger, like, smaller
from lanekeep_env.physics.powertrain import pull
from lanekeep_env.sensing.camera import edge_distance
from lanekeep_env.sensing.measure import measure
from lanekeep_env.tasks.driving import happen, move_on, wanted_speed
from lanekeep_env.tasks.lane_keeping import judge
from lanekeep_env.tasks.termination import CONTACT

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
)

# The ground is the table of segments, ``equipment`` (sensors, gear, slip-speed floor, camera, drive, timelines).
# None or not is decided when a function is compiled, by the type of an argument: what may be None is handed on as one.


@helper
def _begin(k, cars, counters, settings, equipment):
    _surroundings(k, cars, counters, settings, equipment[5])


@helper
def _surroundings(k, cars, counters, settings, timelines):
    """What a control step begins with around cars that have a powertrain: the events that are due, no way driven."""
    if timelines is not None:
        first, block = k * cars.shape[2], cars[k]
        for i in range(cars_in(k, cars, counters)):
            happen(i, block, timelines[counters[at.TIMELINE, first + i]], settings)
            block[at.WAY, i] = like(settings[0], 0.0)


@helper
def _before_substep(k, cars, counters, settings, equipment):
    _pull(k, cars, counters, settings, equipment[4])


@helper
def _pull(k, cars, counters, settings, drive):
    """Longitudinal acceleration of cars with a powertrain in the sub-step to come."""
    if drive is not None:
        for i in range(cars_in(k, cars, counters)):
            pull(i, cars[k], settings, drive)


@helper
def _after_substep(k, cars, counters, world):
    cross_segments(k, cars, counters, world[0])


@helper
def _still(i, block):
    """A car that has diverged stands at the start of its segment: nothing of its state is shown."""
    for row in STATE_ROWS:
        block[row, i] = like(block[0, 0], 0.0)


@helper
def _judge_lane(n, block, settings, outcome):
    """Reward and flags of the block's first ``n`` cars, column by column of ``outcome``."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    half_lane, cap = settings[at.HALF_LANE], settings[at.COST_CAP]
    horizon = settings[at.HORIZON]
    last_step = smaller(horizon, settings[at.MAX_STEPS])
    weight, lateral, reference = settings[at.COST_WEIGHT], settings[at.COST_LATERAL], settings[at.COST_RATE]
    ends = settings[at.DEPARTURE] == at.TERMINATE
    ignores = settings[at.DEPARTURE] == at.OFF
    d_, steer_, before_ = block[at.LATERAL], block[at.STEER], block[at.STEER_BEFORE]
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


@helper
def _judge_drive(n, block, settings, outcome, drive):
    """Add the speed error of cars with a powertrain to the reward; a lead car that is met ends the episode."""
    if drive is not None:
        reward_, terminated_, cost_ = outcome[at.O_REWARD], outcome[at.O_TERMINATED], outcome[at.O_COST]
        seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
        cap, horizon, reference = settings[at.COST_CAP], settings[at.HORIZON], settings[at.SPEED_REFERENCE]
        ends = settings[at.DEPARTURE] == at.TERMINATE
        zero, one = like(seconds, 0.0), like(seconds, 1.0)
        for i in range(n):
            move_on(i, block[at.WAY, i], seconds, block)
            wanted = wanted_speed(block[at.SET_SPEED, i], block[at.LEAD_GAP, i], block[at.STOP_GAP, i])
            error = (block[at.SPEED, i] - wanted) / reference
            if cost_[i] == zero:  # a departure has been charged for all that follows
                reward_[i] = -smaller(error * error * seconds - reward_[i], cap * seconds)
            if block[at.LEAD_GAP, i] <= zero:
                cost_[i] = one
                block[at.DEPARTED, i] = one
                block[at.LEAD_GAP, i] = zero
                left = horizon - block[at.STEP, i]
                reward_[i] = -cap * seconds * (one + (left if left > zero else zero) if ends else one)
                terminated_[i] = like(seconds, CONTACT) if ends else zero


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    first = k * cars.shape[2]
    n = cars_in(k, cars, counters)
    _judge_lane(n, cars[k], settings, outcome[:, first : first + n])
    _judge_drive(n, cars[k], settings, outcome[:, first : first + n], equipment[4])


@helper
def _report(k, first, last, cars, settings, outcome):
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
def _observe(span, cars, counters, world, settings, equipment, observation):
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
    begin=_begin,
    before_substep=_before_substep,
    after_substep=_after_substep,
    still=_still,
    judge=_judge,
    report=_report,
    observe=_observe,
    start=start_on_road,
)
