"""Driving by free space: letting a command pass while the car can still stop after it, and finding a way itself.

The guard looks at where the car is after the next step: if one of the paths from there is free for as long as stopping
takes, the command is harmless. Else, or where nobody knows the way, the car takes the path that is free farthest and
near to what is wanted, as fast as it can stop on it; where none leads on it backs up a little and turns meanwhile.

Everything is elementwise over the rows.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.free_space import STRIDE, FreeSpace, poses
from lanekeep_baselines.leg_odometry import wrapped
from lanekeep_baselines.policy import Floats


class Motion(NamedTuple):
    """How the car moves, (n,) each: speed, m/s, curvature that it drives, 1/m, and the least and most it could."""

    speed: Floats
    curvature: Floats
    least: Floats
    most: Floats


class Choice(NamedTuple):
    """What to do, (n,) each: curvature, 1/m, speed, m/s, way still to go backwards, m, and which of the paths."""

    curvature: Floats
    speed: Floats
    back: Floats
    free: Floats


class Wish(NamedTuple):
    """Where the car is to go, (n,) each.

    Attributes:
        curvature: preferred among equals, 1/m.
        side: 1 where the way is known to turn left, -1 right, else 0.
        heading: of the car from the leg's direction, rad; counts where the side is known.
        lost: whether the way is looked for; else a command is replaced.
    """

    curvature: Floats
    side: Floats
    heading: Floats
    lost: NDArray[np.bool_]


class Sight(NamedTuple):
    """What is known of the way ahead besides the points.

    Attributes:
        heard: way of the nose to what may be ahead unseen, m, inf for nothing, (n,).
        along: how far the way along each path is seen, m, (n, paths), as of `FreeDrive.bearing`.
    """

    heard: Floats
    along: Floats


class Pilot(NamedTuple):
    """What is remembered of who drives, (n,) each.

    Attributes:
        doubt: rises while the guard intervenes, falls else.
        lost: 1 where the way is looked for in free space, else 0.
        losses: how often that began.
        calm: steps for which the car has been along two walls.
        back: way still to go backwards, m.
        curvature: last asked for, 1/m.
        sides: last sum of the side distances, m.
        heading: of the car from the leg's direction, rad.
    """

    doubt: Floats
    lost: Floats
    losses: Floats
    calm: Floats
    back: Floats
    curvature: Floats
    sides: Floats
    heading: Floats


class FreeDrive:
    """Guard and pathfinder of a car on a `FreeSpace`."""

    #: So many paths must be free for the guard: a single one is gone with the next error of a centimetre.
    SEVERAL: ClassVar[int] = 4
    #: Deceleration that speeds are planned with, and share of the largest one that the guard counts on, m/s².
    BRAKE, COUNTED = 1.5, 0.85
    #: Way left at standstill, m; below the second nothing leads on, and the way backwards then, m.
    RESERVE, STUCK, BACK = 0.12, 0.25, 0.5
    #: What is heard, but not seen, nearer than this is all but touched, m.
    TOUCHING: ClassVar[float] = 0.08
    #: Way beyond that of stopping which the guard asks for, m: usually, and after it has intervened.
    AHEAD, AFTER = 0.2, 0.5
    #: Speed backwards and at least, m/s.
    BACKWARD, LEAST = 0.5, 0.25
    #: What a path's value loses for another curvature than the wanted one, m per 1/m: where the way is looked for, and
    #: where a command is replaced.
    APART, NEARBY = 0.15, 0.5
    #: What it gains with the view along it, m per m, up to so far, m; the place of a path that is looked at, m.
    VIEW, FARTHEST_VIEW, AT = 0.25, 6.0, 1.4
    #: From this angle to the leg on, at that place, a path leads back, rad, and what it loses beyond, m per rad.
    BACKWARDS, LOSES = 1.75, 3.0

    def __init__(self, space: FreeSpace, step: float, acceleration: float, fastest: float) -> None:
        self._space, self._step, self._acceleration, self._fastest = space, step, acceleration, fastest
        paths = space.paths
        self._ahead = paths.sign > 0.0
        x, y, heading = poses(paths)
        place = round(self.AT / STRIDE)
        self._bearing, self._turned = np.arctan2(y[place], x[place] + 1e-9), heading[place]

    @property
    def bearing(self) -> Floats:
        """Direction from the car in which each path leads, rad, (paths,)."""
        return self._bearing

    def after(self, x: Floats, y: Floats, motion: Motion, curvature: Floats, target: Floats) -> tuple[Floats, ...]:
        """Return points and speed after the next step with a command: x, y, (points, n), and m/s, (n,)."""
        change = self._acceleration * self._step
        speed = motion.speed + np.clip(target - motion.speed, -change, change)
        way = 0.5 * (motion.speed + speed) * self._step
        turned = way * curvature
        cosine, sine = np.cos(turned), np.sin(turned)
        x, y = x - way * np.cos(0.5 * turned), y - way * np.sin(0.5 * turned)
        return cosine * x + sine * y, cosine * y - sine * x, speed

    def harmless(
        self, x: Floats, y: Floats, motion: Motion, curvature: Floats, target: Floats, doubt: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Return whether the car can still stop after a step with this curvature, 1/m, and set speed, m/s, (n,)."""
        x, y, speed = self.after(x, y, motion, curvature, target)
        strict = self._space.free(x, y)[0]
        can = self._possible(motion) & self._ahead
        free = np.sort(np.where(can, strict, 0.0), axis=1)[:, -self.SEVERAL]
        return free >= self._stopping(speed) + np.where(doubt, self.AFTER, self.AHEAD)

    def _stopping(self, speed: Floats) -> Floats:
        """Return the way to a standstill, m."""
        return np.where(speed > 0.0, speed * speed / (2.0 * self.COUNTED * self._acceleration), 0.0) + self.RESERVE

    def before(self, heard: Floats) -> Floats:
        """Return the speed, m/s, (n,), from which the car stops before what is heard so far ahead, m."""
        return np.sqrt(2.0 * self.BRAKE * np.maximum(heard - self.TOUCHING, 0.0))

    def choose(self, x: Floats, y: Floats, motion: Motion, wish: Wish, sight: Sight, back: Floats) -> Choice:
        """Return the best path's command.

        Args:
            x, y: points, m, (points, n).
            motion: of the car.
            wish: where it is to go.
            sight: what is known of the way ahead.
            back: way that is still to go backwards, m, (n,).
        """
        strict, hard, soft, least = self._space.free(x, y)
        close = np.where(self._ahead, hard, 0.0).max(axis=1) < self.STUCK
        hard = np.where(close[:, None], least, hard)
        can = self._possible(motion)
        value = self._value(strict, hard, soft, motion, wish, sight)
        rows = np.arange(len(wish.curvature))
        best = np.where(can & self._ahead, value, -np.inf).argmax(axis=1)
        # Before what it does not see the car can always stop.
        free = np.minimum(hard[rows, best], sight.heard + self.STUCK - self.TOUCHING)
        freer = self._freer_side(soft)
        stuck = (free < self.STUCK) & (np.abs(motion.speed) < 0.1)
        first = self._space.paths.first
        gap = hard - 0.3 * np.abs(first + freer[:, None]) - self._leads_back(wish)
        behind = np.where(can & ~self._ahead, gap, -np.inf).argmax(axis=1)
        room = hard[rows, behind]
        back = np.where(stuck & (back <= 0.0), self.BACK, back)
        back = np.where(room < 0.1, 0.0, back)
        reverse = back > 0.0
        several = np.sort(np.where(can & self._ahead, strict, 0.0), axis=1)[:, -self.SEVERAL]
        sure = np.maximum(np.minimum(strict[rows, best], several), np.minimum(free, 0.2))
        sure = np.minimum(sure, sight.heard + self.RESERVE - self.TOUCHING)
        fast = np.sqrt(2.0 * self.BRAKE * np.maximum(sure - self.RESERVE, 0.0))
        fast = np.where(free > self.STUCK, np.maximum(fast, self.LEAST), 0.0)
        speed = np.where(
            reverse, -np.minimum(self.BACKWARD, np.sqrt(2.0 * room * 0.5)), np.minimum(fast, self._fastest)
        )
        return Choice(np.where(reverse, first[behind], first[best]), speed, back, free)

    def _leads_back(self, wish: Wish) -> Floats:
        """Return what paths lose that lead back, m, (n, paths)."""
        known = wish.side[:, None] != 0.0
        ends = np.where(known, np.abs(wrapped(wish.heading[:, None] + self._turned)), 0.0)
        return self.LOSES * np.maximum(ends - self.BACKWARDS, 0.0)

    def _value(self, strict: Floats, hard: Floats, soft: Floats, motion: Motion, wish: Wish, sight: Sight) -> Floats:
        """Return what each path is worth, (n, paths): first whether the car can stop on it, then how it leads on."""
        paths, searching = self._space.paths, wish.lost[:, None]
        apart = np.where(searching, self.APART, self.NEARBY) * np.abs(paths.first - wish.curvature[:, None])
        apart += self._leads_back(wish)
        value = (
            soft
            + 0.3 * hard
            - apart
            + np.where(searching, self.VIEW, 0.0) * np.minimum(sight.along, self.FARTHEST_VIEW)
            + 0.1 * wish.side[:, None] * paths.turn
        )
        needed = (self._stopping(motion.speed) + np.maximum(motion.speed, 0.0) * self._step)[:, None]
        return np.where(strict >= needed, 20.0 + value, np.where(hard >= needed, 10.0 + value, hard - apart))

    def _possible(self, motion: Motion) -> NDArray[np.bool_]:
        """Return which paths begin with a curvature that the car can drive, (n, paths)."""
        first = self._space.paths.first
        return (first >= motion.least[:, None] - 0.06) & (first <= motion.most[:, None] + 0.06)

    def _freer_side(self, soft: Floats) -> Floats:
        """Return 1 where the paths to the left are free farther, else -1."""
        first = self._space.paths.first
        left = np.where(self._ahead & (first > 0.0), soft, 0.0).sum(axis=1)
        right = np.where(self._ahead & (first < 0.0), soft, 0.0).sum(axis=1)
        return np.where(left >= right, 1.0, -1.0)
