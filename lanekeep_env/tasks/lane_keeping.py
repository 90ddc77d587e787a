"""Lane keeping: how an episode starts and what a step costs."""

from __future__ import annotations

import numpy as np

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import like


@inline
def running_cost(d, steering_rate, reference_d, weight, reference_rate, cap):
    """Return min(cap, (d / reference)² + weight (steering rate / reference)²), per second."""
    lateral = d / reference_d
    effort = steering_rate / reference_rate
    cost = lateral * lateral + weight * effort * effort
    return cap if cost > cap else cost


@inline
def judge(d, steering_rate, steps_left, seconds, half_lane, reference_d, weight, reference_rate, cap, ends, ignores):
    """Return (reward, outside, terminated) of a step of ``seconds``; the flags are 0 or 1.

    Outside the lane the step costs the cap; where a departure ends the episode (``ends``) it costs the
    cap for the remaining ``steps_left`` as well, so no drive inside the lane is worse. ``ignores``: the
    lane's edge does not count.
    """
    zero, one = like(d, 0.0), like(d, 1.0)
    cost = running_cost(d, steering_rate, reference_d, weight, reference_rate, cap)
    outside = zero if abs(d) <= half_lane else one  # so that NaN is outside
    outside = zero if ignores else outside
    terminated = outside if ends else zero
    charged = cap * (one + (steps_left if steps_left > zero else zero)) if ends else cap
    cost = charged if outside > zero else cost
    return -cost * seconds, outside, terminated


@inline
def steady_turning(v, kappa, front, rear, mass, stiffness_front, stiffness_rear, kinematic):
    """Steering angle (rad), sideslip (rad) and yaw rate (rad/s) of steady driving along ``kappa`` (1/m).

    Linear single track: delta = l kappa + (m_f/C_f - m_r/C_r) v² kappa with the axle masses m_f, m_r;
    kinematic: delta = atan(l kappa), beta = atan(l_r kappa). Episodes start in this state, so that a start
    inside a curve is a car that drives through the curve, not one that must first find it.
    """
    base = front + rear
    if kinematic:
        return np.arctan(base * kappa), np.arctan(rear * kappa), v * kappa
    force = mass * v * v * kappa / base
    slip_front = force * rear / stiffness_front
    slip_rear = force * front / stiffness_rear
    return base * kappa + slip_front - slip_rear, rear * kappa - slip_rear, v * kappa
