"""What guidance adds to cars on roads: set points for the distance from the edge, and plans of the road with errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.engine.episode import cars_in
from lanekeep_env.families.road.kernel import ON_ROADS
from lanekeep_env.families.road.start import start_on_road
from lanekeep_env.physics.numeric import clip, like
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.scenario import guidance as of
from lanekeep_env.tasks.lane_keeping import running_cost

#: Behind the equipment of roads come the numbers of the guidance, the bends and their index.
_NUMBERS, _BENDS, _INDEX = 6, 7, 8
#: Counters of an episode's draws, one an error, and of the first set point; one a control step from there.
_FIRST_ERROR, _FIRST_SET_POINT = np.int64(90), np.int64(1 << 35)

_on_roads_begin, _on_roads_judge, _on_roads_observe = ON_ROADS.begin, ON_ROADS.judge, ON_ROADS.observe


@helper
def _draw(key, which, numbers):
    """Draw the number whose bounds are at ``which``."""
    return numbers[which] + (numbers[which + 1] - numbers[which]) * uniform(key, _FIRST_ERROR + np.int64(which))


@helper
def _set_point(i, key, step, block, numbers):
    """Draw the set point that holds from control step ``step`` of the episode ``key`` on."""
    low, high = numbers[of.SET_LOW], numbers[of.SET_HIGH]
    block[at.SET_POINT, i] = low + (high - low) * uniform(derive(key, _FIRST_SET_POINT + step), np.int64(0))


@helper
def _aim(i, block, settings, numbers):
    """Where the set point is, m left of the lane's centre; the lane is as wide as the edges are apart."""
    return like(settings[0], numbers[of.SIDE]) * (block[at.SET_POINT, i] - settings[at.HALF_LANE])


@helper
def _begin(k, cars, counters, settings, equipment):
    _on_roads_begin(k, cars, counters, settings, equipment)
    first, block, numbers = k * cars.shape[2], cars[k], equipment[_NUMBERS]
    for i in range(cars_in(k, cars, counters)):
        step = np.float64(block[at.STEP, i])
        if step > 0.0 and step % numbers[of.HOLD] == 0.0:
            key = derive(np.uint64(counters[at.KEY, first + i]), counters[at.EPISODE, first + i])
            _set_point(i, key, np.int64(step), block, numbers)


@helper
def _judge(k, cars, counters, world, settings, equipment, outcome):
    """The lane's edge as ever; the running cost counts from the set point."""
    _on_roads_judge(k, cars, counters, world, settings, equipment, outcome)
    first, block = k * cars.shape[2], cars[k]
    told = outcome[:, first:]
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    for i in range(cars_in(k, cars, counters)):
        if told[at.O_COST, i] == like(seconds, 0.0):
            cost = running_cost(
                block[at.LATERAL, i] - _aim(i, block, settings, equipment[_NUMBERS]),
                told[at.O_STEERING_RATE, i],
                settings[at.COST_LATERAL],
                settings[at.COST_WEIGHT],
                settings[at.COST_RATE],
                settings[at.COST_CAP],
            )
            told[at.O_REWARD, i] = -cost * seconds


@helper
def _curvature(station, road, first, count):
    """Curvature of the road whose segments are ``first`` to ``first + count``, 1/m."""
    low, high = first, first + count
    while high - low > 1:
        middle = (low + high) // 2
        if road[middle, at.R_STATION] <= station:
            low = middle
        else:
            high = middle
    return road[low, at.R_CURVATURE] + road[low, at.R_CURVATURE_SLOPE] * (station - road[low, at.R_STATION])


@helper
def _plan(i, block, counted, world, settings, equipment, observation):
    """Write the curvature that the plan has ahead of car i: bends begin elsewhere, are wider, longer, or not known."""
    (road, roads), numbers, bends, index = world, equipment[_NUMBERS], equipment[_BENDS], equipment[_INDEX]
    key = derive(np.uint64(counted[at.KEY, i]), counted[at.EPISODE, i])
    offset, radius = _draw(key, of.OFFSET, numbers), 1.0 + _draw(key, of.RADIUS, numbers)
    longer = radius * (1.0 + _draw(key, of.ANGLE, numbers))
    recognised = _draw(key, of.RECOGNISED, numbers)
    which = counted[at.ROAD, i]
    first, count = np.int64(roads[which, at.S_FIRST]), np.int64(roads[which, at.S_COUNT])
    here = np.float64(block[at.STATION, i]) + np.float64(block[at.ALONG, i])
    column = np.int64(settings[at.FIRST_PREVIEW])
    place = at.CHANNELS + 2 * column
    low, high = settings[place], settings[place + 1]
    for sample in range(np.int64(settings[at.PREVIEW])):
        station = here + sample * np.float64(settings[at.PREVIEW_DISTANCE]) - offset
        kappa = 0.0
        for bend in range(index[which, 0], index[which, 0] + index[which, 1]):
            along = station - bends[bend, 0]
            if 0.0 <= along < longer * bends[bend, 1] and bends[bend, 0] - here <= recognised:
                kappa = _curvature(bends[bend, 0] + along / longer, road, first, count) / radius
        observation[i, column + sample] = clip(like(low, kappa), low, high)


@helper
def _observe(span, cars, counters, world, settings, equipment, observation):
    _on_roads_observe(span, cars, counters, world, settings, equipment, observation)
    k, first, last = span
    begin = k * cars.shape[2]
    for i in range(first, last):
        _plan(i, cars[k], counters[:, begin:], world, settings, equipment, observation[begin:])


@helper
def _start(place, wanted, cars, counters, world, settings, equipment):
    start_on_road(place, wanted, cars, counters, world, settings, equipment)
    k, i = place
    column = k * cars.shape[2] + i
    key = derive(np.uint64(counters[at.KEY, column]), counters[at.EPISODE, column])
    _set_point(i, key, np.int64(0), cars[k], equipment[_NUMBERS])


GUIDED = replace(ON_ROADS, name="guided", begin=_begin, judge=_judge, observe=_observe, start=_start)
