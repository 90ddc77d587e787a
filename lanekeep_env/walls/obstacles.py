"""Rectangular circuits with boxes in their corridors (Team KnightRiders 2017, second task)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from lanekeep_env.checks import ordered, require, shown
from lanekeep_env.walls.boxes import Box, box_outline, boxes_from, check_apart, covers
from lanekeep_env.walls.generators import SMALLEST_BLOCK, Circuit, RandomCircuits
from lanekeep_env.walls.parking import ParkingRow
from lanekeep_env.walls.shapes import outline, rectangle
from lanekeep_env.walls.world import Floats, World

#: Along a corridor, from a box to the next one and to the start, m. A car of the source's turning circles (0.87 m) goes
#: over by 1.7 m in 1.75 m; with its body's length and some air that is what the widest corridor may ask for.
SPACING = 2.5
#: From a box to the corner's square, m.
CORNER = 1.0
#: Nearest that a box stands to a wall without touching it, m: what is narrower is closed.
_AIR = 0.02
_TRIES = 200


@dataclass(frozen=True)
class ObstacleCircuit(Circuit):
    """A rectangular circuit with ``boxes`` in it: (x, y, heading, length, width) each, m and rad.

    The circuit's middle is the origin. A car starts in the middle of the first side, which is the lower one. With
    ``gaps`` (m) a row of parked boxes stands along the right wall of the side opposite, those gaps between them.
    """

    kind: ClassVar[str] = "obstacle-circuit"
    boxes: tuple[Box, ...] = ()
    gaps: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "boxes", boxes_from(self.boxes))
        super().__post_init__()
        if self.gaps in ((), []):
            object.__setattr__(self, "gaps", ())
        else:
            row = ParkingRow(self.gaps, street=max(self.corridor, 1.0))
            object.__setattr__(self, "gaps", row.gaps)
            inside = self.length - 2.0 * self.corridor
            if row.extent > inside:
                raise ValueError(
                    f"world.gaps={shown(self.gaps)} is not allowed: with its boxes the row is {row.extent:.2f} m long, "
                    f"the side has {inside:.2f} m between its corners"
                )
        check_apart(self.all_boxes)
        self._check_inside()

    @property
    def all_boxes(self) -> tuple[Box, ...]:
        """Boxes and parked boxes."""
        return self.boxes + self._row()[0]

    def _row(self) -> tuple[tuple[Box, ...], Floats, list[Floats]]:
        """Return the parked boxes, the spaces between them and the boxes' walls, in the circuit's frame."""
        if len(self.gaps) == 0:
            return (), np.zeros((0, 5)), []
        row = ParkingRow(self.gaps)
        # The kerb is the upper outer wall, driven leftwards, or clockwise the upper inner one, driven rightwards.
        flip = -1.0 if self.clockwise else 1.0
        y = 0.5 * self.width - (self.corridor if self.clockwise else 0.0)
        x = flip * (0.5 * row.extent + row.begin)
        heading = 0.0 if self.clockwise else math.pi
        boxes = tuple((x - flip * bx, y - flip * by, heading, long, wide) for bx, by, _, long, wide in row.boxes)
        spaces = row.spaces() * [-flip, -flip, 0.0, 1.0, 1.0] + [x, y, heading, 0.0, 0.0]
        sides = [[x, y, x, y] - flip * walls for walls in row.sides()]
        return boxes, spaces, sides

    def _check_inside(self) -> None:
        for k, box in enumerate(self.boxes):
            around = np.abs(box_outline(box)[:, :2])
            outside = around > 0.5 * np.array([self.length, self.width])
            inside = around < 0.5 * np.array([self.length, self.width]) - self.corridor
            if outside.any() or inside.all(axis=1).any():
                raise ValueError(
                    f"world.boxes[{k}]={shown(box)} is not allowed: it reaches through a wall; the corridors lie "
                    f"within {self.corridor:g} m of x=+-{0.5 * self.length:g} m and y=+-{0.5 * self.width:g} m"
                )

    def world(self, name: str) -> World:
        """Return the circuit with its boxes under a name."""
        bare = super().world(name)
        boxes = [box_outline(box) for box in self.boxes] + self._row()[2]
        start = bare.start[:1]
        for k, box in enumerate(self.boxes):
            if covers(box, *start[0, :2]):
                raise ValueError(f"world.boxes[{k}]={shown(box)} is not allowed: the start is inside of it")
        return replace(
            bare,
            segments=np.concatenate([bare.segments, *boxes]),
            glass=np.concatenate([bare.glass, np.zeros(sum(map(len, boxes)), dtype=np.bool_)]),
            start=start,
            spaces=self._row()[1],
        )


def passage(circuit: ObstacleCircuit) -> tuple[float, int]:
    """Return the width of a circuit's narrowest passage, m, and the box at it (-1: there is none).

    A chain of boxes from the outer to the inner wall parts the corridor for what is wider than its widest gap; the
    narrowest passage is that of the chain whose widest gap is the smallest.
    """
    size = np.array([circuit.length, circuit.width])
    walls = [outline(rectangle(*(size - shrink))) for shrink in (0.0, 2.0 * circuit.corridor)]
    things = [*walls, *(box_outline(box) for box in circuit.all_boxes)]
    gaps = np.array([[_between(a, b) for b in things] for a in things])
    for k in range(2, len(things)):
        gaps = np.minimum(gaps, np.maximum(gaps[:, k : k + 1], gaps[k : k + 1]))
    nearest = [max(gaps[0, k], gaps[k, 1]) for k in range(2, len(things))]
    return float(gaps[0, 1]), int(np.argmin(nearest)) if nearest and min(nearest) <= gaps[0, 1] else -1


def _between(first: Floats, second: Floats) -> float:
    """Distance of two outlines that do not cross each other, m: one of them has a corner there."""
    least = np.inf
    for corners, sides in ((first[:, :2], second), (second[:, :2], first)):
        along = sides[:, 2:] - sides[:, :2]
        to = corners[:, None] - sides[None, :, :2]
        share = np.clip((to * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        least = min(least, float(np.hypot(*np.moveaxis(to - share[..., None] * along, 2, 0)).min()))
    return least


@dataclass(frozen=True)
class RandomObstacleCircuits(RandomCircuits):
    """A set of rectangular circuits with boxes in them; both directions in turn.

    A box leaves a passage of at least ``passage`` m on one side, stands `CORNER` m off the corners and `SPACING` m off
    the next one and the start, which is in the middle of the longest side. On the other side it leaves anything from
    nothing (it leans on the wall) on.

    Attributes:
        fewest, most: boxes of a circuit.
        smallest, largest: bounds of a box's sides, m.
        turned: largest angle of a box to the corridor, rad.
        passage: narrowest, m.
    """

    kind: ClassVar[str] = "random-obstacle-circuits"
    shortest: float = 9.0
    fewest: int = 2
    most: int = 6
    smallest: float = 0.15
    largest: float = 0.5
    turned: float = math.radians(30.0)
    passage: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        require("world.fewest", self.fewest, "boxes", at_least=0, at_most=1000, whole=True)
        require("world.most", self.most, "boxes", at_least=0, at_most=1000, whole=True)
        ordered(self, "world", "fewest", "most")
        require("world.smallest", self.smallest, "m", at_least=0.01, at_most=100.0)
        require("world.largest", self.largest, "m", at_least=0.01, at_most=100.0)
        ordered(self, "world", "smallest", "largest")
        require("world.turned", self.turned, "rad", at_least=0.0, at_most=math.pi / 4)
        require("world.passage", self.passage, "m", at_least=0.1, at_most=100.0)
        if self.passage + self.smallest > self.widest:
            raise ValueError(
                f"world.passage={self.passage!r} is not allowed: beside a box of {self.smallest:g} m corridors of at "
                f"most {self.widest:g} m leave {max(self.widest - self.smallest, 0.0):g} m"
            )

    def build(self) -> tuple[World, ...]:
        """``count`` worlds."""
        rng = np.random.default_rng([self.seed, 0xB0C5])
        return tuple(self._draw(k, rng).world(f"obstacles-{self.seed}-{k}") for k in range(self.count))

    def _draw(self, k: int, rng: np.random.Generator) -> ObstacleCircuit:
        width, length = np.sort(rng.uniform(self.shortest, self.longest, 2))
        widest = min(self.widest, 0.5 * (width - SMALLEST_BLOCK))
        corridor = rng.uniform(max(self.narrowest, self.passage + self.smallest + _AIR), widest)
        seed = int(rng.integers(2**31))
        bare = ObstacleCircuit(length, width, corridor, k % 2 == 1, self.glass_share, seed)
        wanted = int(rng.integers(self.fewest, self.most + 1))
        boxes: list[Box] = []
        taken: dict[int, list[tuple[float, float]]] = {0: [(0.5 * length, 0.0)]}  # the start
        for _ in range(_TRIES):
            if len(boxes) == wanted:
                break
            side = int(rng.integers(4))
            box, place, reach = self._box(rng, side, bare)
            near = any(abs(place - other) < SPACING + reach + far for other, far in taken.get(side, []))
            end = (length if side % 2 == 0 else width) - corridor - CORNER - reach
            if not near and corridor + CORNER + reach <= place <= end:
                taken.setdefault(side, []).append((place, reach))
                boxes.append(box)
        return replace(bare, boxes=tuple(boxes))

    def _box(self, rng: np.random.Generator, side: int, bare: Circuit) -> tuple[Box, float, float]:
        """Return a box in a side (0: below, then counter-clockwise), its place along it and half its length there."""
        length, width = rng.uniform(self.smallest, self.largest, 2)
        angle = rng.uniform(-self.turned, self.turned)
        across = length * abs(math.sin(angle)) + width * math.cos(angle)
        shrink = min(1.0, (bare.corridor - self.passage - _AIR) / across)
        length, width, across = length * shrink, width * shrink, across * shrink
        reach = 0.5 * (length * math.cos(angle) + width * abs(math.sin(angle)))
        # A wall with the rest beside the passage: nothing or at least `_AIR`.
        rest = bare.corridor - across - self.passage
        gap = 1e-3 if rng.random() < 0.4 else rng.uniform(_AIR, max(rest, _AIR))
        outwards = gap + 0.5 * across
        if rng.random() < 0.5:
            outwards = bare.corridor - outwards
        long = bare.length if side % 2 == 0 else bare.width
        place = rng.uniform(bare.corridor, long - bare.corridor)
        along, off = place - 0.5 * long, 0.5 * (bare.width if side % 2 == 0 else bare.length) - outwards
        heading = 0.5 * math.pi * side
        cosine, sine = round(math.cos(heading)), round(math.sin(heading))
        # Side 0 runs along x below the origin; each further one is turned by a right angle.
        x, y = cosine * along + sine * off, sine * along - cosine * off
        return (x, y, heading + angle, length, width), place, reach
