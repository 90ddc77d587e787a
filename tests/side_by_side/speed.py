"""Bursts of steps in one checkout, timed by the time its process had the processor."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

COLUMNS = 1024
#: Steps after which a single car starts anew, if its episode goes on so long.
LONGEST = 500

_calls: dict[str, Callable[[int], None]] = {}


def single(env_id: str) -> Callable[[int], None]:
    """Steps of one environment without wrappers, restarts included."""
    env = gym.make(env_id).unwrapped
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(LONGEST)]
    env.reset(seed=0)
    env.step(actions[0])

    def run(calls: int) -> None:
        step = env.step
        for i in range(calls):
            _, _, terminated, truncated, _ = step(actions[i % LONGEST])
            if terminated or truncated or i % LONGEST == LONGEST - 1:
                env.reset()

    return run


def vector(env_id: str, dtype: str) -> Callable[[int], None]:
    """Steps of all columns at once on one thread."""
    env = gym.make_vec(env_id, num_envs=COLUMNS, vectorization_mode="vector_entry_point", dtype=dtype)
    env.action_space.seed(0)
    actions = [np.asarray(env.action_space.sample()) for _ in range(16)]
    env.reset(seed=0)
    env.step(actions[0])

    def run(calls: int) -> None:
        for i in range(calls):
            env.step(actions[i % 16])

    return run


def answer(question: tuple[str, Any]) -> float:
    """Processor seconds: ("start", id) of this process up to its first step, (form, calls) of a burst."""
    form, value = question
    if form == "start":
        _calls["single"] = single(value)
        spent = time.process_time()
        _calls.update({dtype: vector(value, dtype) for dtype in ("float64", "float32")})
        return spent
    begin = time.process_time()
    _calls[form](value)
    return time.process_time() - begin
