"""Other people's training code, unmodified, on the environments: plain Gymnasium, and Stable-Baselines3 alone."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

import lanekeep_env  # noqa: F401  (registers the environments)


@pytest.fixture(scope="module")
def cleanrl():
    torch.set_num_threads(1)
    spec = importlib.util.spec_from_file_location("cleanrl_ppo", Path(__file__).parent / "cleanrl_ppo.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_ppo_on_plain_gymnasium_learns_to_stay_in_the_lane(cleanrl):
    """Episodes of 5 s: the cost falls to less than half of what it was at first."""
    envs = cleanrl.make_envs("lanekeep/LaneKeep-v0", 32, 0.98, "vector_entry_point", max_episode_steps=100)
    _, returns = cleanrl.train(envs, updates=15, num_steps=64)
    assert all(len(ended) >= 10 for ended in returns)
    assert np.mean(np.concatenate(returns[-3:])) > 0.5 * np.mean(returns[0])


def test_ppo_on_plain_gymnasium_runs_on_single_environments(cleanrl):
    envs = cleanrl.make_envs("lanekeep/LaneKeep-v0", 4, 0.98, "sync", max_episode_steps=50)
    agent, returns = cleanrl.train(envs, updates=2, num_steps=60)
    fresh = cleanrl.Agent(envs, -1.0).state_dict()
    assert all(torch.isfinite(tensor).all() for tensor in agent.state_dict().values())
    assert not torch.equal(agent.state_dict()["actor_logstd"], fresh["actor_logstd"])
    assert sum(map(len, returns)) >= 4 and np.isfinite(np.concatenate(returns)).all()


@pytest.mark.parametrize(
    ("kind", "cars", "env_id"),
    [
        (DummyVecEnv, 4, "lanekeep/LaneKeep-v0"),
        (SubprocVecEnv, 2, "lanekeep_env:lanekeep/LaneKeep-v0"),  # its processes import nothing by themselves
    ],
)
def test_stable_baselines3_trains_on_its_own_vector_environments(kind, cars, env_id):
    torch.set_num_threads(1)
    envs = make_vec_env(env_id, cars, seed=0, vec_env_cls=kind)
    try:
        model = PPO("MlpPolicy", envs, n_steps=64, batch_size=64, n_epochs=2, seed=0, device="cpu")
        before = {name: tensor.clone() for name, tensor in model.policy.state_dict().items()}
        model.learn(512)
        assert model.num_timesteps == 512
        after = model.policy.state_dict()
        assert all(torch.isfinite(tensor).all() for tensor in after.values())
        assert not torch.equal(after["action_net.weight"], before["action_net.weight"])
        episodes = [(episode["r"], episode["l"]) for episode in model.ep_info_buffer]
        assert episodes and all(0 < length <= 600 and total < 0.0 for total, length in episodes)
        mean, _ = evaluate_policy(model, envs, n_eval_episodes=4)
        assert -600 * 16.0 * 0.05 <= mean < 0.0  # the cap, 16 a second, is the most that 30 s can cost
    finally:
        envs.close()
