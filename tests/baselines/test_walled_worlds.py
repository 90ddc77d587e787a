"""`knightriders-circuit` in drawn worlds between walls: circuits, corridors with one bend, slaloms."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, ClassVar

import circuit_laps
import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env.walls import World
from lanekeep_env.walls.generators import Circuit, Ell, Slalom, WorldRecord

#: Cars and sensors that worlds are driven with.
VARIANTS: dict[str, dict[str, Any]] = {
    "perfect": {},
    "all": {
        "sensors": "production",
        "scan": "kinect",
        "encoder_ticks": 40,
        "steering_offset": (-math.radians(3), math.radians(3)),
    },
    "production": {"sensors": "production"},
    "kinect": {"scan": "kinect"},
    "servo": {"servo": {"left": math.radians(20), "right": math.radians(24), "ticks": 50}},
    "servo2": {"servo": {"left": math.radians(24), "right": math.radians(19), "ticks": 50}, "sensors": "production"},
    "ticks": {"encoder_ticks": 40},
    "offset": {"steering_offset": (-math.radians(3), math.radians(3))},
}
#: Why windows are still touched: in 16 of 111 training worlds ("any+g", 37 from seed 32000 on, with each of the first
#: three variants).
GLASS = (
    "side windows look like openings until the front cone hears them at an angle, and nearer than the camera sees the "
    "car takes what the front cone hears for a wall that was shown before, and does not slow down for it; a corner "
    "that was measured once, past windows, is believed; lost cars back up into walls beside them. Most contacts (11 of "
    "15 in 120 training worlds) are of lost cars that have backed up and drive on at 1.5 m/s into the window they hear"
)
#: Radius of the S-curves that slaloms leave room for, and further way between their walls, m.
RADIUS, ROOM = 1.1, 0.8


def draw(kind: str, seed: int) -> WorldRecord:
    """Draw a world: corridors of 0.8 to 3 m, circuits and bends of 4 to 80 m; "+g": up to a fifth of glass."""
    rng = np.random.default_rng([seed, 77, sum(map(ord, kind))])
    glass = float(rng.uniform(0.0, 0.2)) if kind.endswith("+g") else 0.0
    kind = kind.removesuffix("+g")
    if kind == "any":
        corridor = rng.uniform(0.8, 3.0)
        shortest = max(4.0, 2.0 * corridor + 0.5)
        sides = np.maximum(np.exp(rng.uniform(np.log(shortest), np.log(80.0), 2)), 2.0 * corridor + 0.5)
        length, width = (float(side) for side in sides)
        return Circuit(length, width, float(corridor), bool(rng.integers(2)), glass, seed)
    if kind == "ell":
        width = float(rng.uniform(0.8, 3.0))
        legs = np.maximum(np.exp(rng.uniform(np.log(width + 2.0), np.log(80.0), 2)), width + 2.0)
        return Ell(float(legs[0]), float(legs[1]), width, ["left", "right"][rng.integers(2)], glass, seed)
    width = float(rng.uniform(1.2, 3.0))
    gap = float(rng.uniform(0.8, width - 0.2))
    shift = width - gap
    ahead = math.sqrt(max(4.0 * RADIUS * shift - shift * shift, 0.0))
    spacing = max(1.0, ahead + ROOM) + rng.uniform(0.0, 2.5)
    return Slalom(width, gap, float(spacing), int(rng.integers(2, 7)), glass, seed)


@dataclass(frozen=True)
class Drawn(WorldRecord):
    """A set of ``count`` worlds of a kind that `draw` knows, from seed ``first`` on."""

    kind: ClassVar[str] = "drawn"
    drawn: str = "any"
    first: int = 0
    count: int = 10

    def build(self) -> tuple[World, ...]:
        return tuple(draw(self.drawn, self.first + k).build()[0] for k in range(self.count))


def drive(kind: str, variant: str, first: int, count: int, steps: int = 4500) -> list[str]:
    """Drive ``count`` worlds in one environment; "lap", "contact" or "timeout" of each."""
    env = gym.make_vec(
        "lanekeep/Circuit-v0",
        count,
        "vector_entry_point",
        world=Drawn(kind, first, count),
        episode_steps=steps,
        max_episode_steps=steps,
        **VARIANTS[variant],
    )
    return circuit_laps.endings(env, "knightriders-circuit", first)


@pytest.mark.parametrize(("kind", "variant"), [("any", "production"), ("ell", "perfect"), ("slalom", "kinect")])
def test_a_few_worlds(kind: str, variant: str) -> None:
    assert Counter(drive(kind, variant, 9000, 20))["lap"] >= 19


def endings_of(kinds: dict[str, int], first: int) -> Counter[str]:
    """Drive so many worlds of each kind with each variant; how they end."""
    found = Counter[str]()
    for variant in VARIANTS:
        for kind, count in kinds.items():
            endings = drive(kind, variant, first, count)
            print(variant, kind, dict(Counter(endings)), [first + i for i, e in enumerate(endings) if e != "lap"])
            found.update(endings)
            first += count
    print(dict(found))
    return found


@pytest.mark.slow
def test_a_thousand_worlds_without_glass() -> None:
    found = endings_of({"any": 53, "ell": 36, "slalom": 36}, 810103)
    assert found["contact"] < 0.01 * found.total()
    assert found["lap"] >= 0.99 * found.total()


@pytest.mark.slow
@pytest.mark.xfail(strict=True, reason=GLASS)
def test_three_hundred_worlds_with_glass() -> None:
    found = endings_of({"any+g": 37}, 6000)
    assert found["contact"] < 0.01 * found.total()
