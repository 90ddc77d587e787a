"""Lane keeping: how an episode starts and what a step costs."""

from __future__ import annotations

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import larger, library, like, select, smaller


@inline
def running_cost(d, steering_rate, reference_d, weight, reference_rate, cap):
    """Return min(cap, (d / reference)² + weight (steering rate / reference)²), per second."""
    lateral = d / reference_d
    effort = steering_rate / reference_rate
    cost = lateral * lateral + weight * effort * effort
    return smaller(cap, cost)


@inline
def judge(d, steering_rate, steps_left, seconds, half_lane, reference_d, weight, reference_rate, cap, ends, ignores):
    """Return (reward, outside, terminated) of a step of ``seconds``; the flags are 0 or 1.

    Outside the lane the step costs the cap; where a departure ends the episode (``ends``) it costs the
    cap for the remaining ``steps_left`` as well, so no drive inside the lane is worse. ``ignores``: the
    lane's edge does not count.
    """
    zero, one = like(d, 0.0), like(d, 1.0)
    cost = running_cost(d, steering_rate, reference_d, weight, reference_rate, cap)
    outside = select(abs(d) <= half_lane, zero, one)  # so that NaN is outside
    outside = select(ignores, zero, outside)
    terminated = select(ends, outside, zero)
    charged = select(ends, cap * (one + larger(steps_left, zero)), cap)
    cost = select(outside > zero, charged, cost)
    return -cost * seconds, outside, terminated


@inline
def steady_turning(v, kappa, front, rear, mass, stiffness_front, stiffness_rear, kinematic):
    """Steering angle (rad), sideslip (rad) and yaw rate (rad/s) of steady driving along ``kappa`` (1/m).

    Linear single track: delta = l kappa + (m_f/C_f - m_r/C_r) v² kappa with the axle masses m_f, m_r;
    kinematic: delta = atan(l kappa), beta = atan(l_r kappa). Episodes start in this state, so that a start
    inside a curve is a car that drives through the curve, not one that must first find it.
    """
    base = front + rear
    if kinematic:  # a fact of the model, not of the state
        arctan = library(kappa).arctan
        return arctan(base * kappa), arctan(rear * kappa), v * kappa
    force = mass * v * v * kappa / base
    slip_front = force * rear / stiffness_front
    slip_rear = force * front / stiffness_rear
    return base * kappa + slip_front - slip_rear, rear * kappa - slip_rear, v * kappa
