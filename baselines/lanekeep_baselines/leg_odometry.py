"""Which way round a circuit goes, and whether the car still drives that way: by odometry alone.

A car that turns round in a corridor has turned as far as in two corners, and a box can look like the end of a wall. But
within a leg no body gets farther across than the corridor is wide. Who has gone farther has left it, on the circuit's
inner side: ahead into the next leg, behind into the one before.

A leg need not be straight: where both walls are beside, as far apart as at the start, its direction is theirs, and they
tell the place across. With the direction that it began with it would be left sideways in a bend, backwards in the next.

Everything is elementwise over the rows.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_env.sensing.ultrasonic import HALF_CONE

_RIGHT_ANGLE = 0.5 * np.pi
#: Heading from which on walls beside are those across the leg, rad.
ACROSS = np.pi / 3.0


class Way(NamedTuple):
    """Where the car is on its leg, (n,) each.

    Attributes:
        heading: from the way along the leg, rad, in -pi to pi.
        along: way along the leg since the car came into it, m; negative behind there.
        from_right, from_left: way across from the rightmost and from the leftmost place on the leg so far, m.
        corridor: its width where the car started, between walls and no boxes, m.
    """

    heading: Floats
    along: Floats
    from_right: Floats
    from_left: Floats
    corridor: Floats


def wrapped(angle: Floats) -> Floats:
    """Return an angle in -pi to pi, rad."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def beside(heading: Floats) -> Floats:
    """Return a heading, rad, from the walls beside: up to `ACROSS` those of the leg, beyond those across it."""
    return heading - np.sign(heading) * _RIGHT_ANGLE * np.floor((np.abs(heading) - ACROSS) / _RIGHT_ANGLE + 1.0)


class LegOdometer:
    """Its memory is a `Way`; a car starts along its leg.

    Args:
        width: of the body, m.
    """

    #: Share of a measured heading that corrects the own one, and how far off it may be, rad: a box is no wall.
    GAIN, WITHIN = 0.01, 0.15
    #: How far the sides may be from the corridor's width, m, for both walls to be the leg's.
    SAME: ClassVar[float] = 0.1

    def __init__(self, width: float) -> None:
        self._width = width

    def update(
        self,
        memory: Floats,
        fresh: NDArray[np.bool_] | bool,
        way: Floats,
        turned: Floats,
        measured: Floats,
        right: Floats,
        left: Floats,
    ) -> tuple[Way, Floats]:
        """Return the next way, and 1 where the car has just left a leg to the left, -1 to the right, else 0, (n,).

        Args:
            memory: (n, 5), meaningless in rows that are fresh.
            fresh: rows that start.
            way, turned: of the car in the step that ended, m, and of its heading, rad, (n,).
            measured: heading from some wall's direction, rad, (n,), NaN where none is known.
            right, left: distances of the sides, m, (n,), 0 for nothing.
        """
        start = (0.0 * way, 0.0 * way, 0.0 * way, 0.0 * way, right + left)
        heading, along, from_right, from_left, corridor = np.where(fresh, start, memory.T)
        heading = heading + turned
        # Walls tell the heading but for right angles, echoes from both of them alone but for the cone.
        known = ~np.isnan(measured)
        error = np.where(known, measured, 0.0) - heading
        error = error - _RIGHT_ANGLE * np.round(error / _RIGHT_ANGLE)
        both = (right > 0.0) & (left > 0.0) & (np.abs(right + left - corridor) < self.SAME)
        slow = np.where(known & (np.abs(error) < self.WITHIN), self.GAIN, 0.0)
        beyond = error - np.clip(error, -HALF_CONE, HALF_CONE)
        heading = wrapped(heading + np.where(both, np.where(known, error, beyond), slow * error))
        along, across = along + way * np.cos(heading), way * np.sin(heading)
        ahead = both & (np.abs(heading) < 0.5 * _RIGHT_ANGLE)
        back = both & (np.abs(heading) > 1.5 * _RIGHT_ANGLE)
        along = np.where(ahead, np.maximum(along, 0.0), along)
        half = 0.5 * self._width
        from_right = np.where(ahead, right, np.where(back, left, from_right + across + half)) - half
        from_left = np.where(ahead, left, np.where(back, right, from_left - across + half)) - half
        from_right, from_left = np.maximum(from_right, 0.0), np.maximum(from_left, 0.0)
        most = corridor - self._width
        out = 1.0 * (from_right > most) - 1.0 * (from_left > most)
        out = np.where(both & ~ahead & ~back, np.sign(heading), out)
        heading = wrapped(heading - out * np.where(along < 0.0, -_RIGHT_ANGLE, _RIGHT_ANGLE))
        along, from_right, from_left = (np.where(out != 0.0, 0.0, value) for value in (along, from_right, from_left))
        return Way(heading, along, from_right, from_left, corridor), out
