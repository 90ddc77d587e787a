"""A car on a road: where it starts, how far it may leave its lane, and how slow and fast it gets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, require
from lanekeep_env.physics.load_transfer import LARGEST_ALONG
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.roads import RandomRoads, Road, RoadSpec, road_from, road_set
from lanekeep_env.scenario.car import DEPARTURES, CarScenario
from lanekeep_env.scenario.integration import Integration, rolling, slipping

#: Share of the tightest radius that a lane reaches to inside.
_REACH = 0.9


def _half_width(road: Road) -> float:
    """Half the width that a road's file gives, m; ValueError without any."""
    widths = np.full(1, np.nan) if road.beside is None else road.beside[:, 1:3]
    if np.isnan(widths).all():
        raise ValueError(f"lane_width='file' is not allowed: road {road.name!r} comes without widths (w_tr_left_m ...)")
    return min(float(np.nanmin(widths)), _REACH / max(road.peak_curvature, 1e-9))


@dataclass(frozen=True)
class RoadScenario(CarScenario):
    """A car on a road: the fields of `CarScenario` and these. Subclasses add what their task needs.

    Attributes:
        road: the name of a generator, a mapping with its settings, or the path of a centre-line CSV file. Open ones are
            entered ``episode_steps`` before their end.
        start_lateral_error: the start is drawn within this distance of the lane's centre, m.
        start_course_error: the course at the start is drawn within this angle of the road's, rad.
        lane_width: m; the car departs when its reference point is more than half of it off the centre. "file": twice
            the smallest distance of an edge from the centre line that the road's file gives, and no more than nine
            tenths of twice the tightest radius, inside which a lane folds over itself; cars then start within half of
            that from the centre.
        departure: "terminate" ends the episode, "cost" goes on and charges, "off" ignores departures.
    """

    road: RoadSpec = field(default_factory=RandomRoads)
    start_lateral_error: float = 0.5
    start_course_error: float = math.radians(2.0)
    lane_width: float = 3.5
    departure: str = "terminate"

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {**CarScenario._readers, "road": road_from}
    #: The first of the channels that show the road ahead.
    preview_channel: ClassVar[str] = "curvature_preview_0"
    #: How much road a picture shows, m.
    view: ClassVar[float] = 100.0

    def _settle(self) -> None:
        super()._settle()
        if isinstance(self.lane_width, str):
            choose("lane_width", self.lane_width, ("file",))
            roads = [road for road, _ in road_set(self.road, self.speed)]
            half = min(_half_width(road) for road in roads)
            object.__setattr__(self, "lane_width", round(2.0 * half, 6))
            require("start_lateral_error", self.start_lateral_error, "m", at_least=0.0)
            object.__setattr__(self, "start_lateral_error", min(self.start_lateral_error, round(half / 2, 6)))

    def _check(self) -> None:
        require("lane_width", self.lane_width, "m", at_least=1e-3, at_most=1e3)
        limit = self.departure_limit
        require("start_lateral_error", self.start_lateral_error, "m", at_least=0.0, at_most=limit)
        require("start_course_error", self.start_course_error, "rad", at_least=0.0, at_most=1.0)
        choose("departure", self.departure, DEPARTURES)
        super()._check()

    @property
    def departure_limit(self) -> float:
        """Lateral error beyond which the car has left its lane, m."""
        return self.lane_width / 2

    @property
    def edges(self) -> tuple[float, float]:
        """Right and left edge of the road, m left of its line."""
        return -self.lane_width / 2, self.lane_width / 2

    @cached_property
    def integration(self) -> Integration:
        """Integration step, s, and slip-speed floor, m/s, of the cars of all episodes."""
        if self.model.slips:
            pull = LARGEST_ALONG * GRAVITY * self._friction * self.randomisation.friction[1]
            return slipping(
                self.vehicle,
                self.randomisation,
                self.base_step,
                self._slowest,
                self._fastest,
                pull if self.model.transfers_load else None,
            )
        try:
            return rolling(self.vehicle, self.base_step, self._fastest, self.largest_angle)
        except ValueError:  # which a road on which no car gets so fast does not take
            return rolling(self.vehicle, self.base_step, min(self._fastest, self._fastest_here()), self.largest_angle)

    def _slowest(self) -> float:
        """Lowest speed that an episode can have, m/s; builds the roads."""
        return 0.0

    def _fastest_here(self) -> float:
        """Largest speed on any of the roads, m/s; builds them."""
        profiles = [speeds for _, speeds in road_set(self.road, self.speed)]
        return max(float(speeds.max()) for speeds in profiles) * self.randomisation.speed[1]

    @property
    def _fastest(self) -> float:
        """Largest one."""
        return self.speed.largest * self.randomisation.speed[1]

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        return {
            **super().numbers(),
            at.HALF_LANE: self.departure_limit,
            at.DEPARTURE: DEPARTURES[self.departure],
            at.START_LATERAL: self.start_lateral_error,
            at.START_HEADING: self.start_course_error,
            at.LATERAL_LIMIT: self.speed.lateral_limit,
            at.FIRST_PREVIEW: self.column(self.preview_channel),
        }

    def _fingerprint(self) -> dict[str, Any]:
        return {**super()._fingerprint(), "road": self.road.fingerprint()}
