"""Random scenes before the KnightRiders' camera, with their truth: a wall, an obstacle or nothing in the way.

A corridor, closed in the distance; in it a wall across or slanted, a box, or neither. Hard ones have glass, boxes at
the rim of the detection box, walls nearly along the car, boxes just beside or behind. Lengths are m, angles rad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_classes import NOTHING, OBSTACLE, WALL
from lanekeep_env.scenario import Scan
from lanekeep_env.sensing.ultrasonic import HALF_CONE
from lanekeep_env.walls.raycast import SCRATCH_ROWS, beam_table, cast_many

#: The camera, perfect: the faults are drawn by scene. Its beams (141) and angle (70 degrees) are assumptions.
CAMERA = Scan(beams=141)
FIRST = -0.5 * CAMERA.field_of_view
#: Of the published detection box: what is in the way overlaps it by 2 cm at the least, what is not keeps 2 cm off.
SIDE, AHEAD = 0.25, 1.0
#: Half the width of the way that the improved box covers, and how far ahead both look at the least and at the most.
WAY, SURELY, HARDLY = 0.235, 0.95, 1.3
CASES = ("plain", "rim of the box", "glass", "slanted under 8°", "beside or behind")
#: The side ultrasonics are so far behind the nose.
BEHIND = 0.25
_BEAMS_OF_CONE = 181


@dataclass(frozen=True)
class Scenes:
    """Scans (n, beams), 0 or NaN for nothing; what is heard ahead (n,) and beside (2, n); truth and case (n,)."""

    ranges: Floats
    heard: Floats
    beside: Floats
    truth: NDArray[np.int64]
    case: NDArray[np.int64]


def draw(count: int, seed: int) -> Scenes:
    """Return that many scenes."""
    random = np.random.default_rng(seed)
    ranges, heard, beside = np.empty((count, CAMERA.beams)), np.empty(count), np.empty((2, count))
    truth, case = random.integers(0, 3, count), np.empty(count, dtype=np.int64)
    for i in range(count):
        make = {NOTHING: _nothing, WALL: _wall, OBSTACLE: _obstacle}[int(truth[i])]
        case[i], solid, glass = make(random)
        seen, unseen = _corridor(random)
        solid, glass = solid + seen, glass + unseen
        ranges[i] = with_faults(cast(solid), random)
        heard[i] = echo(solid + glass, 0.0, random)
        beside[:, i] = [echo(solid + glass, side * 0.5 * np.pi, random, BEHIND) for side in (-1.0, 1.0)]
    return Scenes(ranges, heard, beside, truth, case)


def echo(walls: list[Floats], direction: float, random: np.random.Generator, behind: float = 0.0) -> float:
    """Return what an ultrasonic ``behind`` the nose hears, m: the nearest part of a wall inside its cone."""
    cosine, sine = np.cos(direction), np.sin(direction)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    turned = [((wall.reshape(2, 2) + np.array([behind, 0.0])) @ turn).ravel() for wall in walls]
    return float(cast(turned, _BEAMS_OF_CONE, HALF_CONE).min() * (1.0 + 0.005 * random.standard_normal()))


def cast(walls: list[Floats], beams: int = CAMERA.beams, half_view: float = -FIRST) -> Floats:
    """Return the ranges of a fan to walls (x0, y0, x1, y1) before the camera, (beams,), m."""
    rows = np.ascontiguousarray(np.array(walls, dtype=np.float64).T)
    step = 2.0 * half_view / (beams - 1)
    table = beam_table(beams, step)
    ranges, fan, scratch = np.empty((1, beams)), np.empty(table.shape[1]), np.empty((SCRATCH_ROWS, rows.shape[1]))
    cast_many(np.zeros((1, 3)), -half_view, (step, CAMERA.farthest, table), rows, scratch, fan, ranges)
    return ranges[0]


def with_faults(ranges: Floats, random: np.random.Generator) -> Floats:
    """Return a scan with noise, errors beside jumps and lost beams: regular, at the rims, single, out of range."""
    beams = np.arange(len(ranges))
    step = np.append(np.diff(ranges), 0.0)
    shifted = (np.abs(step) > 0.3) & (random.random(len(ranges)) < 0.5)
    read = ranges + np.where(shifted, step * random.random(len(ranges)), 0.0)
    read += random.uniform(0.002, 0.01) * read**2 * random.standard_normal(len(ranges))
    every, rim = random.integers(6, 20), random.integers(0, 6)
    lost = (beams % every == every - 1) | (beams < rim) | (beams >= len(ranges) - rim)
    lost |= (read >= CAMERA.farthest) | (read < CAMERA.nearest)
    return np.where(random.random(len(ranges)) < 0.02, np.nan, np.where(lost, 0.0, read))


def line(distance: float, angle: float, first: float = -8.0, last: float = 8.0) -> Floats:
    """A wall at an angle to the car that crosses its axis there, between two ways along it from the crossing."""
    way = np.array([np.cos(angle), np.sin(angle)])
    return np.concatenate([[distance, 0.0] + first * way, [distance, 0.0] + last * way])


def box(ahead: float, left: float, length: float, width: float, angle: float = 0.0) -> list[Floats]:
    """The sides of a box around a middle."""
    corners = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [length, width]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    places = corners @ turn + [ahead, left]
    return [np.concatenate([places[k - 1], places[k]]) for k in range(4)]


Found = tuple[int, list[Floats], list[Floats]]


def _corridor(random: np.random.Generator) -> tuple[list[Floats], list[Floats]]:
    """Return a corridor's walls that the camera sees, and those of glass: one in seven sides."""
    right, left, end = random.uniform(0.4, 1.5), random.uniform(0.4, 1.5), random.uniform(3.0, 8.0)
    sides = [(-1.5, -right, end, -right), (-1.5, left, end, left)]
    glass = random.random(2) < 1.0 / 7.0
    walls = [np.array(side) for side, unseen in zip(sides, glass, strict=True) if not unseen]
    panes = [np.array(side) for side, unseen in zip(sides, glass, strict=True) if unseen]
    return [*walls, np.array([end, -2.0, end, 2.0])], panes


def _crossing(random: np.random.Generator, angle: float) -> float:
    """Return where a wall crosses the axis: inside the box, and beside the body at the nose."""
    least = max(0.6, 0.2 / np.sin(angle))
    return float(random.uniform(least, max(least, min(SURELY + 0.2 / np.tan(angle), 1.6))))


def _wall(random: np.random.Generator) -> Found:
    angle = random.uniform(np.deg2rad(13.0), 0.5 * np.pi)
    wall = _crossing(random, angle), random.choice([-1.0, 1.0]) * angle
    if random.random() < 0.75:
        return CASES.index("plain"), [line(*wall)], []
    if random.random() < 0.5:
        return CASES.index("glass"), [], [line(*wall)]
    pane = 0.5 * random.uniform(0.3, 1.0)
    return CASES.index("glass"), [line(*wall, -8.0, -pane), line(*wall, pane, 8.0)], [line(*wall, -pane, pane)]


def _obstacle(random: np.random.Generator) -> Found:
    length, width = random.uniform(0.15, 0.5, 2)
    if random.random() < 0.5:  # its middle is in the way, and its nearest part is surely inside the box
        left, angle = random.uniform(-0.15, 0.15), random.uniform(0.0, np.pi)
        reach = 0.5 * (abs(length * np.cos(angle)) + abs(width * np.sin(angle)))
        return CASES.index("plain"), box(random.uniform(0.58, 0.85) + reach, left, length, width, angle), []
    left = random.choice([-1.0, 1.0]) * (WAY - random.uniform(0.02, 0.08) + 0.5 * width)
    return CASES.index("rim of the box"), box(random.uniform(0.58, SURELY) + 0.5 * length, left, length, width), []


def _nothing(random: np.random.Generator) -> Found:
    which = random.random()
    if which < 0.3:
        return CASES.index("plain"), [], []
    if which < 0.6:
        angle = np.deg2rad(random.uniform(3.0, 8.0))
        wall = line(_crossing(random, angle), random.choice([-1.0, 1.0]) * angle)
        return CASES.index("slanted under 8°"), [wall], []
    length, width = random.uniform(0.15, 0.5, 2)
    if which < 0.8:
        left = random.choice([-1.0, 1.0]) * (SIDE + random.uniform(0.02, 0.1) + 0.5 * width)
        return CASES.index("beside or behind"), box(random.uniform(0.6, 1.2) + 0.5 * length, left, length, width), []
    ahead = random.uniform(HARDLY, 2.0) + 0.5 * length
    return CASES.index("beside or behind"), box(ahead, random.uniform(-0.3, 0.3), length, width), []
