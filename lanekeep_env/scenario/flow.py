"""Driving among other cars: lanes, how many drive there, and what happens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, from_mapping, require, shown
from lanekeep_env.roads import RandomRoads, RoadSpec, SpeedSpec, speed_from
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.disturbances import bounds_from
from lanekeep_env.scenario.drive import ahead_channels
from lanekeep_env.scenario.powered import PoweredScenario

SITUATIONS = {"flow": at.FLOWS, "braking_lead": at.LEAD_BRAKES, "cut_in": at.CUTS_IN, "merging": at.MERGES}
#: Cars around that are shown, in their order: (ahead or behind, lanes to the left of the car's).
NEIGHBOURS = tuple((way, side) for side in (-1, 0, 1) for way in ("ahead", "behind"))
_SIDES = {-1: "right", 0: "own", 1: "left"}


@dataclass(frozen=True)
class Flow:
    """The other cars of `lanekeep/Traffic-v0`.

    Attributes:
        cars: how many.
        spacing: from car to car in a lane where an episode starts, m.
        speeds: bounds of the speed that each likes, drawn once an episode, m/s.
        situation: "flow" (they drive as they like), "braking_lead" (the one ahead brakes with 4 to 9 m/s²), "cut_in"
            (one comes from beside in front of the car), "merging" (the lane on the right, in which the car starts,
            ends).
    """

    cars: int = 20
    spacing: float = 80.0
    speeds: tuple[float, float] = (20.0, 28.0)
    situation: str = "flow"

    def __post_init__(self) -> None:
        require("flow.cars", self.cars, "cars", at_least=1, at_most=200, whole=True)
        require("flow.spacing", self.spacing, "m", at_least=15.0, at_most=500.0)
        object.__setattr__(self, "speeds", bounds_from("flow.speeds", "m/s", 1.0, 40.0, self.speeds))
        choose("flow.situation", self.situation, SITUATIONS)


def flow_from(value: Any) -> Flow:
    """Read traffic: a situation's name, a mapping of `Flow`'s fields, or a record; ValueError names what is wrong."""
    if isinstance(value, Flow):
        return value
    if isinstance(value, str):
        return Flow(situation=value)
    if isinstance(value, Mapping):
        return from_mapping(Flow, value, "flow")
    raise ValueError(f"flow={shown(value)} must be a situation ({', '.join(SITUATIONS)}) or a mapping of Flow's fields")


@dataclass(frozen=True)
class TrafficScenario(PoweredScenario):
    """Everything that defines `lanekeep/Traffic-v0`: the fields of `PoweredScenario` with other defaults, and these.

    Attributes:
        lanes: side by side; the road's line is the middle of the right-most one, number 0.
        flow: the other cars: a situation's name or a mapping of `Flow`.
        set_speed: bounds (low, high) of the speed that the car is asked for, m/s, drawn once an episode, or one number.

    Errors and departures are those from the middle of the nearest lane.
    """

    road: RoadSpec = field(default_factory=lambda: RandomRoads(peak_curvature=0.002, design_speed=33.0))
    speed: SpeedSpec = field(default_factory=lambda: speed_from(33.0))
    lane_width: float = 4.0
    reference_speed_error: float = 4.0
    episode_steps: int = 2000
    lanes: int = 3
    flow: Flow = field(default_factory=Flow)
    set_speed: tuple[float, float] = (27.0, 33.0)
    view: ClassVar[float] = 160.0

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **PoweredScenario._readers,
        "flow": flow_from,
        "set_speed": lambda value: bounds_from("set_speed", "m/s", 5.0, 45.0, value),
    }

    def _check(self) -> None:
        require("lanes", self.lanes, "lanes", at_least=1, at_most=8, whole=True)
        require("lane_width", self.lane_width, "m (traffic's cars are 2 m wide)", at_least=2.5)
        if self.lanes == 1 and self.flow.situation in ("cut_in", "merging"):
            raise ValueError(
                f"lanes=1 is not allowed with flow.situation={self.flow.situation!r}: it must be 2 at least"
            )
        super()._check()

    @property
    def edges(self) -> tuple[float, float]:
        """Right and left edge of the road, m left of its line."""
        return -self.lane_width / 2, (self.lanes - 0.5) * self.lane_width

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        car = self.vehicle
        return {
            **super().numbers(),
            at.WISH_LOW: self.set_speed,
            at.LANES: (self.lanes, self.lane_width),
            at.SITUATION: SITUATIONS[self.flow.situation],
            at.SPACING: self.flow.spacing,
            at.FLOW_LOW: self.flow.speeds,
            at.FIRST_NEIGHBOUR: self.column("ahead_right_distance"),
            at.BODY_MIDDLE: (car.cg_to_front_axle - car.cg_to_rear_axle) / 2,
            at.BODY_HALF_LENGTH: car.length / 2,
            at.BODY_HALF_WIDTH: car.width / 2,
        }

    def _channels(self) -> list[Channel]:
        far = float(at.FAR)
        channels = [
            replace(c, source=at.LANE_OFFSET, description="centre of gravity left of the nearest lane's middle")
            if c.name == "lateral_error"
            else c
            for c in super()._channels()
        ]
        channels += [*ahead_channels(), Channel("lane", "", 0.0, 7.0, "the nearest one, 0 for the right-most", at.LANE)]
        for way, side in NEIGHBOURS:
            name, where = f"{way}_{_SIDES[side]}", f"of the nearest car {way} in the {_SIDES[side]} lane"
            none = far if way == "ahead" else -far
            channels += [
                Channel(f"{name}_distance", "m", -far, far, f"{where}, from middle to middle, {none:g} without one"),
                Channel(f"{name}_speed", "m/s", -50.0, 50.0, f"{where}, along the road, 0 without one"),
                Channel(f"{name}_lane", "", -8.0, 8.0, f"{where}, lanes to the left of the middle of the car's own"),
            ]
        return channels
