"""Sensors with faults: the records that describe them (the kernel's part is `measure.py`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from lanekeep_env.checks import choose, from_mapping, nearest, plain_numbers, require, shown
from lanekeep_env.sensing.ultrasonic import ULTRASONICS


@dataclass(frozen=True)
class Sensor:
    """Faults of one measured channel, each off by default; units are those of the channel.

    Attributes:
        noise: standard deviation of white Gaussian noise, a value a sample.
        bias: standard deviation of an offset that is drawn once an episode.
        resolution: step of the quantised value.
        period: s between samples, a multiple of the control step; the last sample is held.
        delay: s from the event to its sample, a multiple of the control step.
        dropout: probability that a sample is lost; the last one is held.
        jump: largest offset, either side, of a step-like error as of satellite positioning ...
        jump_rate: ... which takes a new value this many times a second on average.

    The sample comes delayed, then offset, noisy and quantised. A channel that is
    slower than the control step or drops samples has a channel ``NAME_new`` at the observation's end, 1 where
    the observation brings a new sample.
    """

    noise: float = 0.0
    bias: float = 0.0
    resolution: float = 0.0
    period: float = 0.0
    delay: float = 0.0
    dropout: float = 0.0
    jump: float = 0.0
    jump_rate: float = 0.0

    def __post_init__(self) -> None:
        plain_numbers(self)

    def check(self, channel: str, control_step: float) -> None:
        """Raise ValueError for a number that is not allowed at this control step (s)."""
        name = f"sensors.{channel}"
        for field in ("noise", "bias", "resolution", "jump", "jump_rate"):
            require(f"{name}.{field}", getattr(self, field), "", at_least=0.0, at_most=1e6)
        if 0.0 < self.resolution < 1e-9:
            raise ValueError(f"{name}.resolution={self.resolution!r} is not allowed: it must be 0 for none, or >= 1e-9")
        require(f"{name}.dropout", self.dropout, "", at_least=0.0, at_most=1.0)
        for field in ("period", "delay"):
            seconds = getattr(self, field)
            require(f"{name}.{field}", seconds, "s", at_least=0.0, at_most=5.0)
            if abs(seconds / control_step - round(seconds / control_step)) > 1e-6:
                raise ValueError(
                    f"{name}.{field}={seconds!r} is not allowed: it must be a multiple of the control step, "
                    f"{control_step} s"
                )
        for field, other in (("jump", "jump_rate"), ("jump_rate", "jump")):
            if getattr(self, field) > 0.0 and getattr(self, other) == 0.0:
                raise ValueError(
                    f"{name}.{field}={getattr(self, field)!r} has no effect: it takes a {other} > 0 as well"
                )
        if self.jump_rate * control_step > 1.0:
            raise ValueError(f"{name}.jump_rate={self.jump_rate!r} is not allowed: at most one jump a control step")

    def numbers(self, control_step: float) -> list[float]:
        """What the kernel needs, in the order of `layout.SENSOR_SIZE`."""
        period = max(1, round(self.period / control_step))
        delay = round(self.delay / control_step)
        jumps = self.jump_rate * control_step
        return [self.noise, self.bias, self.resolution, period, delay, self.dropout, self.jump, jumps]


SensorSets = Mapping[str, Mapping[str, Sensor]]

#: Named sets: production sensors (camera, inertial sensors, wheel speeds), and bad ones.
SENSOR_SETS: dict[str, dict[str, Sensor]] = {
    "production": {
        "lateral_error": Sensor(noise=0.03, resolution=0.01, period=0.05, delay=0.05),
        "heading_error": Sensor(noise=0.003, period=0.05, delay=0.05),
        "yaw_rate": Sensor(noise=0.005, bias=0.002),
        "speed": Sensor(noise=0.05),
        "steering_angle": Sensor(noise=0.0002, resolution=0.0001),
    },
    "poor": {
        "lateral_error": Sensor(noise=0.06, bias=0.05, period=0.1, delay=0.1, dropout=0.1, jump=0.3, jump_rate=0.1),
        "heading_error": Sensor(noise=0.006, bias=0.002, period=0.1, delay=0.1, dropout=0.1),
        "yaw_rate": Sensor(noise=0.01, bias=0.01),
        "speed": Sensor(noise=0.2, bias=0.2),
        "steering_angle": Sensor(noise=0.0005, bias=0.002, resolution=0.0005),
    },
}

_LATERAL, _HEADING = (SENSOR_SETS["production"][name] for name in ("lateral_error", "heading_error"))
#: The same for manoeuvres at 50 Hz: production sensors give every second step a sample.
MANOEUVRE_SENSOR_SETS: dict[str, dict[str, Sensor]] = {
    "production": {
        **SENSOR_SETS["production"],
        "lateral_error": replace(_LATERAL, period=0.04, delay=0.04),
        "heading_error": replace(_HEADING, period=0.04, delay=0.04),
    },
    "poor": SENSOR_SETS["poor"],
}

#: The same for guidance by camera: image processing at 12.5 and 8 pictures a second.
CAMERA_SENSOR_SETS: dict[str, dict[str, Sensor]] = {
    "production": {
        "edge_distance": Sensor(noise=0.02, resolution=0.005, period=0.08, delay=0.08, dropout=0.02),
        "speed": Sensor(noise=0.02),
        "steering_angle": Sensor(noise=0.001, resolution=0.001),
    },
    "poor": {
        "edge_distance": Sensor(noise=0.05, bias=0.05, period=0.12, delay=0.16, dropout=0.15),
        "speed": Sensor(noise=0.05, bias=0.05),
        "steering_angle": Sensor(noise=0.003, bias=0.01, resolution=0.002),
    },
}

#: The same between walls: the 1:10 car's ultrasonics (raw, millimetres), gyroscope and potentiometer. Its distances
#: come at about 27 Hz at most, which is each control step of 45 ms.
_ULTRASONIC = Sensor(noise=0.01, resolution=0.001)
_POOR_ULTRASONIC = Sensor(noise=0.02, resolution=0.001, period=0.09, dropout=0.05)
WALL_SENSOR_SETS: dict[str, dict[str, Sensor]] = {
    "production": {
        **{f"distance_{side}": _ULTRASONIC for side in ULTRASONICS},
        "yaw_rate": Sensor(noise=0.02, bias=0.05),
        "steering_angle": Sensor(noise=0.003),
    },
    "poor": {
        **{f"distance_{side}": _POOR_ULTRASONIC for side in ULTRASONICS},
        "yaw_rate": Sensor(noise=0.05, bias=0.1),
        "speed": Sensor(noise=0.03),
        "steering_angle": Sensor(noise=0.01, bias=0.01),
    },
}

Sensors = tuple[tuple[str, Sensor], ...]


def sensors_from(
    value: str | Mapping[str, Any] | Sensors | None,
    channels: Sequence[str],
    sets: SensorSets = SENSOR_SETS,
) -> Sensors:
    """Read sensors: None (perfect), a named set, or a mapping of measured ``channels`` to `Sensor` or its fields.

    With ``base``, a named set, a mapping says what is changed of that; what a channel leaves out stays as it is there.

    Raises:
        ValueError: unknown set, channel or field; the nearest valid one is named.
    """
    if value is None:
        return ()
    if isinstance(value, tuple) and all(
        isinstance(one, tuple) and len(one) == 2 and isinstance(one[1], Sensor) for one in value
    ):
        return value
    if isinstance(value, str):
        choose("sensors", value, sets)
        return tuple(sets[value].items())
    if not isinstance(value, Mapping):
        raise ValueError(f"sensors={shown(value)} must be {', '.join(sets)} or a mapping of channels to faults")
    value = dict(value)
    base = value.pop("base", None)
    if base is not None:
        choose("sensors.base", base, sets)
    usual = {} if base is None else sets[base]
    read: dict[str, Sensor] = dict(usual)
    for channel, sensor in value.items():
        if channel not in channels:
            raise ValueError(
                f"sensors has no channel {shown(channel)}{nearest(channel, channels)}; allowed: {', '.join(channels)}"
            )
        if not isinstance(sensor, Sensor | Mapping):
            raise ValueError(f"sensors.{channel}={shown(sensor)} must be a mapping of faults, e.g. {{'noise': 0.01}}")
        if not isinstance(sensor, Sensor):
            fields = {**(asdict(usual[channel]) if channel in usual else {}), **sensor}
            sensor = from_mapping(Sensor, fields, f"sensors.{channel}")
        read[channel] = sensor
    return tuple((channel, read[channel]) for channel in channels if channel in read)


def sensors_to_dict(sensors: Sensors) -> dict[str, Any]:
    """JSON-able form that `sensors_from` reads back."""
    return {channel: asdict(sensor) for channel, sensor in sensors}
