"""Sets of worlds, built once a process."""

from __future__ import annotations

import functools

from lanekeep_env.walls.generators import WorldRecord
from lanekeep_env.walls.world import World


@functools.lru_cache(maxsize=16)
def world_set(world: WorldRecord, fingerprint: str) -> tuple[World, ...]:
    """Return the worlds of a set, their starts checked; ``fingerprint`` notices a changed file."""
    return tuple(one.check() for one in world.build())
