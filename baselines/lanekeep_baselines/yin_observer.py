"""Yin 2010: the scheduled disturbance observer in discrete time (Yin's signs and units, see `yin_design`).

x' = A_o(v) x + B_o u + k_o(v) (y - C_o x). Over one control step the command u is constant, as the environment holds
it; the measured y, which goes on moving, runs linearly between its samples: then the solution is exact,

    x[k] = Phi x[k-1] + Gamma_0 y[k-1] + Gamma_u u[k-1] + Gamma_1 y[k].

(Holding y as well would be half a control step late: at 50 ms and 50 m/s that halves the loop's damping.)
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.table import Table, weighted_sum
from lanekeep_baselines.yin_design import OUTPUTS, SCHEDULE, Weights, YinModel, observer_gains

#: Speeds at which the observer is discretised, m/s; its matrices are interpolated linearly between them,
SPEEDS: Floats = np.arange(0.0, 60.1, 0.25)
#: and tabulated this finely, m/s, so that the nearest entry serves (three times as quick as interpolating in the loop).
RESOLUTION = 0.02


def transition(model: YinModel, speed: float, gains: Floats, step: float) -> Floats:
    """Return the exact (Phi, Gamma_0, Gamma_u, Gamma_1) side by side, shape (5, 12), at one speed in m/s."""
    from scipy.linalg import expm

    a, b = model.disturbed_plant(speed)
    # One exponential gives all: states x (5), u (1), y (3) and the slope of y over the step (3).
    generator = np.zeros((12, 12))
    generator[:5, :5] = (a - gains @ OUTPUTS) * step
    generator[:5, 5:6] = b * step
    generator[:5, 6:9] = gains * step
    generator[6:9, 9:] = np.eye(3)
    phi = expm(generator)[:5]
    return np.hstack([phi[:, :5], phi[:, 6:9] - phi[:, 9:], phi[:, 5:6], phi[:, 9:]])


@lru_cache(maxsize=8)
def tabulated(model: YinModel, weights: Weights, step: float) -> Floats:
    """Return the transposed transitions at every `RESOLUTION` m/s, shape (n, 12, 5); made once, by whoever asks."""
    gains = Table(SCHEDULE, np.stack([observer_gains(model, v, weights) for v in SCHEDULE]))(SPEEDS)
    rows = [transition(model, v, k, step).T for v, k in zip(SPEEDS, gains, strict=True)]
    table = Table(SPEEDS, np.stack(rows))(np.arange(0.0, SPEEDS[-1] + RESOLUTION / 2, RESOLUTION))
    table.setflags(write=False)
    return table


class Observer:
    """Estimates (delta_L, r, theta_d, y_d, delta_s) from (r, theta_d, y_d) and the applied command, row by row.

    Its memory has eight columns: the five estimates and the three last measured values.
    """

    memory = 8

    def __init__(self, model: YinModel, weights: Weights, step: float) -> None:
        self._transition = tabulated(model, weights, step)

    def update(
        self, memory: Floats, fresh: np.ndarray | bool, speed: Floats, wheel: Floats, applied: Floats, measured: Floats
    ) -> Floats:
        """Return the next memory, (n, 8).

        Args:
            memory: (n, 8); what the last step left behind.
            fresh: rows that start from the measured values and no disturbance, (n,).
            speed: m/s, (n,).
            wheel: measured steering wheel, rad, (n,); starts the estimate of delta_L.
            applied: the command that the actuator got since the last step, rad of steering wheel, (n,).
            measured: r, theta_d, y_d now, (n, 3).
        """
        now = np.empty_like(memory)
        now[:, 5:] = measured
        start = np.concatenate([wheel[:, None], measured, np.zeros_like(wheel)[:, None]], axis=1)
        if fresh is True:
            now[:, :5] = start
            return now
        inputs = np.concatenate([memory, applied[:, None], measured], axis=1)
        nearest = np.clip(speed / RESOLUTION + 0.5, 0.0, len(self._transition) - 1.0).astype(np.intp)
        now[:, :5] = weighted_sum(self._transition[nearest], inputs)
        if fresh is not False:
            now[:, :5] = np.where(np.asarray(fresh)[:, None], start, now[:, :5])
        return now
