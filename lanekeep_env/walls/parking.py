"""Rows of parked boxes along a kerb, with gaps between them (Team KnightRiders 2017, third task).

The kerb is the wall on the right, along x at y = 0; the car starts before the row, heading along x.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lanekeep_env.checks import LARGEST_SET, plain_numbers, require, shown
from lanekeep_env.walls.boxes import Box, box_outline
from lanekeep_env.walls.generators import END_SPACE, WorldRecord, range_of
from lanekeep_env.walls.shapes import outline, rectangle
from lanekeep_env.walls.world import Floats, World

#: From the start to the row, and from the row to the end of the street, m.
RUN_UP, RUN_OUT = 1.2, 2.5
#: Shorter gaps are no spaces, m.
SHORTEST_SPACE = 0.3


@dataclass(frozen=True)
class ParkingRow(WorldRecord):
    """A street with one row of parked boxes.

    Attributes:
        gaps: between neighbours, m, in the order in which a car passes them; one box more than gaps is parked.
        length, width: of the boxes, m; one number for all, or one each.
        kerb: distance of the boxes from the kerb, m; one number for all, or one each.
        street: from the kerb to the wall on the other side, m.
        start_distance: of the car's axis from the boxes' line at the start, m.
    """

    kind: ClassVar[str] = "parking-row"
    gaps: tuple[float, ...] = (0.6, 1.2)
    length: float | tuple[float, ...] = 0.532
    width: float | tuple[float, ...] = 0.265
    kerb: float | tuple[float, ...] = 0.05
    street: float = 2.5
    start_distance: float = 0.4

    def __post_init__(self) -> None:
        gaps = self.gaps
        if not isinstance(gaps, tuple | list) or not 1 <= len(gaps) <= 1000:
            raise ValueError(f"world.gaps={shown(gaps)} is not allowed: a list of 1 to 1000 lengths, m")
        for k, gap in enumerate(gaps):
            require(f"world.gaps[{k}]", gap, "m", at_least=0.01, at_most=100.0)
        object.__setattr__(self, "gaps", tuple(float(gap) for gap in gaps))
        for name, least in (("length", 0.05), ("width", 0.05), ("kerb", 1e-3)):
            value = getattr(self, name)
            each = isinstance(value, tuple | list)
            if each and len(value) != len(gaps) + 1:
                raise ValueError(
                    f"world.{name}={shown(value)} is not allowed: one number, or one for each of {len(gaps) + 1} boxes"
                )
            for number in value if each else (value,):
                require(f"world.{name}", number, "m", at_least=least, at_most=10.0)
            if each:
                object.__setattr__(self, name, tuple(float(number) for number in value))
        require("world.start_distance", self.start_distance, "m", at_least=0.05, at_most=10.0)
        require("world.street", self.street, "m", at_least=self.depth + self.start_distance + 0.2, at_most=100.0)
        super().__post_init__()

    def _each(self, name: str) -> Floats:
        return np.broadcast_to(np.asarray(getattr(self, name), dtype=np.float64), len(self.gaps) + 1)

    @property
    def boxes(self) -> tuple[Box, ...]:
        """The parked boxes, (x, y, heading, length, width) each."""
        lengths, widths, kerbs = (self._each(name) for name in ("length", "width", "kerb"))
        ends = self.begin + np.cumsum(lengths) + np.concatenate([[0.0], np.cumsum(self.gaps)])
        return tuple(
            (float(end - 0.5 * long), float(near + 0.5 * wide), 0.0, float(long), float(wide))
            for end, long, wide, near in zip(ends, lengths, widths, kerbs, strict=True)
        )

    @property
    def begin(self) -> float:
        """Where the row begins along the kerb, m."""
        return END_SPACE + RUN_UP

    @property
    def extent(self) -> float:
        """Length of the row, m."""
        return float(self._each("length").sum()) + sum(self.gaps)

    @property
    def depth(self) -> float:
        """How far the boxes reach from the kerb, m."""
        return float((self._each("width") + self._each("kerb")).max())

    def sides(self) -> list[Floats]:
        """Walls of each box, (3, 4): behind it, along the road and in front; the slit at the kerb is closed."""
        deep = [y + 0.5 * width for _, y, _, _, width in self.boxes]
        return [
            box_outline((x, 0.5 * far, 0.0, length, far))[1:]
            for (x, _, _, length, _), far in zip(self.boxes, deep, strict=True)
        ]

    def spaces(self) -> Floats:
        """The gaps that are long enough to be spaces of a world."""
        found = [
            (before[0] + 0.5 * before[3], 0.0, 0.0, gap, self.depth)
            for before, gap in zip(self.boxes[:-1], self.gaps, strict=True)
            if gap >= SHORTEST_SPACE
        ]
        return np.array(found).reshape(-1, 5)

    def build(self) -> tuple[World, ...]:
        """One world."""
        return (self.world("parking-row"),)

    def world(self, name: str) -> World:
        """Return the street under a name."""
        boxes = self.boxes
        total = boxes[-1][0] + 0.5 * boxes[-1][3] + RUN_OUT
        street = outline(rectangle(total, self.street) + 0.5 * np.array([total, self.street]))
        walls = np.concatenate([street, *self.sides()])
        y = self.depth + self.start_distance
        return World(
            name,
            walls,
            np.zeros(len(walls), dtype=np.bool_),
            np.array([[END_SPACE, y, 0.0]]),
            np.array([[END_SPACE, y], [total - END_SPACE, y]]),
            spaces=self.spaces(),
        )


@dataclass(frozen=True)
class RandomParkingRows(WorldRecord):
    """A set of streets with a row of parked boxes each, whose space that is long enough comes behind shorter ones.

    Attributes:
        count: streets.
        longer: bounds of the length of the space that is long enough, m.
        shorter: bounds of the lengths of the gaps before it, m; there is at least one.
        boxes: bounds of the boxes' lengths, m.
        widths: of their widths, m.
        kerb: of their distances from the kerb, m.
        start_distance: of the car's axis from the boxes' line at the start, m.
        street: of the street's width, m.
        seed: of the set.
    """

    kind: ClassVar[str] = "random-parking-rows"
    count: int = 64
    longer: tuple[float, float] = (1.0, 1.4)
    shorter: tuple[float, float] = (0.1, 0.8)
    boxes: tuple[float, float] = (0.4, 0.6)
    widths: tuple[float, float] = (0.25, 0.3)
    kerb: tuple[float, float] = (0.02, 0.08)
    start_distance: tuple[float, float] = (0.3, 0.5)
    street: tuple[float, float] = (1.6, 2.8)
    seed: int = 0

    def __post_init__(self) -> None:
        require("world.count", self.count, "streets", at_least=1, at_most=LARGEST_SET, whole=True)
        for name, least, most in (
            ("longer", 0.05, 100.0),
            ("shorter", 0.01, 100.0),
            ("boxes", 0.05, 10.0),
            ("widths", 0.05, 10.0),
            ("kerb", 1e-3, 10.0),
            ("start_distance", 0.05, 10.0),
            ("street", 0.5, 100.0),
        ):
            object.__setattr__(self, name, range_of(f"world.{name}", getattr(self, name), "m", least, most))
        if self.shorter[1] >= self.longer[0]:
            raise ValueError(f"world.shorter={self.shorter!r} is not allowed: it must be below longer={self.longer!r}")
        deep = self.widths[1] + self.kerb[1] + self.start_distance[1]
        require("world.street", self.street[0], "m", at_least=deep + 0.2)
        plain_numbers(self)

    def build(self) -> tuple[World, ...]:
        """``count`` worlds."""
        rng = np.random.default_rng([self.seed, 0x9A4C])
        return tuple(self._draw(rng).world(f"parking-{self.seed}-{k}") for k in range(self.count))

    def _draw(self, rng: np.random.Generator) -> ParkingRow:
        before, behind = int(rng.integers(1, 4)), int(rng.integers(0, 2))
        gaps = [rng.uniform(*self.shorter) for _ in range(before)]
        # One before it, at least, could be mistaken for a space.
        gaps[int(rng.integers(before))] = rng.uniform(0.5 * sum(self.shorter), self.shorter[1])
        gaps += [rng.uniform(*self.longer)] + [rng.uniform(*self.shorter) for _ in range(behind)]
        n = len(gaps) + 1
        return ParkingRow(
            tuple(gaps),
            tuple(rng.uniform(*self.boxes, n)),
            tuple(rng.uniform(*self.widths, n)),
            tuple(rng.uniform(*self.kerb, n)),
            rng.uniform(*self.street),
            rng.uniform(*self.start_distance),
        )


def longest_space(world: World) -> float:
    """Length of a world's longest parking space, m; 0 without any."""
    return 0.0 if world.spaces is None or len(world.spaces) == 0 else float(world.spaces[:, 3].max())
