"""Parking: where a body is in a space, what a step costs, and how an episode ends."""

from __future__ import annotations

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import larger, like, select, smaller
from lanekeep_env.tasks.termination import CONTACT, FINISHED


@inline
def share_inside(ahead, left, cosine, sine, half_length, half_width, long, kerb):
    """Return (share, kerb distance, whether it is inside) of a body in a parking space.

    ``ahead`` and ``left`` are its middle's place from the space's rear corner at the kerb, m, ``cosine`` and ``sine``
    of its heading from the kerb's; the share is that of the rectangle around it, along the kerb, that lies within
    ``long`` along the kerb and within ``kerb`` of it, if it stood parallel, m.
    """
    zero, two = like(ahead, 0.0), like(ahead, 2.0)
    reach = half_length * abs(cosine) + half_width * abs(sine)
    across = half_length * abs(sine) + half_width * abs(cosine)
    along = larger(smaller(ahead + reach, long) - larger(ahead - reach, zero), zero)
    deep = larger(smaller(left + across, kerb + two * half_width) - larger(left - across, zero), zero)
    share = along * deep / (two * two * reach * across)
    distance = left - across
    inside = (ahead - reach >= zero) & (ahead + reach <= long) & (distance <= kerb)
    return share, distance, inside


@inline
def judge_parking(share, parked, step, horizon, seconds, touches, ends, largest):
    """Return (reward, ended) of a step towards a parking space, whichever.

    A second costs 1, until the car is parked. An episode that is over without costs up to half of its length more, by
    the share of the car that is outside; a contact costs so much that ``largest`` times the episode's length is full
    (``largest`` a second where contacts do not end it). So contact < time-out < partly in < parked, sooner better.
    """
    one, half = like(share, 1.0), like(share, 0.5)
    late = select(step >= horizon, half * horizon * (one - smaller(share, one)), like(share, 0.0))
    cost = one + select(parked, like(share, 0.0), late)
    cost = select(touches, select(ends, largest * horizon - step + one, largest), cost)
    ended = select(parked, like(share, FINISHED), like(share, 0.0))
    return -cost * seconds, select(touches & ends, like(share, CONTACT), ended)
