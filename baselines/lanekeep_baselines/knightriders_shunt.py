"""Parking in several moves, where a gap is too short for one sweep: an extension of `knightriders-park`."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from lanekeep_baselines.knightriders_park import KnightRidersPark
from lanekeep_baselines.parking_row import AHEAD, SEARCH, Search
from lanekeep_baselines.path_planning import parallel_parking
from lanekeep_baselines.path_shunting import shunts
from lanekeep_baselines.policy import Floats


class KnightRidersShunt(KnightRidersPark):
    """`knightriders-shunt`: one sweep where that will do, else forth and back until the car is along the kerb."""

    name = "knightriders-shunt"

    #: Distances of the parked body from the kerb that are tried, m: the one with the fewest moves is taken.
    KERBS: ClassVar[tuple[float, ...]] = (0.05, 0.065, 0.08, 0.095, 0.11)
    #: Kept to boxes and to the kerb by the plan, m: more than by the moves (`Moves`), for what is not known exactly.
    PLANNED, PLANNED_KERB = 0.02, 0.02

    def _choose(self, length: Floats, known: Floats, now: Search) -> Search:
        swept = super()._choose(length, known, now)
        rows = np.flatnonzero((length > 0.0) & (swept.phase == SEARCH))
        if not len(rows):
            return swept
        some, body = Search(*(column[rows] for column in now)), self._body(known[rows, 2])
        most, start, line, found = np.full(len(rows), np.inf), 0.0 * some.start, 0.0 * some.line, some.phase < 0.0
        for kerb in self.KERBS:
            plan = shunts(length[rows], some.depth, kerb, body, self.PLANNED, self.PLANNED_KERB)
            way = parallel_parking(some.kerb - plan.line, body.radius_right, body.radius_left)
            better = plan.ok & way.ok & (plan.moves > 0) & (plan.moves < most)
            most, found = np.where(better, plan.moves, most), found | better
            start = np.where(better, some.gap + plan.place + way.travel, start)
            line = np.where(better, plan.line, line)
        columns = {"phase": AHEAD + 0.0 * start, "start": start, "line": line, "moves": 1.0 + 0.0 * start}
        changed = {}
        for name, value in columns.items():
            whole = getattr(swept, name).copy()
            whole[rows] = np.where(found, value, whole[rows])
            changed[name] = whole
        return swept._replace(**changed)
