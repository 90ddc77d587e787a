"""Team KnightRiders 2017: parallel parking in reverse, into a gap found by the side ultrasonic (third task, chapter 5).

As in the source the car goes slowly along the row, looks for a gap with the side ultrasonic and the encoder, goes on to
where its path begins, and drives back: an arc to the right, a straight, an arc to the left. Better than there, each a
switch of the policy where the authors wish for it (6.2):
- It starts parallel (``start_parallel``): the Kalman filter along the boxes (`parking_row`) knows its heading.
- It steers what it means: the filter estimates the steering offset (``estimate_offset``), and the servo's map, as half
  circles tell it (`servo_map`), is inverted (``invert_servo``).
- A gap is long enough if the last arc takes the nose past the box in front as deep as it was measured.
- Steering and speed vary along the path (``vary_path``): the last arc is, at each step, the one that from here ends
  along the kerb (as `knightriders-circuit` does in corners), so that radii and start need not be known exactly.

Asked for another mode it leaves the gap again (`parking_moves`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.odometry import Odometer, OdometryScenario
from lanekeep_baselines.parking_gap import hear
from lanekeep_baselines.parking_moves import Moves
from lanekeep_baselines.parking_row import (
    AHEAD,
    LEFT,
    RIGHT,
    STAND,
    STRAIGHT,
    RowReader,
    Search,
)
from lanekeep_baselines.path_clearance import Body
from lanekeep_baselines.path_planning import PARKING_ANGLE, parallel_parking
from lanekeep_baselines.policy import DrivingPolicy, DrivingScenario, Floats
from lanekeep_baselines.servo_map import ServoMap
from lanekeep_baselines.wall_design import WallCar
from lanekeep_env.scenario import Servo
from lanekeep_env.sensing.faults import Sensor
from lanekeep_env.sensing.ultrasonic import FARTHEST

#: Value of the channel `mode` that asks to park.
PARK = 2.0


def _no_parking(scenario: Any) -> str:
    """Return what is lacking where a scenario never asks to park, else ""."""
    return "" if scenario.parks else "a mode 'park', which the scenario's modes do not have"


#: That there is a mode in which to park.
PARKS = Need("a mode 'park'", _no_parking)


class CourseDrive(DrivingScenario, Protocol):
    """A scenario with modes."""

    @property
    def parks(self) -> bool: ...


class ParkingDrive(CourseDrive, OdometryScenario, Protocol):
    """What the controller may know; `lanekeep_env.ParallelParkScenario` is one."""

    @property
    def servo(self) -> Servo: ...


class KnightRidersPark(DrivingPolicy):
    """`knightriders-park`: a gap that is long enough, then arc, straight and arc in reverse.

    Args:
        scenario: with a mode in which to park.
        start_parallel: the car straightens along the row.
        estimate_offset: the steering offset is estimated.
        invert_servo: the servo's map is inverted.
        vary_path: steering and speed vary along the path; else they are those of its arcs.
    """

    name = "knightriders-park"
    reads = ("distance_right", "distance_front", "yaw_rate", "steering_command", *Odometer.reads, "mode")
    needs = (PARKS,)

    #: Speeds along the row, back, and between boxes, m/s.
    SLOW, BACK, SHUNT = 0.3, 0.25, 0.15
    #: Distances of the parked body from the kerb that are aimed at, m: level with the box in front between these.
    NEAREST, FARTHEST = 0.04, 0.10
    #: Spare length that a gap must have, m, and the most that is left behind the car.
    SPARE, BEHIND = 0.02, 0.25
    #: For which the car stands first, to know the bias of a gyroscope that has faults, s.
    REST: ClassVar[float] = 1.5
    #: Nearest to the box behind, m.
    AIR: ClassVar[float] = 0.02
    #: Share of the steering angle that is kept for the offset and for corrections.
    KEPT: ClassVar[float] = float(np.deg2rad(0.3))
    #: The car turns towards the row's direction by so much a metre and radian.
    STRAIGHTEN: ClassVar[float] = 2.0
    #: From a wall ahead where the car stops, m, and how it brakes before it, m/s².
    STOP, BRAKE = 0.15, 0.5
    #: Heading at which the last arc is done, rad.
    DONE: ClassVar[float] = float(np.deg2rad(0.5))

    def __init__(
        self,
        scenario: ParkingDrive,
        *,
        start_parallel: bool = True,
        estimate_offset: bool = True,
        invert_servo: bool = True,
        vary_path: bool = True,
    ) -> None:
        super().__init__(scenario)
        self._straighten, self._vary = self.STRAIGHTEN * start_parallel, vary_path
        car = scenario.vehicle
        self._car = WallCar(car.wheelbase, 0.5 * car.wheelbase, scenario.control_step)
        servo = scenario.servo if invert_servo else Servo()
        self._servo = ServoMap.of(servo, min(scenario.max_steering_angle, car.steering.angle_limit or np.inf))
        self._length, self._half_width = car.length, 0.5 * car.width
        self._overhang = 0.5 * (car.length - car.wheelbase)
        sensors = dict(scenario.sensors)
        noise = sensors.get("distance_right", Sensor()).noise
        self._rest = self.REST if "yaw_rate" in sensors else 0.0
        self._row = RowReader(self._car, self._servo, noise, self.SLOW, Odometer(scenario), estimate_offset)
        self._moves = Moves()
        self.memory = self._row.memory + len(Search._fields)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        split, parks = self._row.memory, at["mode"] == PARK
        last = Search(*memory[:, split:].T)
        new = np.reshape(fresh, -1) | (~parks & (last.phase <= AHEAD))
        right = np.where(at["distance_right"] > 0.0, at["distance_right"], FARTHEST)
        now = Search(*(np.where(new, a, b) for a, b in zip(Search.at_rest(right, self._rest), last, strict=True)))
        known, rest, now, length = self._row.read(at, memory[:, :split], new, now)
        front = np.where(at["distance_front"] > 0.0, at["distance_front"], FARTHEST)
        now = hear(right, front, known[:, 1], now, self._car.sensor, self._length - self._overhang)
        now = self._choose(length, known, now)
        steering, speed, now = self._drive(known, front, ~parks & ~new, now)
        return np.stack([steering, speed], axis=1), np.concatenate([rest, np.stack(now, axis=1)], axis=1)

    def inside(self, memory: Floats) -> NDArray[np.bool_]:
        """Return the rows of a memory (n, memory) that are on the way into a gap, in it, or out of it."""
        return memory[:, self._row.memory + Search._fields.index("phase")] >= RIGHT

    def _choose(self, length: Floats, known: Floats, now: Search) -> Search:
        """Take a gap of that length, m, that has just ended, if it is long enough for one sweep."""
        left, right = self._radius(known[:, 2])
        kerb = np.clip(now.depth - 2.0 * self._half_width, self.NEAREST, self.FARTHEST)
        line = kerb + self._half_width
        shift = now.kerb - line
        # The nose's right corner passes the rear corner of the box in front, ``out`` m wider than the car's side.
        out = np.maximum(now.depth - kerb, 0.05)
        outer = left + self._half_width
        needed = self._overhang + np.sqrt(
            (self._length - self._overhang) ** 2 + outer**2 - np.maximum(outer - out, 0.0) ** 2
        )
        plan = parallel_parking(shift, right, left)
        takes = (length >= needed + self.SPARE) & plan.ok
        behind = np.clip(0.5 * (length - needed), 0.0, self.BEHIND)
        start = now.gap + behind + self._overhang + plan.travel
        return now._replace(
            phase=np.where(takes, AHEAD, now.phase),
            start=np.where(takes, start, now.start),
            line=np.where(takes, line, now.line),
            moves=np.where(takes, 0.0, now.moves),
        )

    def _radius(self, offset: Floats) -> tuple[Floats, Floats]:
        """Return the rear axle's turning radii to the left and to the right, m, with the steering offset."""
        left = self._servo.left - self.KEPT + np.minimum(offset, 0.0)
        right = self._servo.right - self.KEPT - np.maximum(offset, 0.0)
        return self._car.wheelbase / np.tan(left), self._car.wheelbase / np.tan(right)

    def _body(self, offset: Floats) -> Body:
        """Return the body with the turning radii at that steering offset."""
        left, right = self._radius(offset)
        return Body(self._length - self._overhang, self._overhang, self._half_width, left, right)

    def _drive(
        self, known: Floats, front: Floats, asked: NDArray[np.bool_], now: Search
    ) -> tuple[Floats, Floats, Search]:
        """Return steering, speed and what is remembered next; rows are ``asked`` to leave, or not."""
        heading, body = known[:, 1], self._body(known[:, 2])
        step, across = np.abs(now.speed) * self._car.step, now.kerb - now.line  # still to go
        phase = self._next(heading, body, step, across, now)
        phase = self._moves.straighten(phase, heading, now, body, step)
        phase = self._moves.leave(phase, heading, now, body, step, asked)
        now, kind = now._replace(phase=phase, rest=now.rest - self._car.step), phase.astype(np.intp)
        blank = np.zeros_like(heading)
        right, left = -1.0 / body.radius_right + blank, 1.0 / body.radius_left + blank
        straighten, bend = -self._straighten * heading, self._bend(heading, body, across, now)
        curvature = np.choose(
            kind, [straighten, straighten, right, blank, bend, blank, right, left, left, right, blank, right]
        )
        steering = self._servo.command(np.arctan(self._car.wheelbase * curvature) - known[:, 2])
        return steering, np.minimum(self._speed(kind, heading, front, body, now), self._fastest), now

    def _speed(self, phase: NDArray[np.intp], heading: Floats, front: Floats, body: Body, now: Search) -> Floats:
        """Return the set speed, m/s, slow enough at a way's end to stop within a step."""
        ahead, behind = self._moves.room(heading, now, body)
        blank = np.zeros_like(heading)
        row, fast = np.where(now.rest > 0.0, 0.0, self.SLOW), blank + self.BACK
        on = np.clip(2.0 * (now.start - now.place), 0.05, self.SLOW)
        back = -np.clip(2.0 * heading, 0.08, self.BACK) if self._vary else -fast
        back = np.where(now.moves > 0.5, -np.clip(2.0 * behind, 0.05, self.BACK), back)
        forth, shunt = np.clip(2.0 * ahead, 0.05, self.SHUNT), -np.clip(2.0 * behind, 0.05, self.SHUNT)
        speed = np.choose(phase, [row, on, -fast, -fast, back, blank, forth, shunt, forth, shunt, fast, fast])
        # Before a wall the car stops.
        stops = np.sqrt(2.0 * self.BRAKE * np.maximum(front - self.STOP, 0.0))
        return np.where(phase <= AHEAD, np.minimum(speed, stops), speed)

    def _next(self, heading: Floats, body: Body, step: Floats, across: Floats, now: Search) -> Floats:
        """Return the next phase of one sweep: each part ends where the last arc, from there, ends along the kerb."""
        phase = np.where((now.phase == AHEAD) & (now.start - now.place <= 0.5 * step), RIGHT, now.phase)
        turn = body.radius_left * (1.0 - np.cos(heading))
        reached = across - step * np.sin(np.maximum(heading, 0.0)) * 0.5 <= turn
        phase = np.where((phase == RIGHT) & (heading >= PARKING_ANGLE), STRAIGHT, phase)
        phase = np.where(((phase == RIGHT) | (phase == STRAIGHT)) & reached & (heading > 0.02), LEFT, phase)
        room = now.place - now.gap - self._overhang - self.AIR
        done = (heading <= self.DONE) | (room <= 0.5 * step)
        return np.where((phase == LEFT) & done & (now.moves < 0.5), STAND, phase)

    def _bend(self, heading: Floats, body: Body, across: Floats, now: Search) -> Floats:
        """Return the curvature of the last arc, 1/m."""
        most = 1.0 / body.radius_left
        turn = (1.0 - np.cos(heading)) / np.maximum(across, 1e-3)
        # The box behind comes first: what is left to it is turned in, whatever that leaves to the kerb.
        room = now.place - now.gap - self._overhang - self.AIR
        turn = np.where(now.moves > 0.5, turn, np.maximum(turn, heading / np.maximum(room, 1e-3)))
        bend = np.clip(turn, 0.0, most) if self._vary else most + 0.0 * turn
        return np.where(heading > self.DONE, bend, 0.0)
