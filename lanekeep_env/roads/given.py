"""Roads from memory: points, and clothoids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from lanekeep_env.checks import require, shown
from lanekeep_env.roads.file import road_of
from lanekeep_env.roads.generators import RoadRecord
from lanekeep_env.roads.readers.columns import clothoids
from lanekeep_env.roads.readers.drawing import MOST_POINTS, Drawing
from lanekeep_env.roads.road import Road

Rows = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class RoadPoints(RoadRecord):
    """A road through points from memory.

    Attributes:
        points: (x, y) in m, in order: an array (n, 2) or a list.
        closed, smoothing: as for `read_road`.
    """

    kind: ClassVar[str] = "points"
    points: Rows
    closed: bool | None = None
    smoothing: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", _rows("road.points", self.points, 2, "(x, y) in m"))
        _check_closed(self.closed)
        require("road.smoothing", self.smoothing, "m", at_least=0.0, at_most=100.0, optional=True)
        super().__post_init__()

    def to_dict(self) -> dict[str, Any]:
        """Return kind and fields as JSON-able values."""
        return {"kind": self.kind, **asdict(self), "points": [list(point) for point in self.points]}

    def build(self) -> tuple[Road, ...]:
        """One road."""
        return (road_of(Drawing(np.array(self.points)), "points", "road.points", self.closed, self.smoothing),)


@dataclass(frozen=True)
class RoadClothoids(RoadRecord):
    """A road of clothoids, arcs and straights from memory.

    Attributes:
        segments: (length in m, curvature at its start, curvature at its end in 1/m), in order.
        closed: as for `read_road`.
    """

    kind: ClassVar[str] = "clothoids"
    segments: Rows
    closed: bool | None = None

    def __post_init__(self) -> None:
        what = "(length in m, curvature at the start, at the end in 1/m)"
        object.__setattr__(self, "segments", _rows("road.segments", self.segments, 3, what))
        _check_closed(self.closed)
        super().__post_init__()
        self.build()

    def to_dict(self) -> dict[str, Any]:
        """Return kind and fields as JSON-able values."""
        return {"kind": self.kind, "segments": [list(row) for row in self.segments], "closed": self.closed}

    def build(self) -> tuple[Road, ...]:
        """One road."""
        road = clothoids("road.segments", *np.array(self.segments).T)
        return (road_of(Drawing(road=road), "clothoids", "road.segments", self.closed, None),)


def _check_closed(closed: Any) -> None:
    if not (closed is None or isinstance(closed, bool)):
        raise ValueError(f"road.closed={shown(closed)} is not allowed: it must be a bool or None")


def _rows(name: str, value: Any, columns: int, what: str) -> Rows:
    """Rows of so many finite numbers."""
    try:
        table = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        table = np.zeros(0)
    good = isinstance(value, Sequence | np.ndarray) and table.ndim == 2 and table.shape[1] == columns
    if not (good and 1 <= len(table) <= MOST_POINTS and np.isfinite(table).all()):
        shape = f"of shape {table.shape}" if isinstance(value, np.ndarray) else shown(value)
        raise ValueError(f"{name} {shape} is not allowed: it must be 1 to {MOST_POINTS} rows {what}, all finite")
    return tuple(map(tuple, table.tolist()))
