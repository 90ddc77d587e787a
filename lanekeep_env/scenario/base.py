"""What every scenario on a road shares: fields, checks, channels, JSON and hash."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, nearest, plain_numbers, require, shown
from lanekeep_env.physics.integrate import LARGEST_SPEED
from lanekeep_env.physics.models import CarModel
from lanekeep_env.physics.parameters import VEHICLES, VehicleParameters, vehicle_from
from lanekeep_env.randomisation import Randomisation, randomisation_from
from lanekeep_env.roads import LimitedSpeed, RandomRoads, RoadSpec, SpeedSpec, road_from
from lanekeep_env.scenario.integration import Integration, rolling, slipping
from lanekeep_env.sensing.faults import Sensor, Sensors, sensors_to_dict

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
    #: Row of the kernel's lanes that it shows, or that holds the truth of its sensor; None for what something else
    #: writes: a preview, a scan, the flags of sensors.
    source: int | None = None
    #: What measures it, None for what is known.
    sensor: Measured | None = None


@dataclass(frozen=True)
class Measured:
    """That a channel comes from a sensor, and what it shows where that sees nothing.

    Attributes:
        valid: channel that tells whether the last sample saw anything, None where it always does.
        missing: value until anything was seen ...
        holds: ... and after that the last one is held; otherwise ``missing`` is shown whenever nothing is seen.
    """

    valid: str | None = None
    missing: float = 0.0
    holds: bool = True


@dataclass(frozen=True)
class ScenarioRecord:
    """What scenarios share whatever they are about; subclasses have the other fields, and `_channels`.

    Attributes:
        sensors: faults of the measured channels: None, "production", "poor" or a mapping of channels to
            faults (see `Sensor`).
        control_step: s, a multiple of the integration step.
    """

    sensors: Sensors = ()
    control_step: float = 0.05

    #: What control steps and delays are multiples of, s: the integration step of cars that need no shorter one.
    base_step: ClassVar[float] = INTEGRATION_STEP
    #: Fields that may be given by name, number or mapping, and how they are read.
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {}

    def __post_init__(self) -> None:
        for name, read in self._readers.items():
            object.__setattr__(self, name, read(getattr(self, name)))
        self._check()
        plain_numbers(self)
        _ = self.integration  # so that a car which cannot be integrated is found here

    @cached_property
    def integration(self) -> Integration:
        """Integration step, s, and slip-speed floor, m/s, of the cars of all episodes."""
        raise NotImplementedError

    def _check(self) -> None:
        raise NotImplementedError

    @classmethod
    def from_keywords(cls, others: Iterable[str] = (), /, **keywords: Any) -> Self:
        """Build a scenario from the keywords of ``gym.make``; ``others`` are further ones that it may name.

        Raises:
            ValueError: a value that is not allowed.
            TypeError: an unknown keyword; the nearest valid one is named.
        """
        allowed = [f.name for f in fields(cls)]
        for key in keywords:
            if key not in allowed:
                allowed += others
                raise TypeError(f"unknown keyword {shown(key)}{nearest(key, allowed)}; allowed: {', '.join(allowed)}")
        return cls(**keywords)

    def _channels(self) -> list[Channel]:
        """All channels but those that tell of new samples."""
        raise NotImplementedError

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Name, unit, bounds and meaning of each entry of the observation, in order."""
        channels = self._channels()
        for name, sensor in self.sensors:
            if sensor.numbers(self.control_step)[3] > 1 or sensor.dropout > 0.0:
                channels.append(Channel(f"{name}_new", "", 0.0, 1.0, f"1 where {name} is a new sample, else 0"))
        return tuple(channels)

    def channel_bounds(self) -> np.ndarray:
        """Low and high of each channel as float32, shape (channels, 2)."""
        return np.array([(c.low, c.high) for c in self.channels], dtype=np.float32)

    def column(self, name: str) -> int:
        """Column of a channel in the observation, -1 for one that is not there."""
        return next((k for k, channel in enumerate(self.channels) if channel.name == name), -1)

    def channel_table(self) -> np.ndarray:
        """Low, high and source (-1 for none) of each channel, (channels, `layout.CHANNEL_SIZE`)."""
        sources = [-1 if c.source is None else c.source for c in self.channels]
        return np.column_stack([self.channel_bounds(), sources])

    def sensor_table(self) -> np.ndarray:
        """Numbers of the sensors in the order of their channels, (measured channels, `layout.SENSOR_SIZE`)."""
        faults, column = dict(self.sensors), {channel.name: k for k, channel in enumerate(self.channels)}
        rows = []
        for channel in self.channels:
            if channel.sensor is not None:
                numbers = faults.get(channel.name, Sensor()).numbers(self.control_step)
                valid = -1 if channel.sensor.valid is None else column[channel.sensor.valid]
                shown = (column[channel.name], valid, channel.sensor.missing, channel.sensor.holds)
                rows.append((*numbers, channel.source, *shown))
        return np.array(rows, dtype=np.float64)

    def to_dict(self) -> dict[str, Any]:
        """Return the scenario as JSON-able values; `from_keywords` reads them back."""
        values: dict[str, Any] = {}
        for f in fields(self):
            value = getattr(self, f.name)
            if f.name == "sensors":
                value = sensors_to_dict(value)
            elif hasattr(value, "to_dict"):
                value = value.to_dict()
            elif is_dataclass(value) and not isinstance(value, type):
                value = asdict(value)
            values[f.name] = value
        return values

    def _fingerprint(self) -> dict[str, Any]:
        """`to_dict` with what stands for the content of files, and an integration unlike other cars'."""
        ordinary = self.integration == Integration(self.base_step)
        return self.to_dict() if ordinary else {**self.to_dict(), "integration": asdict(self.integration)}

    @cached_property
    def hash(self) -> str:
        """Stable hash of the scenario's values, 16 hexadecimal digits; files count by their content."""
        text = json.dumps(self._fingerprint(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class RoadScenario(ScenarioRecord):
    """A car on a road; every field is a keyword of ``gym.make``. Subclasses add what their task needs.

    Attributes:
        vehicle: a name (`VEHICLES`), a mapping of changes to a named one (``{"base": "yin", "mass": 2000.0}``)
            or `VehicleParameters`.
        road: the name of a generator, a mapping with its settings, or the path of a centre-line CSV file.
        speed: m/s, or a mapping; see the subclass.
        action: "steering_angle" (the action is the road-wheel angle asked for) or "steering_rate".
        max_steering_angle: road-wheel angle that action 1 asks for, rad; also bounds the command in rate mode.
        max_steering_rate: road-wheel speed that action 1 asks for, rad/s (rate mode).
        start_lateral_error: the start is drawn within this distance of the lane's centre, m.
        start_course_error: the course at the start is drawn within this angle of the road's, rad.
        lane_width: m; the car departs when its reference point is more than half of it off the centre.
        departure: "terminate" ends the episode, "cost" goes on and charges, "off" ignores departures.
        reference_lateral_error, cost_weight, reference_steering_rate, cost_cap: m, w, rad/s and 1/s of the
            running cost min(cap, (d / reference)² + w (road-wheel speed / reference)²).
        observation: "measured" (what sensors give) or "full" (adds channels of the true state).
        randomisation: what differs from episode to episode: "nominal", "mismatch", "stress" or a mapping of
            bounds (see `Randomisation`).
        episode_steps: control steps of an episode: it is truncated after them, a departure is charged for the
            rest of them, and open roads are entered that much before their end. ``max_episode_steps`` of
            ``gym.make`` can only shorten an episode; give both for longer ones.
    """

    vehicle: VehicleParameters = VEHICLES["yin"]
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
    observation: str = "measured"
    randomisation: Randomisation = field(default_factory=Randomisation)
    episode_steps: int = 600

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        "vehicle": vehicle_from,
        "road": road_from,
        "randomisation": randomisation_from,
    }
    #: The first of the channels that show the road ahead.
    preview_channel: ClassVar[str] = "curvature_preview_0"
    #: How much road a picture shows, m.
    view: ClassVar[float] = 100.0

    def _check(self) -> None:
        choose("action", self.action, ("steering_angle", "steering_rate"))
        require("max_steering_angle", self.max_steering_angle, "rad", at_least=1e-4, at_most=1.5)
        require("max_steering_rate", self.max_steering_rate, "rad/s", at_least=1e-4, at_most=1e3)
        require("lane_width", self.lane_width, "m", at_least=1e-3, at_most=1e3)
        limit = self.departure_limit
        require("start_lateral_error", self.start_lateral_error, "m", at_least=0.0, at_most=limit)
        require("start_course_error", self.start_course_error, "rad", at_least=0.0, at_most=1.0)
        choose("departure", self.departure, ("terminate", "cost", "off"))
        require("reference_lateral_error", self.reference_lateral_error, "m", at_least=1e-4, at_most=1e3)
        require("cost_weight", self.cost_weight, "", at_least=0.0, at_most=1e6)
        require("reference_steering_rate", self.reference_steering_rate, "rad/s", at_least=1e-4, at_most=1e3)
        require("cost_cap", self.cost_cap, "1/s", at_least=1e-6, at_most=1e6)
        choose("observation", self.observation, ("measured", "full"))
        require("control_step", self.control_step, "s", at_least=self.base_step, at_most=1.0)
        multiple_of_step("control_step", self.control_step)
        check_speed(self.speed.largest, self.randomisation)
        require("episode_steps", self.episode_steps, "steps", at_least=1, at_most=10_000_000, whole=True)
        for channel, sensor in self.sensors:
            sensor.check(channel, self.control_step)
        multiple_of_step("vehicle.steering.delay", self.vehicle.steering.delay)

    @property
    def departure_limit(self) -> float:
        """Lateral error beyond which the car has left its lane, m."""
        return self.lane_width / 2

    @property
    def largest_cost(self) -> float:
        """What a second costs at most, 1/s."""
        return self.cost_cap

    @property
    def model(self) -> CarModel:
        """The vehicle model."""
        raise NotImplementedError

    @cached_property
    def integration(self) -> Integration:
        """Integration step, s, and slip-speed floor, m/s, of the cars of all episodes."""
        if self.model.slips:
            return slipping(self.vehicle, self.randomisation, self.base_step, self._slowest, self._fastest)
        return rolling(self.vehicle, self.base_step, self._fastest, self.largest_angle)

    def _slowest(self) -> float:
        """Lowest speed that an episode can have, m/s; builds the roads."""
        return 0.0

    @property
    def _fastest(self) -> float:
        """Largest one."""
        return self.speed.largest * self.randomisation.speed[1]

    @property
    def largest_angle(self) -> float:
        """Largest angle of the road wheel that can be commanded, rad."""
        return min(self.max_steering_angle, self.vehicle.steering.angle_limit or math.inf)

    @property
    def num_actions(self) -> int:
        """Steering only."""
        return 1

    @property
    def axles(self) -> tuple[float, float]:
        """Distance of the front and the rear axle from the reference point, whose errors are lateral and heading, m."""
        return self.vehicle.cg_to_front_axle, self.vehicle.cg_to_rear_axle

    def _fingerprint(self) -> dict[str, Any]:
        return {**super()._fingerprint(), "road": self.road.fingerprint()}


def steering_channels() -> list[Channel]:
    """The two channels of every steering actuator."""
    angle = 1.6
    return [
        Channel("steering_angle", "rad", -angle, angle, "road wheel, left positive", at.STEER, Measured()),
        Channel("steering_command", "rad", -angle, angle, "command that last entered the actuator", at.COMMAND),
    ]


def check_speed(largest: float, drawn: Randomisation) -> None:
    """Raise ValueError where an episode's car would go faster than `LARGEST_SPEED`."""
    if largest * drawn.speed[1] > LARGEST_SPEED:
        raise ValueError(
            f"randomisation.speed={drawn.speed!r} is not allowed: of {largest:g} m/s that is more than "
            f"{LARGEST_SPEED:g} m/s; it must be <= {LARGEST_SPEED / largest:.3g}"
        )


def multiple_of_step(name: str, seconds: float, step: float = INTEGRATION_STEP) -> None:
    """Raise ValueError unless ``seconds`` is a multiple of the integration step."""
    steps = round(seconds / step)
    if abs(seconds - steps * step) > 1e-9:
        raise ValueError(
            f"{name}={seconds!r} is not allowed: it must be a multiple of {step} s (the nearest is {steps * step:g} s)"
        )
