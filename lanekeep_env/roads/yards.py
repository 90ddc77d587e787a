"""Roads of works yards, for guidance by camera: tight bends, missing markings, turns off the road."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lanekeep_env.checks import LARGEST_SET, choose, ordered, require
from lanekeep_env.roads.generators import RoadRecord, check_total
from lanekeep_env.roads.road import Road


@dataclass(frozen=True)
class YardRoads(RoadRecord):
    """A set of winding roads with edges that are missing here and there.

    Attributes:
        count: roads in the set; an episode's key chooses one and a start on it.
        length: of each road, m.
        smallest_radius, largest_radius: of the bends of the centre line, m; log-uniform between them, both sides.
        gap_spacing: mean distance between missing stretches of the edge, m; None for none.
        gap_length: of each of them, m.
        seed: of the set.

    Bends turn by 0.3 to 1.6 rad with straights of 5 to 40 m between them; every other one has clothoids a quarter of
    its length long, the others begin and end with a jump of curvature.
    """

    kind: ClassVar[str] = "yard"
    count: int = 256
    length: float = 400.0
    smallest_radius: float = 5.0
    largest_radius: float = 100.0
    gap_spacing: float | None = 60.0
    gap_length: float = 5.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("road.count", self.count, "roads", at_least=1, at_most=LARGEST_SET, whole=True)
        require("road.length", self.length, "m", at_least=50.0, at_most=1e6)
        check_total(self.count, self.length)
        require("road.smallest_radius", self.smallest_radius, "m", at_least=1e-2)
        require("road.largest_radius", self.largest_radius, "m", at_least=1e-2, at_most=1e6)
        ordered(self, "road", "smallest_radius", "largest_radius")
        require("road.gap_spacing", self.gap_spacing, "m", at_least=1.0, at_most=1e6, optional=True)
        require("road.gap_length", self.gap_length, "m", at_least=1e-2, at_most=1e6)
        require("road.seed", self.seed, "", at_least=0, whole=True)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """``count`` roads; the gaps' length does not change the curves."""
        curves, gaps = (np.random.default_rng([self.seed, salt]) for salt in (0x7A8D, 0x6A95))
        return tuple(self._with_gaps(self._one(k, curves), gaps) for k in range(self.count))

    def _one(self, number: int, rng: np.random.Generator) -> Road:
        n = 4 + int(self.length / 8.0)
        curvature = np.exp(-rng.uniform(np.log(self.smallest_radius), np.log(self.largest_radius), n))
        curvature *= rng.choice([-1.0, 1.0], n)
        turn = rng.uniform(0.3, 1.6, n)
        smooth = rng.random(n) < 0.5
        # A clothoid turns half as much as an arc of its length: a bend with both ends a quarter of it loses a quarter.
        bend = turn / np.abs(curvature) / np.where(smooth, 0.75, 1.0)
        ramp = np.where(smooth, bend / 4, 0.0)
        straight = rng.uniform(5.0, 40.0, n)
        nothing = np.zeros(n)
        lengths = np.column_stack([straight, ramp, bend - 2 * ramp, ramp]).ravel()
        start = np.column_stack([nothing, nothing, curvature, curvature]).ravel()
        end = np.column_stack([nothing, curvature, curvature, nothing]).ravel()
        kept = lengths > 0.0
        lengths, start, end = lengths[kept], start[kept], end[kept]
        last = int(np.searchsorted(np.cumsum(lengths), self.length)) + 1
        return Road(f"yard-{self.seed}-{number}", lengths[:last], start[:last], end[:last])

    def _with_gaps(self, road: Road, rng: np.random.Generator) -> Road:
        if self.gap_spacing is None:
            return road
        begin = np.cumsum(self.gap_spacing * rng.uniform(0.5, 1.5, 2 + int(2 * road.length / self.gap_spacing)))
        begin = begin[begin < road.length]
        return road.without_marking(np.column_stack([begin, begin + self.gap_length]))


@dataclass(frozen=True)
class TurnOffRoads(RoadRecord):
    """A left curve, a straight, a turn at a junction without edges, a straight (Figure 7 of the source).

    Trächtler, Lohmann, Struck 1992. Lengths are those of the centre line.

    Attributes:
        count: roads in the set.
        smallest_radius, largest_radius: of the turn, m; its inner edge has half a lane less.
        smallest_angle, largest_angle: by which it turns, rad; 90 degrees in the source.
        side: "right", "left" or "both", where the road turns off to.
        lost: length of the stretch without edges, from the start of the turn, over the length of the turn.
        seed: of the set.
    """

    kind: ClassVar[str] = "turn-off"
    from_start: ClassVar[bool] = True
    count: int = 64
    smallest_radius: float = 9.5
    largest_radius: float = 21.5
    smallest_angle: float = math.pi / 2
    largest_angle: float = math.pi / 2
    side: str = "both"
    lost: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("road.count", self.count, "roads", at_least=1, at_most=LARGEST_SET, whole=True)
        require("road.smallest_radius", self.smallest_radius, "m", at_least=1e-2)
        require("road.largest_radius", self.largest_radius, "m", at_least=1e-2, at_most=1e6)
        ordered(self, "road", "smallest_radius", "largest_radius")
        require("road.smallest_angle", self.smallest_angle, "rad", at_least=1e-3)
        require("road.largest_angle", self.largest_angle, "rad", at_least=1e-3, at_most=math.pi)
        ordered(self, "road", "smallest_angle", "largest_angle")
        choose("road.side", self.side, ("right", "left", "both"))
        require("road.lost", self.lost, "(of the turn's length)", at_least=0.0, at_most=10.0)
        require("road.seed", self.seed, "", at_least=0, whole=True)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """``count`` roads."""
        rng, angles = (np.random.default_rng([self.seed, salt]) for salt in (0x70FF, 0xA261))
        return tuple(
            self._one(k, rng, float(angles.uniform(self.smallest_angle, self.largest_angle))) for k in range(self.count)
        )

    def _one(self, number: int, rng: np.random.Generator, angle: float) -> Road:
        first, curve_radius, curve_turn, between = rng.uniform([12.0, 20.0, 0.4, 22.0], [20.0, 40.0, 0.8, 28.0])
        radius = rng.uniform(self.smallest_radius, self.largest_radius)
        left = rng.random() < 0.5 if self.side == "both" else self.side == "left"
        turn = radius * angle
        lengths = np.array([first, curve_radius * curve_turn, between, turn, 100.0])
        curvature = np.array([0.0, 1.0 / curve_radius, 0.0, (1.0 if left else -1.0) / radius, 0.0])
        begin = float(lengths[:3].sum())
        road = Road(f"turn-off-{self.seed}-{number}", lengths, curvature, curvature)
        return road.without_marking([[begin, begin + self.lost * turn]]) if self.lost > 0.0 else road


@dataclass(frozen=True)
class BypassRoads(RoadRecord):
    """A straight, a way round an obstacle to the left without edges, a straight (a blind drive that the source names).

    Trächtler, Lohmann, Struck 1992, section 4. The way swings out by ``shift`` in two arcs, goes straight beside the
    obstacle and swings back in two arcs. Where in the lane the obstacle stands is no part of the road: the way is.

    Attributes:
        count: roads in the set.
        smallest_radius, largest_radius: of the arcs, m.
        smallest_shift, largest_shift: to the left, m.
        beside: length of the straight beside the obstacle, m.
        seed: of the set.
    """

    kind: ClassVar[str] = "bypass"
    from_start: ClassVar[bool] = True
    count: int = 64
    smallest_radius: float = 20.0
    largest_radius: float = 40.0
    smallest_shift: float = 1.5
    largest_shift: float = 3.0
    beside: float = 5.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("road.count", self.count, "roads", at_least=1, at_most=LARGEST_SET, whole=True)
        require("road.smallest_shift", self.smallest_shift, "m", at_least=1e-2)
        require("road.largest_shift", self.largest_shift, "m", at_least=1e-2, at_most=1e3)
        ordered(self, "road", "smallest_shift", "largest_shift")
        # Two arcs swing out by twice their radius at the most.
        require("road.smallest_radius", self.smallest_radius, "m", at_least=0.5 * self.largest_shift)
        require("road.largest_radius", self.largest_radius, "m", at_least=1e-2, at_most=1e6)
        ordered(self, "road", "smallest_radius", "largest_radius")
        require("road.beside", self.beside, "m", at_least=1e-2, at_most=1e6)
        require("road.seed", self.seed, "", at_least=0, whole=True)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """``count`` roads."""
        rng = np.random.default_rng([self.seed, 0xB1FA])
        return tuple(self._one(k, rng) for k in range(self.count))

    def _one(self, number: int, rng: np.random.Generator) -> Road:
        before, radius, shift = rng.uniform(
            [25.0, self.smallest_radius, self.smallest_shift], [35.0, self.largest_radius, self.largest_shift]
        )
        arc = radius * math.acos(1.0 - 0.5 * shift / radius)
        lengths = np.array([before, arc, arc, self.beside, arc, arc, 100.0])
        curvature = np.array([0.0, 1.0, -1.0, 0.0, -1.0, 1.0, 0.0]) / radius
        road = Road(f"bypass-{self.seed}-{number}", lengths, curvature, curvature)
        return road.without_marking([[before, float(lengths[:6].sum())]])
