"""Team KnightRiders 2017: a lap among obstacles (second task, chapter 4), improved.

The report walks along the scan, takes the ends of what stands in its detection box for targets and drives there by
encoder. Better: what `knightriders-circuit` has below it for any walls holds for boxes as well. Points of the last
scans and echoes make a local map that odometry moves; a table of paths tells how far the body, swept along each, is
free; the wall follower's command passes where the car could still stop after it, else the path is taken that is free
farthest and near to what is wanted, backwards a little where none is. Which way round the circuit goes is told by the
corners that were driven (`leg_odometry`), since the end of a box may look like that of a wall.
"""

from __future__ import annotations

from typing import Protocol

from lanekeep_baselines.declared import Need
from lanekeep_baselines.knightriders_circuit import CircuitDrive, KnightRidersCircuit


class ObstacleDrive(CircuitDrive, Protocol):
    """What the controller may know; `lanekeep_env.ObstacleCircuitScenario` is one."""

    @property
    def modes(self) -> tuple[tuple[float, str], ...]: ...


def _no_course(scenario: ObstacleDrive) -> str:
    """Return what is lacking where a scenario has no modes, else ""."""
    return "" if scenario.modes else "a course with modes; without boxes knightriders-circuit drives"


class KnightRidersObstacles(KnightRidersCircuit):
    """`knightriders-obstacles`: along the walls, round the corners and past the boxes of a circuit."""

    name = "knightriders-obstacles"
    needs = (Need("a course", _no_course),)
    #: Against the way round that was driven no votes count.
    DRIVEN = 1e3

    def __init__(self, scenario: ObstacleDrive, *, free_space: bool = True) -> None:
        super().__init__(scenario, free_space=free_space)
