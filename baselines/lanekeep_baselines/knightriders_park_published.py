"""Team KnightRiders 2017: parallel parking as the report has it (chapter 5), for comparison.

The car goes straight on along the row. Where the side ultrasonic jumps a gap begins; it is long enough once the car has
gone X_total (36) along it, which is the report's gap length and in truth the rear axle's travel. Then the car stops and
drives back by encoder: an arc to the right, a straight, an arc to the left (33, 37), of 45 degrees, with D/2 of (29),
which is the front axle's radius, for both sides. Misprints are corrected: (33) in radians, (35) with Y_total once.

The car stops where its rear axle is X_total and its own overhang beyond the gap's begin: the text counts from the gap's
begin as the sensor sees it, and would end in the box behind. Decisions, where the text is silent: what a jump is, the
speeds, that the car shall stand `AIR` from the kerb, and that it stops before a wall.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.knightriders_park import PARKS, CourseDrive
from lanekeep_baselines.path_planning import PARKING_ANGLE
from lanekeep_baselines.policy import DrivingPolicy, Floats
from lanekeep_env.sensing.ultrasonic import FARTHEST


class Progress(NamedTuple):
    """What is remembered, (n,) each.

    Attributes:
        speed: last measured, m/s.
        row: distance of the boxes, m.
        along: way along the present gap, m; negative outside of one.
        wall: largest distance seen in it, m.
        back: way driven back, m; negative before that.
    """

    speed: Floats
    row: Floats
    along: Floats
    wall: Floats
    back: Floats


class KnightRidersParkPublished(DrivingPolicy):
    """`knightriders-park-published`: the report's parking, by its own formulas."""

    name = "knightriders-park-published"
    reads = ("distance_right", "distance_front", "speed", "mode")
    needs = (PARKS,)

    #: Speeds along the row, and back, m/s.
    SLOW, BACK = 0.3, 0.25
    #: A jump of the distance, m, and the parked car's distance from the kerb, m.
    JUMP, AIR = 0.15, 0.05
    #: Share by which the boxes' distance follows what is read.
    FOLLOWS: ClassVar[float] = 0.1
    #: From a wall ahead where the car stops, m.
    STOP: ClassVar[float] = 0.3

    def __init__(self, scenario: CourseDrive) -> None:
        super().__init__(scenario)
        car = scenario.vehicle
        self._limit = min(scenario.max_steering_angle, car.steering.angle_limit or np.inf)
        self._radius = car.wheelbase / np.sin(self._limit)
        # The sensor is half-way between the axles; the body reaches beyond the rear one.
        self._ahead = 0.5 * car.wheelbase + 0.5 * (car.length - car.wheelbase) + self.AIR
        self._half_width, self._step = 0.5 * car.width, scenario.control_step
        self.memory = len(Progress._fields)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        right = np.where(at["distance_right"] > 0.0, at["distance_right"], FARTHEST)
        blank = np.zeros_like(right)
        new = np.reshape(fresh, -1) | (at["mode"] != 2.0)
        begin = Progress(blank, right, blank - 1.0, blank, blank - 1.0)
        last = Progress(*(np.where(new, a, b) for a, b in zip(begin, memory.T, strict=True)))
        way = 0.5 * (last.speed + at["speed"]) * self._step
        searches = last.back < 0.0
        # (30) to (37), with what was seen of the gap so far.
        across = 2.0 * self._radius * (1.0 - np.cos(PARKING_ANGLE))
        shift = np.maximum(last.wall - self._half_width - self.AIR, across)
        middle = shift - across
        total = 2.0 * self._radius * np.sin(PARKING_ANGLE) + middle
        found = last.along >= total
        inside = (right > last.row + self.JUMP) | found
        along = np.where(inside, np.maximum(last.along, 0.0) + way, -1.0)
        wall = np.where(inside & ~found, np.maximum(last.wall, right), np.where(found, last.wall, 0.0))
        along, wall = np.where(searches, along, last.along), np.where(searches, wall, last.wall)
        row = last.row + np.where(inside | ~searches, 0.0, self.FOLLOWS * (right - last.row))  # slowly: ends are ramps
        stops = found & (along >= total + self._ahead)
        back = np.where(searches, np.where(stops, 0.0, -1.0), last.back - np.minimum(way, 0.0))
        arc, straight = self._radius * PARKING_ANGLE, np.sqrt(2.0) * middle
        ends = arc, arc + straight, 2.0 * arc + straight
        steering = np.where(back < ends[0], -self._limit, np.where(back < ends[1], 0.0, self._limit))
        steering = np.where((back < 0.0) | (back >= ends[2]), 0.0, steering)
        front = np.where(at["distance_front"] > 0.0, at["distance_front"], FARTHEST)
        ahead = np.where(front > self.STOP, self.SLOW, 0.0)
        speed = np.where(back < 0.0, ahead, np.where(back < ends[2], -self.BACK, 0.0))
        following = np.stack(Progress(at["speed"], row, along, wall, back), axis=1)
        return np.stack([steering, np.minimum(speed, self._fastest)], axis=1), following
