"""What a driver adds to cars on roads: who steers, who overrides whom, and what that costs.

The driver decides where the car is observed, and holds the angle for the control step to come. The first action is the
assistant's angle, the second its authority a: the actuator is told driver + a (assistant - driver).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.families.road.kernel import ON_ROADS
from lanekeep_env.families.road.segments import curvature_ahead
from lanekeep_env.families.road.start import start_on_road
from lanekeep_env.physics.numeric import clip, larger, like, smaller
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.scenario import driver as of
from lanekeep_env.sensing.measure import normal
from lanekeep_env.tasks.driver import wanted_angle
from lanekeep_env.tasks.lane_keeping import judge

#: Behind the equipment of roads come the driver's numbers.
_DRIVER = 6
#: Counter of the first key of a driver's step; numbers of its draws: a normal one takes two.
_FIRST_STEP = np.int64(1 << 34)
_WANDER, _LAPSE, _LENGTH = np.int64(0), np.int64(2), np.int64(3)

_on_roads_report, _on_roads_observe = ON_ROADS.report, ON_ROADS.observe


@helper
def _drive(i, block, counted, road, driver):
    """Let the driver of car i look, or not, and turn the wheel."""
    episode = derive(np.uint64(counted[at.KEY, i]), counted[at.EPISODE, i])
    key = derive(episode, _FIRST_STEP + np.int64(block[at.STEP, i]))
    spread, keeps = driver[of.WANDER], driver[of.KEEPS]
    block[at.AIM, i] = keeps * block[at.AIM, i] + spread * np.sqrt(1.0 - keeps * keeps) * normal(key, _WANDER)
    if block[at.LAPSE, i] > 0.0:
        block[at.LAPSE, i] -= like(block[0, 0], 1.0)
    elif uniform(key, _LAPSE) < driver[of.LAPSES]:
        low, high = driver[of.SHORTEST], driver[of.LONGEST]
        block[at.LAPSE, i] = np.floor(low + (high - low) * uniform(key, _LENGTH) + 0.5)
    if block[at.LAPSE, i] > 0.0:
        return
    v = np.float64(block[at.SPEED, i])
    wanted = wanted_angle(
        np.float64(block[at.LATERAL, i] - block[at.AIM, i]),
        np.float64(block[at.HEADING, i] + block[at.SIDESLIP, i]),
        np.float64(
            curvature_ahead(i, block[at.SPEED, i] * like(block[0, 0], driver[of.PREVIEW]), block, counted, road)
        ),
        v,
        driver[of.LATERAL],
        driver[of.COURSE],
        driver[of.ANGLE],
        driver[of.ANGLE_GROWTH],
    )
    block[at.DRIVER, i] += driver[of.SHARE] * (wanted - block[at.DRIVER, i])


@helper
def _act(k, cars, counters, settings, equipment):
    """Mix what driver and assistant ask for; count interventions and how they begin and end."""
    block, limit = cars[k], settings[at.COMMAND_LIMIT]
    zero, one = like(limit, 0.0), like(limit, 1.0)
    for i in range(cars_in(k, cars, counters)):
        authority, before = block[at.AUTHORITY, i], block[at.AUTHORITY_BEFORE, i]
        driver = clip(block[at.DRIVER, i], -limit, limit)
        assistance = authority * (block[at.COMMAND, i] - driver)
        jump = abs(assistance - block[at.ASSISTANCE, i])
        block[at.HANDOVER, i] = larger(block[at.HANDOVER, i], zero if authority == before else jump)
        block[at.INTERVENTIONS, i] += one if authority > zero and before == zero else zero
        block[at.ASSISTANCE, i] = assistance
        block[at.AUTHORITY_BEFORE, i] = authority
        block[at.SERVO, i] = driver + assistance


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    """Assistance costs, and the lane's edge; where in the lane the driver drives does not."""
    first = k * cars.shape[2]
    n = cars_in(k, cars, counters)
    block, told = cars[k], outcome[:, first : first + n]
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    horizon = settings[at.HORIZON]
    last_step = smaller(horizon, settings[at.MAX_STEPS])
    ends, ignores = settings[at.DEPARTURE] == at.TERMINATE, settings[at.DEPARTURE] == at.OFF
    zero, one, free = like(seconds, 0.0), like(seconds, 1.0), like(seconds, np.inf)
    for i in range(n):
        block[at.STEP, i] += one
        reward, outside, terminated = judge(
            block[at.LATERAL, i],
            block[at.ASSISTANCE, i],
            horizon - block[at.STEP, i],
            seconds,
            settings[at.HALF_LANE],
            free,
            settings[at.COST_WEIGHT],
            settings[at.COST_RATE],
            settings[at.COST_CAP],
            ends,
            ignores,
        )
        block[at.DEPARTED, i] = one if outside > zero else block[at.DEPARTED, i]
        told[at.O_REWARD, i] = reward
        told[at.O_TERMINATED, i] = terminated
        told[at.O_TRUNCATED, i] = one if block[at.STEP, i] >= last_step else zero
        told[at.O_STEERING_RATE, i] = (block[at.STEER, i] - block[at.STEER_BEFORE, i]) / seconds
        told[at.O_COST, i] = outside


@helper
def _report(k, first, last, cars, settings, outcome):
    _on_roads_report(k, first, last, cars, settings, outcome)
    block, told = cars[k], outcome[:, k * cars.shape[2] :]
    for i in range(first, last):
        told[at.O_INTERVENTIONS, i] = block[at.INTERVENTIONS, i]
        told[at.O_AUTHORITY, i] = block[at.AUTHORITY_BEFORE, i]
        told[at.O_ASSISTANCE, i] = block[at.ASSISTANCE, i]
        told[at.O_HANDOVER, i] = block[at.HANDOVER, i]


@helper
def _observe(span, cars, counters, world, settings, equipment, observation):
    k, first, last = span
    counted = counters[:, k * cars.shape[2] :]
    for i in range(first, last):
        if cars[k, at.STEP, i] > like(settings[0], 0.0):
            _drive(i, cars[k], counted, world[0], equipment[_DRIVER])
    _on_roads_observe(span, cars, counters, world, settings, equipment, observation)


@helper
def _start(place, wanted, cars, counters, world, settings, equipment):
    """Start in steady driving; the driver holds the wheel that this asks for, the assistant nothing."""
    start_on_road(place, wanted, cars, counters, world, settings, equipment)
    k, i = place
    block, zero = cars[k], like(settings[0], 0.0)
    for row in (at.COMMAND, at.AUTHORITY, at.AUTHORITY_BEFORE, at.ASSISTANCE, at.LAPSE, at.INTERVENTIONS, at.HANDOVER):
        block[row, i] = zero
    for row in (at.DRIVER, at.SERVO):
        block[row, i] = block[at.STEER, i]
    column = k * cars.shape[2] + i
    episode = derive(np.uint64(counters[at.KEY, column]), counters[at.EPISODE, column])
    block[at.AIM, i] = equipment[_DRIVER][of.WANDER] * normal(derive(episode, _FIRST_STEP), _WANDER)


WITH_DRIVER = replace(
    ON_ROADS,
    name="with_driver",
    command_row=at.SERVO,
    outcome_rows=at.SUPPORT_OUTCOME_ROWS,
    act=_act,
    judge=_judge,
    report=_report,
    observe=_observe,
    start=_start,
)
