"""`werling-lateral-predictor` behind a lag of 50 ms and a delay of 100 ms, in the environment, up to motorway speed."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_env import EvasiveScenario, LaneKeepScenario

LAG, DELAY, STEP = 0.05, 0.1, 0.02
LATE = {"base": "passat", "steering": {"lag": LAG, "delay": DELAY, "angle_limit": 0.6}}


def errors(name: str, speed: float, road, cars: int = 1, seconds: float = 8.0, start: float = 0.0, step=STEP, **car):
    """Return lateral errors from the shifted reference of the law, m, (steps, cars), from t = 0 on."""
    steps = round(seconds / step)
    env = gym.make_vec(
        "lanekeep/LaneKeep-v0",
        cars,
        "vector_entry_point",
        vehicle={**LATE, **car},
        tyre="magic_formula",
        road=road,
        speed=speed,
        preview=11,
        observation="full",
        control_step=step,
        max_steering_angle=0.5,
        departure="off",
        start_course_error=0.0,
        episode_steps=steps + 1,
        autoreset_mode="disabled",
    )
    scenario = env.unwrapped.scenario
    policy = lanekeep_baselines.make(name, scenario)
    columns = [channel.name for channel in scenario.channels]
    lateral, bend = columns.index("lateral_error"), columns.index("curvature")
    observation, _ = env.reset(seed=0, options={"lateral_error": start})
    state, found = None, []
    for _ in range(steps):
        found.append(observation[:, lateral] + 0.5 * 1.51**2 * observation[:, bend])
        action, state = policy.predict(observation, state)
        observation = env.step(action)[0]
    return np.array(found)


def winding(speed: float):
    """Random clothoid roads of up to 0.4 g."""
    return {
        "kind": "random",
        "count": 12,
        "length": 60.0 * speed,
        "peak_curvature": 0.4 * 9.81 / speed**2,
        "design_speed": speed,
    }


@pytest.mark.parametrize("speed", [25.0, 35.0])
def test_it_keeps_the_lane_where_the_law_without_it_is_lost(speed: float) -> None:
    """On the same roads and cars: centimetres against off the car."""
    assert np.abs(errors("werling-lateral", speed, winding(speed), 12)).max() > 1.0
    assert np.abs(errors("werling-lateral-predictor", speed, winding(speed), 12)).max() < 0.02


@pytest.mark.parametrize("speed", [5.0, 15.0, 25.0, 35.0])
@pytest.mark.parametrize("step", [0.02, 0.05])
def test_an_error_decays_as_designed_from_when_the_steering_answers_on(speed: float, step: float) -> None:
    """d'' + 2 omega d' + omega² d = 0 with omega = 1 1/s, late by delay, lag and half a control step: within 2 %."""
    d = errors("werling-lateral-predictor", speed, "straight", start=0.8, step=step)[:, 0]
    time = np.maximum(step * np.arange(len(d)) - DELAY - LAG - 0.5 * step, 0.0)
    assert np.abs(d - 0.8 * (1.0 + time) * np.exp(-time)).max() < 0.016


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_a_car_of_another_mass_stays_stable(factor: float) -> None:
    """On a straight a wrong mass costs nothing in the end; the policy knows the nominal car alone."""
    nominal = lanekeep_baselines.make("werling-lateral-predictor", EvasiveScenario(vehicle=LATE))
    assert nominal.memory == 5
    d = errors("werling-lateral-predictor", 35.0, "straight", seconds=12.0, start=0.8, mass=factor * 1950.0)
    assert np.abs(d[-100:]).max() < 0.002


def test_commands_on_their_way_are_forgotten_where_an_episode_starts() -> None:
    scenario = EvasiveScenario(vehicle=LATE)
    policy = lanekeep_baselines.make("werling-lateral-predictor", scenario)
    seen = np.zeros((3, len(scenario.channels)), dtype=np.float32)
    seen[:, [channel.name for channel in scenario.channels].index("speed")] = 30.0
    seen[:, 0] = 0.5
    once, queue = policy.predict(seen)
    queued = queue + 0.1
    again, _ = policy.predict(seen, queued, [True, False, True])
    np.testing.assert_array_equal(again[[0, 2]], once[[0, 2]])
    assert again[1, 0] < once[1, 0]  # the car is on its way to the left already


def test_the_command_that_entered_counts_and_not_the_one_asked_for() -> None:
    scenario = LaneKeepScenario(vehicle=LATE, observation="full", preview=1, control_step=STEP)
    policy = lanekeep_baselines.make("werling-lateral-predictor", scenario)
    names = [channel.name for channel in scenario.channels]
    seen = np.zeros(len(names), dtype=np.float32)
    seen[names.index("speed")], seen[names.index("steering_command")] = 30.0, 0.07
    _, queue = policy.predict(seen)
    np.testing.assert_array_equal(queue, [0.0, 0.0, 0.0, 0.0, np.float32(0.07)])
