"""What a car between walls has seen around it lately, as points that its own motion carries along.

The camera sees ahead only, and no glass; the ultrasonics see glass, and only how far it is. So the nearest points of
the scan's sectors and the echoes are kept for the last `KEPT` places of the car, `SPACING` apart or more, and an echo
takes back the points that it shows to be none.

Points are in the frame of the car: from the rear axle, x ahead and y to the left, m.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.free_space import NOWHERE
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_features import ScanReader
from lanekeep_env.sensing.ultrasonic import FARTHEST, HALF_CONE, TANGENT


class LocalMap:
    """Points of the last places of a car; its memory is rows of numbers, elementwise over the rows."""

    #: Places kept, sectors of the scan and echoes that each has.
    KEPT, SECTORS, ECHOES = 32, 12, 5
    #: Way, m, or turn, rad, to the next place.
    SPACING, TURNING = 0.05, 0.07
    #: Points of the scan beyond this are not kept, m.
    FARTHEST_KEPT: ClassVar[float] = 2.5
    #: An echo takes points back that are this much nearer, m, in this share of its cone.
    NEARER, INNER = 0.12, 0.9
    #: An echo ahead is of something that the scan shows if that is not this much farther, m, and of a side wall if it
    #: is not below this share of that one's expected echo.
    SHOWN, SIDE_SHARE = 0.35, 0.75
    #: A kept point so far beside the cone is of something that reaches into it, m.
    BESIDE: ClassVar[float] = 0.15
    #: Share of the cone's beams that show nothing from which on there may be glass.
    OPEN: ClassVar[float] = 0.15
    #: Directions in which it is put, rad; places ahead of the side sensor to which a side wall goes on where the rim of
    #: the scan shows nothing, m.
    ACROSS, GOES_ON = (-0.3, 0.0, 0.3), (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)

    #: Places of a side's wall beyond its echo, and how far off its line the rim still shows the same wall, m.
    UNSEEN, SAME_WALL = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9), 0.12
    #: Angle that is the rim, rad.
    RIM: ClassVar[float] = 0.1

    def __init__(self, reader: ScanReader, nose: float, side_sensor: float) -> None:
        self._reader, self._nose, self._side = reader, nose, side_sensor
        # Nearer than the camera sees at all an echo is no sign of glass.
        self._blind = reader.nearest
        self._rim = int(np.count_nonzero(reader.angles <= reader.angles[0] + self.RIM))
        rim = float(reader.angles[-1, 0])
        self._rim_cosine, self._rim_sine = np.cos(rim), np.sin(rim)
        self._per_place = self.SECTORS + self.ECHOES
        self._points = self.KEPT * self._per_place
        self.memory = 2 * self._points + 2

    def update(
        self,
        at: Mapping[str, Floats],
        ranges: Floats,
        memory: Floats,
        fresh: NDArray[np.bool_] | bool,
        way: Floats,
        turned: Floats,
    ) -> tuple[Floats, Floats]:
        """Return the next memory, (n, memory), and how far what only the ultrasonic sees is ahead, m, (n,): glass.

        Args:
            at: the channels, of which the ultrasonics are read.
            ranges: of the scan, inf where nothing is known, m, (beams, n).
            memory: (n, memory); meaningless in rows that are fresh.
            fresh: rows that start.
            way, turned: of the rear axle in the step that ended, m, and of the heading, rad, (n,).
        """
        n = len(way)
        points = memory[:, :-2].T.reshape(2, self.KEPT, self._per_place, n)
        since, angle = memory[:, -2] + np.abs(way), memory[:, -1] + np.abs(turned)
        x, y = points[0] - way * np.cos(0.5 * turned), points[1] - way * np.sin(0.5 * turned)
        cosine, sine = np.cos(turned), np.sin(turned)
        x, y = cosine * x + sine * y, cosine * y - sine * x
        x, y = np.where(fresh, NOWHERE, x), np.where(fresh, NOWHERE, y)
        new = (since >= self.SPACING) | (angle >= self.TURNING) | fresh
        gone = self._taken_back(at, x, y)
        x, y = np.where(gone, NOWHERE, x), np.where(gone, NOWHERE, y)
        front = self._front(at, ranges, x[:, : self.SECTORS], y[:, : self.SECTORS])
        seen = self._seen(at, ranges, front)
        kept = []
        for old, now in zip((x, y), seen, strict=True):
            moved = np.where(new, np.concatenate([old[:1], old[:-1]]), old)
            kept.append(np.concatenate([now[None], moved[1:]]).reshape(self._points, n))
        rest = np.stack([np.where(new, 0.0, since), np.where(new, 0.0, angle)])
        return np.concatenate([*kept, rest]).T, front

    def points(
        self, at: Mapping[str, Floats], ranges: Floats, memory: Floats, heading: Floats
    ) -> tuple[Floats, Floats]:
        """Return all points, x and y, m, (points, n): of the present step (as given to `update`) and kept ones.

        Args:
            heading: from the side walls' direction, rad, (n,).
        """
        x, y = memory[:, :-2].T.reshape(2, self._points, -1)
        known = np.isfinite(ranges)
        far = np.where(known, ranges, NOWHERE)
        ahead, left = self._nose + far * np.cos(self._reader.angles), far * np.sin(self._reader.angles)
        along, across = [x, ahead], [y, left]
        for side, sign, beams in (("right", -1.0, slice(self._rim)), ("left", 1.0, slice(-self._rim, None))):
            echo, rim = at[f"distance_{side}"], known[beams]
            goes_on = (echo > 0.0) & ~rim.any(axis=0)
            further = np.array(self.GOES_ON)[:, None]
            # What is heard may as well be a corner that comes into the cone ahead.
            along.append(np.where(echo > 0.0, self._side + echo * np.sin(HALF_CONE), NOWHERE)[None])
            across.append(sign * echo[None] * np.cos(HALF_CONE))
            along.append(np.where(goes_on, self._side + further, NOWHERE))
            across.append(np.where(goes_on, sign * echo + 0.0 * further, NOWHERE))
            x_, y_ = self._unseen_wall(echo, sign * heading, ahead[beams], sign * left[beams], rim)
            along.append(x_)
            across.append(sign * y_)
        return np.concatenate(along), np.concatenate(across)

    def _unseen_wall(
        self, echo: Floats, heading: Floats, ahead: Floats, left: Floats, known: NDArray[np.bool_]
    ) -> tuple[Floats, Floats]:
        """Return points of a left wall between its echo and the camera's rim, where nothing is seen, m, (points, n).

        The wall goes on there if all that the rim shows (``ahead`` and ``left``, where ``known``) is on its line.
        """
        foot = np.clip(heading, -HALF_CONE, HALF_CONE)
        x, y = self._side + echo * np.sin(foot), echo * np.cos(foot)
        cosine, sine = np.cos(heading), np.sin(heading)
        off = sine * (ahead - x) + cosine * (left - y)
        same = known.any(axis=0) & ((np.abs(off) < self.SAME_WALL) | ~known).all(axis=0)
        onwards = np.array(self.UNSEEN)[:, None]
        x, y = x + onwards * cosine, y - onwards * sine
        goes_on = (echo > 0.0) & same & (y * self._rim_cosine > (x - self._nose) * self._rim_sine)
        return np.where(goes_on, x, NOWHERE), np.where(goes_on, y, NOWHERE)

    def unseen(self, at: Mapping[str, Floats], ranges: Floats) -> Floats:
        """Return how far off the ultrasonic hears what may be glass ahead, m, (n,), inf where that is nothing.

        It may be where the raw scan, inf for nothing, shows nothing in a part of the sensor's cone, whatever else is
        in it at that distance.
        """
        if "distance_front" not in at:
            return np.full(ranges.shape[1], np.inf)
        echo, cone = at["distance_front"], np.abs(self._reader.angles[:, 0]) <= HALF_CONE
        open_ = np.isinf(ranges[cone]).mean(axis=0) >= self.OPEN
        return np.where(open_ & (echo > self._blind) & (echo > 0.0), echo, np.inf)

    def _seen(self, at: Mapping[str, Floats], ranges: Floats, front: Floats) -> tuple[Floats, Floats]:
        """Return the points of this place, x and y, m, (sectors + echoes, n)."""
        x, y = [], []
        for sector, angles in zip(
            np.array_split(ranges, self.SECTORS), np.array_split(self._reader.angles, self.SECTORS), strict=True
        ):
            nearest = sector.argmin(axis=0)
            reach = np.take_along_axis(sector, nearest[None], axis=0)[0]
            near = reach <= self.FARTHEST_KEPT
            angle = angles[nearest, 0]
            x.append(np.where(near, self._nose + np.where(near, reach, 0.0) * np.cos(angle), NOWHERE))
            y.append(np.where(near, np.where(near, reach, 0.0) * np.sin(angle), NOWHERE))
        for channel, side in (("distance_right", -1.0), ("distance_left", 1.0)):
            echo = at[channel]
            heard = (echo > 0.0) & (echo < self.FARTHEST_KEPT)
            x.append(np.where(heard, self._side, NOWHERE))
            y.append(np.where(heard, side * echo, NOWHERE))
        seen = np.isfinite(front)
        for angle in self.ACROSS:
            x.append(np.where(seen, self._nose + np.where(seen, front, 0.0) * np.cos(angle), NOWHERE))
            y.append(np.where(seen, np.where(seen, front, 0.0) * np.sin(angle), NOWHERE))
        return np.stack(x), np.stack(y)

    def _front(self, at: Mapping[str, Floats], ranges: Floats, x: Floats, y: Floats) -> Floats:
        """Return the distance of what only the ultrasonic sees ahead of the nose, m, (n,), inf for nothing: glass.

        The scan sees what it shows now and what was kept of it, at x and y, m, (places, sectors, n).
        """
        if "distance_front" not in at:
            return np.full(ranges.shape[1], np.inf)
        echo = at["distance_front"]
        cone = np.abs(self._reader.angles) <= HALF_CONE + 0.02
        shown = np.where(cone, ranges, np.inf).min(axis=0) <= echo + self.SHOWN
        # Of what it showed before, only what is too near for it now tells anything: the rest it would show still.
        depth = x - self._nose
        cone = np.abs(y) <= TANGENT * depth + self.BESIDE
        kept = np.where((depth > 0.0) & cone, np.hypot(depth, y), np.inf)
        shown |= kept.min(axis=(0, 1)) <= np.minimum(echo + self.SHOWN, self._blind + 0.1)
        sides = [np.where(at[f"distance_{side}"] > 0.0, at[f"distance_{side}"], np.inf) for side in ("right", "left")]
        wall = np.minimum(*sides) / np.sin(HALF_CONE)
        glass = (echo > 0.0) & ~shown & (echo < self.SIDE_SHARE * wall)
        return np.where(glass, echo, np.inf)

    def _taken_back(self, at: Mapping[str, Floats], x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Return which points an echo shows to be none."""
        gone = np.zeros(x.shape, dtype=bool)
        inner = self.INNER * TANGENT
        for side, sign in (("right", -1.0), ("left", 1.0)):
            echo = np.where(at[f"distance_{side}"] > 0.0, at[f"distance_{side}"], FARTHEST)
            depth, across = sign * y, np.abs(x - self._side)
            gone |= (across <= inner * depth) & (depth * depth + across * across < (echo - self.NEARER) ** 2)
        return gone
