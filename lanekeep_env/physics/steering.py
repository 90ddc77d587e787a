"""The steering actuator: from the command to the road-wheel angle (rad)."""

from __future__ import annotations

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import clip, like, select


@inline
def advance_steering(angle, command, response, largest_change):
    """Return the road-wheel angle half an integration step later.

    First-order lag T answered exactly for a held command, with the speed limited:
    ``response`` = 1 - exp(-(h/2)/T) (1 without lag), ``largest_change`` = rate limit times h/2, rad.
    Exact while the limit is idle or fully active; first order in h over the one half-step between.
    """
    return angle + clip((command - angle) * response, -largest_change, largest_change)


@inline
def advance_gear(motor, wheel, command, response, gain, largest_change, half_gap, on_motor):
    """Return motor angle and road-wheel angle half an integration step later, with backlash between them.

    A P loop sets the speed of the motor, clip((command - measured)/T, +-rate limit); the road wheel follows once the
    motor has crossed the gap, and stays where it is inside it (Trächtler, Lohmann, Struck 1992, section 3). Measured
    is the road wheel, behind the gear (stationary exact whatever the gap), or the motor (``on_motor``: the road wheel
    then errs by up to ``half_gap``). With a closed gap both are the PT1 of `advance_steering`.

    ``gain`` = (h/2)/T; inside the gap the road wheel rests, so the motor's speed is constant. Angles in rad of the
    road wheel. First order in h over the one half-step in which the motor meets the wheel.
    """
    zero, one = like(wheel, 0.0), like(wheel, 1.0)
    error = command - wheel
    driven = clip(error * response, -largest_change, largest_change)  # motor and wheel together
    free = clip(error * gain, -largest_change, largest_change)  # the motor alone
    way = abs(free)
    ahead = select(error > zero, motor - wheel, wheel - motor)
    room = half_gap - ahead
    share = clip(room / select(way > zero, way, one), zero, one)
    behind = motor + share * free + (one - share) * driven
    alone = motor + clip((command - motor) * response, -largest_change, largest_change)
    motor = select(on_motor, alone, behind)
    return motor, clip(wheel, motor - half_gap, motor + half_gap)
