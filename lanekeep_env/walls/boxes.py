"""Boxes that stand between walls: (x, y, heading, length, width) each, in m and rad."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lanekeep_env.checks import require, shown
from lanekeep_env.walls.shapes import outline, rectangle
from lanekeep_env.walls.world import Floats

Box = tuple[float, float, float, float, float]


def box_outline(box: Box) -> Floats:
    """Walls of a box (x, y, heading, length, width; m, rad), (4, 4)."""
    x, y, heading, length, width = box
    turn = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
    return outline(rectangle(length, width) @ turn + (x, y))


def boxes_from(value: Any) -> tuple[Box, ...]:
    """Read boxes: a sequence of (x, y, heading, length, width), m and rad."""
    if not isinstance(value, tuple | list) or not all(isinstance(one, tuple | list) and len(one) == 5 for one in value):
        raise ValueError(
            f"world.boxes={shown(value)} is not allowed: a list of (x, y, heading, length, width), in m and rad"
        )
    for k, box in enumerate(value):
        for name, number in zip(("x", "y", "heading", "length", "width"), box, strict=True):
            least, most = (0.01, 100.0) if name in ("length", "width") else (-1e4, 1e4)
            unit = "rad" if name == "heading" else "m"
            require(f"world.boxes[{k}].{name}", number, unit, at_least=least, at_most=most)
    return tuple(tuple(float(number) for number in box) for box in value)  # type: ignore[misc]


def check_apart(boxes: tuple[Box, ...]) -> None:
    """Raise ValueError for two boxes that overlap (separating axes of rectangles)."""
    corners = [box_outline(box)[:, :2] for box in boxes]
    for k, first in enumerate(corners):
        for j in range(k):
            if not _part(first, corners[j]):
                raise ValueError(f"world.boxes[{k}]={shown(boxes[k])} is not allowed: it overlaps box {j}")


def _part(first: Floats, second: Floats) -> bool:
    for shape in (first, second):
        edges = np.diff(shape[:3], axis=0)
        for normal in np.column_stack([-edges[:, 1], edges[:, 0]]):
            a, b = first @ normal, second @ normal
            if a.max() < b.min() or b.max() < a.min():
                return True
    return False


def covers(box: Box, x: float, y: float) -> bool:
    """Whether a point (m) is inside a box."""
    bx, by, heading, length, width = box
    dx, dy = x - bx, y - by
    along = math.cos(heading) * dx + math.sin(heading) * dy
    across = math.cos(heading) * dy - math.sin(heading) * dx
    return abs(along) <= 0.5 * length and abs(across) <= 0.5 * width
