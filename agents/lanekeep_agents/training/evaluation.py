"""How good a policy is on held-out seeds while it is trained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_env  # noqa: F401
from lanekeep_env.checks import shown

#: No number of a run is larger.
LARGEST = 1e50


@dataclass(frozen=True)
class Score:
    """Over episodes: mean return, share that failed (lane left, wall touched, lap not done), RMS lateral error in m."""

    mean_return: float
    failure_rate: float
    rms_lateral_error: float

    @classmethod
    def of(cls, values: Sequence[Any]) -> Score:
        """Read what a file holds; ValueError or TypeError where it is no score."""
        return cls(*(number(value, float) for value in values))


def number(value: Any, kind: type[int] | type[float]) -> Any:
    """Return a number that a file holds; ValueError where it is none of a run."""
    if type(value) is not kind or not abs(value) <= LARGEST:
        raise ValueError(f"{shown(value)} is not allowed: it must be {kind.__name__}, {LARGEST:g} at the most")
    return value


class Drives(NamedTuple):
    """Episodes that were driven, (n,) each: return, success, squares of the lateral error in m², steps."""

    returns: NDArray[np.float64]
    succeeds: NDArray[np.bool_]
    squares: NDArray[np.float64]
    steps: NDArray[np.int64]


class HeldOut:
    """Episodes of an environment that training never sees: the same ones each time.

    Args:
        env_id: a registered id.
        keywords: of ``gym.make_vec`` for it.
        episodes: number of them, one a car.
        seed: of the first one; training must use others.
    """

    def __init__(self, env_id: str, keywords: Mapping[str, Any], episodes: int, seed: int) -> None:
        self._env = gym.make_vec(
            env_id, episodes, vectorization_mode="vector_entry_point", autoreset_mode="next_step", **keywords
        )
        self._seed = seed
        #: Of the environment.
        self.scenario: Any = self._env.unwrapped.scenario  # type: ignore[attr-defined]

    def score(self, policy: Any) -> Score:
        """Drive ``policy`` (an object with `predict`) through all episodes."""
        found = self.drive(policy)
        rms = float(np.sqrt(found.squares.sum() / found.steps.sum()))
        return Score(float(found.returns.mean()), float(1.0 - found.succeeds.mean()), rms)

    def drive(self, policy: Any) -> Drives:
        """Drive ``policy`` through all episodes; return how each one went."""
        env, n = self._env, self._env.num_envs
        observation, _ = env.reset(seed=self._seed)
        state, start = None, np.ones(n, dtype=bool)
        alive, succeeds = start.copy(), start.copy()
        returns, squares, steps = np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.int64)
        while alive.any():
            action, state = policy.predict(observation, state, start)
            observation, reward, terminated, truncated, info = env.step(action)
            returns += np.where(alive, reward, 0.0)
            squares += np.where(alive, info["lateral_error"] ** 2, 0.0)
            steps += alive
            np.copyto(succeeds, info["is_success"], where=alive)
            start = np.zeros(n, dtype=bool)
            alive &= ~(terminated | truncated)
        return Drives(returns, succeeds, squares, steps)
