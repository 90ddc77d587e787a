"""Team KnightRiders 2017: a circuit among obstacles as the report has it (second task, chapter 4), for comparison.

Without a plan the competition's PD follows the wall on the right, and at each tick of the main timer (0.1 s, here two
control steps) the scan tells what is in the detection box:
- a wall at an angle: one arc, after which the car is along it (4.3.2);
- an obstacle: its nearest jump point with free space, a target 0.2 m to the side, an S-curve to it, else arc and
  straight, else a short way back; without a jump point an arc of 25 degrees to the freer side (4.3.1);
- nothing: a corner to the right is looked for, to which a straight and an arc of 90 degrees lead (4.3.3).
A plan's segments, a way by the encoder with the wheels straight or at their limit, are driven one after another. Only
the area straight ahead is watched meanwhile: a hit discards them all, and after a short way back the car looks anew
(4.4).

Decisions, where the text is silent: the attributes of the class, and that a segment ends where less than half a step is
left of it. A wall nearly across has no side to which the arc is the smaller one: the car turns to the left as long as
the wall that it follows is there, to the right where that has ended. Places in the scan count from the nose, ways are
the rear axle's: a corner is reached, and a jump point passed, when the rear axle is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.path_planning import evade, from_rear_axle
from lanekeep_baselines.policy import DrivingPolicy, DrivingScenario, Floats
from lanekeep_baselines.scan_classes import OBSTACLE, PUBLISHED, WALL, classify
from lanekeep_baselines.scan_corners import right_corner
from lanekeep_baselines.scan_targets import ASIDE, jump_point
from lanekeep_baselines.wall_control import Measured, Pd
from lanekeep_baselines.wall_design import WallCar, pd_design
from lanekeep_env.scenario import Scan

_DEGREE = float(np.pi / 180.0)
#: The fixed arc's angle where no jump point is usable, and the corner's, rad (the report's).
FIXED, CORNER = 25.0 * _DEGREE, 0.5 * np.pi
#: A plan's segments at most.
SEGMENTS = 3


class ScanDrive(DrivingScenario, Protocol):
    """What the controller may know; `lanekeep_env.ObstacleCircuitScenario` is one."""

    @property
    def scan(self) -> Scan: ...


class Route(NamedTuple):
    """What is remembered: (n,) each, the last two (n, `SEGMENTS`).

    Attributes:
        speed: last measured, m/s.
        tick: of the main timer: 0 where it is due.
        distance: last heard of the right wall, m.
        error: of the PD's last step, m.
        ways: left of the plan's segments, m, negative backwards; the first 0 without a plan.
        bends: their steering over its limit, -1, 0 or 1, + left.
    """

    speed: Floats
    tick: Floats
    distance: Floats
    error: Floats
    ways: Floats
    bends: Floats

    @classmethod
    def split(cls, memory: Floats) -> Route:
        """Return the route of a memory (n, columns)."""
        speed, tick, distance, error = memory.T[:4]
        return cls(speed, tick, distance, error, memory[:, 4 : 4 + SEGMENTS], memory[:, 4 + SEGMENTS :])

    def joined(self) -> Floats:
        """Return the memory, (n, columns)."""
        return np.concatenate([np.stack(self[:4], axis=1), self.ways, self.bends], axis=1)


def inner(camera: Scan) -> Scan:
    """Return the camera without the rims that never show anything; all of it where nothing would be left."""
    beams = camera.beams - 2 * camera.missing_rim
    if beams < 2:
        return replace(camera, missing_rim=0)
    return replace(camera, beams=beams, field_of_view=(beams - 1) * camera.step, missing_rim=0)


class KnightRidersObstaclesPublished(DrivingPolicy):
    """`knightriders-obstacles-published`: the report's obstacle avoidance, by its own formulas."""

    name = "knightriders-obstacles-published"
    reads = ("distance_right", "speed", "mode", "scan_0")
    uses = ("scan_*",)
    memory = 4 + 2 * SEGMENTS

    #: Distance of the side sensor from the right wall that is followed, m.
    WANTED: ClassVar[float] = 0.6
    #: Speeds among obstacles, m/s: along the wall and on straights, in arcs, back; without obstacles so much faster.
    STRAIGHT, ARC, BACK, FASTER = 0.8, 0.5, 0.3, 1.5
    #: How far the car goes back, m: where there is no path, and after a hit.
    REVERSE, RETREAT = 0.3, 0.3
    #: The area that is watched while a plan is driven, ahead of the nose and to either side, m: the camera sees nothing
    #: nearer than 0.5 m, the body is 0.1325 m to either side.
    WATCHED, BESIDE = 0.55, 0.14
    #: A wall steeper than this is one across, rad; without an echo nearer than that the followed wall has ended, m.
    ACROSS, ENDED = 60.0 * _DEGREE, 1.5
    #: Control steps from tick to tick of the main timer.
    TICKS: ClassVar[int] = 2

    def __init__(self, scenario: ScanDrive) -> None:
        super().__init__(scenario)
        car = scenario.vehicle
        self._wheelbase, self._overhang = car.wheelbase, 0.5 * (car.length - car.wheelbase)
        self._limit = min(scenario.max_steering_angle, car.steering.angle_limit or np.inf)
        self._radius = car.wheelbase / np.tan(self._limit)
        self._camera, self._step = inner(scenario.scan), scenario.control_step
        self._beams = [f"scan_{k + scenario.scan.missing_rim}" for k in range(self._camera.beams)]
        wall = WallCar(car.wheelbase, 0.5 * car.wheelbase, self._step)
        self._control = Pd(wall, self._limit / _DEGREE, pd_design(self._step))

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        new = np.broadcast_to(np.reshape(fresh, -1), at["speed"].shape)
        last = Route.split(np.where(new[:, None], 0.0, memory))
        heard = at["distance_right"] > 0.0
        distance = np.where(heard, at["distance_right"], np.where(new, self.WANTED, last.distance))
        now = self._driven(last, at["speed"])._replace(distance=distance)
        due = np.flatnonzero(now.tick == 0.0)
        if len(due):
            ways, bends = now.ways.copy(), now.bends.copy()
            scan = np.stack([at[beam][due] for beam in self._beams], axis=1)
            ways[due], bends[due] = self._tick(scan, now.distance[due], at["mode"][due], ways[due], bends[due])
            now = now._replace(ways=ways, bends=bends)
        steering, speed, error = self._follow(at, now, new)
        tick = np.mod(now.tick + 1.0, self.TICKS)
        return np.stack([steering, speed], axis=1), now._replace(tick=tick, error=error).joined()

    def _driven(self, last: Route, speed: Floats) -> Route:
        """Return what is left of the plan after the step that ended (4.4)."""
        way = 0.5 * (last.speed + speed) * self._step
        forwards = np.sign(last.ways[:, 0])
        left = forwards * (last.ways[:, 0] - way)
        done = ((forwards == 0.0) | (left <= 0.5 * np.abs(speed) * self._step))[:, None]
        further = [np.concatenate([part[:, 1:], np.zeros_like(part[:, :1])], axis=1) for part in last[4:]]
        on = last.ways.copy()
        on[:, 0] = forwards * left
        ways, bends = np.where(done, further[0], on), np.where(done, further[1], last.bends)
        return last._replace(speed=speed, ways=ways, bends=bends)

    def _tick(self, scan: Floats, distance: Floats, mode: Floats, ways: Floats, bends: Floats) -> tuple[Floats, Floats]:
        """Return the plans, (n, `SEGMENTS`) ways and bends, after a tick of the main timer (Figures 4.3 and 4.5)."""
        place = PUBLISHED.points(scan, self._camera)
        drives = ways[:, 0] != 0.0
        near = (place[..., 0] <= self.WATCHED) & (np.abs(place[..., 1]) <= self.BESIDE)
        retreats = (ways[:, 0] > 0.0) & near.any(axis=1)
        found, turns = self._plan(place, distance, mode)
        back = np.zeros_like(ways)
        back[:, 0] = -self.RETREAT
        ways = np.where(retreats[:, None], back, np.where(drives[:, None], ways, found))
        return ways, np.where(retreats[:, None], 0.0, np.where(drives[:, None], bends, turns))

    def _plan(self, place: Floats, distance: Floats, mode: Floats) -> tuple[Floats, Floats]:
        """Return ways and bends of what the points (n, beams, 2) ask for, (n, `SEGMENTS`) each (4.3)."""
        seen = classify(place, self._camera, PUBLISHED)
        kind = np.where(mode > 0.5, seen.kind, np.where(seen.kind == OBSTACLE, 0, seen.kind))
        blank = np.zeros_like(distance)
        # A wall: one arc, to be along it.
        follows = np.where(distance < self.ENDED, 1.0, -1.0)
        turn = np.where(np.abs(seen.angle) > self.ACROSS, follows * np.mod(follows * seen.angle, np.pi), seen.angle)
        wall = np.stack([self._radius * np.abs(turn), blank, blank], axis=1)
        # An obstacle.
        jump = jump_point(place, self._camera, PUBLISHED)
        ahead, left = jump.target(ASIDE)
        ahead = from_rear_axle(ahead, self._wheelbase, self._overhang)
        path = evade(ahead, left, self._radius, self._radius, self.REVERSE)
        arc = np.stack([blank + self._radius * FIXED, blank, blank], axis=1)
        passes = jump.found[:, None]
        evades = np.where(passes, path[..., 0], arc)
        # Nothing: straight on to a corner and round it.
        corner = right_corner(place, self._camera, PUBLISHED)
        straight = from_rear_axle(corner.ahead, self._wheelbase, self._overhang)
        rounds = np.where(
            corner.found[:, None], np.stack([straight, blank + self._radius * CORNER, blank], axis=1), 0.0
        )
        first = np.array([1.0, 0.0, 0.0])
        is_wall, is_obstacle = (kind == WALL)[:, None], (kind == OBSTACLE)[:, None]
        sides = np.where(passes, np.sign(path[..., 1]), jump.side[:, None] * first)
        bends = np.where(is_obstacle, sides, np.array([0.0, -1.0, 0.0]))
        bends = np.where(is_wall, np.sign(turn)[:, None] * first, bends)
        ways = np.where(is_wall, wall, np.where(is_obstacle, evades, rounds))
        return self._without_gaps(ways, bends)

    def _without_gaps(self, ways: Floats, bends: Floats) -> tuple[Floats, Floats]:
        """Move segments that have a way to the front: a first way of 0 is no plan."""
        order = np.argsort(ways == 0.0, axis=1, kind="stable")
        ways = np.take_along_axis(ways, order, axis=1)
        return ways, np.where(ways == 0.0, 0.0, np.take_along_axis(bends, order, axis=1))

    def _follow(self, at: Mapping[str, Floats], now: Route, fresh: NDArray[np.bool_]) -> tuple[Floats, Floats, Floats]:
        """Return steering, rad, and speed, m/s, of the plan or along the wall, and the PD's error, m."""
        drives, bend = now.ways[:, 0] != 0.0, now.bends[:, 0]
        wanted = np.full_like(now.distance, self.WANTED)
        # The PD is off while a plan is driven; then it begins with the error that it finds.
        starts = fresh | drives
        blank = 0.0 * wanted
        measured = Measured(now.speed, now.distance, blank, blank)
        steering, error = self._control.command(measured, wanted, now.error[:, None], starts)
        steering = np.where(drives, bend * self._limit, steering * _DEGREE)
        speed = np.where(drives & (bend != 0.0), self.ARC, self.STRAIGHT)
        speed = np.where(at["mode"] > 0.5, speed, self.FASTER * speed)
        speed = np.where(drives & (now.ways[:, 0] < 0.0), -self.BACK, speed)
        return steering, np.minimum(speed, self._fastest), error[:, 0]
