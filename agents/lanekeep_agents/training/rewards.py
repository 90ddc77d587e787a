"""Rewards as the learner sees them: a departure costs the discounted rest, not the whole episode."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn


class LearnersRewards(VecEnvWrapper):
    """Bounds and scales rewards, keeps the score of whole episodes, and times the environment.

    Where a departure ends an episode it is charged the largest cost for all of the remaining time at once. A learner
    that discounts by ``gamma`` a step values that time at cost/(1 - gamma) at most: the charge is bounded by this, so
    that leaving the lane is as bad as staying outside of it for ever, and returns have one scale.

    Args:
        venv: cars, with corrections or without.
        largest_cost: of a control step; more is not told to the learner.
        gamma: discount of a control step.
        scale: factor of the rewards.

    Attributes:
        seconds: spent in the environment since the start, s.
    """

    def __init__(self, venv: VecEnv, largest_cost: float, gamma: float, scale: float) -> None:
        super().__init__(venv)
        self._least, self._floor = -largest_cost, -largest_cost / (1.0 - gamma)
        self._scale = scale
        self._returns: NDArray[np.float64] = np.zeros(self.num_envs)
        self._lengths: NDArray[np.int64] = np.zeros(self.num_envs, dtype=np.int64)
        self.seconds = 0.0

    def reset(self) -> VecEnvObs:
        """Start every car anew."""
        self._returns[:] = 0.0
        self._lengths[:] = 0
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        """Advance all cars; infos of ended episodes get "episode": return "r" (neither bounded nor scaled), length."""
        begun = time.perf_counter()
        observation, rewards, dones, infos = self.venv.step_wait()
        self.seconds += time.perf_counter() - begun
        self._returns += rewards
        self._lengths += 1
        bounded = np.maximum(rewards, self._least)
        for car in np.flatnonzero(dones):
            if not infos[car].get("TimeLimit.truncated"):
                bounded[car] = max(rewards[car], self._floor)
            infos[car]["episode"] = {"r": float(self._returns[car]), "l": int(self._lengths[car]), "t": 0.0}
        self._returns[dones] = 0.0
        self._lengths[dones] = 0
        return observation, bounded * self._scale, dones, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps."""
        return {"returns": self._returns.copy(), "lengths": self._lengths.copy()}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Go on from `get_state`."""
        self._returns[:], self._lengths[:] = state["returns"], state["lengths"]
