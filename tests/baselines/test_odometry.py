"""Odometry of a car between walls, against the truth of the simulated car under random commands."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_baselines.odometry import Odometer, ramp

WORLD = {"kind": "circuit", "length": 400.0, "width": 400.0, "corridor": 100.0}
CARS, STEPS = 16, 400
TICK = 2.0 * np.pi * 0.033 / 40


def drive(**keywords: Any) -> dict[str, np.ndarray]:
    """Drive by random commands, some backwards; truth, readings and estimates over time, (steps, cars) each."""
    env = gym.make_vec("lanekeep/Circuit-v0", CARS, "vector_entry_point", world=WORLD, scan="none", **keywords)
    scenario, rng = env.unwrapped.scenario, np.random.default_rng(5)
    odometer, memory = Odometer(scenario), np.zeros((CARS, Odometer.memory))
    names = [channel.name for channel in scenario.channels]
    observation, info = env.reset(seed=5)
    told: dict[str, list[Any]] = {"true": [], "read": [], "speed": [], "mean": [], "pose": []}
    action = np.zeros((CARS, 2), dtype=np.float32)
    for step in range(STEPS):
        at = dict(zip(names, observation.astype(np.float64).T, strict=True))
        speed, mean, memory = odometer.update(at, memory, step == 0)
        poses = [env.unwrapped._core.pose(car) for car in range(CARS)]
        for name, value in (
            ("true", info["speed"].copy()),
            ("read", at["speed"]),
            ("speed", speed),
            ("mean", mean),
            ("pose", [(pose.x, pose.y, pose.heading) for pose in poses]),
        ):
            told[name].append(value)
        new = rng.random(CARS) < 0.2
        action[new] = rng.uniform(-1.0, 1.0, (new.sum(), 2))
        observation, _, _, _, info = env.step(action)
    env.close()
    back, step = scenario.vehicle.cg_to_rear_axle, scenario.control_step
    run = {name: np.array(values) for name, values in told.items()}
    x, y, heading = run["pose"][..., 0], run["pose"][..., 1], np.unwrap(run["pose"][..., 2], axis=0)
    dx, dy = np.diff(x - back * np.cos(heading), axis=0), np.diff(y - back * np.sin(heading), axis=0)
    middle = heading[:-1] + 0.5 * np.diff(heading, axis=0)
    return {**run, "ways": dx * np.cos(middle) + dy * np.sin(middle), "own": run["mean"][1:] * step}


@pytest.mark.parametrize("faults", [{}, {"encoder_ticks": 40}, {"encoder_ticks": 40, "encoder_direction": False}])
def test_speed_and_way_are_those_of_the_car(faults: dict[str, Any]) -> None:
    run = drive(**faults)
    if not faults:
        np.testing.assert_allclose(run["speed"], run["true"], atol=1e-5)
    else:  # far nearer than what is read, though that is the mean speed of the step, which is told backwards as well
        error, raw = (np.abs(np.abs(run[name]) - np.abs(run["true"])).mean() for name in ("speed", "read"))
        assert error < 0.4 * raw
        assert np.abs(run["speed"] - run["true"]).max() < TICK / 0.045
    assert np.abs(np.cumsum(run["ways"] - run["own"], axis=0)).max() < 0.01 + 2.0 * TICK


def test_a_ramp_ends_at_its_target_or_as_far_as_it_comes() -> None:
    rng = np.random.default_rng(1)
    before, target = rng.uniform(-1.0, 1.0, (2, 1000))
    after, mean = ramp(before, target, 0.3)
    share = np.linspace(0.0, 1.0, 20001)[:, None]
    fine = before + np.clip(target - before, -0.3 * share, 0.3 * share)
    np.testing.assert_allclose(after, fine[-1])
    np.testing.assert_allclose(mean, 0.5 * (fine[1:] + fine[:-1]).mean(axis=0), atol=1e-6)
