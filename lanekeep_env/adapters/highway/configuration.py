"""What a configuration of theirs must not be where our car or our channels are in it: told before an episode begins."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from highway_env.envs.merge_env import MergeEnv
from highway_env.envs.roundabout_env import RoundaboutEnv
from highway_env.envs.two_way_env import TwoWayEnv

from lanekeep_env.checks import known

#: What they show on a road of u-turns, unless told otherwise.
_GRID = "TimeToCollision"


def check_keys(config: Iterable[str], defaults: Mapping[str, Any]) -> None:
    """Raise ValueError for a key that none of the ``defaults`` has: highway-env would pass over it."""
    known("config", config, tuple(defaults), "key")


def check_world(env: Any, numbers: int) -> None:
    """Raise ValueError where rewards or observations of ``env`` cannot be those of our car, or of so many numbers."""
    name = type(env).__name__ if env.spec is None else env.spec.id
    if isinstance(env, TwoWayEnv):
        raise ValueError(
            f"{name} is not allowed with our car: its reward reads the target speed of a car that is told 'faster' or "
            "'slower' (DiscreteMetaAction)"
        )
    if isinstance(env, MergeEnv | RoundaboutEnv) and numbers != 1:
        raise ValueError(
            f"{name} is not allowed with an action of two numbers: its reward takes one; "
            "allowed: 'longitudinal': False or 'lateral': False"
        )
    if env.config["observation"]["type"] == _GRID:
        raise ValueError(
            f"observation type {_GRID!r} of {name} is not allowed with our car: it reads the target speeds of a car "
            "that is told 'faster' or 'slower'; allowed: all others, 'LanekeepObservation' for one"
        )
