"""States that are no numbers any more: whatever made them so, the episode ends there, as a failure."""

from __future__ import annotations

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import like


@inline
def are_finite(x, d, theta, beta, r, v, steered, acceleration):
    """Return whether all of a car's state, and by how much it has steered, is finite (no NaN, no infinity)."""
    total = x + d + theta + beta + r + v + steered + acceleration
    return total - total == like(x, 0.0)
