"""The policies in `lanekeep/LaneKeep-v0`: the ones made for curves never leave the lane."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_env  # noqa: F401  (registers the environments)


@pytest.mark.parametrize(
    "name", ["yin-lqr-observer", "yin-lqr-feedforward", "lq-preview", "lq-preview-offset-free", "lqg"]
)
@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"road": {"kind": "yin"}},
        {"vehicle": "commonroad-3"},
        {"dynamics": "kinematic"},
        {"action": "steering_rate"},
    ],
    ids=str,
)
def test_no_departure_in_an_episode(name: str, settings: dict) -> None:
    envs = gym.make_vec("lanekeep/LaneKeep-v0", num_envs=16, preview=12, **settings)
    policy = lanekeep_baselines.make(name, envs.unwrapped.scenario)
    observation, _ = envs.reset(seed=0)
    state, start = None, np.ones(16, dtype=bool)
    for _ in range(600):
        action, state = policy.predict(observation, state, start)
        observation, _, terminated, truncated, _ = envs.step(action)
        assert not terminated.any()
        start = terminated | truncated
    envs.close()
