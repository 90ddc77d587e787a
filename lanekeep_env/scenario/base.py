"""What every scenario shares: fields, checks, channels, JSON and hash."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import nearest, plain_numbers, shown
from lanekeep_env.scenario.effects import Need, default_of, refuse_idle, unmet
from lanekeep_env.scenario.integration import Integration
from lanekeep_env.sensing.faults import SENSOR_SETS, Sensor, Sensors, SensorSets, sensors_from, sensors_to_dict

#: Longest integration step of every vehicle model, s.
INTEGRATION_STEP = 0.01


@dataclass(frozen=True)
class Channel:
    """One entry of the observation."""

    name: str
    unit: str
    low: float
    high: float
    description: str
    #: Row of the kernel's block that it shows, or that holds the truth of its sensor; None for what something else
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
        control_step: s; the integration step divides it, and is 0.01 s (0.005 s between walls) where that does.
    """

    sensors: Sensors = ()
    control_step: float = 0.05

    #: Longest integration step, s.
    longest_step: ClassVar[float] = INTEGRATION_STEP
    #: Named sets of ``sensors``.
    _sensor_sets: ClassVar[SensorSets] = SENSOR_SETS
    #: Fields that may be given by name, number or mapping, and how they are read.
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {}
    #: What fields take to have an effect.
    _needs: ClassVar[tuple[Need, ...]] = ()
    #: Records that go by a name, for many scenarios, by field: what has no effect in this one is passed over.
    _sets: ClassVar[dict[str, Iterable[Any]]] = {}

    def __post_init__(self) -> None:
        for name, read in self._readers.items():
            object.__setattr__(self, name, read(self._completed(name)))
        self._settle()
        self._check()
        plain_numbers(self)
        measured = [channel.name for channel in self._channels() if channel.sensor is not None]
        object.__setattr__(self, "sensors", sensors_from(self.sensors, measured, self._sensor_sets))
        for channel, sensor in self.sensors:
            sensor.check(channel, self.control_step)
        _ = self.integration  # so that a car which cannot be integrated is found here

    @cached_property
    def integration(self) -> Integration:
        """Integration step, s, and slip-speed floor, m/s, of the cars of all episodes."""
        raise NotImplementedError

    @property
    def base_step(self) -> float:
        """Integration step of cars that need no shorter one, s: the longest one that divides the control step.

        Delays are multiples of it.
        """
        steps = self.control_step / self.longest_step
        whole = max(1, round(steps))
        return self.longest_step if abs(steps - whole) < 1e-6 else self.control_step / math.ceil(steps)

    def _completed(self, name: str) -> Any:
        """A field's value; a mapping of some fields of what is the default says what is changed of that."""
        value, usual = getattr(self, name), default_of(type(self), name)
        # A vehicle's mapping names the car that it changes by itself.
        if name == "vehicle" or not isinstance(value, Mapping) or not is_dataclass(usual) or isinstance(usual, type):
            return value
        kind = getattr(usual, "kind", None)
        changes = {key: one for key, one in value.items() if key != "kind"}
        known = {f.name for f in fields(usual) if f.init}
        if value.get("kind") != kind or not changes.keys() <= known:
            return value  # another kind of thing, or for the reader to refuse
        rest = {key: getattr(usual, key) for key in known}
        return {**({} if kind is None else {"kind": kind}), **rest, **changes}

    def _settle(self) -> None:
        """Put numbers in the place of words that stand for them."""

    def _check(self) -> None:
        raise NotImplementedError

    @classmethod
    def from_keywords(cls, others: Iterable[str] = (), /, **keywords: Any) -> Self:
        """Build a scenario from the keywords of ``gym.make``; ``others`` are further ones that it may name.

        The record's own constructor also takes what has no effect, for code that changes a field of a scenario.
        ``scenario`` stands for all keywords: a record of this class, or what its `to_dict` returned.

        Raises:
            ValueError: a value that is not allowed, or has no effect in this scenario and is not the default.
            TypeError: an unknown keyword; the nearest valid one is named.
        """
        whole = keywords.pop("scenario", None)
        if whole is not None:
            return cls._given(whole, keywords)
        cls.check_names(keywords, others)
        scenario = cls(**keywords)
        refuse_idle(scenario, scenario._refused(), keywords)
        return scenario

    @classmethod
    def _given(cls, whole: Any, keywords: Mapping[str, Any]) -> Self:
        """A scenario that is given as one value: a record of this class, or the mapping of its `to_dict`."""
        if keywords:
            raise ValueError(
                f"scenario= takes no other keyword beside it, and {', '.join(keywords)} was given: "
                "dataclasses.replace(scenario, ...) changes one"
            )
        if type(whole) is cls:
            return whole
        if not isinstance(whole, Mapping):
            raise ValueError(f"scenario={shown(whole)} must be a {cls.__name__}, or a mapping of its keywords")
        return cls.from_keywords(**whole)

    @classmethod
    def check_names(cls, names: Iterable[str], others: Iterable[str] = ()) -> None:
        """Raise TypeError for a name that is no field, with the nearest one; ``others`` might be named as well."""
        allowed = [f.name for f in fields(cls)]
        for name in names:
            if name not in allowed:
                allowed += others
                # Python's own words, which clients look for (TorchRL drops a keyword that is refused in them).
                raise TypeError(
                    f"got an unexpected keyword argument {shown(name)}{nearest(name, allowed)}; "
                    f"allowed: {', '.join(allowed)}"
                )

    @property
    def without_effect(self) -> dict[str, Need]:
        """Fields that do not matter in this scenario whatever they say ("friction", "speed.hold"), and why."""
        return unmet(self, self._needs)

    def _refused(self) -> dict[str, Need]:
        """Those of them that a keyword must not give."""
        passed = [name for name, records in self._sets.items() if getattr(self, name) in records]
        return {path: need for path, need in self.without_effect.items() if path.partition(".")[0] not in passed}

    def _channels(self) -> list[Channel]:
        """All channels but those that tell of new samples."""
        raise NotImplementedError

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Name, unit, bounds and meaning of each entry of the observation, in order."""
        channels = [*self._channels(), *self._hidden_channels()]
        for name, sensor in self.sensors:
            if sensor.numbers(self.control_step)[3] > 1 or sensor.dropout > 0.0:
                channels.append(Channel(f"{name}_new", "", 0.0, 1.0, f"1 where {name} is a new sample, else 0"))
        return tuple(channels)

    def _hidden_channels(self) -> list[Channel]:
        """What disturbs the car and only a full observation shows."""
        return []

    def channel_bounds(self) -> np.ndarray:
        """Low and high of each channel as float32, shape (channels, 2)."""
        return np.array([(c.low, c.high) for c in self.channels], dtype=np.float32)

    def column(self, name: str) -> int:
        """Column of a channel in the observation, -1 for one that is not there."""
        return next((k for k, channel in enumerate(self.channels) if channel.name == name), -1)

    def gathered(self, perfect: bool) -> list[tuple[int, int]]:
        """Column and source of the channels that show rows as they stand; measured ones if ``perfect``."""
        return [
            (column, channel.source)
            for column, channel in enumerate(self.channels)
            if channel.source is not None and (perfect or channel.sensor is None)
        ]

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
        """Return the scenario as JSON-able values; `from_keywords` reads back those of a scenario that it built."""
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


def steering_channels() -> list[Channel]:
    """The two channels of every steering actuator."""
    angle = 1.6
    return [
        Channel("steering_angle", "rad", -angle, angle, "road wheel, left positive", at.STEER, Measured()),
        Channel("steering_command", "rad", -angle, angle, "command that last entered the actuator", at.COMMAND),
    ]
