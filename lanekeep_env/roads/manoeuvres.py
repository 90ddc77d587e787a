"""Paths of manoeuvres: evasive lane changes, and tight bends to back up along."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lanekeep_env.checks import LARGEST_SET, choose, ordered, require
from lanekeep_env.roads.generators import RoadRecord
from lanekeep_env.roads.road import Floats, Road, fitted


@dataclass(frozen=True)
class EvasiveRoads(RoadRecord):
    """A lane change on a quintic in world coordinates: y = D (10 u³ - 15 u⁴ + 6 u⁵), u = x/L.

    Werling, Gröll, Bretthauer 2008, Figure 8: an evasive path whose lateral acceleration reaches 4.0 m/s² at 55 km/h;
    the article prints no path, this one gives its figure.

    Attributes:
        shift: D, m.
        shift_length: L, m.
        side: "left", "right" or "both".
        before: straight before it, m.
    """

    kind: ClassVar[str] = "evasive"
    from_start: ClassVar[bool] = True
    shift: float = 3.5
    shift_length: float = 36.7
    side: str = "both"
    before: float = 10.0

    def __post_init__(self) -> None:
        require("road.shift", self.shift, "m", at_least=1e-3, at_most=20.0)
        require("road.shift_length", self.shift_length, "m", at_least=2.0 * self.shift, at_most=1e5)
        choose("road.side", self.side, ("left", "right", "both"))
        require("road.before", self.before, "m", at_least=1e-2, at_most=1e5)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """One road a side."""
        sides = {"left": (1.0,), "right": (-1.0,), "both": (1.0, -1.0)}[self.side]
        return tuple(self._one(side) for side in sides)

    def _one(self, side: float) -> Road:
        stations, curvatures, headings = quintic(side * self.shift, self.shift_length)
        # Straights before and behind have no curvature, as the quintic at both its ends.
        stations = np.concatenate([[0.0], self.before + stations, [self.before + stations[-1] + 150.0]])
        curvatures = np.concatenate([[0.0], curvatures, [0.0]])
        headings = np.concatenate([[0.0], headings, [0.0]])
        return fitted(f"evasive-{'left' if side > 0 else 'right'}", stations, curvatures, headings)


def quintic(shift: float, length: float, pieces: int = 160) -> tuple[Floats, Floats, Floats]:
    """Return arc length (m), curvature (1/m) and heading (rad) along y = D (10 u³ - 15 u⁴ + 6 u⁵), (pieces + 1,)."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    u = np.linspace(0.0, 1.0, pieces + 1)

    def slope(u: Floats) -> Floats:
        return shift / length * 30.0 * u**2 * (1.0 - u) ** 2

    middle, half = 0.5 * (u[1:] + u[:-1]), 0.5 / pieces
    way = np.sqrt(1.0 + slope(middle[:, None] + half * nodes) ** 2) @ weights * half * length
    bend = shift / length**2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    curvature = bend / (1.0 + slope(u) ** 2) ** 1.5
    return np.concatenate([[0.0], np.cumsum(way)]), curvature, np.arctan(slope(u))


@dataclass(frozen=True)
class ParkingPaths(RoadRecord):
    """A set of paths as a car backs into a place along them: straights and bends near its turning circle.

    Attributes:
        count: paths in the set.
        smallest_radius, largest_radius: of the bends, m, both sides.
        transition: length of the clothoids between straight and bend, m (curvature is continuous, as the source asks).
        seed: of the set.
    """

    kind: ClassVar[str] = "parking"
    from_start: ClassVar[bool] = True
    count: int = 64
    smallest_radius: float = 5.0
    largest_radius: float = 12.0
    transition: float = 3.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("road.count", self.count, "paths", at_least=1, at_most=LARGEST_SET, whole=True)
        require("road.smallest_radius", self.smallest_radius, "m", at_least=1e-2)
        require("road.largest_radius", self.largest_radius, "m", at_least=1e-2, at_most=1e6)
        ordered(self, "road", "smallest_radius", "largest_radius")
        require("road.transition", self.transition, "m", at_least=1e-2, at_most=1e5)
        require("road.seed", self.seed, "", at_least=0, whole=True)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """``count`` paths."""
        rng = np.random.default_rng([self.seed, 0x9A4C])
        return tuple(self._one(k, rng) for k in range(self.count))

    def _one(self, number: int, rng: np.random.Generator) -> Road:
        n = 4
        curvature = rng.choice([-1.0, 1.0], n) / rng.uniform(self.smallest_radius, self.largest_radius, n)
        arc = np.maximum(rng.uniform(0.4, math.pi / 2, n) / np.abs(curvature) - self.transition, 1.0)
        straight, nothing = rng.uniform(3.0, 8.0, n), np.zeros(n)
        ramp = np.full(n, self.transition)
        lengths = np.append(np.column_stack([straight, ramp, arc, ramp]).ravel(), 6.0)
        start = np.append(np.column_stack([nothing, nothing, curvature, curvature]).ravel(), 0.0)
        end = np.append(np.column_stack([nothing, curvature, curvature, nothing]).ravel(), 0.0)
        return Road(f"parking-{self.seed}-{number}", lengths, start, end)
