"""Scans of wall segments, beam by beam with shapely, for tests that know the truth."""

from __future__ import annotations

import numpy as np
import shapely

#: The field of view assumed for the report's camera, rad, and its range, m.
VIEW, FARTHEST = np.deg2rad(70.0), 12.0


def cast(*walls: object, beams: int = 141) -> np.ndarray:
    """Ranges (1, beams), m, of shapely geometries (m, ahead and left of the camera), the range's end without a hit."""
    world = shapely.unary_union([shapely.LineString(wall) if isinstance(wall, list) else wall for wall in walls])
    angles = np.linspace(-0.5 * VIEW, 0.5 * VIEW, beams)
    ends = FARTHEST * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rays = shapely.linestrings(np.stack([np.zeros_like(ends), ends], axis=1))
    hits = shapely.intersection(rays, world)
    ranges = shapely.distance(shapely.Point(0.0, 0.0), hits)
    return np.where(np.isnan(ranges), FARTHEST, ranges)[None]


def wall(distance: float, angle: float, right: float = 50.0, left: float = 50.0) -> list[tuple[float, float]]:
    """A wall whose direction is ``angle`` rad, that crosses the car's axis ``distance`` m ahead; its lengths, m."""
    ahead, across = np.cos(angle), np.sin(angle)
    right, left = (right, left) if angle > 0.0 else (-right, -left)
    return [(distance - right * ahead, -right * across), (distance + left * ahead, left * across)]


def box(ahead: float, left: float, length: float, width: float, turned: float = 0.0) -> shapely.Polygon:
    """A box whose middle is there, m; ``turned`` rad."""
    shape = shapely.box(ahead - length / 2, left - width / 2, ahead + length / 2, left + width / 2)
    return shapely.affinity.rotate(shape, turned, use_radians=True)
