"""Drives the circuits of an environment, a car each, once."""

from __future__ import annotations

from typing import Any

import numpy as np

import lanekeep_baselines


def endings(env: Any, name: str, seed: int) -> list[str]:
    """Drive world i with car i by policy ``name``; "lap", "contact" or "timeout" of each. Closes ``env``."""
    count = env.num_envs
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
    observation, _ = env.reset(seed=seed, options={"world_index": np.arange(count)})
    found, state, starts = [""] * count, np.zeros((count, policy.memory)), np.ones(count, dtype=bool)
    while live := [i for i, ending in enumerate(found) if not ending]:
        action = np.zeros((count, 2), dtype=np.float32)
        action[live], state[live] = policy.predict(observation[live], state[live], starts[live])
        starts[:] = False
        observation, _, terminated, truncated, info = env.step(np.clip(action, -1.0, 1.0))
        for i in live:
            if terminated[i] or truncated[i]:
                found[i] = "contact" if info["cost"][i] > 0.0 else "lap" if terminated[i] else "timeout"
    env.close()
    return found
