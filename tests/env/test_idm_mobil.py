"""IDM and MOBIL in the kernel drive highway-env's own cars, vehicle by vehicle."""

import math

import numpy as np
import pytest

from lanekeep_env import layout as at
from lanekeep_env.traffic.drive import drive

road_ = pytest.importorskip("highway_env.road.road")
behaviour = pytest.importorskip("highway_env.vehicle.behavior")


class OfTheSystem:
    """NumPy, with the system's elementary functions.

    NumPy has its own where the processor is new enough, which differ in the last bit. At a standstill the law of
    steering multiplies that by up to 140 a step, whoever computes it.
    """

    sin, cos, tan, arcsin, arctan = (staticmethod(f) for f in (math.sin, math.cos, math.tan, math.asin, math.atan))
    power = staticmethod(math.pow)

    def __getattr__(self, name):
        return getattr(np, name)


@pytest.fixture(autouse=True)
def same_elementary_functions(monkeypatch):
    for name in ("behavior", "controller", "kinematics", "objects"):
        monkeypatch.setattr(f"highway_env.vehicle.{name}.np", OfTheSystem())


STEPS, SECONDS = 450, 1 / 15  # 30 s of highway-env's own step


def random_state(rng):
    """Cars somewhere on one to five lanes, sparse to jammed; a tenth of the states has some that overlap."""
    lanes, count = int(rng.integers(1, 6)), int(rng.integers(2, 31))
    spacing = rng.uniform(3.0 if rng.random() < 0.1 else 9.0, 60.0)
    network = road_.RoadNetwork.straight_road_network(lanes, speed_limit=30)
    road = road_.Road(network=network, np_random=np.random.RandomState(int(rng.integers(1 << 30))))
    along = np.zeros(lanes)
    for _ in range(count):
        lane = int(rng.integers(lanes))
        along[lane] += spacing * rng.uniform(0.7, 1.5)
        where = network.get_lane(("0", "1", lane)).position(10.0 + along[lane], rng.normal(0.0, 0.3))
        car = behaviour.IDMVehicle(road, where, rng.normal(0.0, 0.02), rng.uniform(0.0, 35.0))
        car.target_speed = rng.uniform(10.0, 38.0)
        car.randomize_behavior()
        road.vehicles.append(car)
    return lanes, road


def as_arrays(lanes, road):
    cars = np.zeros((at.T_ROWS, len(road.vehicles)))
    for j, car in enumerate(road.vehicles):
        cars[[at.T_X, at.T_Y], j] = car.position
        cars[[at.T_HEADING, at.T_SPEED, at.T_TIMER], j] = car.heading, car.speed, car.timer
        cars[[at.T_LANE, at.T_TARGET], j] = car.lane_index[2], car.target_lane_index[2]
        cars[[at.T_WISH, at.T_EXPONENT], j] = car.target_speed, car.DELTA
    numbers = np.zeros(at.T_ROAD_SIZE)
    numbers[[at.T_LANES, at.T_LANE_WIDTH, at.T_SPEED_LIMIT, at.T_GRIP]] = lanes, 4.0, 30.0, np.inf
    return cars, numbers


def differences(seed):
    """Drive one state in both; return the worst difference of a position (m), lane changes and contacts.

    Behind a contact that is the worst of the second after it: their matrix products round as the processor likes, and
    at a standstill the last bit grows. Lanes and contacts are the same to the end.
    """
    lanes, road = random_state(np.random.default_rng([16, seed]))
    cars, numbers = as_arrays(lanes, road)
    worst, changes, until, lane = 0.0, 0, STEPS, cars[at.T_LANE].copy()
    for step in range(STEPS):
        road.act()
        road.step(SECONDS)
        drive(1, SECONDS, cars, numbers)
        np.testing.assert_array_equal(cars[at.T_TARGET], [car.target_lane_index[2] for car in road.vehicles])
        np.testing.assert_array_equal(cars[at.T_LANE], [car.lane_index[2] for car in road.vehicles])
        crashed = np.array([car.crashed for car in road.vehicles])
        np.testing.assert_array_equal(cars[at.T_CRASHED] > 0, crashed)
        until = min(until, step + 15) if crashed.any() else until
        if step <= until:
            positions = np.array([car.position for car in road.vehicles]).T
            worst = max(worst, np.abs(cars[[at.T_X, at.T_Y]] - positions).max())
        changes += int((cars[at.T_LANE] != lane).sum())
        lane = cars[at.T_LANE].copy()
    return worst, changes, int(crashed.sum())


def compare(count):
    """Compare states until so many of them are without a contact; return lane changes and contacts."""
    free, total, seed = 0, np.zeros(2, dtype=int), 0
    while free < count:
        worst, *happened = differences(seed)
        assert worst < 1e-9, f"state {seed}"
        free, total, seed = free + (happened[1] == 0), total + happened, seed + 1
    return total


def test_cars_of_highway_env_drive_the_same_way():
    changes, contacts = compare(2)
    assert changes > 5 and contacts > 5


@pytest.mark.slow
def test_200_states_of_highway_env_drive_the_same_way():
    changes, contacts = compare(200)
    assert changes > 500 and contacts > 500
