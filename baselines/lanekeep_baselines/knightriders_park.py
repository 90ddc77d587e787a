"""Team KnightRiders 2017: parallel parking in reverse, into a gap found by the side ultrasonic (third task, chapter 5).

As in the source the car goes slowly along the row, looks for a gap with the side ultrasonic and the encoder, goes on to
where its path begins, and drives back: an arc to the right, a straight, an arc to the left. Better than there:
- The Kalman filter along the boxes knows heading, steering offset and yaw-rate bias: the car starts parallel, as the
  authors wish (6.2), and steers what it means.
- The ultrasonic's cone sees a box's end before and behind it, as far as that is from the cone's rim: then the reading
  tells where the end is along the row, to the millimetre. How far the kerb is tells how deep the boxes are.
- A gap is long enough if the last arc takes the nose past the box in front as deep as it was measured.
- The servo's map, as half circles tell it, is inverted (`servo_map`).
- The path is closed over the estimated pose: the last arc is, at each step, the one that from here ends along the kerb
  (as `knightriders-circuit` does in corners), so that radii, start and offset need not be known exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.path_planning import PARKING_ANGLE, parallel_parking
from lanekeep_baselines.policy import DrivingPolicy, DrivingScenario, Floats
from lanekeep_baselines.servo_map import ServoMap
from lanekeep_baselines.wall_design import WallCar
from lanekeep_baselines.wall_estimator import WallFilter, WallNoise
from lanekeep_env.scenario import Servo
from lanekeep_env.sensing.faults import Sensor, Sensors
from lanekeep_env.sensing.ultrasonic import FARTHEST, HALF_CONE

#: No such place, m.
_NONE = -1e6
#: Phases: along the row, on to the start, back to the right, straight back, back to the left, parked.
SEARCH, AHEAD, RIGHT, STRAIGHT, LEFT, STAND = range(6)
#: How much farther away a corner is where the cone loses it, and how far along an end is that only its rim sees.
_SLANT, _RIM = float(1.0 / np.cos(HALF_CONE)), float(np.sin(HALF_CONE))


#: Along a row the distance tells little: it jumps, and corners bend it. What is known of heading and offset is kept.
NOISE = WallNoise(
    side_distance=0.012,
    start=(0.012, 0.06, 0.02, 0.05),
    distance=0.002,
    heading=0.004,
    steering_offset=0.001,
    yaw_rate_bias=0.0005,
)


class Search(NamedTuple):
    """What is remembered besides filter and readings, (n,) each; places count along the row, m.

    Attributes:
        speed: last measured, m/s.
        phase: see above.
        place: of the rear axle.
        kerb: distance of the rear axle from it, m.
        beside: 1 while the sensor is along a box, else 0.
        box: the box's distance from the sensor, m.
        begin: where that box, or the last one, begins, `_NONE` before the first.
        gap: where the last gap began, `_NONE` before the first.
        peak: largest reading since then, m.
        edge: where the next box begins, `_NONE` while none is seen.
        start: where the rear axle begins its way back.
        line: distance of the rear axle from the kerb that is aimed at, m.
    """

    speed: Floats
    phase: Floats
    place: Floats
    kerb: Floats
    beside: Floats
    box: Floats
    begin: Floats
    gap: Floats
    peak: Floats
    edge: Floats
    start: Floats
    line: Floats


def _no_parking(scenario: Any) -> str:
    """Return what is lacking where a scenario never asks to park, else ""."""
    return "" if scenario.parks else "a mode 'park', which the scenario's modes do not have"


#: That there is a mode in which to park.
PARKS = Need("a mode 'park'", _no_parking)


class CourseDrive(DrivingScenario, Protocol):
    """A scenario with modes."""

    @property
    def parks(self) -> bool: ...


class ParkingDrive(CourseDrive, Protocol):
    """What the controller may know; `lanekeep_env.ParallelParkScenario` is one."""

    @property
    def sensors(self) -> Sensors: ...
    @property
    def servo(self) -> Servo: ...


class KnightRidersPark(DrivingPolicy):
    """`knightriders-park`: a gap that is long enough, then arc, straight and arc in reverse."""

    name = "knightriders-park"
    reads = ("distance_right", "distance_front", "yaw_rate", "speed", "steering_command", "mode")
    needs = (PARKS,)

    #: Speeds along the row, and back, m/s.
    SLOW, BACK = 0.3, 0.25
    #: A jump of the distance that is an end of a box, m.
    JUMP: ClassVar[float] = 0.06
    #: Distances of the parked body from the kerb that are aimed at, m: level with the box in front between these.
    NEAREST, FARTHEST = 0.04, 0.10
    #: Spare length that a gap must have, m, and the most that is left behind the car.
    SPARE, BEHIND = 0.02, 0.25
    #: By how much a reading must fall for an end ahead, m.
    FALL: ClassVar[float] = 0.04
    #: Nearest to the box behind, m.
    AIR: ClassVar[float] = 0.02
    #: Share of the steering angle that is kept for the offset and for corrections.
    KEPT: ClassVar[float] = float(np.deg2rad(0.3))
    #: The car turns towards the row's direction by so much a metre and radian.
    STRAIGHTEN: ClassVar[float] = 2.0
    #: From a wall ahead where the car stops, m, and how it brakes before it, m/s².
    STOP, BRAKE = 0.15, 0.5
    #: Heading at which the last arc is done, rad, and how far from the line at most, m.
    DONE: ClassVar[float] = float(np.deg2rad(0.5))
    #: Beside noise, m, what a reading may be off the expected one and still be of the same wall.
    SAME: ClassVar[float] = 0.006
    #: Readings that together tell whether they are.
    MEAN: ClassVar[int] = 6

    def __init__(self, scenario: ParkingDrive) -> None:
        super().__init__(scenario)
        car = scenario.vehicle
        self._car = WallCar(car.wheelbase, 0.5 * car.wheelbase, scenario.control_step)
        self._servo = ServoMap.of(scenario.servo, min(scenario.max_steering_angle, car.steering.angle_limit or np.inf))
        self._length, self._half_width = car.length, 0.5 * car.width
        self._overhang = 0.5 * (car.length - car.wheelbase)
        # The filter hears, where the rear axle is now, what the sensor said there: only then is it known whether that
        # was a box, or its end at the cone's rim.
        self._lag = max(1, round(self._car.sensor / (self.SLOW * scenario.control_step)))
        self._noise = dict(scenario.sensors).get("distance_right", Sensor()).noise
        self._filter = WallFilter(WallCar(car.wheelbase, 0.0, scenario.control_step), NOISE)
        self._split = self._filter.memory, self._filter.memory + self._lag
        self.memory = self._split[1] + len(Search._fields)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        first, second = self._split
        blank = np.zeros_like(at["speed"])
        right = np.where(at["distance_right"] > 0.0, at["distance_right"], FARTHEST)
        begin = Search(*(blank,) * 3, right, blank, right, *(blank + _NONE,) * 2, right, blank + _NONE, blank, blank)
        new = np.reshape(fresh, -1) | (at["mode"] != 2.0)
        now = Search(*(np.where(new, a, b) for a, b in zip(begin, memory[:, second:].T, strict=True)))
        heard = np.where(new[:, None], right[:, None], memory[:, first:second])
        way = 0.5 * (now.speed + at["speed"]) * self._car.step
        before = memory[:, :first]
        known, listens = self._locate(at, heard, before, new, now, way)
        middle = np.where(new, known[:, 1], 0.5 * (before[:, 1] + known[:, 1]))
        kerb = np.where(listens, known[:, 0], now.kerb + way * np.sin(middle))
        now = now._replace(speed=at["speed"], place=now.place + way * np.cos(middle), kerb=kerb)
        now = self._measure(right, known, now)
        front = np.where(at["distance_front"] > 0.0, at["distance_front"], FARTHEST)
        steering, speed, now = self._drive(known, front, now)
        moves = (at["speed"] > 0.5 * self.SLOW)[:, None]
        heard = np.where(moves, np.concatenate([heard[:, 1:], right[:, None]], axis=1), heard)
        return np.stack([steering, speed], axis=1), np.concatenate([known, heard, np.stack(now, axis=1)], axis=1)

    def _locate(
        self, at: Mapping[str, Floats], heard: Floats, memory: Floats, new: NDArray[np.bool_], now: Search, way: Floats
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the filter's next memory, and where it hears the kerb; what it ``heard`` begins where the axle is."""
        right = heard[:, 0]
        place = now.place + way
        box = (place >= now.begin) & (now.begin != _NONE) & ((now.gap < now.begin) | (place < now.gap))
        # The kerb is seen as far from boxes as their ends are not nearer.
        rim = _RIM * now.kerb + self.SAME
        next_ = np.where(now.edge != _NONE, now.edge, np.where(now.begin > place, now.begin, np.inf))
        kerb = ~box & (place > now.gap + rim) & (place < next_ - rim)
        kerb &= np.abs(right - now.kerb) < 0.25
        moves = (now.phase == SEARCH) & (now.speed > 0.5 * self.SLOW)
        # What was read after it tells another wall, even one as little off as noise is: boxes may stand close together.
        expected = memory[:, 0] + way * np.sin(memory[:, 1])
        half = self.MEAN // 2
        soon, then = heard[:, :half].mean(axis=1), heard[:, half : self.MEAN].mean(axis=1)
        further = 0.5 * (self.MEAN - 1) * self.SLOW * self._car.step * np.sin(memory[:, 1])
        other = np.abs(0.5 * (soon + then) - expected - further) > 4.0 * self._noise / np.sqrt(self.MEAN) + self.SAME
        even = np.abs(then - soon) < 3.0 * self._noise * np.sqrt(2.0 / half) + self.SAME
        hears = moves & ((box & (even | ~other)) | (kerb & even))
        # Another wall: its distance counts anew, heading and offset stay known.
        states = memory.copy()
        states[:, 4:8] = np.where((hears & other)[:, None], 0.0, states[:, 4:8])
        for column in (8, 12, 16):
            states[:, column] = np.where(hears & other, 0.0, states[:, column])
        states[:, 4] = np.where(hears & other, 1.0, states[:, 4])
        distance = np.where(hears | new, right, 0.0)
        steering = self._servo.angle(at["steering_command"])
        known = self._filter.update(states, new, way / self._car.step, steering, distance, at["yaw_rate"])
        return known, kerb & hears & ~new

    def _measure(self, right: Floats, known: Floats, now: Search) -> Search:
        """Find ends of boxes, and a gap that is long enough."""
        looks, sensor = now.phase == SEARCH, now.place + self._car.sensor
        kerb = now.kerb + self._car.sensor * np.sin(known[:, 1])
        beside = now.beside > 0.5
        # An end passed: the reading goes beyond that of a corner at the cone's rim.
        ends = looks & beside & (right > _SLANT * now.box + self.JUMP)
        gap = np.where(ends, sensor - _RIM * right, now.gap)
        peak = np.where(ends, right, np.maximum(now.peak, right))
        # An end ahead: it falls again.
        opens = looks & ~beside
        sees = opens & (now.edge == _NONE) & (right < kerb - 2.0 * self.JUMP) & (right < peak - self.FALL)
        edge = np.where(sees, sensor + _RIM * right, now.edge)
        edge = np.where(ends | (opens & (right > kerb - self.JUMP)), _NONE, edge)
        reaches = opens & (edge != _NONE) & (sensor >= edge)
        box = np.where(reaches, right, now.box + np.where(beside & ~ends, 0.2 * (right - now.box), 0.0))
        length = np.where(reaches & (gap != _NONE), edge - gap, 0.0)
        now = now._replace(
            beside=1.0 * ((beside & ~ends) | reaches),
            box=box,
            begin=np.where(reaches, edge, now.begin),
            gap=gap,
            peak=np.where(reaches, 0.0, peak),
            edge=np.where(reaches, _NONE, edge),
        )
        return self._choose(length, kerb - box, known, now)

    def _choose(self, length: Floats, depth: Floats, known: Floats, now: Search) -> Search:
        """Take a gap of that length, m, behind a box as deep as that, m, if it is long enough."""
        radius = self._radius(known[:, 2])
        kerb = np.clip(depth - 2.0 * self._half_width, self.NEAREST, self.FARTHEST)
        line = kerb + self._half_width
        shift = now.kerb - line
        # The nose's right corner passes the rear corner of the box in front, ``out`` m wider than the car's side.
        out = np.maximum(depth - kerb, 0.05)
        outer = radius[0] + self._half_width
        needed = self._overhang + np.sqrt(
            (self._length - self._overhang) ** 2 + outer**2 - np.maximum(outer - out, 0.0) ** 2
        )
        plan = parallel_parking(shift, radius[1], radius[0])
        takes = (length >= needed + self.SPARE) & plan.ok
        behind = np.clip(0.5 * (length - needed), 0.0, self.BEHIND)
        start = now.gap + behind + self._overhang + plan.travel
        return now._replace(
            phase=np.where(takes, AHEAD, now.phase),
            start=np.where(takes, start, now.start),
            line=np.where(takes, line, now.line),
        )

    def _radius(self, offset: Floats) -> tuple[Floats, Floats]:
        """Return the rear axle's turning radii to the left and to the right, m, with the steering offset."""
        left = self._servo.left - self.KEPT + np.minimum(offset, 0.0)
        right = self._servo.right - self.KEPT - np.maximum(offset, 0.0)
        return self._car.wheelbase / np.tan(left), self._car.wheelbase / np.tan(right)

    def _drive(self, known: Floats, front: Floats, now: Search) -> tuple[Floats, Floats, Search]:
        """Return steering, speed and what is remembered next."""
        heading, offset, phase = known[:, 1], known[:, 2], now.phase
        step = np.abs(now.speed) * self._car.step
        left = now.start - now.place
        phase = np.where((phase == AHEAD) & (left <= 0.5 * step), RIGHT, phase)
        # Right, straight, left: each ends where the last arc, from there, ends along the kerb.
        to_left, to_right = self._radius(offset)
        across = now.kerb - now.line  # still to go
        turn = 1.0 - np.cos(heading)
        reached = across - step * np.sin(np.maximum(heading, 0.0)) * 0.5 <= to_left * turn
        phase = np.where((phase == RIGHT) & (heading >= PARKING_ANGLE), STRAIGHT, phase)
        phase = np.where(((phase == RIGHT) | (phase == STRAIGHT)) & reached & (heading > 0.02), LEFT, phase)
        # The box behind comes first: what is left to it is turned in, whatever that leaves to the kerb.
        room = now.place - now.gap - self._overhang - self.AIR
        phase = np.where((phase == LEFT) & ((heading <= self.DONE) | (room <= 0.5 * step)), STAND, phase)
        bend = np.maximum(turn / np.maximum(across, 1e-3), heading / np.maximum(room, 1e-3))
        bend = np.clip(bend, 0.0, 1.0 / to_left)
        curvature = np.choose(
            phase.astype(np.intp),
            [
                -self.STRAIGHTEN * heading,
                -self.STRAIGHTEN * heading,
                -1.0 / to_right,
                0.0 * bend,
                np.where(heading > self.DONE, bend, 0.0),
                0.0 * bend,
            ],
        )
        steering = self._servo.command(np.arctan(self._car.wheelbase * curvature) - offset)
        # Slow enough at the way's end to stop within a step.
        ahead = np.clip(2.0 * left, 0.05, self.SLOW)
        back = -np.clip(2.0 * heading, 0.08, self.BACK)
        speed = np.choose(
            phase.astype(np.intp),
            [self.SLOW + 0.0 * left, ahead, -self.BACK + 0.0 * left, -self.BACK + 0.0 * left, back, 0.0 * left],
        )
        # Before a wall the car stops.
        stops = np.sqrt(2.0 * self.BRAKE * np.maximum(front - self.STOP, 0.0))
        speed = np.where(phase <= AHEAD, np.minimum(speed, stops), speed)
        return steering, np.minimum(speed, self._fastest), now._replace(phase=phase)
