"""Our roads as lanes of highway-env: straights, arcs and clothoids, exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane, LineType

from lanekeep_env.adapters.highway.axes import Floats, mirrored, turned
from lanekeep_env.roads import Road
from lanekeep_env.roads.road import chords

#: Where the search for the nearest point of a road begins: samples are at most this far apart, m ...
_SPACING = 1.0
#: ... and the road turns at most this much between them, rad.
_TURN = 0.25
_MOST_ITERATIONS = 50


class RoadLane(AbstractLane):
    """A road of ours, or a lane beside its centre line: offset curves are exact as well.

    ``longitudinal`` is the arc length of the road's centre line, ``lateral`` counts from the lane's middle, to the
    right, as everywhere in highway-env. A closed road's end is its start; an open one goes on beyond both ends.

    Args:
        road: ours, or a mapping of its fields.
        offset: of the lane's middle to the left of the road's centre line, m.
        width: m.
        line_types, forbidden, speed_limit, priority: as of every lane of theirs.
    """

    def __init__(
        self,
        road: Road | Mapping[str, Any],
        offset: float = 0.0,
        width: float = AbstractLane.DEFAULT_WIDTH,
        line_types: Sequence[int] | None = None,
        forbidden: bool = False,
        speed_limit: float = 20.0,
        priority: int = 0,
    ) -> None:
        road = road if isinstance(road, Road) else Road(**road)
        road.check_lane(abs(offset) + width / 2)
        self.road, self.offset, self.width = road, offset, width
        self.line_types = list(line_types or (LineType.STRIPED, LineType.STRIPED))
        self.forbidden, self.speed_limit, self.priority = forbidden, speed_limit, priority
        self.length = road.length
        spacing = min(_SPACING, _TURN / max(road.peak_curvature, 1e-9))
        self._pieces = pieces = road.refined(spacing)
        # With one more piece behind the end of an open road, where its last curvature goes on.
        self._starts = np.append(pieces.curvature_start, pieces.curvature_end[-1])
        self._slopes = np.append((pieces.curvature_end - pieces.curvature_start) / pieces.lengths, 0.0)
        self._last = len(pieces.lengths) - pieces.closed

    def position(self, longitudinal: float, lateral: float) -> Floats:
        """World position, m, (2,)."""
        return mirrored(self.road.position(longitudinal, self.offset + turned(lateral)))

    def heading_at(self, longitudinal: float) -> float:
        """Heading, rad."""
        return turned(float(self.road.heading(longitudinal)))

    def width_at(self, longitudinal: float) -> float:
        """The same everywhere, m."""
        return self.width

    def local_coordinates(self, position: Floats) -> tuple[float, float]:
        """Return (longitudinal, lateral), m, of the road's point nearest to a world position, by Newton's method."""
        road, place = self.road, mirrored(position)
        nearest = int(np.argmin(((self._pieces.points - place) ** 2).sum(axis=1)))
        s = float(self._pieces.stations[nearest])
        for _ in range(_MOST_ITERATIONS):
            along, across, curvature = self._seen_from(s, place)
            # Nearer to the centre of curvature than a tenth of the radius a step is held.
            step = along / max(1.0 - across * curvature, 0.1)
            s += step
            if abs(step) < 1e-9:  # the next one would be its square
                break
        across = self._seen_from(s, place)[1]
        return s % road.length if road.closed else s, turned(across - self.offset)

    def _seen_from(self, s: float, place: Floats) -> tuple[float, float, float]:
        """A place ahead and to the left of the road's point at ``s``, m, and the curvature there, 1/m.

        `Road.position` answers for any number of points; here is one, and its piece is short.
        """
        pieces = self._pieces
        s = s % pieces.length if pieces.closed else s
        k = min(max(int(np.searchsorted(pieces.stations, s, side="right")) - 1, 0), self._last)
        u, heading = s - pieces.stations[k], pieces.headings[k]
        start, slope = self._starts[k], self._slopes[k]
        x, y = place - pieces.points[k] - chords(heading, start, slope, u)
        heading += (start + 0.5 * slope * u) * u
        cosine, sine = math.cos(heading), math.sin(heading)
        return x * cosine + y * sine, y * cosine - x * sine, start + slope * u

    def to_config(self) -> dict[str, Any]:
        """Return what `lane_from_config` makes the same lane of, JSON-able."""
        road = self.road
        curve = {name: getattr(road, name).tolist() for name in ("lengths", "curvature_start", "curvature_end")}
        return {
            "class_path": f"{type(self).__module__}.{type(self).__qualname__}",
            "config": {
                "road": {"name": road.name, **curve, "closed": road.closed, "origin": list(road.origin)},
                "offset": self.offset,
                "width": self.width,
                "line_types": self.line_types,
                "forbidden": self.forbidden,
                "speed_limit": self.speed_limit,
                "priority": self.priority,
            },
        }
