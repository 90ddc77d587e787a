"""What a car that goes slowly along a row of parked cars knows: where it is, where boxes end, how deep they are.

A Kalman filter along the boxes knows heading, steering offset and yaw-rate bias. The ultrasonic's cone sees a box's end
before and behind it, as far as that is from the cone's rim: then the reading tells where the end is along the row, to
the millimetre. How far the kerb is tells how deep the boxes are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.odometry import Odometer
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.servo_map import ServoMap
from lanekeep_baselines.wall_design import WallCar
from lanekeep_baselines.wall_estimator import WallFilter, WallNoise
from lanekeep_env.sensing.ultrasonic import FARTHEST, HALF_CONE

#: No such place, m.
NONE = -1e6
#: Phases of parking: along the row, on to the start, back to the right, straight back, back to the left, parked; in
#: several moves forth to the right, back to the left; out again: forth to the left, back to the right, straight away,
#: along the row.
SEARCH, AHEAD, RIGHT, STRAIGHT, LEFT, STAND, FORTH, BACK, OUT, IN, AWAY, BESIDE = range(12)
#: How much farther away a corner is where the cone loses it, and how far along an end is that only its rim sees.
_SLANT, _RIM = float(1.0 / np.cos(HALF_CONE)), float(np.sin(HALF_CONE))


#: Along a row the distance tells little: it jumps, and corners bend it. What is known of heading and offset is kept.
NOISE = WallNoise(
    side_distance=0.012,
    start=(0.02, 0.06, 0.012, 0.05),
    distance=0.002,
    heading=0.004,
    steering_offset=0.001,
    yaw_rate_bias=0.0005,
)


class Search(NamedTuple):
    """What is remembered besides filter and readings, (n,) each; places count along the row, m.

    Attributes:
        speed: present, m/s.
        phase: one of the above.
        place: of the rear axle.
        kerb: distance of the rear axle from it, m.
        beside: 1 while the sensor is along a box, else 0.
        box: the box's distance from the sensor, m.
        begin: where that box, or the last one, begins, `NONE` before the first.
        end: where that box ends, or the last one that has ended, `NONE` before the first.
        gap: where the gap begins that ended last, or that is chosen, `NONE` before the first.
        peak: largest reading since then, m.
        edge: where the next box begins, `NONE` while none is seen.
        rims: readings since the last end was seen first.
        depth: how far the box that ended the last gap reaches from the kerb, m.
        start: where the rear axle begins its way back.
        line: distance of the rear axle from the kerb at which the last arc of that way would end along it, m.
        moves: 1 where the gap is entered in several moves, else 0.
        rest: for which the car still stands before it begins, s: a gyroscope at rest shows its bias.
    """

    speed: Floats
    phase: Floats
    place: Floats
    kerb: Floats
    beside: Floats
    box: Floats
    begin: Floats
    end: Floats
    gap: Floats
    peak: Floats
    edge: Floats
    rims: Floats
    depth: Floats
    start: Floats
    line: Floats
    moves: Floats
    rest: Floats

    @classmethod
    def at_rest(cls, right: Floats, rest: float) -> Search:
        """Return what is known before the row: the distance of the wall, m; the car stands for ``rest`` s."""
        blank = np.zeros_like(right)
        none = blank + NONE
        return cls(blank, blank, blank, right, blank, right, none, none, none, right, none, *(blank,) * 5, blank + rest)


class RowReader:
    """Reads the row; its memory is the filter's and the last readings.

    Args:
        car: that drives.
        servo: what it makes of commands.
        noise: of a reading, m, standard deviation.
        slow: speed along the row, m/s.
        odometer: tells its way.
        offset: whether the steering offset is estimated; else it counts as none.
    """

    #: A jump of the distance that is an end of a box, m.
    JUMP: ClassVar[float] = 0.06
    #: By how much a reading must fall for an end ahead, m.
    FALL: ClassVar[float] = 0.04
    #: Beside noise, m, what a reading may be off the expected one and still be of the same wall.
    SAME: ClassVar[float] = 0.006
    #: Beyond a box's distance, m, a reading at the cone's rim is not of its corner: boxes are not equally deep.
    CORNER: ClassVar[float] = 0.08
    #: Readings after the first one that may tell of the same end.
    RIMS: ClassVar[int] = 6
    #: Way after which a reading is known to be of a box 0.5 m away, or not, m.
    LATER: ClassVar[float] = 0.25
    #: Readings that together tell whether they are.
    MEAN: ClassVar[int] = 6

    def __init__(
        self, car: WallCar, servo: ServoMap, noise: float, slow: float, odometer: Odometer, offset: bool
    ) -> None:
        self._car, self._servo, self._noise, self._slow, self._odometer = car, servo, noise, slow, odometer
        # The filter hears, ``behind`` the rear axle, what the sensor said there: only then is it known whether that was
        # a box, or its end at the cone's rim.
        self._lag = math.ceil(self.LATER / (slow * car.step))
        self._behind = self._lag * slow * car.step - car.sensor
        start = NOISE.start if offset else (*NOISE.start[:2], 0.0, NOISE.start[3])
        expected = replace(NOISE, start=start, steering_offset=NOISE.steering_offset if offset else 0.0)
        self._filter = WallFilter(WallCar(car.wheelbase, -self._behind, car.step), expected)
        self.memory = self._filter.memory + odometer.memory + self._lag

    def read(
        self, at: Mapping[str, Floats], memory: Floats, new: NDArray[np.bool_], now: Search
    ) -> tuple[Floats, Floats, Search, Floats]:
        """Return what the filter knows, the next memory, the search, and the length of a gap that ended, m.

        The length is 0 where none did, (n,). Rows that are ``new`` start.
        """
        first, second = self._filter.memory, self._filter.memory + self._odometer.memory
        right = np.where(at["distance_right"] > 0.0, at["distance_right"], FARTHEST)
        before, heard = memory[:, :first], np.where(new[:, None], right[:, None], memory[:, second:])
        speed, mean, driven = self._odometer.update(at, memory[:, first:second], new)
        way = mean * self._car.step
        known, listens = self._locate(at, heard, before, new, now, way)
        middle = np.where(new, known[:, 1], 0.5 * (before[:, 1] + known[:, 1]))
        kerb = np.where(listens, known[:, 0] + self._behind * np.sin(known[:, 1]), now.kerb + way * np.sin(middle))
        now = now._replace(speed=speed, place=now.place + way * np.cos(middle), kerb=kerb)
        now, length = self._measure(right, known, now)
        moves = (speed > 0.5 * self._slow)[:, None]
        heard = np.where(moves, np.concatenate([heard[:, 1:], right[:, None]], axis=1), heard)
        return known, np.concatenate([known, driven, heard], axis=1), now, length

    def _locate(
        self, at: Mapping[str, Floats], heard: Floats, memory: Floats, new: NDArray[np.bool_], now: Search, way: Floats
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the filter's next memory, and where it hears the kerb; what it ``heard`` begins where the axle is."""
        right = heard[:, 0]
        place = now.place + way - self._behind
        box = (place >= now.begin) & (now.begin != NONE) & ((now.end < now.begin) | (place < now.end))
        # The kerb is seen as far from boxes as their ends are not nearer.
        rim = _RIM * now.kerb + self.SAME
        next_ = np.where(now.edge != NONE, now.edge, np.where(now.begin > place, now.begin, np.inf))
        kerb = ~box & (place > now.end + rim) & (place < next_ - rim)
        kerb &= np.abs(right - now.kerb) < 0.25
        moves = (now.phase <= AHEAD) & (now.speed > 0.5 * self._slow) & (place >= self._car.sensor)
        # What was read after it tells another wall, even one as little off as noise is: boxes may stand close together.
        expected = memory[:, 0] + way * np.sin(memory[:, 1])
        half = self.MEAN // 2
        soon, then = heard[:, :half].mean(axis=1), heard[:, half : self.MEAN].mean(axis=1)
        further = 0.5 * (self.MEAN - 1) * self._slow * self._car.step * np.sin(memory[:, 1])
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

    def _measure(self, right: Floats, known: Floats, now: Search) -> tuple[Search, Floats]:
        """Find ends of boxes; return the length of a gap that ended, m, 0 where none did."""
        looks, on, sensor = now.phase == SEARCH, now.phase <= AHEAD, now.place + self._car.sensor
        kerb = now.kerb + self._car.sensor * np.sin(known[:, 1])
        beside = now.beside > 0.5
        # An end passed: the reading goes beyond that of a corner at the cone's rim.
        ends = on & beside & (right > _SLANT * now.box + self.JUMP)
        # Where along the row the readings are of, if they are of the cone's rim; the cone turns with the car.
        passed, coming = (sensor + sign * np.sin(HALF_CONE + sign * known[:, 1]) * right for sign in (-1.0, 1.0))
        end = np.where(ends, passed, now.end)
        peak = np.where(ends, right, np.maximum(now.peak, right))
        # An end ahead: it falls again.
        opens = looks & ~beside
        sees = opens & (now.edge == NONE) & (right < kerb - 2.0 * self.JUMP) & (right < peak - self.FALL)
        edge = np.where(sees, coming, now.edge)
        # The first reading of an end is one that noise has chosen: those that follow count, while they are of the rim.
        rims = np.where(ends | sees, 0.0, now.rims + 1.0)
        follows = (
            (right > _SLANT * (now.box + self.CORNER)) & (right < kerb - self.JUMP) & (rims > 0.0) & (rims <= self.RIMS)
        )
        after = on & ~beside & (now.edge == NONE) & follows
        end = np.where(after, end + (passed - end) / np.maximum(rims, 1.0), end)
        before = opens & (now.edge != NONE) & follows
        edge = np.where(before, edge + (coming - edge) / np.maximum(rims, 1.0), edge)
        edge = np.where(ends | (opens & (right > kerb - self.JUMP)), NONE, edge)
        reaches = opens & (edge != NONE) & (sensor >= edge)
        gap = np.where(looks & (ends | after), end, now.gap)
        box = np.where(reaches, right, now.box + np.where(beside & ~ends, 0.2 * (right - now.box), 0.0))
        length = np.where(reaches & (gap != NONE), edge - gap, 0.0)
        now = now._replace(
            beside=1.0 * ((beside & ~ends) | reaches),
            box=box,
            begin=np.where(reaches, edge, now.begin),
            end=end,
            gap=gap,
            peak=np.where(reaches, 0.0, peak),
            edge=np.where(reaches, NONE, edge),
            rims=rims,
            depth=np.where(reaches, kerb - box, now.depth),
        )
        return now, length
