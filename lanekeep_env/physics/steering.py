"""The steering actuator: from the command to the road-wheel angle (rad)."""

from __future__ import annotations

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import clip


@inline
def advance_steering(angle, command, response, largest_change):
    """Return the road-wheel angle half an integration step later.

    First-order lag T answered exactly for a held command, with the speed limited:
    ``response`` = 1 - exp(-(h/2)/T) (1 without lag), ``largest_change`` = rate limit times h/2, rad.
    Exact while the limit is idle or fully active; first order in h over the one half-step between.
    """
    return angle + clip((command - angle) * response, -largest_change, largest_change)
