"""Forces from outside that push a car sideways: a bank's and the wind's, beside the tyres' of any model with slip.

A bank is the road's roll angle, positive where its left side is up (ISO 8855): weight then pulls to the right. A
crosswind is positive to the left, a headwind against the car's nose. A model feels a side force F at its centre of
gravity, left positive, and a yaw moment M: beta' grows by F cos(beta)/(m v), or F/(m v) where angles are small, and r'
by M/J. Along its course a car's speed is not the model's matter.

Standstill: below the slip-speed floor a push fades with the speed, as tyres that stand hold by static friction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import larger, like, magnitude, select, sin_cos, sqrt
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.single_track import slip_speed_floor


@inline
def side_weight(mass, bank):
    """Return what a bank pulls to the left with, N."""
    sine, _ = sin_cos(bank)
    return -mass * like(sine, GRAVITY) * sine


@inline
def wind_force(v, beta, headwind, crosswind, area):
    """Return the wind's side force, N: c_y A rho/2 w² with c_y = c_y' sin(tau), ``area`` = c_y' A rho/2 in N s²/m².

    w is the speed of the air about the car and tau its angle to the car's axis, the tangent of which is across over
    along: (crosswind - v sin(beta)) / (v cos(beta) + headwind).
    """
    sine, cosine = sin_cos(beta)
    along, across = v * cosine + headwind, crosswind - v * sine
    return area * sqrt(along * along + across * across) * across


@inline
def push_of(v, beta, floor, push):
    """Return side force, N, and yaw moment, N m; ``push`` is (side weight, headwind, crosswind, area, lever)."""
    weight, headwind, crosswind, area, lever = push
    wind = wind_force(v, beta, headwind, crosswind, area)
    share = magnitude(v) / larger(magnitude(v), slip_speed_floor(v, floor))
    return (weight + wind) * share, wind * lever * share


@inline
def _across_its_course(force, beta):
    _, cosine = sin_cos(beta)
    return force * cosine


@inline
def _as_it_is(force, beta):
    return force


def pushed(
    rates: Callable[..., Any], outputs: Callable[..., Any], small_angles: bool, rename: Callable[..., Any]
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return rates and outputs of a model with pushes from outside; its ``car`` is then (car, push).

    Args:
        rates, outputs: of the model, functions of `single_track`.
        small_angles: whether its equations are those of small slip angles.
        rename: gives the functions a name of their own, see `integrate.named`.
    """
    across = _as_it_is if small_angles else _across_its_course

    @inline
    @rename
    def pushed_rates(d, theta, beta, r, steer, v, kappa, car):
        own, push = car
        s_rate, d_rate, theta_rate, beta_rate, r_rate = rates(d, theta, beta, r, steer, v, kappa, own)
        force, moment = push_of(v, beta, own[8], push)
        floored = larger(magnitude(v), slip_speed_floor(v, own[8]))
        floored = select(v < like(v, 0.0), -floored, floored)  # backwards sideslip grows the other way
        beta_rate += across(force, beta) * own[2] / floored
        return s_rate, d_rate, theta_rate, beta_rate, r_rate + moment * own[3]

    @inline
    @rename
    def pushed_outputs(beta, r, steer, v, car):
        own, push = car
        beta, r, acceleration = outputs(beta, r, steer, v, own)
        force, _ = push_of(v, beta, own[8], push)
        return beta, r, acceleration + across(force, beta) * own[2]

    return pushed_rates, pushed_outputs
