"""Cars between walls that follow one at a distance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, require, shown
from lanekeep_env.physics import models
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.roads.speed import SetSpeeds, set_speeds_from
from lanekeep_env.scenario.base import Channel, Measured, steering_channels
from lanekeep_env.scenario.car import DEPARTURES, LARGEST_ANGLE, CarScenario, multiple_of_step
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.integration import Integration, rolling, slipping
from lanekeep_env.scenario.scan import Scan, scan_from
from lanekeep_env.scenario.servo import Servo, servo_from
from lanekeep_env.sensing.faults import WALL_SENSOR_SETS, SensorSets
from lanekeep_env.sensing.ultrasonic import FARTHEST, ULTRASONICS
from lanekeep_env.walls import Corridor, WorldRecord, world_from
from lanekeep_env.walls.generators import range_of

#: Shortest and longest corridor without a length of its own, m: float32 reaches no further.
_SHORTEST_CORRIDOR, _LONGEST_CORRIDOR = 80.0, 1000.0
#: By which it is longer than the way of an episode, m: no sensor sees its end.
_BEYOND = 10.0


def _offset(value: Any) -> tuple[float, float]:
    return range_of("steering_offset", value, "rad", -0.5, 0.5)


@dataclass(frozen=True)
class WallFollowScenario(CarScenario):
    """Everything that defines `lanekeep/WallFollow-v0`; every field is a keyword of ``gym.make``.

    The fields of `CarScenario` and these:

    Attributes:
        dynamics: "kinematic" (no slip) or "dynamic" (sideslip, linear tyres; forwards only).
        world: the name of a generator, a mapping with its settings, or the path of a map_server map's YAML file; by
            default a corridor that episodes do not come to the end of, 80 m at the least and 1 km at the most.
        speed: m/s, or a mapping of `SetSpeeds`.
        steering_offset: bounds (low, high) of what the road wheel has more than asked for, rad, drawn once an episode,
            or one number, beside the vehicle's own.
        servo: a mapping of `Servo`, or None.
        set_distance: of the side sensor from the wall on the right, m.
        side_sensor: place of the side ultrasonics ahead of the rear axle, m (the source's l_H); None: half-way.
        start_lateral_error: the start is drawn within this of ``set_distance``, m.
        start_heading_error: and within this angle of the centre line's direction, rad.
        contact: "terminate" ends the episode, "cost" goes on and charges, "off" ignores contacts.
        scan: of the depth camera: "none", "perfect", "kinect" or a mapping of `Scan`.
        encoder_ticks: of the wheel a turn, 0 for a continuous measurement (40 in the source, 8 its Hall sensor).
        encoder_direction: whether the encoder tells forwards from backwards (the Hall sensor does not).
    """

    longest_step: ClassVar[float] = 0.005
    view: ClassVar[float] = 8.0
    largest_observed_speed: ClassVar[float] = 20.0
    task: ClassVar[int] = at.WALL_FOLLOW

    control_step: float = 0.045
    vehicle: VehicleParameters = VEHICLES["knightriders"]
    dynamics: str = "kinematic"
    world: WorldRecord = field(default_factory=lambda: Corridor(length=None, width=2.5))
    speed: SetSpeeds = field(
        default_factory=lambda: SetSpeeds(0.3, 2.0, hold=None, standstill=0.0, lateral_acceleration=None)
    )
    max_steering_angle: float = math.radians(22.0)
    max_steering_rate: float = 3.0
    steering_offset: tuple[float, float] = (-math.radians(3.0), math.radians(3.0))
    servo: Servo = field(default_factory=Servo)
    set_distance: float = 1.0
    side_sensor: float | None = None
    start_lateral_error: float = 0.3
    start_heading_error: float = math.radians(20.0)
    contact: str = "terminate"
    reference_lateral_error: float = 0.1
    reference_steering_rate: float = 2.0
    scan: Scan = field(default_factory=Scan)
    encoder_ticks: int = 0
    encoder_direction: bool = True

    _sensor_sets: ClassVar[SensorSets] = WALL_SENSOR_SETS
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {
        **CarScenario._readers,
        "world": world_from,
        "speed": set_speeds_from,
        "scan": scan_from,
        "servo": servo_from,
        "steering_offset": _offset,
    }
    _needs: ClassVar[tuple[Need, ...]] = (
        *CarScenario._needs,
        Need(
            "encoder_direction",
            "whether the encoder tells forwards from backwards",
            "the car only drives forwards",
            lambda s: s.reverses,
        ),
        *(
            Need(f"scan.{name}", "of the depth camera", "beams=0 is no scan", lambda s: s.scan.beams > 0)
            for name in (f.name for f in fields(Scan))
            if name not in ("beams", "period")  # a period also brings the channel scan_new
        ),
    )

    def _check(self) -> None:
        choose("dynamics", self.dynamics, ("kinematic", "dynamic"))
        super()._check()
        if isinstance(self.world, Corridor) and self.world.length is None:
            way = math.ceil(self._fastest * self.control_step * self.episode_steps + _BEYOND)
            length = min(max(float(way), _SHORTEST_CORRIDOR), _LONGEST_CORRIDOR)
            object.__setattr__(self, "world", replace(self.world, length=length))
        require("set_distance", self.set_distance, "m", above=0.0, at_most=FARTHEST)
        require("side_sensor", self.side_sensor, "m", at_least=-1.0, at_most=5.0, optional=True)
        require("start_lateral_error", self.start_lateral_error, "m", at_least=0.0, at_most=1e3)
        require("start_heading_error", self.start_heading_error, "rad", at_least=0.0, at_most=math.pi)
        choose("contact", self.contact, DEPARTURES)
        require("encoder_ticks", self.encoder_ticks, "ticks a turn", at_least=0, at_most=1_000_000, whole=True)
        if not isinstance(self.encoder_direction, bool):
            raise ValueError(
                f"encoder_direction={shown(self.encoder_direction)} is not allowed: it must be True or False"
            )
        multiple_of_step("scan.period", self.scan.period, self.control_step)
        self._check_turn(self.largest_speed or self.speed.maximum)

    @cached_property
    def integration(self) -> Integration:
        """Integration step, s, and slip-speed floor, m/s, of the cars of all episodes."""
        if self.model.slips:  # which a wall may stop
            return slipping(self.vehicle, self.randomisation, self.base_step, lambda: 0.0, self._fastest)
        return rolling(self.vehicle, self.base_step, self._fastest, self._wheel_angle + self._largest_offset)

    @property
    def _fastest(self) -> float:
        """Largest speed of an episode, m/s."""
        return self.largest_speed or self.speed.largest * self.randomisation.speed[1]

    @property
    def _wheel_angle(self) -> float:
        """Largest angle that command and servo give the road wheel, rad."""
        most = self.largest_angle
        servo = self.servo.table(most)
        return self.largest_gain * (most if servo is None else float(np.abs(servo[1:]).max()))

    @property
    def _largest_offset(self) -> float:
        """Of the road wheel to either side, rad."""
        return max(abs(self.vehicle.steering.offset + bound) for bound in self.steering_offset)

    def _check_angles(self) -> None:
        """Command, servo and offset together must leave the wheel short of standing across."""
        largest = self._wheel_angle
        if largest + self._largest_offset > LARGEST_ANGLE:
            raise ValueError(
                f"steering_offset={self.steering_offset!r} is not allowed: with the steering angle of {largest:g} rad "
                f"it must be <= {LARGEST_ANGLE} rad in all"
            )

    def _check_turn(self, fastest: float) -> None:
        """Raise ValueError where the car could make half a turn in a control step: contact is swept between steps."""
        angle = self.largest_gain * self.max_steering_angle + self._largest_offset
        turn = fastest * self.control_step * math.tan(min(angle, 1.5)) / self.vehicle.wheelbase
        if turn >= math.pi:
            raise ValueError(
                f"control_step={self.control_step!r} is not allowed: at {fastest:g} m/s and full steering the car "
                f"would turn by {turn:.1f} rad in it, more than half a turn (contact is looked for once a control step)"
            )

    @property
    def model(self) -> models.CarModel:
        """The vehicle model."""
        return models.KINEMATIC_PACED if self.dynamics == "kinematic" else models.LINEAR_PACED

    @property
    def slows_for_bends(self) -> bool:
        """There is no road."""
        return False

    @property
    def stops(self) -> bool:
        """A wall does, and then the car accelerates again."""
        return self.contact != "terminate"

    @property
    def reverses(self) -> bool:
        """Whether the car may drive backwards."""
        return False

    @property
    def largest_speed(self) -> float:
        """Speed that action 1 asks for, m/s; 0 where speed is no action."""
        return 0.0

    @property
    def side_sensor_place(self) -> float:
        """Place of the ultrasonics to both sides ahead of the rear axle, m; on circuits half-way between the axles."""
        place = self.side_sensor if self.task == at.WALL_FOLLOW else None
        return 0.5 * self.vehicle.wheelbase if place is None else place

    def _channels(self) -> list[Channel]:
        channels = [
            Channel(
                f"distance_{side}",
                "m",
                0.0,
                FARTHEST,
                f"of the nearest wall in the ultrasonic's cone to the {side}, 0: no echo",
                row,
                Measured(missing=0.0, holds=False),
            )
            for side, (row, *_) in ULTRASONICS.items()
        ]
        channels += [
            Channel("yaw_rate", "rad/s", -20.0, 20.0, "left positive", at.YAW_RATE, Measured()),
            Channel("speed", "m/s", -20.0, 20.0, "of the wheels, by the encoder", at.WHEEL_SPEED, Measured()),
            *steering_channels(),
        ]
        channels += self._further()
        for k in range(self.scan.beams):
            angle = math.degrees(k * self.scan.step - self.scan.field_of_view / 2)
            channels.append(Channel(f"scan_{k}", "m", 0.0, self.scan.farthest, f"range at {angle:+.1f} deg, 0: none"))
        if self.observation == "full":
            channels += [
                Channel("lateral_error", "m", -20.0, 20.0, self._lateral_error, at.ERROR),
                Channel("heading_error", "rad", -math.pi, math.pi, "heading minus the centre line's", at.TURNED),
                Channel("clearance", "m", 0.0, 20.0, "distance of the body from the nearest wall", at.CLEARANCE),
                Channel("steering_offset", "rad", -0.5, 0.5, "of this episode", at.STEER_OFFSET),
            ]
        if round(self.scan.period / self.control_step) > 1:
            channels.append(Channel("scan_new", "", 0.0, 1.0, "1 where the scan is a new one, else 0", at.SCAN_NEW))
        return channels

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        car, (front, rear) = self.vehicle, self.axles
        ahead = 0.5 * (front - rear)
        return {
            **super().numbers(),
            at.DEPARTURE: DEPARTURES[self.contact],
            at.START_LATERAL: self.start_lateral_error,
            at.START_HEADING: self.start_heading_error,
            at.LARGEST_SPEED: self.largest_speed,
            # The dynamic car does not know backwards.
            at.SECOND: (at.SPEED_TARGET, 0.0 if self.model.slips else -1.0, self.largest_speed),
            at.TASK: self.task,
            at.SET_DISTANCE: self.set_distance,
            at.TICK: 2.0 * math.pi * car.wheel_radius / self.encoder_ticks if self.encoder_ticks else 0.0,
            at.SIGNLESS: not self.encoder_direction,
            at.OFFSET_LOW: [self.vehicle.steering.offset + bound for bound in self.steering_offset],
            at.SIDE_ARM: self.side_sensor_place - rear,
            at.BODY_MIDDLE: (ahead, 0.5 * car.length, 0.5 * car.width),
            at.FRONT_ARM: ahead + 0.5 * car.length,
            at.FIRST_PREVIEW: self.column("scan_0"),
        }

    _lateral_error: ClassVar[str] = "of the side sensor: distance of the right wall minus the set one"

    def _further(self) -> list[Channel]:
        """Channels between the scalar ones and the scan."""
        return []

    def _fingerprint(self) -> dict[str, Any]:
        return {**super()._fingerprint(), "world": self.world.fingerprint()}
