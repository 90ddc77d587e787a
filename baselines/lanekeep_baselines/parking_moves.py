"""Moves between two parked cars, closed over the estimated pose: straightening in several moves, and out of the gap.

A move ends where a corner of the body is as near as `AIR` to a box or to the kerb; `path_shunting` tells in advance
where that is. Out of a gap the arc left is driven on as soon as the nose passes the box in front on it.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.parking_row import (
    AWAY,
    BACK,
    BESIDE,
    FORTH,
    IN,
    LEFT,
    OUT,
    RIGHT,
    SEARCH,
    STAND,
    STRAIGHT,
    Search,
)
from lanekeep_baselines.path_clearance import Body
from lanekeep_baselines.path_planning import PARKING_ANGLE
from lanekeep_baselines.path_shunting import passes
from lanekeep_baselines.policy import Floats


class Moves:
    """What phase follows; rows are independent of each other."""

    #: Nearest to a box and to the kerb, m, along the row; and more to a box by so much where the car is across, since
    #: only along the row it hears where it is.
    AIR, KERB, ACROSS = 0.015, 0.01, 0.015
    #: Heading at which the car is along the kerb, rad.
    DONE: ClassVar[float] = float(np.deg2rad(1.0))
    #: Beside the row at the end of leaving, m.
    CLEAR: ClassVar[float] = 0.3

    def room(self, heading: Floats, now: Search, body: Body) -> tuple[Floats, Floats]:
        """Return the ways, m, (n,), that the body has left forwards and backwards, as if along the heading."""
        sine, cosine = np.sin(heading), np.maximum(np.cos(heading), 0.1)
        air = self.AIR + (body.half_width + self.ACROSS) * np.abs(sine)
        ahead = now.begin - now.place - body.front * cosine - air
        behind = now.place - now.gap - body.rear * cosine - air
        kerb = now.kerb - body.rear * sine - body.half_width * cosine - self.KERB
        return ahead / cosine, np.minimum(behind / cosine, kerb / np.maximum(sine, 0.05))

    def straighten(self, phase: Floats, heading: Floats, now: Search, body: Body, step: Floats) -> Floats:
        """Return the next phase of rows that go in, in several moves; ``step`` is the way of a control step, m."""
        ahead, behind = self.room(heading, now, body)
        backwards = ((phase == LEFT) | (phase == BACK)) & (now.moves > 0.5)
        forwards = phase == FORTH
        along = heading <= self.DONE
        phase = np.where(backwards & (behind <= 0.5 * step), FORTH, phase)
        phase = np.where(forwards & (ahead <= 0.5 * step), BACK, phase)
        return np.where((backwards | forwards) & along, STAND, phase)

    def leave(
        self, phase: Floats, heading: Floats, now: Search, body: Body, step: Floats, asked: NDArray[np.bool_]
    ) -> Floats:
        """Return the next phase of rows that go out again, or are ``asked`` to; `SEARCH` where they are out."""
        begins = {RIGHT: BESIDE, STRAIGHT: AWAY, LEFT: OUT, STAND: OUT, FORTH: OUT, BACK: OUT}
        for inside, out in begins.items():
            phase = np.where(asked & (now.phase == inside), out, phase)
        ahead, behind = self.room(heading, now, body)
        pose = np.stack([now.place - now.gap, now.kerb, heading], axis=1)
        clear = passes(pose, now.begin - now.gap - self.AIR, now.depth + self.AIR, body)
        was = phase
        phase = np.where((was == OUT) & ~clear & (ahead <= 0.5 * step), IN, phase)
        phase = np.where((was == IN) & (behind <= 0.5 * step), OUT, phase)
        phase = np.where((was == OUT) & (heading >= PARKING_ANGLE), AWAY, phase)
        back = now.kerb + body.radius_right * (1.0 - np.cos(heading))
        phase = np.where((was == AWAY) & (back >= now.depth + body.half_width + self.CLEAR), BESIDE, phase)
        return np.where((was == BESIDE) & (heading <= self.DONE), SEARCH, phase)
