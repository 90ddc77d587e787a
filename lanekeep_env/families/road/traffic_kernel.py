"""What traffic adds to a car with pedals: the others drive, lanes count, and whoever is touched ends the episode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.families.road import drive_kernel
from lanekeep_env.families.road.kernel import lane_judge
from lanekeep_env.families.road.kernel import observe as observe_road
from lanekeep_env.families.road.traffic_lead import is_avoidable, see_traffic
from lanekeep_env.families.road.traffic_start import start_in_traffic
from lanekeep_env.physics.numeric import clip, like
from lanekeep_env.tasks.avoidable import avoided
from lanekeep_env.tasks.driving import TOLERANCE, wanted_speed
from lanekeep_env.tasks.termination import CONTACT, STOP_PASSED
from lanekeep_env.traffic.change_lane import neighbours
from lanekeep_env.traffic.drive import decide, move
from lanekeep_env.traffic.follow import LENGTH
from lanekeep_env.traffic.touch import touches

# Behind the timelines, a car's own each, the equipment holds the others and the lanes that they drive on.
_DRIVE, _TIMELINES, _TRAFFIC, _STREETS = 4, 5, 6, 7

_judge_lane = lane_judge(at.LANE_OFFSET)


@helper
def _time(i, block, settings):
    """Return the time of car i's episode, s."""
    return np.float64(block[at.STEP, i]) * np.float64(settings[at.STEP_TIME]) * np.float64(settings[at.SUBSTEPS])


@helper
def _obey(time, seconds, half_length, grip, traffic):
    """Let cars do what they are told: brake at a time, or come in front of car 0 at a gap."""
    for j in range(1, traffic.shape[1]):
        if traffic[at.T_BRAKES_AT, j] <= time < traffic[at.T_BRAKES_UNTIL, j]:
            brake = min(traffic[at.T_BRAKE, j], grip)
            traffic[at.T_PULL, j] = -min(brake, max(traffic[at.T_SPEED, j], 0.0) / seconds)
        gap = traffic[at.T_X, j] - traffic[at.T_X, 0] - LENGTH / 2 - half_length
        if 0.0 < gap < traffic[at.T_CUTS_IN, j]:
            traffic[at.T_TARGET, j] = traffic[at.T_LANE, 0]
            traffic[at.T_CUTS_IN, j] = 0.0


@helper
def _begin(k, cars, counters, settings, equipment):
    """The others decide on what they see at the start of the control step."""
    drive_kernel.begin(k, cars, counters, settings, equipment)
    first, block = k * cars.shape[2], cars[k]
    seconds = np.float64(settings[at.STEP_TIME]) * settings[at.SUBSTEPS]
    for i in range(cars_in(k, cars, counters)):
        traffic, streets = equipment[_TRAFFIC][first + i], equipment[_STREETS][first + i]
        decide(1, traffic, streets)
        half = np.float64(settings[at.BODY_HALF_LENGTH])
        _obey(_time(i, block, settings), seconds, half, streets[at.T_GRIP], traffic)


@helper
def _drive_on(i, block, counted, length, timeline, traffic, streets, settings):
    """Move the others, and car i among them by what it drove along its road; return the number of one that it meets."""
    seconds = np.float64(settings[at.STEP_TIME]) * settings[at.SUBSTEPS]
    place = np.float64(block[at.STATION, i] + block[at.ALONG, i])
    way = place - block[at.PLACE_BEFORE, i]
    way += length if way < -0.5 * length else 0.0  # a round is done
    block[at.PLACE_BEFORE, i] = place
    traffic[at.T_X, 0] += way
    block[at.LANE_END, i] -= way
    move(1, seconds, traffic, streets)
    see_traffic(i, _time(i, block, settings), block, counted, timeline, traffic, streets, settings)
    for j in range(1, traffic.shape[1]):
        if touches(j, settings[at.BODY_HALF_LENGTH], settings[at.BODY_HALF_WIDTH], traffic):
            return j
    return 0


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    """Reward and flags: errors in the lane and of the speed, contacts, the end of a lane."""
    first, block = k * cars.shape[2], cars[k]
    n, counted, told = cars_in(k, cars, counters), counters[:, first:], outcome[:, first:]
    zero, one = like(settings[0], 0.0), like(settings[0], 1.0)
    for i in range(n):
        block[at.STEP, i] += one  # the time at which the others then are
        timeline, traffic = equipment[_TIMELINES][first + i], equipment[_TRAFFIC][first + i]
        length = world[1][counted[at.ROAD, i], at.S_LENGTH]
        met = _drive_on(i, block, counted, length, timeline, traffic, equipment[_STREETS][first + i], settings)
        new, passed = block[at.ENDING, i] == zero, block[at.STOP_GAP, i] < -TOLERANCE
        block[at.ENDING, i] = CONTACT if met > 0 else (STOP_PASSED if passed else 0.0)
        block[at.AVOIDABLE, i] = zero
        if new and met > 0:
            block[at.AVOIDABLE, i] = is_avoidable(
                i, met, _time(i, block, settings), block, timeline, traffic, world[0], settings, equipment[_DRIVE]
            )
        elif new and passed:
            block[at.AVOIDABLE, i] = avoided(i, at.STOP_SIGHT, block, timeline, world[0], settings, equipment[_DRIVE])
        block[at.STEP, i] -= one
    _judge_lane(n, block, settings, told)
    _charge_speed(n, block, settings, told)
    drive_kernel.end(n, block, settings, told)


@helper
def _charge_speed(n, block, settings, outcome):
    """Add to the reward what the car is slower than its set speed, or faster than its gap allows, whichever is more."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    most = settings[at.COST_CAP] * seconds
    for i in range(n):
        speed, wish = block[at.SPEED, i], block[at.SET_SPEED, i]
        allowed = wanted_speed(wish, block[at.LEAD_GAP, i], block[at.STOP_GAP, i])
        error = max(wish - speed, speed - allowed) / settings[at.SPEED_REFERENCE]
        if outcome[at.O_COST, i] == like(seconds, 0.0):
            outcome[at.O_REWARD, i] = -min(error * error * seconds - outcome[at.O_REWARD, i], most)


@helper
def _report(k, first, last, cars, settings, outcome):
    """Copy the truth that a state decides; errors are those in the nearest lane."""
    drive_kernel.report_drive(k, first, last, cars, settings, outcome)
    for i in range(first, last):
        outcome[at.O_LATERAL_ERROR, k * cars.shape[2] + i] = cars[k, at.LANE_OFFSET, i]


@helper
def _observe(span, cars, counters, world, settings, equipment, observation):
    """As on any road, and the nearest cars ahead and behind in three lanes."""
    observe_road(span, cars, counters, world, settings, equipment, observation)
    k, first, last = span
    begin = k * cars.shape[2]
    for i in range(first, last):
        traffic, seen = equipment[_TRAFFIC][begin + i], observation[begin + i]
        column, lane = np.int64(settings[at.FIRST_NEIGHBOUR]), np.int64(cars[k, at.LANE, i])
        for side in range(-1, 2):
            front = rear = np.int64(-1)
            if 0 <= lane + side < settings[at.LANES]:
                front, rear = neighbours(np.int64(0), lane + side, traffic, equipment[_STREETS][begin + i])
            _show(front, at.FAR, side, lane, column, traffic, settings, seen)
            _show(rear, -at.FAR, side, lane, column + 3, traffic, settings, seen)
            column += 6


@helper
def _show(j, none, side, lane, column, traffic, settings, seen):
    """Write distance, speed and lane of car j, or what stands for none within sight."""
    distance, speed, its = np.float64(none), 0.0, np.float64(side)
    if j >= 0 and abs(traffic[at.T_X, j] - traffic[at.T_X, 0]) < at.FAR:
        distance = traffic[at.T_X, j] - traffic[at.T_X, 0]
        speed = clip(traffic[at.T_SPEED, j] * traffic[at.T_COSINE, j], -50.0, 50.0)
        its = clip(traffic[at.T_Y, j] / settings[at.LANE_WIDTH] - lane, -8.0, 8.0)
    seen[column], seen[column + 1], seen[column + 2] = distance, speed, its


AMONG_TRAFFIC = replace(
    drive_kernel.DRIVING,
    name="among_traffic",
    begin=_begin,
    judge=_judge,
    report=_report,
    observe=_observe,
    start=start_in_traffic,
)
