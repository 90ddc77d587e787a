"""A 1:10 car among obstacles and into a parking space: courses whose modes follow each other."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, require, shown
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.circuit import CircuitScenario
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.scan import SCANS, Scan
from lanekeep_env.sensing.ultrasonic import FARTHEST
from lanekeep_env.walls import RandomObstacleCircuits, RandomParkingRows, WorldRecord

#: What a car on a course is to do (Team KnightRiders 2017, mode machine), and how the channel ``mode`` tells it.
MODES = {"roundtrip": at.ROUNDTRIP, "obstacles": at.OBSTACLES, "park": at.PARK}
#: Below this speed a parked car stands, m/s.
STANDSTILL = 0.01
_MOST_MODES = 100


def modes_from(value: Any) -> tuple[tuple[float, str], ...]:
    """Read modes: a name of `MODES`, or a list of (time from which it holds, s; name), the first from 0 on."""
    if isinstance(value, str):
        value = ((0.0, value),)
    pairs = isinstance(value, tuple | list) and all(isinstance(one, tuple | list) and len(one) == 2 for one in value)
    if not pairs or not 1 <= len(value) <= _MOST_MODES:
        raise ValueError(
            f"modes={shown(value)} is not allowed: a name ({', '.join(MODES)}) or a list of (seconds, name), at most "
            f"{_MOST_MODES}"
        )
    last = -math.inf
    for k, (time, name) in enumerate(value):
        require(f"modes[{k}] (its time)", time, "s", at_least=0.0, at_most=1e6)
        choose(f"modes[{k}] (its name)", name, MODES)
        if time <= last or (k == 0 and time != 0.0):
            raise ValueError(f"modes[{k}]={shown((time, name))} is not allowed: times rise, the first one is 0")
        last = time
    return tuple((float(time), str(name)) for time, name in value)


@dataclass(frozen=True)
class CourseScenario(CircuitScenario):
    """What courses share: the fields of `CircuitScenario` and these.

    Attributes:
        modes: what the car is to do, "roundtrip", "obstacles" or "park", or a list of (seconds, mode) where that
            changes in the episode; the last one decides when it is done.
        kerb_distance: farthest that the body of a parked car is from the kerb, m.
        parking_angle: largest angle of a parked car to the kerb, rad.
        parking_time: for which it has to stand so, s.
    """

    modes: tuple[tuple[float, str], ...] = ((0.0, "obstacles"),)
    kerb_distance: float = 0.15
    parking_angle: float = math.radians(5.0)
    parking_time: float = 2.0

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {**CircuitScenario._readers, "modes": modes_from}
    _needs: ClassVar[tuple[Need, ...]] = (
        *CircuitScenario._needs,
        *(
            Need(name, "of a parked car", "no mode is 'park'", lambda s: s.parks)
            for name in ("kerb_distance", "parking_angle", "parking_time")
        ),
        Need("laps", "after which an episode is done", "the last mode is 'park'", lambda s: not s.ends_parked),
    )

    def _check(self) -> None:
        require("kerb_distance", self.kerb_distance, "m", at_least=0.001, at_most=100.0)
        require("parking_angle", self.parking_angle, "rad", at_least=0.001, at_most=math.pi)
        require("parking_time", self.parking_time, "s", at_least=0.0, at_most=1000.0)
        super()._check()

    @property
    def parks(self) -> bool:
        """Whether the car is to park at any time."""
        return any(name == "park" for _, name in self.modes)

    @property
    def ends_parked(self) -> bool:
        """Whether the last mode, which decides about success, is to park."""
        return self.modes[-1][1] == "park"

    @property
    def task(self) -> int:  # type: ignore[override]
        """What decides about success: that of the last mode."""
        return at.PARKING if self.ends_parked else at.CIRCUIT

    @property
    def parking_steps(self) -> int:
        """Control steps for which a parked car has to stand."""
        return max(1, math.ceil(self.parking_time / self.control_step - 1e-9))

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        laps = self.parking_steps if self.ends_parked else self.laps
        return {**super().numbers(), at.LAPS: laps}

    def course_numbers(self) -> np.ndarray:
        """Numbers of the course for the kernel."""
        events = [
            number
            for time, name in self.modes
            for number in (math.ceil(time / self.control_step - 1e-9), float(MODES[name]))
        ]
        return np.array(
            [self.kerb_distance, self.parking_angle, self.parking_steps, STANDSTILL, len(self.modes), *events]
        )

    def _further(self) -> list[Channel]:
        channels = [
            *super()._further(),
            Channel("mode", "", 0.0, 2.0, "0 roundtrip, 1 obstacles, 2 park", at.MODE),
        ]
        if self.observation == "full":
            channels += [
                Channel(
                    "space_ahead", "m", -200.0, 200.0, "middle of the longest space, along its kerb", at.SPACE_AHEAD
                ),
                Channel("space_left", "m", -200.0, 200.0, "the same, to the left", at.SPACE_LEFT),
                Channel("space_turned", "rad", -math.pi, math.pi, "heading minus that of its kerb", at.SPACE_TURNED),
                Channel("space_length", "m", 0.0, 100.0, "0 without any", at.SPACE_LENGTH),
                Channel("space_share", "", 0.0, 1.0, "of the car that is in a space", at.SHARE),
                Channel("kerb_distance", "m", -1.0, FARTHEST, "of the body in it, else 6", at.KERB_DISTANCE),
            ]
        return channels


@dataclass(frozen=True)
class ObstacleCircuitScenario(CourseScenario):
    """Everything that defines `lanekeep/ObstacleCircuit-v0`: the fields of `CourseScenario` with other defaults."""

    world: WorldRecord = field(default_factory=RandomObstacleCircuits)
    scan: Scan = field(default_factory=lambda: SCANS["columns"])
    episode_steps: int = 2700


@dataclass(frozen=True)
class ParallelParkScenario(CourseScenario):
    """Everything that defines `lanekeep/ParallelPark-v0`: the fields of `CourseScenario` with other defaults."""

    modes: tuple[tuple[float, str], ...] = ((0.0, "park"),)
    world: WorldRecord = field(default_factory=RandomParkingRows)
    scan: Scan = field(default_factory=lambda: SCANS["columns"])
    start_lateral_error: float = 0.03
    start_heading_error: float = math.radians(3.0)
    max_speed: float = 1.0
    episode_steps: int = 1400
