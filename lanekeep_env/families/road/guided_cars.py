"""The arrays behind a camera-guided car with set points or a faulty plan: those on roads, and what it is told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lanekeep_env.families.road.cars import RoadCars
from lanekeep_env.families.road.guided import GUIDED
from lanekeep_env.roads import Road


def bends(roads: Sequence[Road]) -> tuple[np.ndarray, np.ndarray]:
    """Return start and length of all bends, m, (bends, 2), and each road's first bend and their number, (roads, 2).

    A bend is a stretch of curvature between straights, or between a straight and an end of the road.
    """
    found: list[np.ndarray] = []
    index = []
    for road in roads:
        curved = ((road.curvature_start != 0.0) | (road.curvature_end != 0.0)).astype(np.int64)
        edges = np.diff(curved, prepend=0, append=0)
        starts, ends = road.stations[np.flatnonzero(edges == 1)], road.stations[np.flatnonzero(edges == -1)]
        index.append((sum(len(one) for one in found), len(starts)))
        found.append(np.column_stack([starts, ends - starts]))
    return np.ascontiguousarray(np.concatenate(found)), np.array(index, dtype=np.int64)


class GuidedCars(RoadCars):
    """n cars that are told where to drive."""

    family = GUIDED

    def _bind(self) -> None:
        super()._bind()
        tables = bends([road for road, _ in self.road_set()])
        self.equipment = *self.equipment, self.scenario.guidance_numbers(), *tables
