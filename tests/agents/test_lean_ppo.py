"""The quicker PPO against Stable-Baselines3's own: the same gradients, but for critics that are far off."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO

from lanekeep_agents.training import lean_ppo
from lanekeep_agents.training.lean_ppo import LARGEST_ERROR, LeanPPO
from lanekeep_agents.training.normalisation import Normalised
from lanekeep_agents.training.rewards import LearnersRewards
from lanekeep_agents.vec_env import CarVecEnv

CARS, STEPS = 32, 8


def model_of(kind, env_id, **parameters):
    cars = CarVecEnv(env_id, CARS, dtype="float32", max_episode_steps=6)  # ends and starts are in it
    env = Normalised(LearnersRewards(cars, 0.8, 0.98, 1.0))
    network = {"net_arch": {"pi": [8, 8], "vf": [8, 8]}, "optimizer_kwargs": {"fused": kind is LeanPPO}}
    options = {"n_steps": STEPS, "batch_size": CARS * STEPS, "n_epochs": 1, "gamma": 0.98, **parameters}
    return kind("MlpPolicy", env, seed=3, device="cpu", policy_kwargs=network, **options)


@pytest.mark.parametrize("env_id", ("lanekeep/LaneKeep-v0", "lanekeep/Drive-v0"))  # one number an action, and two
def test_a_step_is_that_of_stable_baselines3(env_id, monkeypatch):
    """One step over a whole rollout, where it normalises advantages alike, with any error of the critic let through."""
    monkeypatch.setattr(lean_ppo, "LARGEST_ERROR", 1e9)
    parameters = {"ent_coef": 0.01, "max_grad_norm": 0.5, "gae_lambda": 0.9, "learning_rate": 1e-3}
    lean, plain = (model_of(kind, env_id, **parameters).learn(CARS * STEPS) for kind in (LeanPPO, PPO))
    assert lean.num_timesteps == plain.num_timesteps and lean._n_updates == plain._n_updates
    for name, found in lean.policy.named_parameters():
        wanted = dict(plain.policy.named_parameters())[name]
        torch.testing.assert_close(found.grad, wanted.grad, rtol=1e-4, atol=1e-6)


def test_ratios_are_clipped_and_far_errors_of_the_critic_pull_as_much_as_near_ones():
    """The derivatives by the last biases, against those written out."""
    model = model_of(LeanPPO, "lanekeep/LaneKeep-v0")
    policy, draw = model.policy, torch.Generator().manual_seed(0)
    observations = torch.randn((500, *model.observation_space.shape), generator=draw)
    actions = torch.randn((500, 1), generator=draw)
    with torch.no_grad():
        values, before, _ = policy.evaluate_actions(observations, actions)
        mean = policy.get_distribution(observations).distribution.mean[:, 0]
    old = before + 0.5 * torch.randn(500, generator=draw)
    advantages = torch.randn(500, generator=draw)
    returns = values[:, 0] + 5.0 * torch.randn(500, generator=draw)
    model._loss(0.2, observations, actions, old, advantages, returns).backward()
    errors = (values[:, 0] - returns).numpy()
    pull = np.clip(errors, -LARGEST_ERROR, LARGEST_ERROR)
    assert (np.abs(errors) > LARGEST_ERROR).mean() > 0.5
    assert policy.value_net.bias.grad.item() == pytest.approx(2.0 * model.vf_coef * pull.mean(), rel=1e-4)
    ratio, gain = np.exp((before - old).numpy()), advantages.numpy()
    counts = ~(((ratio > 1.2) & (gain > 0.0)) | ((ratio < 0.8) & (gain < 0.0)))
    by_mean = ratio * (actions[:, 0] - mean).numpy()  # the standard deviation is 1 at first
    assert 0.1 < counts.mean() < 0.9
    assert policy.action_net.bias.grad.item() == pytest.approx(-(counts * gain * by_mean).mean(), rel=1e-4)
