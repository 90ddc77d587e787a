"""Road sets, built once a process."""

from __future__ import annotations

import functools

from lanekeep_env.roads.road import Floats, Road
from lanekeep_env.roads.specs import RoadSpec, build_roads
from lanekeep_env.roads.speed import SpeedSpec


def road_set(road: RoadSpec, speed: SpeedSpec) -> tuple[tuple[Road, Floats], ...]:
    """Return the roads of a set, each with the speed at its segment borders, m/s; do not change them."""
    return _built(road, speed, road.fingerprint())


@functools.lru_cache(maxsize=16)
def _built(road: RoadSpec, speed: SpeedSpec, fingerprint: str) -> tuple[tuple[Road, Floats], ...]:
    """``fingerprint`` notices a changed file."""
    return build_roads(road, speed)
