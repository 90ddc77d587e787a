"""Learning agents on the lanekeep environments.

`sb3_vec_env` gives Stable-Baselines3 the compiled vector environment without a Python loop over lanes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lanekeep_agents.vec_env import LaneVecEnv

__all__ = ["sb3_vec_env"]


def sb3_vec_env(env_id: str, num_envs: int, **keywords: Any) -> LaneVecEnv:
    """Make ``env_id`` as a Stable-Baselines3 ``VecEnv`` of ``num_envs`` lanes.

    Args:
        env_id: a registered id, e.g. "lanekeep/LaneKeep-v0".
        num_envs: number of lanes.
        keywords: those of ``gym.make_vec`` for this id (scenario fields, dtype, num_threads).

    Raises:
        ImportError: Stable-Baselines3 is not installed; names the extra that brings it.
    """
    try:
        from lanekeep_agents.vec_env import LaneVecEnv
    except ModuleNotFoundError as error:
        if error.name not in ("stable_baselines3", "torch"):
            raise
        raise ImportError(f'{error.name} is missing: pip install "lanekeep[agents]"') from error
    return LaneVecEnv(env_id, num_envs, **keywords)
