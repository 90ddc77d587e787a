"""Residual learning: the action is a classical controller's plus a bounded learned correction."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

import lanekeep_baselines


class Corrections(VecEnvWrapper):
    """Shows the base controller's action beside the observation and adds the correction to it.

    action = clip(clip(base, -1, 1) + bound * clip(correction, -1, 1), -1, 1). The base sees the environment's own
    observations, each once, and keeps its state from step to step as it does on its own.

    Args:
        venv: a `CarVecEnv`.
        base: name of the classical policy.
        bound: largest correction, as a share of the largest action.
    """

    def __init__(self, venv: VecEnv, scenario: Any, base: str, bound: float) -> None:
        space, actions = venv.observation_space, venv.action_space
        assert isinstance(space, gym.spaces.Box) and isinstance(actions, gym.spaces.Box)
        low = np.concatenate([space.low, actions.low])
        high = np.concatenate([space.high, actions.high])
        super().__init__(venv, gym.spaces.Box(low, high, dtype=np.float32), actions)
        self._base = lanekeep_baselines.make(base, scenario)
        self._bound = np.float32(bound)
        self._memory: np.ndarray | None = None
        self._proposed = np.zeros((venv.num_envs, *actions.shape), dtype=np.float32)

    def _propose(self, observation: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        action, memory = self._base.predict(observation, self._memory, starts)
        return np.clip(action, -1.0, 1.0), memory

    def _beside(self, observation: np.ndarray, starts: np.ndarray) -> np.ndarray:
        self._proposed, self._memory = self._propose(observation, starts)
        return np.concatenate([observation, self._proposed], axis=1)

    def reset(self) -> VecEnvObs:
        """Start every car anew."""
        observation = self.venv.reset()
        assert isinstance(observation, np.ndarray)
        self._memory = None
        return self._beside(observation, np.ones(self.num_envs, dtype=bool))

    def step_async(self, actions: np.ndarray) -> None:
        """Add the corrections to what the base proposed for this step."""
        self.venv.step_async(np.clip(self._proposed + self._bound * np.clip(actions, -1.0, 1.0), -1.0, 1.0))

    def step_wait(self) -> VecEnvStepReturn:
        """Advance all cars."""
        observation, rewards, dones, infos = self.venv.step_wait()
        assert isinstance(observation, np.ndarray)
        ended = np.flatnonzero(dones)
        if len(ended):
            last = observation.copy()
            last[ended] = [infos[car]["terminal_observation"] for car in ended]
            proposed, _ = self._propose(last, np.zeros(self.num_envs, dtype=bool))
            for car in ended:
                infos[car]["terminal_observation"] = np.concatenate([last[car], proposed[car]])
        return self._beside(observation, dones), rewards, dones, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps."""
        memory = {} if self._memory is None else {"memory": self._memory}
        return {"proposed": self._proposed, **memory}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Go on from `get_state`."""
        self._proposed, self._memory = state["proposed"], state.get("memory")
