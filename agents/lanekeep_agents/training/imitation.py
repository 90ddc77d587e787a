"""Behaviour cloning: a warm start from a classical controller."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecNormalize

from lanekeep_agents.training.checkpoint import statistics_of

#: Steps of every car, epochs over them, rows of a batch, learning rate.
STEPS, EPOCHS, BATCH, RATE = 400, 20, 256, 3e-3
#: Largest standard deviation of the noise on the actions driven: the teacher shows how it recovers.
NOISE = 0.3


def imitate(model: BaseAlgorithm, env: VecNormalize, teacher: Any, gamma: float, seed: int) -> None:
    """Fit the actor (and PPO's critic) of a fresh model to a classical controller, and set the normalisation.

    The teacher drives ``env`` with noise of another size in every car; what is learned is what it asked for.

    Args:
        model: a fresh algorithm on ``env``.
        env: normalised cars, reset afterwards.
        teacher: a classical policy for the scenario of the cars.
        gamma: discount of a step, for the critic.
        seed: of the noise and of the batches.
    """
    random = np.random.default_rng(seed)
    n = env.num_envs
    size = random.uniform(0.0, NOISE, size=(n, 1))
    cars, starts, memory = env.venv, np.ones(n, dtype=bool), None
    observation = cars.reset()
    seen, wanted, rewards, ends = [], [], [], []
    for _ in range(STEPS):
        assert isinstance(observation, np.ndarray)
        action, memory = teacher.predict(observation, memory, starts)
        action = np.clip(action, -1.0, 1.0)
        seen.append(observation)
        wanted.append(action)
        driven = np.clip(action + size * random.standard_normal(action.shape), -1.0, 1.0).astype(np.float32)
        observation, reward, starts, _ = cars.step(driven)
        rewards.append(reward)
        ends.append(starts)
    rows = np.concatenate(seen)
    statistics = statistics_of(env)
    statistics.mean, statistics.var = rows.mean(axis=0, dtype=np.float64), rows.var(axis=0, dtype=np.float64)
    statistics.count = float(len(rows))
    inputs = torch.from_numpy(np.asarray(env.normalize_obs(rows), dtype=np.float32))
    network: Any = model.policy
    _fit(network, lambda batch: network._predict(batch, deterministic=True), inputs, np.concatenate(wanted), random)
    if isinstance(model, TD3):
        network.actor_target.load_state_dict(network.actor.state_dict())
    if isinstance(model, PPO):
        _fit(network, network.predict_values, inputs, _returns(rewards, ends, gamma), random)


def _returns(rewards: list[np.ndarray], ends: list[np.ndarray], gamma: float) -> np.ndarray:
    """Discounted sums of the rewards that follow, as if each car went on at its last reward, (rows, 1)."""
    follows = rewards[-1] / (1.0 - gamma)
    found = []
    for reward, ended in zip(reversed(rewards), reversed(ends), strict=True):
        follows = reward + gamma * np.where(ended, 0.0, follows)
        found.append(follows)
    return np.concatenate(found[::-1])[:, None].astype(np.float32)


def _fit(policy: Any, output: Any, inputs: torch.Tensor, wanted: np.ndarray, random: np.random.Generator) -> None:
    """Least squares by Adam, with a step size that falls to zero."""
    targets = torch.from_numpy(np.asarray(wanted, dtype=np.float32))
    optimizer = torch.optim.Adam(policy.parameters(), lr=RATE)
    batches = -(-len(inputs) // BATCH)
    falling = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.0, EPOCHS * batches)
    for _ in range(EPOCHS):
        for rows in np.array_split(random.permutation(len(inputs)), batches):
            loss: Any = torch.nn.functional.mse_loss(output(inputs[rows]), targets[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            falling.step()
