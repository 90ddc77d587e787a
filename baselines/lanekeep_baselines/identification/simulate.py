"""The model of the identification, driven along a run: Yin's single track in world axes, compiled.

    x' = v cos(beta + psi), y' = v sin(beta + psi), psi' = r,
    beta' = a11/v beta + (a12/v² - 1) r + b1/v delta, r' = a21 beta + a22/v r + b2 delta,
    delta' = (delta_c - delta)/lag

Between two samples the command delta_c is held, as it was driven, and the measured speed v runs linearly; a measured
delta in place of a command runs linearly too. Sub-steps of 10 ms or less: delta exactly; beta, r and psi by classical
Runge-Kutta (4th order); x and y by Simpson's rule over the same sub-step, with the course in its middle from the cubic
through both ends (4th order as well, and a third of the sines and cosines of a Runge-Kutta step). Exact discretisation
would need a matrix exponential for each sample, since v varies; this takes about 50 ns a sub-step. The equations are
written down here anew, so that the simulator is not fitted with itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_env.compile import inline, kernel

#: Longest sub-step, s.
SUBSTEP = 0.01
#: What is simulated, in the order of the output's columns.
OUTPUTS = ("steering", "yaw_rate", "heading", "x", "y")
#: Order of the start values.
STATES = ("steering", "sideslip", "yaw_rate")
#: a11, a12, a21, a22, b1, b2.
Model = tuple[float, float, float, float, float, float]
#: Before a sub-step, in its middle and after it.
Triple = tuple[float, float, float]


class Inputs(NamedTuple):
    """What a run was driven with.

    Attributes:
        speed: at each sample, m/s, above 0, (samples,).
        command: steering angle asked for from each sample to the next, rad, (samples,).
        step: between samples, s.
        held: False takes ``command`` for the steering angle itself, linear between samples; lag and delay do not act.
        delay: s by which the command arrives late; rounded to sub-steps.
    """

    speed: Floats
    command: Floats
    step: float
    held: bool = True
    delay: float = 0.0


@inline
def _follow(delta: float, asked: float, lag: float, left: float) -> Triple:
    """Return the steering in a sub-step; ``left`` is what half of it leaves of the way to ``asked``."""
    before = asked if lag <= 0.0 else delta
    middle = asked + (before - asked) * left
    return before, middle, asked + (middle - asked) * left


@inline
def _between(first: float, last: float, j: int, substeps: int) -> Triple:
    """Return the steering in sub-step j where it runs linearly between samples."""
    rise = (last - first) / substeps
    before = first + rise * j
    return before, before + 0.5 * rise, before + rise


@inline
def _rates(model: Model, v: float, delta: float, beta: float, r: float) -> tuple[float, float]:
    """Return the rates of sideslip and yaw rate."""
    a11, a12, a21, a22, b1, b2 = model
    return a11 / v * beta + (a12 / (v * v) - 1.0) * r + b1 / v * delta, a21 * beta + a22 / v * r + b2 * delta


@inline
def _turn(model: Model, v: Triple, delta: Triple, beta: float, r: float, h: float) -> tuple[float, float, float, float]:
    """Return sideslip and yaw rate a sub-step later, how far the heading turned, and the rate of the course before."""
    kb1, kr1 = _rates(model, v[0], delta[0], beta, r)
    r2 = r + 0.5 * h * kr1
    kb2, kr2 = _rates(model, v[1], delta[1], beta + 0.5 * h * kb1, r2)
    r3 = r + 0.5 * h * kr2
    kb3, kr3 = _rates(model, v[1], delta[1], beta + 0.5 * h * kb2, r3)
    r4 = r + h * kr3
    kb4, kr4 = _rates(model, v[2], delta[2], beta + h * kb3, r4)
    turned = h / 6.0 * (r + 2.0 * (r2 + r3) + r4)
    beta += h / 6.0 * (kb1 + 2.0 * (kb2 + kb3) + kb4)
    return beta, r + h / 6.0 * (kr1 + 2.0 * (kr2 + kr3) + kr4), turned, kb1 + r


@kernel()
def _simulate(
    parameters: Floats,
    start: Floats,
    inputs: tuple[Floats, Floats, bool],
    timing: tuple[float, int, int],
    anchors: tuple[Floats, int],
    out: Floats,
) -> None:
    """Fill ``out`` (sets, samples, 5).

    ``inputs``: speed, command, held; ``timing``: step, sub-steps of it, delay in sub-steps; ``anchors``: anchor and the
    samples of a stretch.
    """
    (speed, command, held), (step, substeps, delay), (anchor, stretch) = inputs, timing, anchors
    h = step / substeps
    for car in range(parameters.shape[0]):
        of = parameters[car]
        model, lag = (of[0], of[1], of[2], of[3], of[4], of[5]), of[6]
        left = math.exp(-0.5 * h / lag) if lag > 0.0 else 0.0  # of the way to the command, after half a sub-step
        delta, beta, r = start[car, 0], start[car, 1], start[car, 2]
        psi, x, y, sine, cosine = 0.0, 0.0, 0.0, 0.0, 1.0
        for k in range(speed.shape[0]):
            if k % stretch == 0:
                psi, x, y = anchor[k, 0], anchor[k, 1], anchor[k, 2]
                sine, cosine = math.sin(beta + psi), math.cos(beta + psi)
            out[car, k, 0], out[car, k, 1], out[car, k, 2] = delta, r, psi
            out[car, k, 3], out[car, k, 4] = x, y
            if k + 1 == speed.shape[0]:
                break
            slope = (speed[k + 1] - speed[k]) / step
            for j in range(substeps):
                v0 = speed[k] + slope * h * j
                v = v0, v0 + 0.5 * h * slope, v0 + h * slope
                if held:
                    wheel = _follow(delta, command[max(k * substeps + j - delay, 0) // substeps], lag, left)
                else:
                    wheel = _between(command[k], command[k + 1], j, substeps)
                course = beta + psi
                beta, r, turned, rate = _turn(model, v, wheel, beta, r, h)
                psi += turned
                delta = wheel[2]
                # The course in the middle, from its values and rates at both ends.
                rate_end = _rates(model, v[2], delta, beta, r)[0] + r
                half_way = 0.5 * (course + beta + psi) + 0.125 * h * (rate - rate_end)
                x += h / 6.0 * (v[0] * cosine + 4.0 * v[1] * math.cos(half_way))
                y += h / 6.0 * (v[0] * sine + 4.0 * v[1] * math.sin(half_way))
                sine, cosine = math.sin(beta + psi), math.cos(beta + psi)
                x += h / 6.0 * v[2] * cosine
                y += h / 6.0 * v[2] * sine


def simulate(
    parameters: Floats, start: Floats, inputs: Inputs, *, anchor: Floats | None = None, stretch: int | None = None
) -> Floats:
    """Return the outputs over a run for many parameter sets at once, (sets, samples, 5), in the order of `OUTPUTS`.

    Args:
        parameters: (sets, 7): a11, a12, a21, a22, b1, b2 (units of `YinModel`, angles as in the command) and lag, s.
        start: (sets, 3), in the order of `STATES`; SI.
        inputs: what is driven.
        anchor: heading, x and y, (samples, 3), of which each stretch takes its first; None for 0.
        stretch: samples after which heading and position are taken from ``anchor`` again; None for never.
    """
    speed, command, step, held, delay = inputs
    count = len(speed)
    substeps = math.ceil(step / SUBSTEP - 1e-9)
    anchor = np.zeros((count, 3)) if anchor is None else np.ascontiguousarray(anchor)
    out = np.empty((len(parameters), count, len(OUTPUTS)))
    timing = (step, substeps, round(delay * substeps / step))
    parameters, start = np.ascontiguousarray(parameters), np.ascontiguousarray(start)
    _simulate(parameters, start, (speed, command, held), timing, (anchor, stretch or count), out)
    return out
