"""The lane-keeping car as a linear system in discrete time, exact from one control step to the next.

Linear single track in path coordinates, ISO signs, at a constant speed v:

    delta' = (u - delta) / lag                      u comes late by the actuator's delay
    beta'  = (F_f + F_r) / (m v) - r                F_f = C_f (delta + o_f - beta - l_f r / v)
    r'     = (l_f F_f - l_r F_r) / J                F_r = C_r (o_r - beta + l_r r / v)
    theta' = r - v kappa
    d'     = v (theta + beta)

with the road-wheel angle delta, sideslip beta, yaw rate r, heading error theta and lateral error d. The slip offsets
o_f and o_r of the axles are what a car of another mass or with other tyres seems to have in a curve. Over a step
commands and offsets are constant, as the environment holds the former, and the curvature kappa runs linearly, as on a
clothoid. Rate and angle limits are not in the model; a car without slip is the limit of stiff tyres, as in
`yin_design`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.yin_design import NO_SLIP
from lanekeep_env.physics.parameters import VehicleParameters

#: Order of the states.
STEER, SIDESLIP, YAW_RATE, HEADING, LATERAL = range(5)
STATES = 5
#: Below this speed, m/s, the car is taken at this speed, as the environment's tyres are.
SLOWEST = 1.0


@dataclass(frozen=True, eq=False)
class StepModel:
    """x[k+1] = A x[k] + sum_j B_j u[k-j] + O (o_f, o_r) + E_0 kappa[k] + E_1 kappa[k+1], exact, at one speed.

    Attributes:
        a: A, shape (5, 5).
        b: B_0 ... B_m side by side, shape (5, m + 1); m is the delay in control steps, rounded up.
        offsets: O, shape (5, 2).
        curvature: E_0 and E_1 side by side, shape (5, 2).
    """

    a: Floats
    b: Floats
    offsets: Floats
    curvature: Floats

    @classmethod
    def of(cls, car: VehicleParameters, speed: float, step: float, slip: bool = True) -> StepModel:
        """Discretise ``car`` at ``speed`` (m/s) with a control ``step`` (s); without ``slip`` it is a kinematic one.

        One matrix exponential for each part of the step: until the delayed command arrives, and from then on.
        """
        rates = _rates(car, max(speed, SLOWEST), slip)
        whole, rest = divmod(round(car.steering.delay * 1e6), round(step * 1e6))
        # Columns: x, o_f, o_r, kappa and its slope, the command that acts first, the one that acts then.
        first = _exponential(rates, 1e-6 * rest, car.steering.lag, STATES + 4)
        then = _exponential(rates, step - 1e-6 * rest, car.steering.lag, STATES + 5)
        whole_step = (then @ first)[:STATES]
        b = np.zeros((STATES, whole + 1 + (rest > 0)))
        b[:, whole] = whole_step[:, -1]
        if rest:
            b[:, whole + 1] = whole_step[:, -2]
        slope = whole_step[:, STATES + 3] / step
        return cls(
            a=whole_step[:, :STATES],
            b=b,
            offsets=whole_step[:, STATES : STATES + 2],
            curvature=np.stack([whole_step[:, STATES + 2] - slope, slope], axis=1),
        )

    def with_commands(self) -> tuple[Floats, Floats, Floats]:
        """Return A, B and O, E_0, E_1 (side by side) of the states (x, u[k-1] ... u[k-m]) with input u[k]."""
        m = self.b.shape[1] - 1
        a = np.zeros((STATES + m, STATES + m))
        a[:STATES, :STATES], a[:STATES, STATES:] = self.a, self.b[:, 1:]
        a[STATES + 1 :, STATES:-1] = np.eye(max(m - 1, 0))
        b = np.zeros((STATES + m, 1))
        b[:STATES, 0] = self.b[:, 0]
        b[STATES : STATES + 1] = 1.0
        known = np.vstack([np.hstack([self.offsets, self.curvature]), np.zeros((m, 4))])
        return a, b, known


def steady_sideslip(car: VehicleParameters, slip: bool) -> tuple[float, float]:
    """Return (c0, c2) of the sideslip (c0 + c2 v²) kappa in a steady curve, rad."""
    stiffness = (1.0 if slip else NO_SLIP) * car.rear_cornering_stiffness
    return car.cg_to_rear_axle, -car.mass * car.cg_to_front_axle / (car.wheelbase * stiffness)


def _rates(car: VehicleParameters, v: float, slip: bool) -> Floats:
    """Rates of beta, r, theta and d over the columns (x, o_f, o_r, kappa), shape (5, 8); delta's row is empty."""
    stiffness = 1.0 if slip else NO_SLIP
    front, rear = np.zeros(STATES + 3), np.zeros(STATES + 3)
    front[[STEER, SIDESLIP, YAW_RATE, STATES]] = 1.0, -1.0, -car.cg_to_front_axle / v, 1.0
    rear[[SIDESLIP, YAW_RATE, STATES + 1]] = -1.0, car.cg_to_rear_axle / v, 1.0
    front *= stiffness * car.front_cornering_stiffness
    rear *= stiffness * car.rear_cornering_stiffness
    rates = np.zeros((STATES, STATES + 3))
    rates[SIDESLIP] = (front + rear) / (car.mass * v)
    rates[SIDESLIP, YAW_RATE] -= 1.0
    rates[YAW_RATE] = (car.cg_to_front_axle * front - car.cg_to_rear_axle * rear) / car.yaw_inertia
    rates[HEADING, [YAW_RATE, STATES + 2]] = 1.0, -v
    rates[LATERAL, [SIDESLIP, HEADING]] = v, v
    return rates


def _exponential(rates: Floats, seconds: float, lag: float, command: int) -> Floats:
    """Return the transition over ``seconds`` while column ``command`` acts, shape (11, 11)."""
    from scipy.linalg import expm

    generator = np.zeros((STATES + 6, STATES + 6))
    generator[:STATES, : STATES + 3] = rates
    generator[STATES + 2, STATES + 3] = 1.0
    if lag > 0.0:
        generator[STEER, STEER], generator[STEER, command] = -1.0 / lag, 1.0 / lag
        return np.asarray(expm(generator * seconds))
    # Without a lag the road wheel is the command that acts.
    generator[:, command] += generator[:, STEER]
    generator[:, STEER] = 0.0
    transition = np.asarray(expm(generator * seconds))
    if seconds > 0.0:
        transition[STEER] = np.eye(STATES + 6)[command]
    return transition
