"""Driving with steering, throttle and brake: set speeds, a car ahead, stop points."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, from_mapping, plain_numbers, require, shown
from lanekeep_env.physics import models
from lanekeep_env.physics.integrate import LARGEST_SPEED
from lanekeep_env.physics.parameters import VEHICLES, VehicleParameters
from lanekeep_env.physics.powertrain_parameters import Powertrain, powertrain_from
from lanekeep_env.roads import RandomRoads, RoadSpec, SpeedSpec, speed_from
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.lane_keep import LaneKeepScenario
from lanekeep_env.sensing.faults import MANOEUVRE_SENSOR_SETS, SensorSets

#: Kinds of events and the units of the numbers that follow time and kind.
EVENTS: dict[str, tuple[int, tuple[str, ...]]] = {
    "speed": (at.SPEED_EVENT, ("m/s",)),
    "lead": (at.LEAD_EVENT, ("m", "m/s")),
    "lead_gone": (at.LEAD_GONE, ()),
    "stop": (at.STOP_EVENT, ("m",)),
    "stop_gone": (at.STOP_GONE, ()),
}
#: The largest of them: what stands as far as `layout.FAR` is not there, and speeds are observed up to 100 m/s.
LARGEST = {"m": at.FAR - 1.0, "m/s": 100.0}
#: The longest timeline, s: eleven days, far beyond any episode.
LONGEST = 1e6
#: Events of one timeline, and bytes of the kernel's table of all of them.
MOST_EVENTS = 10_000
LARGEST_TABLE = 64 << 20
#: Seconds from one random event to the next at the least, but for a last one that is the end of another; bytes of one.
_SOONEST, _EVENT_SIZE = 6.0, 32
Event = tuple[float, str, tuple[float, ...]]


@dataclass(frozen=True)
class Traffic:
    """What happens around a car: one given timeline, or a set of random ones.

    Attributes:
        events: (time in s, kind, numbers ...) in order of time, or none for random timelines. Kinds: "speed" (m/s; the
            one at 0 s is also the car's speed at the start), "lead" (gap in m, speed in m/s of a car ahead),
            "lead_gone", "stop" (distance of a stop point in m), "stop_gone"; up to 199 m and 100 m/s.
        count: random timelines in the set; an episode's key chooses one.
        duration: of each of them, s; with ``count`` it bounds the table of all events to 64 MiB.
        largest_speed: m/s, 30 at the most: who sees 200 m cannot stop from more with 3 m/s².
        seed: of the set.
    """

    events: tuple[Event, ...] = ()
    count: int = 256
    duration: float = 60.0
    largest_speed: float = 20.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.events, tuple | list):
            raise ValueError(f"traffic.events={shown(self.events)} is not allowed: a list of (time, kind, numbers ...)")
        if len(self.events) > MOST_EVENTS:
            raise ValueError(f"traffic.events has {len(self.events)} events, allowed are {MOST_EVENTS} at the most")
        object.__setattr__(self, "events", tuple(self._event(event) for event in self.events))
        times = [event[0] for event in self.events]
        if times != sorted(times):
            raise ValueError(f"traffic.events: times {shown(times)} are not allowed: they must rise")
        if self.events and (self.events[0][0] != 0.0 or self.events[0][1] != "speed"):
            raise ValueError('traffic.events must begin with (0.0, "speed", m/s)')
        require("traffic.count", self.count, "timelines", at_least=1, at_most=100_000, whole=True)
        longest = min(LONGEST, (LARGEST_TABLE // _EVENT_SIZE // int(self.count) - 2) * _SOONEST)
        require("traffic.duration", self.duration, f"s for {int(self.count)} timelines", above=0.0, at_most=longest)
        require("traffic.largest_speed", self.largest_speed, "m/s", at_least=5.0, at_most=30.0)
        require("traffic.seed", self.seed, "", at_least=0, whole=True)
        plain_numbers(self)

    @staticmethod
    def _event(event: Sequence[Any]) -> Event:
        if not isinstance(event, Sequence) or len(event) < 2:
            raise ValueError(f"traffic.events: {shown(event)} is not allowed: (time, kind, numbers ...)")
        time, kind, *numbers = event
        numbers = [one for number in numbers for one in (number if isinstance(number, list | tuple) else [number])]
        require("traffic.events time", time, "s", at_least=0.0, at_most=LONGEST)
        choose("traffic.events kind", kind, EVENTS)
        units = EVENTS[kind][1]
        if len(numbers) != len(units):
            raise ValueError(f"traffic.events: {kind!r} takes {len(units)} numbers, not {shown(numbers)}")
        for number, unit in zip(numbers, units, strict=True):
            require(f"traffic.events {kind}", number, unit, at_least=0.0, at_most=LARGEST[unit])
        return float(time), str(kind), tuple(float(number) for number in numbers)

    def build(self) -> np.ndarray:
        """Return the kernel's timelines, (timelines, events, 4)."""
        if self.events:
            timelines: Iterable[Sequence[Event]] = [self.events]
            count, most = 1, len(self.events)
        else:
            rng = np.random.default_rng([self.seed, 0x7AFF])
            timelines = (self._random(rng) for _ in range(self.count))
            count, most = self.count, int(self.duration / _SOONEST) + 2
        table = np.full((count, most, 4), np.inf)
        for timeline, events in zip(table, timelines, strict=True):
            timeline[: len(events)] = [
                (time, EVENTS[kind][0], *(*numbers, 0.0, 0.0)[:2]) for time, kind, numbers in events
            ]
        used = np.isfinite(table[:, :, at.E_TIME]).any(axis=0).sum()
        return np.ascontiguousarray(table[:, :used])

    def _random(self, rng: np.random.Generator) -> list[Event]:
        """Set speeds; every other one meets a slower car that turns off again, or a stop point."""
        speed = float(rng.uniform(0.3, 1.0) * self.largest_speed)
        events: list[Event] = [(0.0, "speed", (speed,))]
        time = 0.0
        while True:
            time += float(rng.uniform(6.0, 12.0))
            if time > self.duration:
                return events
            chance = rng.random()
            if chance < 0.35:
                speed = float(rng.uniform(0.2, 1.0) * self.largest_speed)
                events.append((time, "speed", (speed,)))
            elif chance < 0.7:
                ahead = float(rng.uniform(0.4, 0.9) * speed)
                # Far enough that 3 m/s² are not needed to fall in behind it.
                gap = 10.0 + 1.5 * speed + (speed - ahead) ** 2 / 3.0
                events.append((time, "lead", (min(gap, 150.0), ahead)))
                time += float(rng.uniform(8.0, 16.0))
                events.append((time, "lead_gone", ()))
            else:
                events.append((time, "stop", (min(10.0 + speed + speed**2 / 3.0, 190.0),)))
                time += float(rng.uniform(18.0, 24.0)) + speed
                events.append((time, "stop_gone", ()))


def traffic_from(value: Mapping[str, Any] | Sequence[Any] | Traffic | None) -> Traffic:
    """Read traffic: None (random), a list of events, a mapping, or a record; ValueError names what is wrong."""
    if value is None:
        return Traffic()
    if isinstance(value, Traffic):
        return value
    if isinstance(value, Mapping):
        return from_mapping(Traffic, value, "traffic")
    if isinstance(value, Sequence) and not isinstance(value, str):
        return Traffic(events=tuple(value))
    raise ValueError(f"traffic={shown(value)} must be a list of events or a mapping of Traffic's fields")


def bounds_from(name: str, unit: str, limit: float, value: Any) -> tuple[float, float]:
    """Read bounds (low, high) or one number for both, within ``limit`` either side."""
    low, high = value if isinstance(value, tuple | list) and len(value) == 2 else (value, value)
    for bound in (low, high):
        require(name, bound, unit, at_least=-limit, at_most=limit)
    if high < low:
        raise ValueError(f"{name}={shown(value)} is not allowed: the bounds must be (low, high) with low <= high")
    return float(low), float(high)


def _slope_from(value: Any) -> tuple[float, float]:
    return bounds_from("slope", "rad", 0.3, value)


def _wind_from(value: Any) -> tuple[float, float]:
    return bounds_from("wind", "m/s", 40.0, value)


@dataclass(frozen=True)
class DriveScenario(LaneKeepScenario):
    """Everything that defines `lanekeep/Drive-v0`: the fields of `LaneKeepScenario` with other defaults, and these.

    Attributes:
        powertrain: a name, or a mapping of `Powertrain`.
        traffic: a list of events, or a mapping of `Traffic`; random timelines by default.
        slope: bounds (low, high) of the road's rise, rad, drawn once an episode, or one number.
        wind: the same of the headwind, m/s.
        reference_speed_error: of the running cost, m/s.

    ``speed`` only says how far an episode goes; the car's own follows from its pedals.
    """

    vehicle: VehicleParameters = VEHICLES["passat"]
    road: RoadSpec = field(default_factory=lambda: RandomRoads(peak_curvature=0.004, design_speed=25.0))
    speed: SpeedSpec = field(default_factory=lambda: speed_from(20.0))
    max_steering_angle: float = 0.5
    start_lateral_error: float = 0.3
    start_course_error: float = 0.02
    reference_steering_rate: float = 0.2
    observation: str = "full"
    control_step: float = 0.02
    episode_steps: int = 3000
    tyre: str = "magic_formula"
    preview: int = 11
    powertrain: Powertrain = field(default_factory=Powertrain)
    traffic: Traffic = field(default_factory=Traffic)
    slope: tuple[float, float] = (-0.03, 0.03)
    wind: tuple[float, float] = (-5.0, 5.0)
    reference_speed_error: float = 2.0

    _sensor_sets: ClassVar[SensorSets] = MANOEUVRE_SENSOR_SETS
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **LaneKeepScenario._readers,
        "powertrain": powertrain_from,
        "traffic": traffic_from,
        "slope": _slope_from,
        "wind": _wind_from,
    }
    _needs: ClassVar[tuple[Need, ...]] = (
        *LaneKeepScenario._needs,
        *(
            Need(
                f"traffic.{name}", f"{name} of random timelines", "the events are given", lambda s: not s.traffic.events
            )
            for name in ("count", "duration", "largest_speed", "seed")
        ),
        Need(
            "powertrain.creep_speed",
            "speed at which creeping ends",
            "creep=0 does not creep",
            lambda s: s.powertrain.creep > 0.0,
        ),
    )

    def _check(self) -> None:
        require("reference_speed_error", self.reference_speed_error, "m/s", at_least=1e-3, at_most=1e3)
        super()._check()
        self.powertrain.check(self.vehicle.mass * self.randomisation.mass[0])
        if (self.dynamics, self.tyre) != ("dynamic", "magic_formula"):
            raise ValueError(
                f"dynamics={self.dynamics!r} with tyre={self.tyre!r} is not allowed: the car with a powertrain is "
                "'dynamic' on 'magic_formula' tyres"
            )

    @property
    def model(self) -> models.CarModel:
        """The vehicle model."""
        return models.POWERED

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        return {
            **super().numbers(),
            at.SLOPE_LOW: np.sin(self.slope),
            at.WIND_LOW: self.wind,
            at.SPEED_REFERENCE: self.reference_speed_error,
            at.SECOND: (at.PEDAL, -1.0, 1.0),
        }

    def _slowest(self) -> float:
        """It stops."""
        return 0.0

    @property
    def _fastest(self) -> float:
        return LARGEST_SPEED

    @property
    def sets_speed(self) -> bool:
        """The pedals do."""
        return False

    @property
    def num_actions(self) -> int:
        """Steering and pedal."""
        return 2

    def _channels(self) -> list[Channel]:
        far = float(at.FAR)
        return [
            *super()._channels(),
            Channel("acceleration", "m/s²", -20.0, 20.0, "longitudinal", at.PULL),
            Channel(
                "pedal", "", -1.0, 1.0, "what was asked for: throttle where positive, brake where negative", at.PEDAL
            ),
            Channel("gear", "", 0.0, 7.0, "0 for the first", at.GEAR),
            Channel("set_speed", "m/s", 0.0, 100.0, "asked for", at.SET_SPEED),
            Channel("lead_gap", "m", 0.0, far, f"to the car ahead, {far:g} without one", at.LEAD_GAP),
            Channel("lead_speed", "m/s", 0.0, 100.0, "of the car ahead", at.LEAD_SPEED),
            Channel("stop_gap", "m", -far, far, f"to the stop point, {far:g} without one", at.STOP_GAP),
        ]
