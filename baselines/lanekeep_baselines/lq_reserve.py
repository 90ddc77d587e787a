"""How far an LQ design is from instability, and what it gives up so that this is far enough.

Tuned weights are the least cost on the cars they were tuned for; no LQG design has margins of its own (J. Doyle,
"Guaranteed margins for LQG regulators", IEEE TAC 23(4), 1978). Where the largest sensitivity is above `BOUND`, the
weights go as far towards `ROBUST` ones as it takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lanekeep_baselines.lq_design import MEASURED, Weights
from lanekeep_baselines.lq_model import StepModel
from lanekeep_baselines.policy import Floats

#: Ms, the usual bound.
BOUND = 2.0
#: Reserve of lag, s, and deviation of the road wheel from its model, rad a step, with which all shipped full-size cars
#: are within the bound from 1 to 60 m/s, with and without 50 ms of steering delay (`lanekeep margins`).
LAG, STEER_DEVIATION = 0.033, 1e-5
#: Shares of the way that are tried.
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
#: Frequencies, as shares of half the rate of the control steps; below the first one nothing is sensitive.
_GRID: Floats = np.geomspace(2e-3, 1.0, 160)


@dataclass(frozen=True, eq=False)
class Loop:
    """u = -feedback (x, u[k-1] ... u[k-m]) of a filter's x, around the car it was designed for.

    Attributes:
        model: of the car as it is.
        feedback: shape (states + m,), where ``states`` are those that the filter has.
        filtering: F of `Estimated.filter`, whose curvatures are not used.
        known: whether there are such curvatures.
    """

    model: StepModel
    feedback: Floats
    filtering: Floats
    known: bool

    def is_stable(self) -> bool:
        """Tell whether car and filter, of which the design knows another lag, settle together."""
        past, n = self.model.b.shape[1], len(self.filtering)
        car, of_commands = len(self.model.a), n + 2 * self.known
        states = len(self.feedback) - (past - 1)
        # Over (x, u[k-1] ... u[k-past], what the filter knew): what it knows now, and the command.
        knows = np.zeros((n, car + past + n))
        knows[:, car + past :] = self.filtering[:, :n]
        knows[:, car : car + past] = self.filtering[:, of_commands : of_commands + past]
        knows[:, MEASURED] = self.filtering[:, of_commands + past :]
        asks = -self.feedback[:states] @ knows[:states]
        asks[car : car + past - 1] -= self.feedback[states:]
        moves = np.zeros((car, car + past + n))
        moves[:, :car], moves[:, car : car + past - 1] = self.model.a, self.model.b[:, 1:]
        moves += np.outer(self.model.b[:, 0], asks)
        shifted = np.eye(past - 1, car + past + n, car)
        whole = np.vstack([moves, asks[None], shifted, knows])
        return bool(np.abs(np.linalg.eigvals(whole)).max() < 1.0)

    def sensitivity(self) -> float:
        """Return Ms, the largest |1 / (1 + L)| with the loop L broken at the car's input; inf where it is unstable."""
        if not self.is_stable():
            return math.inf
        z = np.exp(1j * math.pi * _GRID)
        commands, n = self.model.b.shape[1], len(self.filtering)
        a, b, _ = self.model.with_commands()
        car = np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a, b.astype(complex))[:, MEASURED, 0]
        first = n + 2 * self.known
        past = 1.0 / z[:, None] ** np.arange(1, commands + 1)
        of_commands = past @ self.filtering[:, first : first + commands].T
        of_sensors = car @ self.filtering[:, first + commands :].T
        states = len(self.feedback) - (commands - 1)
        both = np.stack([of_commands, of_sensors], axis=2)
        found = np.linalg.solve(np.eye(n) - self.filtering[:, :n] / z[:, None, None], both)
        asked = np.einsum("s,fsi->fi", self.feedback[:states], found[:, :states])
        own = 1.0 + asked[:, 0] + past[:, : commands - 1] @ self.feedback[states:]
        return _peak(np.abs(own / (own + asked[:, 1])))


def _peak(values: Floats) -> float:
    """Return the largest value, or that of the parabola through it and its neighbours."""
    i = int(values.argmax())
    if not 0 < i < len(values) - 1:
        return float(values[i])
    before, top, after = (float(one) for one in values[i - 1 : i + 2])
    bend = 2.0 * top - before - after
    return top if bend <= 0.0 else top + 0.125 * (after - before) ** 2 / bend


def moved(weights: Weights, share: float) -> Weights:
    """Return the weights that lie ``share`` of the way from ``weights`` to robust ones."""
    if share == 0.0:
        return weights
    steer = weights.steer ** (1.0 - share) * STEER_DEVIATION**share
    return replace(weights, lag=weights.lag + share * (LAG - weights.lag), steer=steer)


def least_share(sensitivity: Callable[[float], float]) -> float:
    """Return the least share whose Ms keeps the bound, or the one with the least Ms where none does."""
    found = []
    for share in SHARES:
        found.append(sensitivity(share))
        if found[-1] <= BOUND:
            return share
    return SHARES[int(np.argmin(found))]
