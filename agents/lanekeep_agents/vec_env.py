"""Stable-Baselines3's ``VecEnv`` over a lanekeep vector environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

import lanekeep_env  # noqa: F401

#: Methods that change all cars.
_OF_ALL = ("reset", "step", "narrow", "set_state", "close")


class CarVecEnv(VecEnv):
    """Same-step autoreset, as Stable-Baselines3 expects it.

    Infos are filled for the cars whose episode ended in this step (terminal_observation,
    TimeLimit.truncated and the truth of the last step); the others share one empty dict, since a dict a
    car would cost more than the simulation. `truth` holds the vector infos of the last step.
    """

    def __init__(self, env_id: str, num_envs: int, **keywords: Any) -> None:
        self.env = gym.make_vec(
            env_id, num_envs, vectorization_mode="vector_entry_point", autoreset_mode="same_step", **keywords
        )
        self.truth: dict[str, Any] = {}
        self._start: dict[str, np.ndarray] = {}
        super().__init__(num_envs, self.env.single_observation_space, self.env.single_action_space)
        self._actions = np.zeros((num_envs, *(self.action_space.shape or ())), dtype=np.float32)

    def reset(self) -> VecEnvObs:
        """Reset every car; the seed of the last `seed` call is used once."""
        seed = None if self._seeds[0] is None else list(self._seeds)
        start, self._start = self._start, {}  # once, even if it is refused
        observation, self.truth = self.env.reset(seed=seed, options=start or None)  # type: ignore[arg-type]
        self.reset_infos = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observation

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Keep reset options for the next `reset`: one mapping for all cars, or one a car with the same keys.

        What episodes draw is bounded at once, for each car's next one on: callbacks narrow it while a model learns.
        """
        each = [options or {}] * self.num_envs if not isinstance(options, list) else options
        if len(each) != self.num_envs or len({tuple(sorted(one)) for one in each}) > 1:
            raise ValueError(f"reset options must be one mapping, or {self.num_envs} of them with the same keys")
        # What is the same for all is handed on as it is: bounds of what episodes draw are not one number a car.
        start = {
            key: value if all(np.array_equal(one[key], value) for one in each) else np.array([one[key] for one in each])
            for key, value in each[0].items()
        }
        self.env.unwrapped.narrow(start)  # type: ignore[attr-defined]
        self._start = start

    def _reset_options(self) -> None:
        self._start = {}

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Advance all cars."""
        observation, rewards, terminated, truncated, self.truth = self.env.step(self._actions)
        dones = terminated | truncated
        infos: list[dict[str, Any]] = [{}] * self.num_envs
        if "final_obs" in self.truth:
            final, last = self.truth["final_obs"], self.truth["final_info"]
            names = [name for name in last if not name.startswith("_")]
            for car in np.flatnonzero(dones):
                infos[car] = {
                    "terminal_observation": final[car],
                    "TimeLimit.truncated": bool(truncated[car] and not terminated[car]),
                    **{name: last[name][car].item() for name in names},
                }
        return observation, rewards, dones, infos

    def close(self) -> None:
        """Close the vector environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of the vector environment, each chosen car's part of it."""
        return self._shares(getattr(self.env.unwrapped, attr_name), indices)

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the vector environment, for all cars at once.

        Raises:
            AttributeError: it is one of the scenario, which is settled, or ``indices`` are not all.
        """
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise AttributeError(f"{attr_name} cannot be set for some cars: they are one vector environment")
        setattr(self.env.unwrapped, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """Call a method of the vector environment once; return each chosen car's part of the result.

        An array with an entry a car is shared out, and so are pictures; anything else is everybody's.
        """
        if method_name in _OF_ALL and len(list(self._get_indices(indices))) != self.num_envs:
            raise AttributeError(f"{method_name} cannot be called for some cars: they are one vector environment")
        result = getattr(self.env.unwrapped, method_name)(*args, **kwargs)
        if method_name == "render" and result is not None:
            return [result[car] for car in self._get_indices(indices)]
        return self._shares(result, indices)

    def _shares(self, value: Any, indices: VecEnvIndices) -> list[Any]:
        each = isinstance(value, np.ndarray) and value.ndim > 0 and len(value) == self.num_envs
        return [value[car] if each else value for car in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: VecEnvIndices = None) -> list[bool]:
        """No car is wrapped."""
        return [False] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return a picture of each car (render_mode="rgb_array"), None for each without."""
        pictures: Any = self.env.render()
        return [None] * self.num_envs if pictures is None else pictures
