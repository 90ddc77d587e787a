"""What the report does where a plan would hit something: a short way back, then a fixed arc to the freer side (4.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats


class FixedArc:
    """Instead of free space: backs up, straight, and turns by `ANGLE`; a hit on the arc begins it anew.

    Args:
        step: s.
        tightest: curvature of the arc, 1/m.
    """

    #: The arc's angle, rad (the report's), and the way back, m.
    ANGLE, BACK = float(np.deg2rad(25.0)), 0.3
    #: Speeds backwards and on the arc, m/s; how far beams count for the freer side, m.
    BACKWARD, ARC, FAR = 0.3, 0.5, 3.0

    def __init__(self, step: float, tightest: float) -> None:
        self._step, self._tightest = step, tightest

    def drive(
        self, harmless: NDArray[np.bool_], left: Floats, speed: Floats, curvature: Floats, ranges: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return curvature, 1/m, set speed, m/s, and way left, m, (n,) each, of rows that back up or are to.

        Args:
            harmless: whether the plan's command is.
            left: way left, m: positive backwards, negative on the arc, 0 without either.
            speed: m/s.
            curvature: asked for last, 1/m: the arc's side is kept.
            ranges: of the scan, (beams, n), from right to left, inf where nothing is known.
        """
        way = self._step * np.abs(speed)
        hit = ~harmless & (left <= 0.0)
        back = np.where(hit, self.BACK, left - way)
        turns = ~hit & (left > 0.0) & (back <= 0.0)
        goes = ~hit & (left < 0.0)
        left = np.where(turns, -self.ANGLE / self._tightest, np.where(goes, np.minimum(left + way, 0.0), back))
        seen, half = np.minimum(ranges, self.FAR), len(ranges) // 2
        freer = np.where(seen[half:].sum(axis=0) >= seen[:half].sum(axis=0), 1.0, -1.0)
        side = np.where(turns, freer, np.sign(curvature))
        bends = left < 0.0
        return np.where(bends, side * self._tightest, 0.0), np.where(bends, self.ARC, -self.BACKWARD), left
