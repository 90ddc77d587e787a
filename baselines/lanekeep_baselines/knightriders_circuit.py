"""Team KnightRiders 2017: a rectangular circuit between walls as fast as possible (first task, 4.3.3).

As in the source the car follows the right wall and looks for a wall's end in the scan meanwhile; a corner found, a
straight up to it and an arc of 90 degrees are planned and driven by odometry, then the wall is taken up again.

Added to it:
- Corners to the left are the mirrored search along the left wall. A circuit's direction is remembered.
- The wall is followed by the redesigned cascade on the Kalman filter. Through a corner the filter goes on without a
  side wall, so that heading, steering offset and yaw-rate bias stay known; half-way it changes over to the next leg's
  wall, whose place follows from the corner's.
- The corner's place is that of the wall ahead less the corridor's width, within what the scan shows of the wall's end;
  an end elsewhere is none of a corner. The camera loses it from view 1.4 times its side distance before it: then the
  wall ahead and odometry tell.
- The arc is planned anew in each step: the one that from here touches the next leg's lane. It starts where its radius
  is `RADIUS`.
- The lane is near the inner wall, where the lap is shortest and the arc still clears the corner; farther from it in
  wide corridors, whose inner walls may be short. Until the direction is known it is the middle.
- The speed is the largest one, less where the arc's lateral acceleration asks for it or no direction is known.
- A command passes only while the car can still stop after it among what it has seen lately (`local_map`, `free_drive`).
  Else the nearest path that is free is driven instead; after more than four of these the way is looked for in free
  space, until the car has been along two walls for a while. That way it also drives where there is no rectangle.
- Odometry tells the leg that it is on and whether it has turned round on it (`leg_odometry`).
  Windows are heard by the ultrasonics only, often late: walls with glass are still touched at times.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.circuit_pilot import CircuitPilot
from lanekeep_baselines.fixed_arc import FixedArc
from lanekeep_baselines.free_drive import FreeDrive, Pilot
from lanekeep_baselines.free_space import Body, FreeSpace
from lanekeep_baselines.leg_odometry import LegOdometer, Way, beside
from lanekeep_baselines.local_map import LocalMap
from lanekeep_baselines.odometry import Odometer, OdometryScenario
from lanekeep_baselines.policy import DrivingPolicy, Floats
from lanekeep_baselines.scan_features import ScanReader, WallEnd
from lanekeep_baselines.wall_cascade import LARGEST_HEADING
from lanekeep_baselines.wall_control import Cascade, Measured
from lanekeep_baselines.wall_design import WallCar
from lanekeep_baselines.wall_estimator import WallFilter, WallNoise
from lanekeep_env.scenario import Scan
from lanekeep_env.sensing.faults import Sensor
from lanekeep_env.sensing.ultrasonic import HALF_CONE

_RIGHT_ANGLE = 0.5 * np.pi
#: A corner of which nothing is known is this far ahead, m.
_UNKNOWN = 1e3
#: Phases: along a wall, in the first and in the second half of a corner.
_WALL, _ENTERS, _LEAVES = 0.0, 1.0, 2.0


class CircuitDrive(OdometryScenario, Protocol):
    """What the controller may know; `lanekeep_env.CircuitScenario` is one."""

    @property
    def scan(self) -> Scan: ...


class Leg(NamedTuple):
    """What is remembered besides filter and cascade, (n,) each.

    Attributes:
        corner: way of the rear axle to the inner corner ahead, m.
        corridor: width, m.
        votes: for corners to the left, minus those to the right.
        phase: `_WALL`, `_ENTERS` or `_LEAVES`.
    """

    corner: Floats
    corridor: Floats
    votes: Floats
    phase: Floats


class KnightRidersCircuit(DrivingPolicy):
    """`knightriders-circuit`: along the walls and round the corners of a rectangular circuit.

    Args:
        scenario: with a scan.
        free_space: a way is looked for where a command is not harmless; else the car backs up and takes the report's
            fixed arc.
    """

    name = "knightriders-circuit"
    reads = ("distance_right", "distance_left", "yaw_rate", "steering_command", *Odometer.reads, "scan_0")
    uses = ("distance_front", "steering_angle", "scan_*")

    #: Radius of the corners, m: 19.3 degrees of steering at the source's car, which leaves 1.7 beyond an offset of 1.
    RADIUS: ClassVar[float] = 1.0
    #: Lateral acceleration in corners and deceleration before them, m/s².
    LATERAL, BRAKE = 4.0, 1.5
    #: Distance of the lane from the inner wall, m: in corridors up to 2 m, and in such of 3 m, between them linear.
    NEAR, WIDE = 0.55, 1.25
    #: Where the arc ends and the cascade takes over, rad.
    END: ClassVar[float] = float(np.deg2rad(8.0))
    #: How far a side distance may be from the expected one, m, to be one of the same wall.
    SAME: ClassVar[float] = 0.2
    #: How far the wall ahead less the corridor may be from a wall's end in the scan, m, for that to be a corner.
    AGREE: ClassVar[float] = 0.5
    #: Standard deviation of the heading at the start, rad, and that above which no direction is seen.
    START, SURE = 0.1, 0.08
    #: Standard deviation of the potentiometer at the road wheel at least, rad.
    WHEEL: ClassVar[float] = 0.005
    #: Votes that settle the direction, the most that are kept, and those of a driven corner.
    SETTLED, MOST, DRIVEN = 3.0, 12.0, 0.0
    #: Heading from the leg's direction with which no wall is taken up: the car goes round the wrong way, rad.
    AWRY: ClassVar[float] = 2.0
    #: Angle of the largest one that paths in free space leave, rad.
    SPARE: ClassVar[float] = float(np.deg2rad(1.0))
    #: Speeds, m/s: without a direction at the corner, and below which gains are those of this one.
    CREEP, SLOWEST = 1.2, 0.2

    def __init__(self, scenario: CircuitDrive, *, free_space: bool = True) -> None:
        super().__init__(scenario)
        car = scenario.vehicle
        self._car = WallCar(car.wheelbase, 0.5 * car.wheelbase, scenario.control_step)
        self._nose = 0.5 * car.wheelbase + 0.5 * car.length  # of the camera, ahead of the rear axle
        self._limit = scenario.max_steering_angle
        self._odometer = Odometer(scenario)
        self._filter = WallFilter(self._car, self._noise(scenario))
        wheel = dict(scenario.sensors).get("steering_angle", Sensor())
        self._wheel = max(self.WHEEL, float(np.hypot(wheel.noise, wheel.bias)))
        self._control = Cascade(self._car, self._limit, LARGEST_HEADING)
        self._reader = ScanReader(scenario.scan)
        body = Body(self._nose, 0.5 * (car.length - car.wheelbase), 0.5 * car.width)
        self._map = LocalMap(self._reader, self._nose, self._car.sensor)
        tightest = float(np.tan(self._limit - self.SPARE) / car.wheelbase)
        space = FreeSpace(body, tightest)
        free = FreeDrive(space, scenario.control_step, scenario.max_acceleration, scenario.max_speed)
        arc = None if free_space else FixedArc(scenario.control_step, tightest)
        self._pilot = CircuitPilot(free, self._reader, self._car, self._limit, arc)
        self._legs = LegOdometer(car.width)
        own = len(Leg._fields), len(Pilot._fields), len(Way._fields)
        sizes = (self._filter.memory, self._control.memory, *own, self._map.memory, self._odometer.memory)
        self._split = tuple(np.cumsum(sizes[:-1]))
        self.memory = sum(sizes)

    def _noise(self, scenario: CircuitDrive) -> WallNoise:
        """Return the filter's noise: what it has for granted, more for worse sensors, and a start along the wall."""
        nominal, sensors = WallNoise(), dict(scenario.sensors)
        side, yaw = (sensors.get(channel, Sensor()) for channel in ("distance_right", "yaw_rate"))
        return replace(
            nominal,
            side_distance=max(nominal.side_distance, side.noise),
            yaw_rate=max(nominal.yaw_rate, yaw.noise),
            start=(max(nominal.start[0], side.noise), self.START, nominal.start[2], max(nominal.start[3], yaw.bias)),
        )

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        filtered, steered, leg_, pilot_, way_, map_, before = np.split(memory, self._split, axis=1)
        speed, mean, now = self._odometer.update(at, before, fresh)
        at, way = {**at, "speed": speed}, mean * self._car.step
        blank = np.zeros_like(at["speed"])
        start = (blank + _UNKNOWN, at["distance_right"] + at["distance_left"], blank, blank)
        leg = Leg(*(np.where(fresh, new, old) for new, old in zip(start, leg_.T, strict=True)))
        pilot = Pilot(*np.where(fresh, 0.0, pilot_.T))
        ranges = self._reader.ranges(np.stack([at[channel] for channel in self._reader.channels]))
        turned = np.where(fresh, 0.0, (at["yaw_rate"] - filtered[:, 3]) * self._car.step)
        filled = self._reader.bridged(ranges)
        map_, glass = self._map.update(at, filled, map_, fresh, way, turned)
        lost = pilot.lost > 0.5
        known = self._locate(at, filtered, fresh, leg, way, lost)
        leg = leg._replace(corner=leg.corner - way * np.cos(known[:, 1]))
        measured = np.where(lost | (leg.phase != _WALL), np.nan, known[:, 1])
        sides = at["distance_right"], at["distance_left"]
        round_, left = self._legs.update(way_, fresh, way, turned, measured, *sides)
        leg = leg._replace(votes=leg.votes + left * self.DRIVEN)
        known, leg, pilot = self._take_up(at, known, leg, pilot._replace(heading=round_.heading))
        known, leg = self._change_over(known, leg)
        leg = self._look(at, ranges, glass, known, leg)
        command, steered, phase = self._drive(at, steered, fresh, known, leg)
        command, pilot, keep = self._pilot.steer(
            at,
            self._map.points(at, filled, map_, beside(pilot.heading)),
            filled,
            command,
            known,
            self._side(leg),
            np.minimum(self._map.unseen(at, ranges), glass),
            pilot,
        )
        leg = leg._replace(phase=np.where(keep, phase, leg.phase))
        steered = np.where(keep[:, None], steered, command[:, :1])
        parts = [known, steered, *(np.stack(own, axis=1) for own in (leg, pilot, round_)), map_, now]
        return command, np.concatenate(parts, axis=1)

    def _take_up(self, at: Mapping[str, Floats], known: Floats, leg: Leg, pilot: Pilot) -> tuple[Floats, Leg, Pilot]:
        """Take the wall up again where the car has been along two walls for a while."""
        right, left = at["distance_right"], at["distance_left"]
        sides = right + left
        along = (right > 0.0) & (left > 0.0) & (np.abs(sides - pilot.sides) < 0.08)
        along &= (np.abs(at["yaw_rate"] - known[:, 3]) < 0.2) & (at["speed"] > 0.2)
        calm = np.where(along, pilot.calm + 1.0, 0.0)
        over = (pilot.lost > 0.5) & (calm >= 6.0 * np.maximum(pilot.losses, 1.0))
        over &= (np.abs(pilot.heading) < self.AWRY) | (self._side(leg) == 0.0)
        states, covariance = known[:, :4].copy(), known[:, 4:].reshape(-1, 4, 4).copy()
        states[:, 0], states[:, 1] = right, 0.0
        covariance[:, :2, :] = covariance[:, :, :2] = 0.0
        covariance[:, 0, 0], covariance[:, 1, 1] = 0.05**2, self.START**2
        changed = np.concatenate([states, covariance.reshape(-1, 16)], axis=1)
        known = np.where(over[:, None], changed, known)
        leg = leg._replace(
            corner=np.where(over, _UNKNOWN, leg.corner),
            corridor=np.where(over, sides, leg.corridor),
            phase=np.where(over, _WALL, leg.phase),
        )
        return known, leg, pilot._replace(lost=np.where(over, 0.0, pilot.lost), calm=calm, sides=sides)

    def _locate(
        self,
        at: Mapping[str, Floats],
        memory: Floats,
        fresh: NDArray[np.bool_] | bool,
        leg: Leg,
        way: Floats,
        lost: NDArray[np.bool_],
    ) -> Floats:
        """Return the filter's next memory, with the right wall's distance where that is the leg's wall.

        It is, if it is about the expected one or both sides add up to the corridor, up to the inner wall's end: where
        that is or may be the right one's, the cone would show its corner.
        """
        right, left, heading = at["distance_right"], at["distance_left"], memory[:, 1]
        same = np.abs(right - memory[:, 0] - way * np.sin(heading)) < self.SAME
        same |= (left > 0.0) & (np.abs(right + left - leg.corridor) < 0.5 * self.SAME)
        passed = (self._side(leg) <= 0.0) & (leg.corner - way < self._car.sensor)
        shown = (right > 0.0) & same & (leg.phase != _ENTERS) & ~passed & ~lost
        distance = np.where(shown | fresh, right, 0.0)  # 0 corrects nothing
        known = self._filter.update(
            memory, fresh, way / self._car.step, at["steering_command"], distance, at["yaw_rate"]
        )
        if "steering_angle" not in at:
            return known
        return self._filter.correct_offset(known, at["steering_angle"] - at["steering_command"], self._wheel)

    def _side(self, leg: Leg) -> Floats:
        """Return 1 where corners go to the left, -1 to the right, 0 where that is not known."""
        return np.where(np.abs(leg.votes) >= self.SETTLED, np.sign(leg.votes), 0.0)

    def _change_over(self, known: Floats, leg: Leg) -> tuple[Floats, Leg]:
        """Count from the next leg's right wall where half of a corner is driven."""
        side, heading = self._side(leg), known[:, 1]
        over = (leg.phase == _ENTERS) & (side * heading >= 0.5 * _RIGHT_ANGLE)
        to_corner = leg.corner - self._car.sensor * np.cos(heading)
        distance = np.where(side < 0.0, -to_corner, to_corner + leg.corridor)
        states, covariance = known[:, :4].copy(), known[:, 4:].reshape(-1, 4, 4).copy()
        states[:, 0], states[:, 1] = distance, heading - side * _RIGHT_ANGLE
        covariance[:, 0, :] = covariance[:, :, 0] = 0.0
        covariance[:, 0, 0] = 0.05**2
        changed = np.concatenate([states, covariance.reshape(-1, 16)], axis=1)
        known = np.where(over[:, None], changed, known)
        corner, phase = np.where(over, _UNKNOWN, leg.corner), np.where(over, _LEAVES, leg.phase)
        return known, leg._replace(corner=corner, phase=phase)

    def _look(self, at: Mapping[str, Floats], ranges: Floats, glass: Floats, known: Floats, leg: Leg) -> Leg:
        """Measure corridor and corner, and vote for the direction, where the car is along a wall."""
        along, distance, heading = leg.phase == _WALL, known[:, 0], known[:, 1]
        right, left, corridor = at["distance_right"], at["distance_left"], leg.corridor
        straight = along & (np.abs(heading) < HALF_CONE) & (right > 0.0) & (left > 0.0)
        straight &= leg.corner > self._car.sensor
        wider = np.where(straight, right + left - corridor, 0.0)
        corridor = corridor + np.where(np.abs(wider) < self.SAME, 0.2, 0.0) * wider
        at_nose = distance + (self._nose - self._car.sensor) * np.sin(heading)
        ahead = self._nose * np.cos(heading)
        wall = np.minimum(self._reader.ahead(ranges, heading), glass * np.cos(heading))
        front = wall - corridor
        ends = (
            self._reader.wall_end(ranges, heading, at_nose, -1.0).about(front, self.AGREE),
            self._reader.wall_end(ranges, heading, corridor - at_nose, 1.0).about(front, self.AGREE),
        )
        vote = 1.0 * ends[1].seen - 1.0 * ends[0].seen
        vote = np.where(known[:, 9] < self.SURE**2, vote, 0.0)  # the heading's variance
        # Nothing seen until the inner wall ends beside the car: its ultrasonic looks into the next leg.
        late = (self._side(leg) == 0.0) & (leg.corner < self._car.sensor) & (vote == 0.0)
        to_left, to_right = left > corridor - distance + self.SAME, right > distance + self.SAME
        vote = np.where(late, 1.0 * to_left - 1.0 * to_right, vote)
        most = np.maximum(self.MOST, np.abs(leg.votes))
        votes = np.clip(leg.votes + np.where(along, vote, 0.0), -most, most)
        side = self._side(leg._replace(votes=votes))
        end = WallEnd(*(np.where(side > 0.0, b, a) for a, b in zip(*ends, strict=True)))
        place = np.where(end.seen & (side != 0.0), np.clip(front, end.near, end.far), front) + ahead
        found = along & np.isfinite(place)
        if "scan_new" in at:
            found &= at["scan_new"] > 0.5
        share = np.where(leg.corner > 0.5 * _UNKNOWN, 1.0, 0.5)
        corner = np.where(found, leg.corner + share * (np.where(found, place, 0.0) - leg.corner), leg.corner)
        return leg._replace(corner=corner, corridor=corridor, votes=votes)

    def _drive(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool, known: Floats, leg: Leg
    ) -> tuple[Floats, Floats, Floats]:
        """Return steering and speed, (n, 2), the cascade's next memory and the next phase: arc or cascade."""
        distance, heading, offset, bias = known[:, 0], known[:, 1], known[:, 2], known[:, 3]
        speed, side, corridor = at["speed"], self._side(leg), leg.corridor
        inner = self.NEAR + (self.WIDE - self.NEAR) * np.clip(corridor - 2.0, 0.0, 1.0)
        inner = np.minimum(inner, 0.5 * corridor)
        wanted = np.where(side == 0.0, 0.5 * corridor, np.where(side < 0.0, inner, corridor - inner))
        # Angle still to turn, and way across to the next leg's lane: their arc.
        rear = distance - self._car.sensor * np.sin(heading)
        leaves = leg.phase == _LEAVES
        turn = np.where(leaves, 0.0, _RIGHT_ANGLE) - side * heading
        across = np.where(leaves, side * (rear - wanted), leg.corner + inner)
        needs = 1.0 - np.cos(turn)
        tightest = np.tan(self._limit) / self._car.wheelbase
        curvature = np.clip(needs / np.maximum(across, 1e-3), 0.5 / self.RADIUS, tightest)
        half_step = 0.5 * speed * self._car.step * np.cos(heading)
        begins = (leg.phase == _WALL) & (side != 0.0) & (across - half_step <= self.RADIUS * needs)
        ends = leaves & (turn <= self.END)
        phase = np.where(begins, _ENTERS, np.where(ends, _WALL, leg.phase))
        arc = phase != _WALL
        # The cascade goes on from straight wheels where an arc ends.
        last = np.where(ends[:, None], -offset[:, None], memory)
        turned = np.where(ends, 0.0, (at["yaw_rate"] - bias) * self._car.step)
        measured = Measured(np.maximum(speed, self.SLOWEST), distance, heading, turned)
        steering, following = self._control.command(measured, wanted, last, fresh)
        steering = np.where(arc, np.arctan(self._car.wheelbase * side * curvature) - offset, steering)
        slow = np.sqrt(self.LATERAL * self.RADIUS)
        near = np.where(side == 0.0, self.CREEP, slow)
        way = np.where(side == 0.0, leg.corner, across - self.RADIUS)
        target = np.where(arc, slow, np.sqrt(near**2 + 2.0 * self.BRAKE * np.maximum(way, 0.0)))
        target = np.minimum(target, self._fastest)
        return np.stack([steering, target], axis=1), following, phase
