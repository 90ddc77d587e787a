"""TorchRL collects on single environments by their ids, and on the vector environment."""

from __future__ import annotations

import gymnasium as gym
import pytest

pytest.importorskip("torchrl")
import torch
from torchrl.envs import GymEnv, GymWrapper, check_env_specs


def test_an_id_is_taken_as_it_is(env_id):
    env = GymEnv(env_id, device="cpu")
    check_env_specs(env)
    driven = env.rollout(100)
    assert torch.isfinite(driven["next", "observation"]).all() and (driven["next", "reward"] <= 0.0).all()


@pytest.mark.parametrize("mode", ["same_step", "disabled"])  # TorchRL refuses Gymnasium's default, next_step
def test_cars_of_the_vector_environment_begin_anew(env_id, mode):
    env = GymWrapper(gym.make_vec(env_id, 4, autoreset_mode=mode, max_episode_steps=20))
    assert env.batch_size == (4,)
    check_env_specs(env)
    driven = env.rollout(65, break_when_any_done=False)
    assert driven.shape == (4, 65)
    assert (driven["next", "done"].sum(1) >= 3).all()
    assert torch.isfinite(driven["next", "observation"]).all()
