"""The way ahead of a vehicle along their lanes: where it is on it, and how it bends."""

from __future__ import annotations

import math
from collections.abc import Iterator
from copy import copy
from typing import Any, NamedTuple

import numpy as np
from highway_env.envs.lane_keeping_env import LaneKeepingEnv
from highway_env.road.lane import AbstractLane
from highway_env.vehicle.behavior import IDMVehicle

from lanekeep_env.adapters.highway.axes import Floats, turned

#: Half the way over which headings are differenced, m.
_REACH = 0.05
_ITERATIONS = 8


class Foot(NamedTuple):
    """A place against a lane, in our signs: longitudinal coordinate, lateral error (m), the lane's heading (rad)."""

    s: float
    lateral: float
    heading: float


def foot(lane: AbstractLane, place: Floats) -> Foot:
    """Return the point of a lane's middle that is nearest to a place.

    A lane's own ``local_coordinates`` are where the search begins: those of a sine are no distances.
    """
    s, _ = lane.local_coordinates(place)
    for _ in range(_ITERATIONS):
        along, across = _seen_from(lane, s, place)
        if abs(along) < 1e-9:
            break
        s += along / _metric(lane, s) / max(1.0 - turned(across) * curvature(lane, s), 0.1)
    heading = turned(float(lane.heading_at(s)))
    return Foot(float(s), turned(_seen_from(lane, s, place)[1]), heading)


def _seen_from(lane: AbstractLane, s: float, place: Floats) -> tuple[float, float]:
    x, y = place - lane.position(s, 0.0)
    heading = lane.heading_at(s)
    cosine, sine = math.cos(heading), math.sin(heading)
    return x * cosine + y * sine, y * cosine - x * sine


def _metric(lane: AbstractLane, s: float) -> float:
    """Metres of a lane's middle a metre of its longitudinal coordinate."""
    return float(np.linalg.norm(lane.position(s + _REACH, 0.0) - lane.position(s - _REACH, 0.0))) / (2.0 * _REACH)


def curvature(lane: AbstractLane, s: float) -> float:
    """Return the curvature of a lane's middle, 1/m, left positive."""
    turn = lane.heading_at(s + _REACH) - lane.heading_at(s - _REACH)
    turn = (turn + math.pi) % (2.0 * math.pi) - math.pi
    return turned(float(turn)) / (2.0 * _REACH * _metric(lane, s))


def lane_of(env: Any, vehicle: Any) -> tuple[str, str, int]:
    """Return the index of the lane that a vehicle is to follow.

    The one that the environment judges it by; else, where it has a route, the nearest one of that; else the nearest.
    """
    network = env.road.network
    if isinstance(env, LaneKeepingEnv):
        return next(index for index, lane in network.lanes_dict().items() if lane is env.lane)
    route = getattr(vehicle, "route", None)
    if route:
        on_route = [(a, b, i) for a, b, _ in route for i in range(len(network.graph[a][b]))]
        return min(on_route, key=lambda index: _distance(network, index, vehicle))
    found: tuple[str, str, int] = vehicle.lane_index
    return found


class LaneChoice:
    """Which lane a vehicle is to follow among others: highway-env's own MOBIL decides, as for its own vehicles."""

    def __init__(self, env: Any, vehicle: Any) -> None:
        self._env, self._vehicle = env, vehicle
        # Beside the road: MOBIL must not find the vehicle itself ahead of it.
        self._road = copy(env.road)
        self._driver = IDMVehicle(self._road, vehicle.position, vehicle.heading, vehicle.speed)

    def __call__(self, seconds: float) -> tuple[str, str, int]:
        """Return the lane's index, ``seconds`` after the last call."""
        driver, vehicle = self._driver, self._vehicle
        self._road.vehicles = [other for other in self._env.road.vehicles if other is not vehicle]
        driver.position, driver.heading, driver.speed = vehicle.position.copy(), vehicle.heading, vehicle.speed
        driver.on_state_update()
        driver.timer += seconds
        driver.follow_road()
        driver.change_lane_policy()
        found: tuple[str, str, int] = driver.target_lane_index
        return found


def _distance(network: Any, index: tuple[str, str, int], vehicle: Any) -> float:
    return float(network.get_lane(index).distance_with_heading(vehicle.position, vehicle.heading))


def curvatures(env: Any, vehicle: Any, index: tuple[str, str, int], s: float, spacing: float) -> Iterator[float]:
    """Yield the curvature at ``s`` of a lane and from there on each ``spacing`` m ahead, 1/m."""
    network, lane = env.road.network, env.road.network.get_lane(index)
    while True:
        yield curvature(lane, s)
        s += spacing / _metric(lane, s)
        if s > lane.length:
            place = lane.position(s, 0.0)
            following = _next(network, index, getattr(vehicle, "route", None), place)
            if following != index:
                index, lane = following, network.get_lane(following)
                s = foot(lane, place).s


def _next(network: Any, index: tuple[str, str, int], route: Any, place: Floats) -> tuple[str, str, int]:
    node = index[1]
    for begin, end, _ in route or ():
        if begin == node:
            chosen, _ = network.next_lane_given_next_road(*index, end, None, place)
            return node, end, chosen
    found: tuple[str, str, int] = network.next_lane(index, position=place)
    return found
