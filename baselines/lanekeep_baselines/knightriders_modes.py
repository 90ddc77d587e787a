"""Team KnightRiders 2017: the mode machine over the three tasks: round trip, round trip with obstacles, park the car.

Each mode has a policy of its own, which starts afresh where the mode begins. Decisions: parking searches slowly, near
the row and along it. So the policy before it drives on, braking, until the car is as slow and turns no more; then the
wall on the right is approached, which the authors wish for. A car that is in a gap, or on its way in, leaves it first
when another mode is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.knightriders_circuit import KnightRidersCircuit
from lanekeep_baselines.knightriders_obstacles import KnightRidersObstacles, ObstacleDrive
from lanekeep_baselines.knightriders_park import PARKS, KnightRidersPark, ParkingDrive
from lanekeep_baselines.policy import DrivingPolicy, Floats
from lanekeep_baselines.wall_approach import WallApproach

#: Values of the channel `mode`, and what comes before the last.
ROUNDTRIP, OBSTACLES, PARK, APPROACH = 0.0, 1.0, 2.0, 3.0

_Part = type[KnightRidersCircuit] | type[KnightRidersPark] | type[WallApproach]


def _together(parts: Iterable[_Part], declared: str) -> tuple[str, ...]:
    """Return the channels that any of the policies declares so, each once."""
    return tuple(dict.fromkeys(channel for part in parts for channel in getattr(part, declared)))


class CourseDrive(ObstacleDrive, ParkingDrive, Protocol):
    """What the machine may know: what its policies may."""


class KnightRidersModes(DrivingPolicy):
    """`knightriders-modes`: the policy of the mode that the channel `mode` tells, which may change at any time.

    Its memory is the mode that is driven and the memory of that policy, at a place of its own.
    """

    name = "knightriders-modes"

    #: The policy of each mode.
    PARTS: ClassVar[Mapping[float, type[KnightRidersCircuit] | type[KnightRidersPark]]] = {
        ROUNDTRIP: KnightRidersCircuit,
        OBSTACLES: KnightRidersObstacles,
        PARK: KnightRidersPark,
    }
    reads = _together((*PARTS.values(), WallApproach), "reads")
    uses = _together((*PARTS.values(), WallApproach), "uses")
    needs = (*KnightRidersObstacles.needs, PARKS)

    #: The row is approached once speed, m/s, and yaw rate, rad/s, are below these: in an arc it is twice as much.
    SLOW, STRAIGHT = 0.4, 0.2

    def __init__(self, scenario: CourseDrive) -> None:
        super().__init__(scenario)
        self._approach, self._park = WallApproach(scenario), KnightRidersPark(scenario)
        parts = {mode: part(scenario) for mode, part in self.PARTS.items() if mode != PARK}
        self._parts = {**parts, PARK: self._park, APPROACH: self._approach}
        ends = 1 + np.cumsum([part.memory for part in self._parts.values()])
        self._places = {
            mode: slice(end - part.memory, end) for end, (mode, part) in zip(ends, self._parts.items(), strict=True)
        }
        self.memory = int(ends[-1])

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        new = np.broadcast_to(np.reshape(fresh, -1), at["speed"].shape)
        last = memory[:, 0]
        mode, brakes = self._mode(at, memory, new)
        begins = new | (mode != last)
        commands, following = np.zeros((len(mode), 2)), np.zeros_like(memory)
        following[:, 0] = mode
        for key, part in self._parts.items():
            rows = np.flatnonzero(mode == key)
            if len(rows):
                some = {channel: values[rows] for channel, values in at.items()}
                place = self._places[key]
                commands[rows], following[rows, place] = part.command(some, memory[rows, place], begins[rows])
        commands[:, 1] = np.where(brakes, np.minimum(commands[:, 1], WallApproach.SLOW), commands[:, 1])
        return commands, following

    def _mode(
        self, at: Mapping[str, Floats], memory: Floats, new: NDArray[np.bool_]
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the key of the policy that drives, (n,), and where it brakes because parking comes next."""
        wanted, last = np.clip(np.rint(at["mode"]), ROUNDTRIP, PARK), memory[:, 0]
        hasty = (np.abs(at["speed"]) > self.SLOW) | (np.abs(at["yaw_rate"]) > self.STRAIGHT)
        drives = ~new & (wanted == PARK) & (last < PARK)
        arrived = self._approach.arrived(at, memory[:, self._places[APPROACH]])
        approaches = (drives & ~hasty) | (~new & (wanted == PARK) & (last == APPROACH) & ~arrived)
        leaves = ~new & (last == PARK) & self._park.inside(memory[:, self._places[PARK]])
        mode = np.where(approaches, APPROACH, np.where(drives & hasty, last, np.where(leaves, PARK, wanted)))
        return mode, drives & hasty
