"""IDM and MOBIL in the kernel drive highway-env's own cars, vehicle by vehicle."""

import numpy as np
import pytest

from lanekeep_env import layout as at
from lanekeep_env.traffic.drive import drive

road_ = pytest.importorskip("highway_env.road.road")
behaviour = pytest.importorskip("highway_env.vehicle.behavior")

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


def compare(seeds):
    changes = crashes = 0
    for seed in seeds:
        lanes, road = random_state(np.random.default_rng([16, seed]))
        cars, numbers = as_arrays(lanes, road)
        before = cars[at.T_LANE].copy()
        for step in range(STEPS):
            road.act()
            road.step(SECONDS)
            drive(1, SECONDS, cars, numbers)
            targets = [car.target_lane_index[2] for car in road.vehicles]
            np.testing.assert_array_equal(cars[at.T_TARGET], targets, err_msg=f"state {seed}, step {step}")
            np.testing.assert_array_equal(cars[at.T_LANE], [car.lane_index[2] for car in road.vehicles])
            positions = np.array([car.position for car in road.vehicles]).T
            np.testing.assert_allclose(cars[:2], positions, rtol=0, atol=1e-9, err_msg=f"state {seed}, step {step}")
        np.testing.assert_array_equal(cars[at.T_CRASHED] > 0, [car.crashed for car in road.vehicles])
        changes += int((cars[at.T_LANE] != before).sum())
        crashes += int(cars[at.T_CRASHED].sum())
    return changes, crashes


def test_cars_of_highway_env_drive_the_same_way():
    changes, _ = compare(range(4))
    assert changes > 5


@pytest.mark.slow
def test_200_states_of_highway_env_drive_the_same_way():
    changes, crashes = compare(range(200))
    assert changes > 200 and crashes > 20
