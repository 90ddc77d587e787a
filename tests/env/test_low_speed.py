"""Slow cars on tyres: steady circles against the closed form, and accelerations that stay a car's."""

import gymnasium as gym
import numpy as np
import pytest
from with_effect import with_effect

import lanekeep_env
from lanekeep_env import layout as at

CARS = sorted(lanekeep_env.VEHICLES)


def drawn(envs):
    """Mass, distances to the axles and stiffnesses of each car of a vector environment."""
    n = envs.num_envs
    rows = envs.unwrapped._core.cars[:, at.CAR : at.CAR + at.CAR_SIZE].transpose(1, 0, 2).reshape(at.CAR_SIZE, -1)
    front, rear, inverse_mass, _, stiff_front, stiff_rear, _, _ = rows[:, :n]
    return 1.0 / inverse_mass, front, rear, stiff_front, stiff_rear


def circle(mass, front, rear, stiff_front, stiff_rear, v, angle):
    """Yaw rate of the steady circle, r = v delta / (l + K v²), rad/s."""
    base = front + rear
    gradient = mass / base * (rear / stiff_front - front / stiff_rear)
    return v * angle / (base + gradient * v * v)


@pytest.mark.parametrize("randomisation", ["nominal", "mismatch", "stress"])
@pytest.mark.parametrize("vehicle", CARS)
def test_steady_circles_at_low_speed(vehicle, randomisation):
    corners = {**vars(lanekeep_env.RANDOMISATIONS[randomisation]), "speed": 1.0}
    cars = with_effect("lanekeep/LaneKeep-v0", {"vehicle": vehicle, "randomisation": corners})
    for v in (0.2, 0.5, 1.0, 2.0):
        envs = gym.make_vec(
            "lanekeep/LaneKeep-v0",
            num_envs=64,
            vectorization_mode="vector_entry_point",
            **cars,
            road="straight",
            speed=v,
            departure="off",
            max_steering_angle=0.1,
            observation="full",
        )
        envs.reset(seed=1)
        names = [channel.name for channel in envs.unwrapped.channels]
        for _ in range(100):
            observation = envs.step(np.full((64, 1), 0.2, np.float32))[0]
        wanted = circle(*drawn(envs), v, observation[:, names.index("steering_angle")])
        np.testing.assert_allclose(observation[:, names.index("yaw_rate")], wanted, rtol=0.01)


@pytest.mark.parametrize("vehicle", ["knightriders", "pses"])
def test_steady_circles_of_cars_between_walls(vehicle):
    corners = {**vars(lanekeep_env.RANDOMISATIONS["stress"]), "speed": 1.0}
    cars = {"vehicle": vehicle, "dynamics": "dynamic", "randomisation": corners}
    cars = with_effect("lanekeep/WallFollow-v0", cars)
    for v in (0.2, 0.5, 1.0, 2.0):
        envs = gym.make_vec(
            "lanekeep/WallFollow-v0",
            num_envs=64,
            vectorization_mode="vector_entry_point",
            **cars,
            world={"kind": "corridor", "length": 200.0, "width": 90.0},
            speed=v,
            contact="off",
            steering_offset=0.0,
            start_lateral_error=0.0,
            start_heading_error=0.0,
            max_steering_angle=0.1,
        )
        envs.reset(seed=1, options={"lateral_error": 10.0})
        names = [channel.name for channel in envs.unwrapped.channels]
        for _ in range(60):
            observation = envs.step(np.full((64, 1), 0.2, np.float32))[0]
        wanted = circle(*drawn(envs), v, observation[:, names.index("steering_angle")])
        np.testing.assert_allclose(observation[:, names.index("yaw_rate")], wanted, rtol=0.01)


@pytest.mark.parametrize("tyre", ["linear", "magic_formula", "load_sensitive"])
@pytest.mark.parametrize("vehicle", CARS)
def test_no_car_of_the_stress_set_leaves_the_region_of_stability(vehicle, tyre):
    """A slow car's tyres give no more than the steered angle asks for: C delta/m, and as much again while it swings."""
    for v in (0.0, 0.2, 1.0, 2.0):
        envs = gym.make_vec(
            "lanekeep/LaneKeep-v0",
            num_envs=64,
            vectorization_mode="vector_entry_point",
            vehicle=vehicle,
            tyre=tyre,
            randomisation="stress",
            road="straight",
            speed=v,
            departure="off",
        )
        envs.reset(seed=2)
        mass, _, _, front, rear = drawn(envs)
        rng = np.random.default_rng(3)
        for _ in range(60):
            info = envs.step(rng.uniform(-1.0, 1.0, (64, 1)).astype(np.float32))[4]
            assert (np.abs(info["lateral_acceleration"]) <= 2.0 * 0.15 * (front + rear) / mass).all()
