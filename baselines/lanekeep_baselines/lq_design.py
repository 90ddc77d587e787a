"""Discrete LQ control with preview and the steady-state Kalman filter, on the exact model of `lq_model`.

The cost is the benchmark's own (`lanekeep_env.tasks.lane_keeping`): over the control steps of length h

    sum_k (d[k] / reference)² + w ((delta[k+1] - delta[k]) / (h reference rate))²,

so it charges the road wheel as it moves behind the actuator, not the command. Its optimum for a known disturbance
x[k+1] = A x[k] + B u[k] + e[k] is (Anderson, Moore, "Optimal control", 1990; Tomizuka, "Optimal continuous finite
preview problem", IEEE TAC 20(3), 1975)

    u[k] = -K x[k] - sum_i M (A_c')^i P e[k+i],    M = (R + B'PB)^-1 B',  A_c = A - B K,

with the Riccati equation's P; a disturbance that stays as it is adds M (1 - A_c')^-1 P e. The cap of the cost is not in
the design.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lanekeep_baselines.lq_model import HEADING, LATERAL, STATES, STEER, YAW_RATE, StepModel
from lanekeep_baselines.policy import Floats

#: Measured states, in the order of the sensors.
MEASURED = (STEER, YAW_RATE, HEADING, LATERAL)
#: Doublings of the horizon after which a Riccati equation is given up: 2^40 control steps.
DOUBLINGS = 40
#: Below this speed, m/s, a road's curvature is not expected to be any larger.
SLOWEST_BEND = 10.0


@dataclass(frozen=True)
class Weights:
    """What the design leaves free.

    Attributes:
        rate: factor of the cost's weight on the steering rate.
        slip: standard deviation of the axles' slip offsets that are new in each step, rad.
        steer: standard deviation of what the road wheel moves in each step beside its model, rad.
        drift: how far the constant slip offsets wander in a second, rad; read where they are estimated.
        bend: standard deviation of the road's curvature as lateral acceleration, m/s²: of its error, new in each step,
            where it is known; of how far it wanders in a second where it is estimated.
        lag: that the actuator is taken to have beyond the nominal one's, s: a reserve for cars that differ.
    """

    rate: float
    slip: float
    steer: float
    drift: float
    bend: float
    lag: float = 0.0


@dataclass(frozen=True)
class Cost:
    """Of a step: (d / lateral)² + weight (steering rate / rate)², in m and rad/s."""

    lateral: float
    weight: float
    rate: float


@dataclass(frozen=True, eq=False)
class Gains:
    """u = -state (x, u[k-1] ... u[k-m]) - offsets (o_f, o_r) - constant kappa, or - sum_i curvature[i] kappa[k+i].

    Attributes:
        state: shape (5 + m,).
        offsets: shape (2,).
        constant: for a curvature that stays as it is, shape (1,).
        curvature: of the curvature now and in each step to come, shape (steps,); the last one also stands for all
            that follow, which are held.
    """

    state: Floats
    offsets: Floats
    constant: Floats
    curvature: Floats


def settled(a: Floats, c: Floats, noise: Floats) -> Floats:
    """Return the covariance X of x[k+1] = A x[k] + w after many measurements C x[k] + v, before the next one.

    X = A X A' - A X C' (1 + C X C')^-1 C X A' + cov(w), for v of covariance 1.
    """
    from scipy.linalg import solve_discrete_are  # here, so that what a policy declares can be read without it

    try:
        return np.asarray(solve_discrete_are(a.T, c.T, noise, np.eye(len(c))))
    except ValueError:  # it cannot order the eigenvalues that some chains of late sensors have
        return doubled(a.T, c.T @ c, noise)


def least_cost(a: Floats, b: Floats, q: Floats, r: Floats, s: Floats) -> Floats:
    """Return the P of the least sum of x'Qx + 2 x'Su + u'Ru over the steps to come, x'Px; one command u."""
    from scipy.linalg import solve_discrete_are

    try:
        return np.asarray(solve_discrete_are(a, b, q, r, s=s))
    except ValueError:  # as above
        now = np.zeros_like(q)
        for _ in a:
            if r.any():
                break
            # A command that is still on its way costs nothing: the cost is counted a step later.
            now, q, s, r = now + q, a.T @ q @ a, s + a.T @ q @ b, r + b.T @ q @ b
        moves = b / r
        return now + doubled(a - moves @ s.T, moves @ b.T, q - s / r @ s.T)


def doubled(a: Floats, g: Floats, h: Floats) -> Floats:
    """Return the X of X = A' X (1 + G X)^-1 A + H by structure-preserving doubling, which orders nothing.

    Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time algebraic Riccati equations", Int.
    J. Control 77(8), 2004: each round doubles the number of steps since nothing was known.
    """
    n = len(a)
    for _ in range(DOUBLINGS):
        moved = np.linalg.solve(np.eye(n) + g @ h, np.hstack([a, g]))
        more = a.T @ h @ moved[:, :n]
        a, g, h = a @ moved[:, :n], g + a @ moved[:, n:] @ a.T, h + more
        if np.abs(more).max() <= 1e-15 * np.abs(h).max():
            return 0.5 * (h + h.T)
    raise ValueError(f"the Riccati equation has no solution within 2^{DOUBLINGS} control steps")


@dataclass(frozen=True, eq=False)
class Stage:
    """A control step of the optimum: z[k+1] = A z[k] + B u[k] + D (o_f, o_r, kappa[k], kappa[k+1]), and what it costs.

    z is (x, u[k-1] ... u[k-m]). Both entries of output z + direct u are squared and added; all steps together cost z'Pz
    at the least, where nothing disturbs.

    Attributes:
        a: shape (n, n).
        b: shape (n, 1).
        known: D, shape (n, 4).
        output: of the lateral error and of the road wheel's move, shape (2, n).
        direct: shape (2, 1).
        p: P, shape (n, n).
        state: the optimum is u = -state z, shape (1, n).
    """

    a: Floats
    b: Floats
    known: Floats
    output: Floats
    direct: Floats
    p: Floats
    state: Floats

    @classmethod
    def of(cls, model: StepModel, cost: Cost, step: float) -> Stage:
        """Solve the Riccati equation for control steps of ``step`` s."""
        a, b, known = model.with_commands()
        n = len(a)
        moves = np.eye(n)[STEER]
        output = np.stack([np.eye(n)[LATERAL] / cost.lateral, np.zeros(n)])
        output[1] = (a[STEER] - moves) * np.sqrt(cost.weight) / (step * cost.rate)
        direct = np.array([[0.0], [b[STEER, 0] * np.sqrt(cost.weight) / (step * cost.rate)]])
        q, s, r = output.T @ output, output.T @ direct, direct.T @ direct
        p = least_cost(a, b, q, r, s)
        inverse = 1.0 / (r + b.T @ p @ b)
        return cls(a, b, known, output, direct, p, inverse @ (b.T @ p @ a + s.T))

    def ahead(self) -> Floats:
        """M, shape (1, n): what a disturbance of the next step asks of the command is M P e."""
        return np.asarray(self.b.T / (self.direct.T @ self.direct + self.b.T @ self.p @ self.b))

    def closed(self) -> Floats:
        """A of the optimal loop, shape (n, n)."""
        return np.asarray(self.a - self.b @ self.state)


def gains(model: StepModel, cost: Cost, step: float, steps: int = 1) -> Gains:
    """Solve the Riccati equation for control steps of ``step`` s; the curvature is known at ``steps`` >= 1 of them."""
    stage = Stage.of(model, cost, step)
    closed, ahead = stage.closed().T, stage.ahead()  # M (A_c')^i
    disturbance = stage.p @ stage.known
    held = (ahead @ np.linalg.solve(np.eye(len(closed)) - closed, disturbance))[0]
    curvature = np.zeros(steps)
    for i in range(steps - 1):
        now, following = (ahead @ disturbance)[0, 2:]
        curvature[i] += now
        curvature[i + 1] += following
        ahead = ahead @ closed
    constant = held[2:3] + held[3:]
    curvature[-1] = constant[0] - curvature[:-1].sum()
    return Gains(stage.state[0], held[:2], constant, curvature)


def on_samples(curvature: Floats, step: float, samples: int, interval: float) -> Floats:
    """Turn gains of control steps into gains of ``samples`` an ``interval`` (s) apart, linear between, held behind."""
    times = step * np.arange(len(curvature))
    shares = [np.interp(times, interval * np.arange(samples), one) for one in np.eye(samples)]
    return np.array(shares) @ curvature


@dataclass(frozen=True)
class Measuring:
    """What the sensors make of the measured states.

    Attributes:
        noise: standard deviations, rad, rad/s, rad and m.
        late: control steps from an event to its sample.
    """

    noise: tuple[float, ...]
    late: tuple[int, ...]


@dataclass(frozen=True)
class Estimated:
    """The model with the constants that a filter estimates beside the states.

    Attributes:
        offsets: the slip offsets of the axles.
        curvature: the road's; otherwise it is known.
    """

    offsets: bool
    curvature: bool

    @property
    def states(self) -> int:
        """Numbers that are estimated."""
        return STATES + 2 * self.offsets + self.curvature

    def filter(self, model: StepModel, weights: Weights, measuring: Measuring, speed: float, step: float) -> Floats:
        """Return F of x[k] = F (x[k-1], kappa[k-1], kappa[k], u[k-1] ... u[k-1-m], y[k]), the steady Kalman filter.

        The curvatures are there only where they are known. Behind the states, x holds what late sensors are still to
        tell, each channel's from the newest to the oldest. Shape (n, n + 2 + m + 1 + 4) or two less.
        """
        n, known = self.states + sum(measuring.late), self.states
        a, constant = np.zeros((n, n)), model.curvature.sum(axis=1)
        a[:STATES, :STATES], a[STATES:known, STATES:known] = model.a, np.eye(known - STATES)
        noise = np.zeros((n, n))
        noise[:STATES, :STATES] = weights.slip**2 * model.offsets @ model.offsets.T
        noise[STEER, STEER] = weights.steer**2
        bend = weights.bend / max(speed, SLOWEST_BEND) ** 2
        if self.offsets:
            a[:STATES, STATES : STATES + 2] = model.offsets
            noise[STATES : STATES + 2, STATES : STATES + 2] = weights.drift**2 * step * np.eye(2)
        if self.curvature:
            a[:STATES, known - 1] = constant
            noise[known - 1, known - 1] = bend**2 * step
        else:
            noise[:STATES, :STATES] += bend**2 * np.outer(constant, constant)
        shown = list(MEASURED)
        for i, steps in enumerate(measuring.late):
            for _ in range(steps):
                a[known, shown[i]] = 1.0
                shown[i], known = known, known + 1
        # In units of its noise: scipy then solves the equation whatever the weights are.
        deviations = np.array(measuring.noise)
        measured = np.eye(n)[shown] / deviations[:, None]
        covariance = settled(a, measured, noise)
        seen = covariance @ measured.T
        correction = np.linalg.solve(measured @ seen + np.eye(len(MEASURED)), seen.T).T
        inputs = model.b if self.curvature else np.hstack([model.curvature, model.b])
        inputs = np.vstack([inputs, np.zeros((n - STATES, inputs.shape[1]))])
        kept = np.eye(n) - correction @ measured
        return np.hstack([kept @ a, kept @ inputs, correction / deviations])
