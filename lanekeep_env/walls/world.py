"""A walled world: wall segments, which of them are glass, where a car may start, and the line that it follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

Floats = NDArray[np.float64]

#: Nearest that a wall may be to the middle of a car at its start, m (half the width of a 1:10 car and some air).
START_CLEARANCE = 0.2

# Two walls that leave less than this between their bearings are closed, rad.
_CLOSED = 1e-9


@dataclass(frozen=True, eq=False)
class World:
    """Walls without thickness, in m; frozen, its arrays cannot be written.

    Attributes:
        name: what tables and plots call it.
        segments: x0, y0, x1, y1 of each wall, m, (n, 4).
        glass: of each wall, (n,): contact and ultrasonic meet glass, the depth camera sees through it.
        start: x (m), y (m), heading (rad) of the poses that a car may start from, (k, 3).
        centre_line: points that a car passes if it is known where to go, m, (m, 2), or None.
        closed: whether the last point of the centre line leads back to the first.
        spaces: parking spaces, (s, 5): x, y (m) of the corner at the kerb behind a car that is parked, direction of the
            kerb on the car's right (rad), length along it and depth away from it (m), or None.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, a wall without length.
    """

    name: str
    segments: Floats
    glass: NDArray[np.bool_]
    start: Floats
    centre_line: Floats | None = None
    closed: bool = False
    spaces: Floats | None = None

    def __post_init__(self) -> None:
        self._set("segments", self.segments, np.float64, "(n, 4): x0, y0, x1, y1 in m", 4)
        self._set("start", self.start, np.float64, "(k, 3): x, y in m, heading in rad", 3)
        if self.centre_line is not None:
            self._set("centre_line", self.centre_line, np.float64, "(m, 2): x, y in m", 2)
            if len(self.centre_line) < 2:
                raise ValueError(f"world {self.name!r}: centre_line has 1 point; at least 2 are needed")
            if not np.ptp(self.centre_line, axis=0).any():
                raise ValueError(f"world {self.name!r}: the points of centre_line are all the same; they must differ")
        if self.spaces is not None and len(self.spaces):
            self._set("spaces", self.spaces, np.float64, "(s, 5): x, y in m, heading in rad, length, depth in m", 5)
        glass = np.array(self.glass, dtype=np.bool_)
        if glass.shape != (len(self.segments),):
            raise ValueError(f"world {self.name!r}: glass has shape {glass.shape}, allowed is ({len(self.segments)},)")
        glass.flags.writeable = False
        object.__setattr__(self, "glass", glass)
        lengths = np.hypot(*(self.segments[:, 2:] - self.segments[:, :2]).T)
        if not (lengths > 0.0).all():
            raise ValueError(f"world {self.name!r}: wall {int(np.argmin(lengths))} has no length; walls need > 0 m")

    def _set(self, field: str, values: ArrayLike, dtype: DTypeLike, shape: str, columns: int) -> None:
        array = np.array(values, dtype=dtype)
        if array.ndim != 2 or array.shape[1] != columns or len(array) == 0:
            raise ValueError(f"world {self.name!r}: {field} has shape {array.shape}, allowed is {shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"world {self.name!r}: {field} holds a value that is not finite")
        array.flags.writeable = False
        object.__setattr__(self, field, array)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Smallest x, smallest y, largest x, largest y of all walls, m."""
        points = self.segments.reshape(-1, 2)
        (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
        return float(left), float(low), float(right), float(high)

    @cached_property
    def stations(self) -> Floats:
        """Arc length of the centre line at its points, m; a closed one has the whole length as one more."""
        if self.centre_line is None:
            raise ValueError(f"world {self.name!r} has no centre line")
        points = np.concatenate([self.centre_line, self.centre_line[:1]]) if self.closed else self.centre_line
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])

    @property
    def length(self) -> float:
        """Length of the centre line, m."""
        return float(self.stations[-1])

    @property
    def opaque(self) -> int:
        """Number of walls that are not glass."""
        return int(np.count_nonzero(~self.glass))

    def rows(self, dtype: DTypeLike = np.float64) -> NDArray:
        """Walls as the compiled functions take them, (4, n): the opaque ones first, then the glass."""
        order = np.argsort(self.glass, kind="stable")
        return np.ascontiguousarray(self.segments[order].T, dtype=dtype)

    def distance(self, x: float, y: float) -> float:
        """Distance of a point (m) from the nearest wall, m."""
        point, start = np.array([x, y]), self.segments[:, :2]
        along = self.segments[:, 2:] - start
        share = np.clip(((point - start) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        return float(np.hypot(*(point - start - share[:, None] * along).T).min())

    def touches(self, x: float, y: float, heading: float, length: float, width: float) -> bool:
        """Whether a rectangle around a point (m) with a heading (rad) and a size (m) touches a wall."""
        turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
        a, b = (self.segments[:, :2] - (x, y)) @ turn, (self.segments[:, 2:] - (x, y)) @ turn
        e = np.abs(b - a)
        apart = (np.abs(a + b) > np.array([length, width]) + e).any(axis=1)
        across = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 0.5 * (length * e[:, 1] + width * e[:, 0])
        return bool((~(apart | across)).any())

    def way_out(self, x: float, y: float) -> float | None:
        """Direction (rad) of a ray from a point (m) that meets no wall, glass included; None if all are met.

        Exact but for gaps that look narrower than 1e-9 rad.
        """
        a, b = self.segments[:, :2] - (x, y), self.segments[:, 2:] - (x, y)
        turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
        first = np.where(turn >= 0.0, np.arctan2(a[:, 1], a[:, 0]), np.arctan2(b[:, 1], b[:, 0]))
        order = np.argsort(first)
        first, last = first[order], (first + np.abs(turn))[order]
        # The walls that begin before pi and end behind it also cover the beginning.
        reached = np.maximum.accumulate(np.concatenate([[last.max() - 2.0 * math.pi], last]))
        nexts = np.concatenate([first, [math.pi + (first[0] + math.pi)]])
        gaps = nexts - reached
        widest = int(np.argmax(gaps))
        return float(reached[widest] + 0.5 * gaps[widest]) if gaps[widest] > _CLOSED else None

    def check(self, clearance: float = START_CLEARANCE) -> World:
        """Return the world itself if a car can start in it.

        Raises:
            ValueError: a start nearer to a wall than ``clearance`` (m), or one that sees out of the walls; so does
                a point of the centre line.
        """
        for x, y, _ in self.start:
            near = self.distance(x, y)
            if not near >= clearance:
                raise ValueError(
                    f"world {self.name!r}: the start ({x:.3f}, {y:.3f}) m is {near:.3f} m from a wall; "
                    f"allowed are >= {clearance} m"
                )
        if self._opening is not None:
            x, y, heading = self._opening
            raise ValueError(
                f"world {self.name!r}: the walls are open: from ({x:.3f}, {y:.3f}) m one sees out towards "
                f"{math.remainder(heading, 2.0 * math.pi):.3f} rad"
            )
        return self

    @cached_property
    def _opening(self) -> tuple[float, float, float] | None:
        """The first start or point of the centre line that sees out, x and y (m), and in which direction (rad)."""
        line = self.start[:, :2] if self.centre_line is None else np.concatenate([self.start[:, :2], self.centre_line])
        for x, y in line:
            heading = self.way_out(x, y)
            if heading is not None:
                return float(x), float(y), heading
        return None


def pack(worlds: Sequence[World], dtype: DTypeLike = np.float64) -> tuple[NDArray, NDArray[np.int64]]:
    """Put the walls of several worlds behind each other for a kernel.

    Returns:
        The walls, (4, all), and for each world the indices of its first wall, its first glass wall and the one
        behind its last, (worlds, 3): a depth camera sees walls [0]..[1]-1, ultrasonic and contact [0]..[2]-1.
    """
    counts = np.array([len(world.segments) for world in worlds], dtype=np.int64)
    ends = np.cumsum(counts)
    begins = ends - counts
    opaque = np.array([world.opaque for world in worlds], dtype=np.int64)
    walls = np.concatenate([world.rows(dtype) for world in worlds], axis=1)
    return walls, np.column_stack([begins, begins + opaque, ends])
