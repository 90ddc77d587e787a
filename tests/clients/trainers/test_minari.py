"""Minari records episodes, and builds the environment anew from what the dataset says of it."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("minari")
import minari
from minari import DataCollector


def test_a_dataset_holds_the_episodes_and_recovers_their_environment(env_id, tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = DataCollector(gym.make(env_id, control_step=0.04), record_infos=True)
    env.action_space.seed(0)
    observations, actions = [], []
    for seed in range(3):
        observations.append([env.reset(seed=seed)[0]])
        actions.append([])
        for _ in range(50):
            actions[-1].append(env.action_space.sample())
            observation, _, terminated, truncated, _ = env.step(actions[-1][-1])
            observations[-1].append(observation)
            if terminated or truncated:
                break
    env.create_dataset("lanekeep/test-v0", algorithm_name="random", num_episodes_average_score=2)
    data = minari.load_dataset("lanekeep/test-v0")
    assert len(data) == 3
    recovered = data.recover_environment()
    assert recovered.spec.id == env_id and recovered.unwrapped.scenario == env.unwrapped.scenario
    for seed, episode in enumerate(data):
        np.testing.assert_array_equal(episode.observations, observations[seed])
        np.testing.assert_array_equal(episode.actions, actions[seed])
        assert len(episode.infos["lateral_error"]) == len(observations[seed])
        again = [recovered.reset(seed=seed)[0], *(recovered.step(action)[0] for action in actions[seed])]
        np.testing.assert_array_equal(again, observations[seed])
