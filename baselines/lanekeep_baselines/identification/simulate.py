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

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_env.compile import kernel

#: Longest sub-step, s.
SUBSTEP = 0.01
#: What is simulated, in the order of the output's columns.
OUTPUTS = ("steering", "yaw_rate", "heading", "x", "y")
#: Order of the start values.
STATES = ("steering", "sideslip", "yaw_rate")


@kernel()
def _simulate(
    parameters: Floats,
    start: Floats,
    anchor: Floats,
    stretch: int,
    speed: Floats,
    command: Floats,
    held: bool,
    step: float,
    substeps: int,
    delay: int,
    out: Floats,
) -> None:
    """Fill ``out`` (lanes, samples, 5); ``stretch`` counts samples, ``delay`` sub-steps; not ``held`` is linear."""
    h = step / substeps
    for lane in range(parameters.shape[0]):
        a11, a12, a21, a22 = parameters[lane, 0], parameters[lane, 1], parameters[lane, 2], parameters[lane, 3]
        b1, b2, lag = parameters[lane, 4], parameters[lane, 5], parameters[lane, 6]
        left = math.exp(-0.5 * h / lag) if lag > 0.0 else 0.0  # of the way to the command, after half a sub-step
        delta, beta, r = start[lane, 0], start[lane, 1], start[lane, 2]
        psi, x, y, sine, cosine = 0.0, 0.0, 0.0, 0.0, 1.0
        for k in range(speed.shape[0]):
            if k % stretch == 0:
                psi, x, y = anchor[k, 0], anchor[k, 1], anchor[k, 2]
                sine, cosine = math.sin(beta + psi), math.cos(beta + psi)
            out[lane, k, 0], out[lane, k, 1], out[lane, k, 2] = delta, r, psi
            out[lane, k, 3], out[lane, k, 4] = x, y
            if k + 1 == speed.shape[0]:
                break
            slope = (speed[k + 1] - speed[k]) / step
            for j in range(substeps):
                v0 = speed[k] + slope * h * j
                v1, v2 = v0 + 0.5 * h * slope, v0 + h * slope
                if held:
                    asked = command[max(k * substeps + j - delay, 0) // substeps]
                    if lag <= 0.0:
                        delta = asked
                    middle = asked + (delta - asked) * left
                    end = asked + (middle - asked) * left
                else:
                    rise = (command[k + 1] - command[k]) / substeps
                    delta = command[k] + rise * j
                    middle, end = delta + 0.5 * rise, delta + rise
                p0, q0, s0 = a11 / v0, a12 / (v0 * v0) - 1.0, b1 / v0 * delta
                p1, q1, s1 = a11 / v1, a12 / (v1 * v1) - 1.0, b1 / v1 * middle
                p2, q2, s2 = a11 / v2, a12 / (v2 * v2) - 1.0, b1 / v2 * end
                w0, w1, w2 = a22 / v0, a22 / v1, a22 / v2
                kb1, kr1 = p0 * beta + q0 * r + s0, a21 * beta + w0 * r + b2 * delta
                b, c = beta + 0.5 * h * kb1, r + 0.5 * h * kr1
                kb2, kr2 = p1 * b + q1 * c + s1, a21 * b + w1 * c + b2 * middle
                r2 = c
                b, c = beta + 0.5 * h * kb2, r + 0.5 * h * kr2
                kb3, kr3 = p1 * b + q1 * c + s1, a21 * b + w1 * c + b2 * middle
                r3 = c
                b, c = beta + h * kb3, r + h * kr3
                kb4, kr4 = p2 * b + q2 * c + s2, a21 * b + w2 * c + b2 * end
                course, rate = beta + psi, kb1 + r
                psi += h / 6.0 * (r + 2.0 * (r2 + r3) + c)
                beta += h / 6.0 * (kb1 + 2.0 * (kb2 + kb3) + kb4)
                r += h / 6.0 * (kr1 + 2.0 * (kr2 + kr3) + kr4)
                delta = end
                # The course in the middle, from its values and rates at both ends.
                rate_end = p2 * beta + q2 * r + s2 + r
                half_way = 0.5 * (course + beta + psi) + 0.125 * h * (rate - rate_end)
                x += h / 6.0 * (v0 * cosine + 4.0 * v1 * math.cos(half_way))
                y += h / 6.0 * (v0 * sine + 4.0 * v1 * math.sin(half_way))
                sine, cosine = math.sin(beta + psi), math.cos(beta + psi)
                x += h / 6.0 * v2 * cosine
                y += h / 6.0 * v2 * sine


def simulate(
    parameters: Floats,
    start: Floats,
    speed: Floats,
    command: Floats,
    step: float,
    *,
    held: bool = True,
    delay: float = 0.0,
    anchor: Floats | None = None,
    stretch: int | None = None,
) -> Floats:
    """Return the outputs over a run for many parameter sets at once, (lanes, samples, 5), in the order of `OUTPUTS`.

    Args:
        parameters: (lanes, 7): a11, a12, a21, a22, b1, b2 (units of `YinModel`, angles as in ``command``) and lag, s.
        start: (lanes, 3), in the order of `STATES`; SI.
        speed: at each sample, m/s, above 0, (samples,).
        command: steering angle asked for from each sample to the next, rad, (samples,).
        step: between samples, s.
        held: False takes ``command`` for the steering angle itself, linear between samples; lag and delay do not act.
        delay: s by which the command arrives late; rounded to sub-steps.
        anchor: heading, x and y, (samples, 3), of which each stretch takes its first; None for 0.
        stretch: samples after which heading and position are taken from ``anchor`` again; None for never.
    """
    count = len(speed)
    substeps = math.ceil(step / SUBSTEP - 1e-9)
    anchor = np.zeros((count, 3)) if anchor is None else np.ascontiguousarray(anchor)
    out = np.empty((len(parameters), count, len(OUTPUTS)))
    late = round(delay * substeps / step)
    parameters, start = np.ascontiguousarray(parameters), np.ascontiguousarray(start)
    _simulate(parameters, start, anchor, stretch or count, speed, command, held, step, substeps, late, out)
    return out
