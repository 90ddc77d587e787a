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
from lanekeep_env.randomisation import Randomisation, Range
from lanekeep_env.roads import RandomRoads, Road, RoadSpec, road_from, road_set
from lanekeep_env.scenario import disturbances
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.car import DEPARTURES, CarScenario
from lanekeep_env.scenario.effects import Need
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
        bank: bounds (low, high) of the road's roll angle, rad, drawn once an episode, or one number; left side up is
            positive and pulls to the right. Cars with tyres only, as the wind.
        crosswind: the same of the wind to the left, m/s.
        gusts: standard deviation of what it has more or less, m/s, a first-order random process.
        gust_time: of that process's correlation, which falls by e in it, s.
        patches: of other friction along the road, a mapping of `Patches`, or None; saturating tyres only.
        changes: of the car in mid-episode, a mapping of `Changes`, or None.

    What disturbs the car is no channel but in the full observation. Its steering's gain and offset are the vehicle's
    and the randomisation's.
    """

    road: RoadSpec = field(default_factory=RandomRoads)
    start_lateral_error: float = 0.5
    start_course_error: float = math.radians(2.0)
    lane_width: float = 3.5
    departure: str = "terminate"
    bank: Range = (0.0, 0.0)
    crosswind: Range = (0.0, 0.0)
    gusts: float = 0.0
    gust_time: float = 2.0
    patches: disturbances.Patches | None = None
    changes: disturbances.Changes | None = None

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **CarScenario._readers,
        **disturbances.READERS,
        "road": road_from,
    }
    _needs: ClassVar[tuple[Need, ...]] = (*CarScenario._needs, *disturbances.NEEDS)
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
        disturbances.check(self)

    @property
    def departure_limit(self) -> float:
        """Lateral error beyond which the car has left its lane, m."""
        return self.lane_width / 2

    @cached_property
    def curvature_bound(self) -> float:
        """Bound of the channels that show curvature, 1/m: 1, or the next whole number that no bend exceeds."""
        return max(1.0, *(float(math.ceil(road.peak_curvature)) for road, _ in road_set(self.road, self.speed)))

    def _curvature(self, name: str, description: str, source: int | None = None) -> Channel:
        return Channel(name, "1/m", -self.curvature_bound, self.curvature_bound, description, source)

    @property
    def edges(self) -> tuple[float, float]:
        """Right and left edge of the road, m left of its line."""
        return -self.lane_width / 2, self.lane_width / 2

    @property
    def steering_errs(self) -> bool:
        """Whether the road wheel goes elsewhere than it is told."""
        steering, drawn = self.vehicle.steering, self.randomisation
        gains, offsets = (steering.gain, *drawn.steering_gain), (steering.offset, *drawn.steering_offset)
        return gains != (1.0, 1.0, 1.0) or offsets != (0.0, 0.0, 0.0)

    @property
    def pushed(self) -> bool:
        """Whether anything pushes the car sideways."""
        return self.model.slips and (self.bank != (0.0, 0.0) or self.crosswind != (0.0, 0.0) or self.gusts > 0.0)

    @property
    def disturbed(self) -> bool:
        """Whether anything does."""
        return self.pushed or self.steering_errs or self.patches is not None or self.changes is not None

    @property
    def occurring(self) -> Randomisation:
        """Bounds of all cars that occur in an episode."""
        return disturbances.widened(self.randomisation, self.changes)

    @cached_property
    def integration(self) -> Integration:
        """Integration step, s, and slip-speed floor, m/s, of the cars of all episodes."""
        if self.model.slips:
            pull = (
                LARGEST_ALONG
                * GRAVITY
                * self._friction
                * self.occurring.friction[1]
                * disturbances.grippiest_patch(self)
            )
            return slipping(
                self.vehicle,
                self.occurring,
                self.base_step,
                self._slowest,
                self._fastest,
                pull if self.model.transfers_load else None,
            )
        try:
            return rolling(self.vehicle, self.base_step, self._fastest, self.widest_angle)
        except ValueError:  # which a road on which no car gets so fast does not take
            return rolling(self.vehicle, self.base_step, min(self._fastest, self._fastest_here()), self.widest_angle)

    @property
    def _least_share(self) -> float:
        """Least that patches and changes leave of the friction."""
        changed = 1.0 if self.changes is None else min(1.0, self.changes.friction[0])
        return changed * disturbances.lowest_patch(self)

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

    @property
    def fastest(self) -> float:
        """Largest speed of an episode, m/s."""
        return self._fastest

    def _hidden_channels(self) -> list[Channel]:
        return disturbances.channels(self) if self.observation == "full" else []

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        return {
            **super().numbers(),
            **(disturbances.numbers(self) if self.disturbed else {}),
            at.HALF_LANE: self.departure_limit,
            at.DEPARTURE: DEPARTURES[self.departure],
            at.START_LATERAL: self.start_lateral_error,
            at.START_HEADING: self.start_course_error,
            # The profile asks for no more than the most slippery place gives.
            at.LATERAL_LIMIT: self.speed.lateral_limit / self._least_share,
            at.FIRST_PREVIEW: self.column(self.preview_channel),
        }

    def _fingerprint(self) -> dict[str, Any]:
        return {**super()._fingerprint(), "road": self.road.fingerprint()}
