"""Walled worlds made from a few numbers, on the scale of 1:10 cars: corridor, L, slalom, rectangular circuits.

The share of glass is that of every wall's length, as one window at a place drawn from the seed.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from lanekeep_env.checks import LARGEST_SET, choose, ordered, plain_numbers, require, shown
from lanekeep_env.walls.shapes import bend_radius, outline, rectangle, rounded, with_windows
from lanekeep_env.walls.world import Floats, World

#: A car starts this far from the end wall behind it, and its line ends this far from the one ahead, m.
END_SPACE = 1.0

_NARROWEST = 0.5
# Walls that a circuit goes round are at least this long, m.
SMALLEST_BLOCK = 0.5


class WorldRecord:
    """What all records of worlds share: a kind, JSON-able fields and a fingerprint."""

    kind: ClassVar[str]
    #: Field with the narrowest corridor that turns by a right angle, and with the narrowest gap; "" for none.
    turns: ClassVar[str] = ""
    passes: ClassVar[str] = ""

    def to_dict(self) -> dict[str, Any]:
        """Return kind and fields as JSON-able values; `world_from` reads them back."""
        return {"kind": self.kind, **asdict(self)}  # type: ignore[call-overload]

    def fingerprint(self) -> str:
        """Text that changes whenever the world does."""
        return repr(sorted(self.to_dict().items()))

    def __post_init__(self) -> None:
        plain_numbers(self)

    def build(self) -> tuple[World, ...]:
        """Return the worlds of the set."""
        raise NotImplementedError


def range_of(name: str, value: Any, unit: str, least: float, most: float) -> tuple[float, float]:
    """Read bounds (low, high), or one number for both, between ``least`` and ``most``."""
    low, high = value if isinstance(value, tuple | list) and len(value) == 2 else (value, value)
    for bound in (low, high):
        require(name, bound, unit, at_least=least, at_most=most)
    if high < low:
        raise ValueError(f"{name}={shown(value)} is not allowed: the bounds must be (low, high) with low <= high")
    return float(low), float(high)


def _check_glass(record: Any) -> None:
    require("world.glass_share", record.glass_share, "", at_least=0.0, at_most=1.0)
    require("world.seed", record.seed, "", at_least=0, whole=True)


def _windows(walls: Floats, record: Any) -> tuple[Floats, Any]:
    return with_windows(walls, record.glass_share, np.random.default_rng([record.seed, 0x61A55]))


@dataclass(frozen=True)
class Corridor(WorldRecord):
    """A straight corridor of ``length`` x ``width`` m with end walls, from x = 0 along x, its middle at y = 0.

    Without a length, None, it is as long as a scenario's episodes ask for.
    """

    kind: ClassVar[str] = "corridor"
    length: float | None = 20.0
    width: float = 2.0
    glass_share: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("world.length", self.length, "m", at_least=3.0 * END_SPACE, at_most=10_000.0, optional=True)
        require("world.width", self.width, "m", at_least=_NARROWEST, at_most=100.0)
        _check_glass(self)
        super().__post_init__()

    def build(self) -> tuple[World, ...]:
        """One world."""
        if self.length is None:
            raise ValueError("world.length=None is not allowed here: no episode says how long; give it in m")
        corners = rectangle(self.length, self.width) + np.array([0.5 * self.length, 0.0])
        line = np.array([[END_SPACE, 0.0], [self.length - END_SPACE, 0.0]])
        return (World("corridor", *_windows(outline(corners), self), np.array([[END_SPACE, 0.0, 0.0]]), line),)


@dataclass(frozen=True)
class Ell(WorldRecord):
    """A corridor of ``width`` m with one right angle: outer lengths ``first`` and ``second`` m, ``turn`` left or right.

    The first leg runs along x from x = 0, its middle at y = 0.
    """

    kind: ClassVar[str] = "ell"
    turns: ClassVar[str] = "width"
    first: float = 8.0
    second: float = 8.0
    width: float = 2.0
    turn: str = "left"
    glass_share: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("world.width", self.width, "m", at_least=_NARROWEST, at_most=100.0)
        for name in ("first", "second"):
            value = getattr(self, name)
            require(f"world.{name}", value, "m", at_least=self.width + 2.0 * END_SPACE, at_most=10_000.0)
        choose("world.turn", self.turn, ("left", "right"))
        _check_glass(self)
        super().__post_init__()

    def build(self) -> tuple[World, ...]:
        """One world."""
        half, inner, top = 0.5 * self.width, self.first - self.width, self.second - 0.5 * self.width
        corners = np.array(
            [[0.0, -half], [self.first, -half], [self.first, top], [inner, top], [inner, half], [0.0, half]]
        )
        line = np.array([[END_SPACE, 0.0], [self.first - half, 0.0], [self.first - half, top - END_SPACE]])
        line = rounded(line, bend_radius(self.width), closed=False)
        mirror = [1.0, 1.0 if self.turn == "left" else -1.0]
        walls, glass = _windows(outline(corners * mirror), self)
        return (World(f"ell-{self.turn}", walls, glass, np.array([[END_SPACE, 0.0, 0.0]]), line * mirror),)


@dataclass(frozen=True)
class Slalom(WorldRecord):
    """A corridor of ``width`` m with ``count`` walls across it, ``spacing`` m apart, from alternate sides.

    Each leaves a gap of ``gap`` m at the other side; the first one stands at the left. The corridor
    runs along x from x = 0, its middle at y = 0.
    """

    kind: ClassVar[str] = "slalom"
    passes: ClassVar[str] = "gap"
    width: float = 3.0
    gap: float = 1.5
    spacing: float = 3.0
    count: int = 5
    glass_share: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("world.width", self.width, "m", at_least=2 * _NARROWEST, at_most=100.0)
        require("world.gap", self.gap, "m", at_least=_NARROWEST, at_most=self.width - 0.1)
        require("world.spacing", self.spacing, "m", at_least=END_SPACE, at_most=1000.0)
        require("world.count", self.count, "walls", at_least=1, at_most=1000, whole=True)
        _check_glass(self)
        super().__post_init__()

    def build(self) -> tuple[World, ...]:
        """One world."""
        first, half = END_SPACE + self.spacing, 0.5 * self.width
        at = first + self.spacing * np.arange(self.count)
        side = np.where(np.arange(self.count) % 2, -1.0, 1.0)
        length = at[-1] + self.spacing + END_SPACE
        across = np.column_stack([at, side * half, at, -side * (half - self.gap)])
        outer = outline(rectangle(length, self.width) + np.array([0.5 * length, 0.0]))
        walls, glass = _windows(np.concatenate([outer, across]), self)
        # Half cosine waves through the middles of the gaps.
        marks = np.concatenate([[0.0], -side * (half - 0.5 * self.gap), [0.0]])
        pieces = max(8, math.ceil(self.spacing / 0.1))
        x = np.arange(pieces * (self.count + 1) + 1) / pieces
        k = np.minimum(x.astype(np.int64), self.count)
        y = marks[k] + 0.5 * (1.0 - np.cos(np.pi * (x - k))) * (marks[k + 1] - marks[k])
        line = np.column_stack([END_SPACE + self.spacing * x, y])
        return (World("slalom", walls, glass, np.array([[END_SPACE, 0.0, 0.0]]), line),)


@dataclass(frozen=True)
class Circuit(WorldRecord):
    """A rectangular circuit of ``length`` x ``width`` m outside, its corridor ``corridor`` m wide.

    Whichever way it goes, a car follows the wall on its right: ``clockwise`` that is the inner one. It may start
    in the middle of any side; the centre line begins at the first of these.
    """

    kind: ClassVar[str] = "circuit"
    turns: ClassVar[str] = "corridor"
    length: float = 12.0
    width: float = 8.0
    corridor: float = 2.0
    clockwise: bool = False
    glass_share: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("world.corridor", self.corridor, "m", at_least=_NARROWEST, at_most=100.0)
        for name in ("length", "width"):
            smallest = 2.0 * self.corridor + SMALLEST_BLOCK
            require(f"world.{name}", getattr(self, name), "m", at_least=smallest, at_most=10_000.0)
        if not isinstance(self.clockwise, bool):
            raise ValueError(f"world.clockwise={self.clockwise!r} is not allowed: it must be True or False")
        _check_glass(self)
        super().__post_init__()

    def build(self) -> tuple[World, ...]:
        """One world."""
        return (self.world(f"circuit-{'clockwise' if self.clockwise else 'counterclockwise'}"),)

    def world(self, name: str) -> World:
        """Return the circuit under a name."""
        inner = rectangle(self.length - 2.0 * self.corridor, self.width - 2.0 * self.corridor)
        walls = np.concatenate([outline(rectangle(self.length, self.width)), outline(inner)])
        corners = rectangle(self.length - self.corridor, self.width - self.corridor)
        if self.clockwise:
            corners = corners[[1, 0, 3, 2]]
        ahead = np.roll(corners, -1, axis=0) - corners
        start = np.column_stack([corners + 0.5 * ahead, np.arctan2(ahead[:, 1], ahead[:, 0])])
        line = rounded(np.roll(corners, -1, axis=0), bend_radius(self.corridor), closed=True)
        return World(name, *_windows(walls, self), start, np.concatenate([start[:1, :2], line]), closed=True)


@dataclass(frozen=True)
class RandomCircuits(WorldRecord):
    """A set of rectangular circuits, clockwise and counter-clockwise in turn.

    Attributes:
        count: circuits in the set.
        shortest, longest: bounds of the outer sides, m; each side is drawn between them.
        narrowest, widest: bounds of the corridor's width, m.
        glass_share: as for all worlds.
        seed: of the set; other seeds give other circuits.
    """

    kind: ClassVar[str] = "random-circuits"
    turns: ClassVar[str] = "narrowest"
    count: int = 64
    shortest: float = 6.0
    longest: float = 20.0
    narrowest: float = 1.2
    widest: float = 3.0
    glass_share: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require("world.count", self.count, "circuits", at_least=1, at_most=LARGEST_SET, whole=True)
        require("world.narrowest", self.narrowest, "m", at_least=_NARROWEST, at_most=100.0)
        require("world.widest", self.widest, "m", at_least=_NARROWEST, at_most=100.0)
        ordered(self, "world", "narrowest", "widest")
        require("world.shortest", self.shortest, "m", at_least=2.0 * self.narrowest + SMALLEST_BLOCK, at_most=10_000.0)
        require("world.longest", self.longest, "m", at_least=0.0, at_most=10_000.0)
        ordered(self, "world", "shortest", "longest")
        _check_glass(self)
        super().__post_init__()

    def build(self) -> tuple[World, ...]:
        """``count`` worlds; a circuit too small for the widest corridor draws a narrower one."""
        rng = np.random.default_rng([self.seed, 0xC12C])
        worlds = []
        for k in range(self.count):
            length, width = rng.uniform(self.shortest, self.longest, 2)
            widest = min(self.widest, 0.5 * (min(length, width) - SMALLEST_BLOCK))
            corridor = rng.uniform(self.narrowest, max(widest, self.narrowest))
            seed = int(rng.integers(2**31))
            circuit = Circuit(length, width, corridor, k % 2 == 1, self.glass_share, seed)
            worlds.append(circuit.world(f"circuit-{self.seed}-{k}"))
        return tuple(worlds)
