"""What stands between a circuit's plan and the wheels: a command passes while it is harmless, else free space tells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.fixed_arc import FixedArc
from lanekeep_baselines.free_drive import FreeDrive, Motion, Pilot, Sight, Wish
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_features import ScanReader
from lanekeep_baselines.wall_design import WallCar


class CircuitPilot:
    """Guards the commands of `knightriders-circuit` and looks for the way where it is lost.

    Args:
        free: knows which commands are harmless, and the best path where one is not.
        reader: of the scan.
        car: that is driven.
        limit: largest steering angle, rad.
        arc: what is done instead of looking for a way in free space, or None.
    """

    #: Largest speed where the way is looked for, m/s.
    LOOKING: ClassVar[float] = 1.5
    #: Commands replaced after which the way is looked for.
    DOUBT: ClassVar[float] = 4.0

    def __init__(self, free: FreeDrive, reader: ScanReader, car: WallCar, limit: float, arc: FixedArc | None) -> None:
        self._free, self._reader, self._car, self._limit, self._arc = free, reader, car, limit, arc

    def steer(
        self,
        at: Mapping[str, Floats],
        points: tuple[Floats, Floats],
        ranges: Floats,
        command: Floats,
        known: Floats,
        side: Floats,
        heard: Floats,
        pilot: Pilot,
    ) -> tuple[Floats, Pilot, NDArray[np.bool_]]:
        """Return the command, from free space where the given one is not harmless or the way is lost."""
        offset, base = known[:, 2], self._car.wheelbase
        least, most = np.tan(offset - self._limit) / base, np.tan(offset + self._limit) / base
        motion = Motion(at["speed"], pilot.curvature, least, most)
        # Before what it hears, but does not see, the car can always stop.
        command = np.stack([command[:, 0], np.minimum(command[:, 1], self._free.before(heard))], axis=1)
        asked = np.tan(np.clip(command[:, 0], -self._limit, self._limit) + offset) / base
        harmless = self._free.harmless(*points, motion, asked, command[:, 1], pilot.doubt > 0.0)
        if self._arc is not None:
            keep = harmless & (pilot.back == 0.0)
            bend, speed, back = self._arc.drive(harmless, pilot.back, at["speed"], pilot.curvature, ranges)
            pilot = pilot._replace(back=np.where(keep, 0.0, back), curvature=np.where(keep, asked, bend))
            fixed = np.stack([np.arctan(bend * base) - offset, speed], axis=1)
            return np.where(keep[:, None], command, fixed), pilot, keep
        lost = pilot.lost > 0.5
        keep = harmless & ~lost
        wanted = np.where(lost, 0.5 * pilot.curvature, np.where(pilot.doubt > 0.0, pilot.curvature, asked))
        curvature, speed, back = asked.copy(), command[:, 1].copy(), np.zeros_like(asked)
        rows = np.flatnonzero(~keep)
        if len(rows):
            x, y = (values[:, rows] for values in points)
            choice = self._free.choose(
                x,
                y,
                Motion(*(values[rows] for values in motion)),
                Wish(wanted[rows], side[rows], pilot.heading[rows], lost[rows]),
                Sight(heard[rows], self._reader.view(ranges[:, rows], self._free.bearing)),
                np.where(lost, pilot.back, 0.0)[rows],
            )
            slower = np.where(lost[rows], np.minimum(choice.speed, self.LOOKING), choice.speed)
            curvature[rows], speed[rows] = choice.curvature, slower
            back[rows] = np.maximum(choice.back - self._car.step * np.abs(at["speed"][rows]), 0.0)
        doubt = np.where(keep, np.maximum(pilot.doubt - 0.2, 0.0), pilot.doubt + 1.0)
        loses = ~lost & (doubt > self.DOUBT)
        pilot = pilot._replace(
            doubt=np.where(loses | lost, 0.0, doubt),
            lost=np.where(loses, 1.0, pilot.lost),
            losses=pilot.losses + loses,
            back=back,
            curvature=curvature,
        )
        free = np.stack([np.arctan(curvature * base) - offset, speed], axis=1)
        return np.where(keep[:, None], command, free), pilot, keep
