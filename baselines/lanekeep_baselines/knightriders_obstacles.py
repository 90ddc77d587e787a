"""Team KnightRiders 2017: a lap among obstacles (second task, chapter 4), improved.

The report walks along the scan, takes the ends of what stands in its detection box for targets and drives there by
encoder. Better: what `knightriders-circuit` has below it for any walls holds for boxes as well. Points of the last
scans and echoes make a local map that odometry moves; a table of paths tells how far the body, swept along each, is
free; the wall follower's command passes where the car could still stop after it, else the path is taken that is free
farthest and near to what is wanted, backwards a little where none is.
"""

from __future__ import annotations

from lanekeep_baselines.knightriders_circuit import KnightRidersCircuit


class KnightRidersObstacles(KnightRidersCircuit):
    """`knightriders-obstacles`: along the walls, round the corners and past the boxes of a circuit."""

    name = "knightriders-obstacles"
