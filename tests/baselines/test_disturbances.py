"""Who holds the lane's centre against a steady disturbance: designs that estimate what disturbs the car."""

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines

DISTURBED = {
    "bank": {"bank": 0.05},
    "crosswind": {"crosswind": -10.0},
    "steering-offset": {"randomisation": {"steering_offset": 0.005}},
    "both": {"bank": -0.03, "crosswind": 8.0, "randomisation": {"steering_offset": -0.003, "steering_gain": 0.8}},
}


def steady_error(name, **keywords):
    """Lateral error after 40 s on a straight at 25 m/s, m; the policy is told of a car that nothing disturbs."""
    steady = {"road": "straight", "speed": 25.0, "preview": 20, "departure": "off", "episode_steps": 801}
    env = gym.make("lanekeep/LaneKeep-v0", **steady, **keywords)
    policy = lanekeep_baselines.make(name, gym.make("lanekeep/LaneKeep-v0", **steady).unwrapped.scenario)
    (observation, info), state = env.reset(seed=1), None
    errors = []
    for step in range(800):
        action, state = policy.predict(observation[None], state, np.array([step == 0]))
        observation, *_, info = env.step(action[0])
        errors.append(info["lateral_error"])
    assert np.ptp(errors[-100:]) < 1e-4
    return errors[-1]


@pytest.mark.parametrize("disturbance", DISTURBED)
def test_the_trimmed_design_has_no_steady_error(disturbance):
    assert abs(steady_error("lq-preview-trimmed", **DISTURBED[disturbance])) < 1e-4


def test_slip_offsets_stand_for_what_pushes_the_car_and_not_for_a_faulty_steering():
    assert abs(steady_error("lq-preview-offset-free", bank=0.05, crosswind=-8.0)) < 1e-4
    assert abs(steady_error("lq-preview-offset-free", **DISTURBED["steering-offset"])) > 0.02


@pytest.mark.parametrize("name", ["lq-preview", "mpc-preview", "stanley"])
def test_designs_without_have_one(name):
    """The other way round on the other bank, to the last digits of a channel."""
    left, right = (steady_error(name, bank=sign * 0.05) for sign in (1.0, -1.0))
    assert abs(left) > 0.02 and left + right == pytest.approx(0.0, abs=1e-4)
    assert left < 0.0  # left side up: the car hangs to the right
