"""Scenarios: frozen records of everything that defines an environment, checked when they are built."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np

from lanekeep_env.checks import choose, nearest, plain_numbers, require
from lanekeep_env.physics.parameters import VEHICLES, VehicleParameters, vehicle_from
from lanekeep_env.randomisation import Randomisation, randomisation_from
from lanekeep_env.roads import LimitedSpeed, RandomRoads, RoadSpec, RoadWorksRoads, SpeedSpec, road_from, speed_from
from lanekeep_env.sensing.faults import Sensors, sensors_from, sensors_to_dict

#: Integration step of every vehicle model, s; control steps and delays are multiples of it.
INTEGRATION_STEP = 0.01


@dataclass(frozen=True)
class Channel:
    """One entry of the observation."""

    name: str
    unit: str
    low: float
    high: float
    description: str


#: Fields that may be given by name, number or mapping, and how they are read.
_READERS: dict[str, Callable[[Any], Any]] = {
    "vehicle": vehicle_from,
    "road": road_from,
    "speed": speed_from,
    "randomisation": randomisation_from,
    "sensors": sensors_from,
}


@dataclass(frozen=True)
class LaneKeepScenario:
    """Everything that defines `lanekeep/LaneKeep-v0`; every field is a keyword of ``gym.make``.

    Attributes:
        vehicle: a name ("yin", "commonroad-1" ... "commonroad-3"), a mapping of changes to a named one
            (``{"base": "yin", "mass": 2000.0}``) or `VehicleParameters`.
        dynamics: "dynamic" (sideslip and tyres) or "kinematic" (no slip).
        tyre: "linear" or "magic_formula" (saturates at friction times load); dynamic car only.
        friction: road friction coefficient; only saturating tyres know it, with others it has no effect.
        road: the name of a generator, a mapping with its settings, or the path of a centre-line CSV file.
        speed: m/s, or a mapping of `LimitedSpeed`; 0.4 g of lateral acceleration and 180 km/h by default.
        action: "steering_angle" (the action is the road-wheel angle asked for) or "steering_rate".
        max_steering_angle: road-wheel angle that action 1 asks for, rad; also bounds the command in rate mode.
        max_steering_rate: road-wheel speed that action 1 asks for, rad/s (rate mode).
        start_lateral_error: the start is drawn within this distance of the lane's centre, m.
        start_course_error: the course at the start is drawn within this angle of the road's, rad.
        lane_width: m; the car departs when its centre of gravity is more than half of it off the centre.
        departure: "terminate" ends the episode, "cost" goes on and charges, "off" ignores departures.
        reference_lateral_error, cost_weight, reference_steering_rate, cost_cap: m, w, rad/s and 1/s of the
            running cost min(cap, (d / reference)² + w (road-wheel speed / reference)²).
        preview: number of curvature samples in the observation, the first one at the car.
        preview_interval: time between preview samples at the present speed, s.
        observation: "measured" (what sensors give) or "full" (adds sideslip, curvature, lateral acceleration).
        randomisation: what differs from episode to episode: "nominal", "mismatch", "stress" or a mapping of
            bounds (see `Randomisation`).
        sensors: faults of the measured channels: None, "production", "poor" or a mapping of channels to
            faults (see `Sensor`).
        control_step: s, a multiple of 10 ms.
        episode_steps: control steps of an episode: it is truncated after them, a departure is charged for the
            rest of them, and open roads are entered that much before their end. ``max_episode_steps`` of
            ``gym.make`` can only shorten an episode; give both for longer ones.
    """

    vehicle: VehicleParameters = VEHICLES["yin"]
    dynamics: str = "dynamic"
    tyre: str = "linear"
    friction: float = 1.0
    road: RoadSpec = field(default_factory=RandomRoads)
    speed: SpeedSpec = field(default_factory=LimitedSpeed)
    action: str = "steering_angle"
    max_steering_angle: float = 0.15
    max_steering_rate: float = 0.4
    start_lateral_error: float = 0.5
    start_course_error: float = math.radians(2.0)
    lane_width: float = 3.5
    departure: str = "terminate"
    reference_lateral_error: float = 0.5
    cost_weight: float = 1.0
    reference_steering_rate: float = 0.1
    cost_cap: float = 16.0
    preview: int = 0
    preview_interval: float = 0.1
    observation: str = "measured"
    randomisation: Randomisation = field(default_factory=Randomisation)
    sensors: Sensors = ()
    control_step: float = 0.05
    episode_steps: int = 600

    def __post_init__(self) -> None:
        for name, read in _READERS.items():
            object.__setattr__(self, name, read(getattr(self, name)))
        self._check()
        plain_numbers(self)

    def _check(self) -> None:
        choose("dynamics", self.dynamics, ("dynamic", "kinematic"))
        choose("tyre", self.tyre, ("linear", "magic_formula"))
        require("friction", self.friction, "", above=0.0, at_most=2.0)
        choose("action", self.action, ("steering_angle", "steering_rate"))
        require("max_steering_angle", self.max_steering_angle, "rad", above=0.0, at_most=1.5)
        require("max_steering_rate", self.max_steering_rate, "rad/s", above=0.0)
        require("lane_width", self.lane_width, "m", above=0.0)
        limit = self.departure_limit
        require("start_lateral_error", self.start_lateral_error, "m", at_least=0.0, at_most=limit)
        require("start_course_error", self.start_course_error, "rad", at_least=0.0, at_most=1.0)
        choose("departure", self.departure, ("terminate", "cost", "off"))
        require("reference_lateral_error", self.reference_lateral_error, "m", above=0.0)
        require("cost_weight", self.cost_weight, "", at_least=0.0)
        require("reference_steering_rate", self.reference_steering_rate, "rad/s", above=0.0)
        require("cost_cap", self.cost_cap, "1/s", above=0.0)
        require("preview", self.preview, "samples", at_least=0, at_most=1000, whole=True)
        require("preview_interval", self.preview_interval, "s", above=0.0)
        choose("observation", self.observation, ("measured", "full"))
        require("control_step", self.control_step, "s", above=0.0, at_most=1.0)
        multiple_of_step("control_step", self.control_step)
        require("episode_steps", self.episode_steps, "steps", at_least=1, at_most=10_000_000, whole=True)
        for channel, sensor in self.sensors:
            sensor.check(channel, self.control_step)
        multiple_of_step("vehicle.steering.delay", self.vehicle.steering.delay)

    @classmethod
    def from_keywords(cls, others: Iterable[str] = (), /, **keywords: Any) -> LaneKeepScenario:
        """Build a scenario from the keywords of ``gym.make``; ``others`` are further ones that it may name.

        Raises:
            ValueError: a value that is not allowed.
            TypeError: an unknown keyword; the nearest valid one is named.
        """
        allowed = [f.name for f in fields(cls)]
        for key in keywords:
            if key not in allowed:
                allowed += others
                raise TypeError(f"unknown keyword {key!r}{nearest(key, allowed)}; allowed: {', '.join(allowed)}")
        return cls(**keywords)

    @property
    def departure_limit(self) -> float:
        """Lateral error beyond which the car has left its lane, m."""
        return self.lane_width / 2

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Name, unit, bounds and meaning of each entry of the observation, in order."""
        angle = 1.6
        channels = [
            Channel("lateral_error", "m", -20.0, 20.0, "centre of gravity left of the lane's centre"),
            Channel("heading_error", "rad", -math.pi, math.pi, "heading minus the road's, left positive"),
            Channel("yaw_rate", "rad/s", -4.0, 4.0, "left positive"),
            Channel("speed", "m/s", 0.0, 100.0, "present speed"),
            Channel("steering_angle", "rad", -angle, angle, "road wheel, left positive"),
            Channel("steering_command", "rad", -angle, angle, "command that last entered the actuator"),
        ]
        for k in range(self.preview):
            ahead = f"{k * self.preview_interval:g} s ahead" if k else "at the car"
            channels.append(Channel(f"curvature_preview_{k}", "1/m", -1.0, 1.0, f"of the road {ahead}, left positive"))
        if self.observation == "full":
            channels += [
                Channel("sideslip", "rad", -math.pi, math.pi, "course minus heading"),
                Channel("curvature", "1/m", -1.0, 1.0, "of the road at the car, left positive"),
                Channel("lateral_acceleration", "m/s²", -50.0, 50.0, "of the centre of gravity, left positive"),
            ]
        for name, sensor in self.sensors:
            if sensor.numbers(self.control_step)[3] > 1 or sensor.dropout > 0.0:
                channels.append(Channel(f"{name}_new", "", 0.0, 1.0, f"1 where {name} is a new sample, else 0"))
        return tuple(channels)

    def channel_bounds(self) -> np.ndarray:
        """Low and high of each channel as float32, shape (channels, 2)."""
        return np.array([(c.low, c.high) for c in self.channels], dtype=np.float32)

    def to_dict(self) -> dict[str, Any]:
        """Return the scenario as JSON-able values; `from_keywords` reads them back."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        values["vehicle"] = asdict(self.vehicle)
        values["road"] = self.road.to_dict()
        values["speed"] = self.speed.to_dict()
        values["randomisation"] = asdict(self.randomisation)
        values["sensors"] = sensors_to_dict(self.sensors)
        return values

    @cached_property
    def hash(self) -> str:
        """Stable hash of the scenario's values, 16 hexadecimal digits; a road file counts by its content."""
        values = self.to_dict()
        values["road"] = self.road.fingerprint()
        text = json.dumps(values, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class RoadWorksScenario(LaneKeepScenario):
    """`lanekeep/RoadWorks-v0`: lane keeping in a narrow lane whose centre shifts sideways, at 80 km/h.

    The car departs when its body touches the lane's edge, so what is left is (lane_width - car width) / 2.
    """

    road: RoadSpec = field(default_factory=RoadWorksRoads)
    speed: SpeedSpec = field(default_factory=lambda: LimitedSpeed(maximum=80.0 / 3.6))
    start_lateral_error: float = 0.15
    start_course_error: float = math.radians(1.0)
    lane_width: float = 2.75
    reference_lateral_error: float = 0.15

    def _check(self) -> None:
        require("lane_width", self.lane_width, "m (the car's width)", above=self.vehicle.width)
        super()._check()

    @property
    def departure_limit(self) -> float:
        """Lateral error at which the body touches the lane's edge, m."""
        return (self.lane_width - self.vehicle.width) / 2


def multiple_of_step(name: str, seconds: float) -> None:
    """Raise ValueError unless ``seconds`` is a multiple of the integration step."""
    steps = round(seconds / INTEGRATION_STEP)
    if abs(seconds - steps * INTEGRATION_STEP) > 1e-9:
        raise ValueError(
            f"{name}={seconds!r} is not allowed: it must be a multiple of {INTEGRATION_STEP} s "
            f"(the nearest is {steps * INTEGRATION_STEP:g} s)"
        )
