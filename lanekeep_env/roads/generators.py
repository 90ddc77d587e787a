"""Roads made from a few numbers: straight, circle, slalom, sine, random clothoid roads, Yin's scenario (b)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from lanekeep_env.checks import LARGEST_SET, plain_numbers, require
from lanekeep_env.roads.road import Floats, Road, fitted

#: All roads of a set together, m, so that building them takes seconds and their table some 100 MB at the most.
LARGEST_TOTAL = 1e8
#: Waves of a road.
MOST_WAVES = 10_000


def check_total(count: int, length: float) -> None:
    """Raise ValueError for a set that is too large to be built."""
    if count * length > LARGEST_TOTAL:
        raise ValueError(
            f"road.count={count} is not allowed: with {length:g} m each the roads are {count * length:.2g} m long; "
            f"it must be <= {int(LARGEST_TOTAL / length)} roads"
        )


class RoadRecord:
    """What all road records share: a kind, JSON-able fields and a fingerprint."""

    kind: ClassVar[str]
    #: Speed that the profile does not fall below on this road, m/s.
    minimum_speed: ClassVar[float | None] = None
    #: Episodes start at the road's beginning, not anywhere on it.
    from_start: ClassVar[bool] = False

    def to_dict(self) -> dict[str, Any]:
        """Return kind and fields as JSON-able values; `road_from` reads them back."""
        return {"kind": self.kind, **asdict(self)}  # type: ignore[call-overload]

    def fingerprint(self) -> str:
        """Text that changes whenever the road does."""
        return repr(sorted(self.to_dict().items()))

    def __post_init__(self) -> None:
        plain_numbers(self)

    def build(self) -> tuple[Road, ...]:
        """Return the roads of the set."""
        raise NotImplementedError


@dataclass(frozen=True)
class StraightRoad(RoadRecord):
    """A straight of ``length`` m."""

    kind: ClassVar[str] = "straight"
    length: float = 10_000.0

    def __post_init__(self) -> None:
        require("road.length", self.length, "m", at_least=1e-3, at_most=LARGEST_TOTAL)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """One road."""
        return (Road("straight", np.array([self.length]), np.zeros(1), np.zeros(1)),)


@dataclass(frozen=True)
class CircleRoad(RoadRecord):
    """A closed circle; ``radius`` in m, positive to the left."""

    kind: ClassVar[str] = "circle"
    radius: float = 150.0

    def __post_init__(self) -> None:
        require("road.radius", self.radius, "m")
        require("|road.radius|", abs(self.radius), "m", above=0.0, at_most=1_000_000)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """One road."""
        curvature = np.array([1.0 / self.radius])
        return (Road("circle", np.array([2 * math.pi * abs(self.radius)]), curvature, curvature, closed=True),)


@dataclass(frozen=True)
class SlalomRoad(RoadRecord):
    """Clothoids from side to side: curvature a triangle wave of ``wavelength`` m between +- ``peak_curvature`` 1/m."""

    kind: ClassVar[str] = "slalom"
    peak_curvature: float = 0.01
    wavelength: float = 300.0
    length: float = 6000.0

    def __post_init__(self) -> None:
        _check_wave(self)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """One road."""
        quarters = max(4, round(4 * self.length / self.wavelength))
        wave = self.peak_curvature * np.array([0.0, 1.0, 0.0, -1.0])[np.arange(quarters + 1) % 4]
        return (Road("slalom", np.full(quarters, self.wavelength / 4), wave[:-1], wave[1:]),)


@dataclass(frozen=True)
class SineRoad(RoadRecord):
    """Curvature ``peak_curvature`` sin(2 pi s / ``wavelength``), 1/m and m; fitted to 1 mm."""

    kind: ClassVar[str] = "sine"
    peak_curvature: float = 0.0109
    wavelength: float = 400.0
    length: float = 6400.0

    def __post_init__(self) -> None:
        _check_wave(self)
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """One road."""
        halves = max(1, math.ceil(2 * self.length / self.wavelength))
        signs = np.where(np.arange(halves) % 2, -1.0, 1.0)
        return (_half_waves("sine", np.full(halves, self.wavelength / 2), signs * self.peak_curvature),)


def _check_wave(road: SlalomRoad | SineRoad) -> None:
    require("road.peak_curvature", road.peak_curvature, "1/m", at_least=1e-9, at_most=100.0)
    require("road.wavelength", road.wavelength, "m", at_least=1e-2, at_most=1e6)
    require("road.length", road.length, "m", at_least=road.wavelength, at_most=min(1e6, MOST_WAVES * road.wavelength))


def _half_waves(name: str, lengths: Floats, peaks: Floats) -> Road:
    """Half sine waves of curvature one behind the other, so that it is continuous and passes through zero."""
    # Positions err with the fourth power of a piece's length (see `fitted`).
    stations, curvatures, headings = [np.zeros(1)], [np.zeros(1)], [np.zeros(1)]
    for length, peak in zip(lengths, peaks, strict=True):
        pieces = max(8, math.ceil(length / 5.0))
        phase = np.pi * np.arange(1, pieces + 1) / pieces
        stations.append(stations[-1][-1] + length * phase / np.pi)
        curvatures.append(peak * np.sin(phase))
        headings.append(headings[-1][-1] + peak * length / np.pi * (1.0 - np.cos(phase)))
    return fitted(name, np.concatenate(stations), np.concatenate(curvatures), np.concatenate(headings))


@dataclass(frozen=True)
class YinRoad(RoadRecord):
    """Scenario (b) of Yin 2010: curvature varies continuously with both signs, peak 0.0109 1/m (R = 91.8 m).

    The slides show no map. This road chains half sine waves of different length and height, so that the
    speed profile (68 to 180 km/h, 0.4 g where possible) reaches both its ends.
    """

    kind: ClassVar[str] = "yin"
    minimum_speed: ClassVar[float | None] = 68.0 / 3.6
    peak_curvature: ClassVar[float] = 0.0109
    #: Half waves: length in m and height as a share of the peak.
    half_waves: ClassVar[tuple[tuple[float, float], ...]] = (
        (900.0, 0.14),
        (500.0, -0.45),
        (350.0, 1.0),
        (300.0, -1.0),
        (450.0, 0.6),
        (800.0, -0.14),
        (600.0, 0.3),
        (250.0, -0.9),
        (350.0, 1.0),
        (700.0, -0.2),
    )

    def build(self) -> tuple[Road, ...]:
        """One road."""
        lengths, shares = np.array(self.half_waves).T
        return (_half_waves("yin", lengths, self.peak_curvature * shares),)


@dataclass(frozen=True)
class RandomRoads(RoadRecord):
    """A set of random roads of straights, clothoids and arcs, as road builders lay them out.

    Attributes:
        count: roads in the set; an episode's key chooses one and a start on it.
        length: of each road, m.
        peak_curvature: tightest arc, 1/m.
        design_speed: m/s; the gentlest arcs ask for half of 0.4 g at this speed.
        seed: of the set; other seeds give other roads (training and test roads, say).

    Curvatures are log-uniform between gentlest and tightest, both signs equally likely; arcs turn by
    0.15 to 1.2 rad. A clothoid is so long that the lateral acceleration of 0.4 g (or of the design speed)
    builds up at 1.5 m/s³.
    """

    kind: ClassVar[str] = "random"
    count: int = 256
    length: float = 6000.0
    peak_curvature: float = 0.0109
    design_speed: float = 50.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("road.count", self.count, "roads", at_least=1, at_most=LARGEST_SET, whole=True)
        require("road.length", self.length, "m", at_least=500.0, at_most=1e6)
        check_total(self.count, self.length)
        require("road.design_speed", self.design_speed, "m/s", at_least=1.0, at_most=100.0)
        require("road.peak_curvature", self.peak_curvature, "1/m", at_least=self.gentlest_curvature, at_most=0.1)
        require("road.seed", self.seed, "", at_least=0, whole=True)
        super().__post_init__()

    @property
    def gentlest_curvature(self) -> float:
        """Curvature of the gentlest arcs, 1/m."""
        return 0.5 * 0.4 * 9.81 / self.design_speed**2

    def build(self) -> tuple[Road, ...]:
        """``count`` roads."""
        rng = np.random.default_rng([self.seed, 0x10AD])
        return tuple(self._one(k, rng) for k in range(self.count))

    def _one(self, number: int, rng: np.random.Generator) -> Road:
        lateral, jerk = 0.4 * 9.81, 1.5
        n = 8 + int(self.length / 120.0)
        size = np.exp(rng.uniform(np.log(self.gentlest_curvature), np.log(self.peak_curvature), n))
        speed = np.minimum(self.design_speed, np.sqrt(lateral / size))
        transition = size * speed**3 / jerk
        arc = np.maximum(rng.uniform(0.15, 1.2, n) / size - transition, 20.0)
        # Every third bend follows the one before without a straight between them.
        straight = np.where(rng.random(n) < 0.33, 0.0, rng.uniform(40.0, 300.0, n))
        curvature = size * rng.choice([-1.0, 1.0], n)
        lengths = np.column_stack([straight, transition, arc, transition]).ravel()
        nothing = np.zeros(n)
        start = np.column_stack([nothing, nothing, curvature, curvature]).ravel()
        end = np.column_stack([nothing, curvature, curvature, nothing]).ravel()
        kept = lengths > 0.0
        lengths, start, end = lengths[kept], start[kept], end[kept]
        last = int(np.searchsorted(np.cumsum(lengths), self.length)) + 1
        return Road(f"random-{self.seed}-{number}", lengths[:last], start[:last], end[:last])


@dataclass(frozen=True)
class RoadWorksRoads(RoadRecord):
    """A set of lanes through road works: straights, and shifts to the side that undo each other.

    The road is the centre of the lane itself. A shift by D over L is an S of clothoids whose curvature
    runs 0, k, -k, 0 over L/4, L/2, L/4 with k = 8 D / L².

    Attributes:
        count, length (m), seed: as for `RandomRoads`.
        shift: largest lateral shift, m; drawn between half of it and it.
        shift_length: shortest length of a shift, m; drawn between it and 1.6 times it.
    """

    kind: ClassVar[str] = "roadworks"
    count: int = 64
    length: float = 3000.0
    shift: float = 3.25
    shift_length: float = 70.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("road.count", self.count, "roads", at_least=1, at_most=LARGEST_SET, whole=True)
        require("road.length", self.length, "m", at_least=500.0, at_most=1e6)
        check_total(self.count, self.length)
        require("road.shift", self.shift, "m", at_least=1e-3, at_most=20.0)
        require("road.shift_length", self.shift_length, "m", at_least=1e-2, at_most=1e5)
        require("road.seed", self.seed, "", at_least=0, whole=True)
        peak = 8 * self.shift / self.shift_length**2
        if peak > 0.05:
            raise ValueError(
                f"road.shift={self.shift} m over road.shift_length={self.shift_length} m is not allowed: "
                f"its curvature of {peak:.3f} 1/m must be <= 0.05 1/m"
            )
        super().__post_init__()

    def build(self) -> tuple[Road, ...]:
        """``count`` roads."""
        rng = np.random.default_rng([self.seed, 0x3078])
        return tuple(self._one(k, rng) for k in range(self.count))

    def _one(self, number: int, rng: np.random.Generator) -> Road:
        n = 4 + int(self.length / 60.0)
        straight = rng.uniform(20.0, 120.0, n)
        length = self.shift_length * rng.uniform(1.0, 1.6, n)
        # Shifts go out and come back, so that the lane stays near the carriageway.
        side = rng.choice([-1.0, 1.0], n // 2 + 1).repeat(2)[:n] * np.where(np.arange(n) % 2, -1.0, 1.0)
        peak = 8.0 * self.shift * rng.uniform(0.5, 1.0, n // 2 + 1).repeat(2)[:n] * side / length**2
        nothing = np.zeros(n)
        lengths = np.column_stack([straight, length / 4, length / 2, length / 4]).ravel()
        start = np.column_stack([nothing, nothing, peak, -peak]).ravel()
        end = np.column_stack([nothing, peak, -peak, nothing]).ravel()
        last = int(np.searchsorted(np.cumsum(lengths), self.length)) + 1
        return Road(f"roadworks-{self.seed}-{number}", lengths[:last], start[:last], end[:last])
