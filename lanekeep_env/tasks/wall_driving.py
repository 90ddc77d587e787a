"""Following a wall and driving circuits: what a step costs, and how an episode ends."""

from __future__ import annotations

from lanekeep_env import layout as at
from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import larger, like, select, smaller
from lanekeep_env.tasks.lane_keeping import running_cost
from lanekeep_env.tasks.termination import CONTACT, FINISHED


@inline
def judge_following(d, steering_rate, steps_left, seconds, touches, reference_d, weight, reference_rate, cap, ends):
    """Return (reward, ended) of a step along a wall.

    The running cost of lane keeping; a contact costs the cap, and where it ends the episode (``ends``) the cap for the
    remaining ``steps_left`` as well.
    """
    zero, one = like(d, 0.0), like(d, 1.0)
    cost = running_cost(d, steering_rate, reference_d, weight, reference_rate, cap)
    charged = select(ends, cap * (one + larger(steps_left, zero)), cap)
    cost = select(touches, charged, cost)
    return -cost * seconds, select(touches & ends, like(d, CONTACT), zero)


@inline
def judge_circuit(progress, steps_left, seconds, touches, done, largest_speed, ends):
    """Return (reward, ended) of a step on a circuit.

    Time is what counts: a second costs 1 minus the progress along the centre line over that at the largest speed, at
    most 2. A lap done ends the cost; a contact costs 2 a second, and where it ends the episode (``ends``) for the
    remaining ``steps_left`` as well, so that no drive without a contact is worse.
    """
    zero, one, most = like(progress, 0.0), like(progress, 1.0), like(progress, at.LARGEST_CIRCUIT_COST)
    cost = one - progress / (largest_speed * seconds)
    cost = smaller(most, cost)
    charged = select(ends, most * (one + larger(steps_left, zero)), most)
    cost = select(touches, charged, cost)
    ended = select(done, like(progress, FINISHED), zero)
    ended = select(touches & ends, like(progress, CONTACT), ended)
    return -cost * seconds, ended
