"""Yin 2010: the printed gains, the Riccati equations behind them, and what they leave open.

The last slide prints k_c and k_o without speed, car or weights. With R = R_o = 1, no weight on the yaw rate and an
actuator of unit gain, the entries of both Riccati equations can be solved for them. Signs and units are Yin's
(`yin_design`); angles are those of the steering wheel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import control
import numpy as np
from scipy.optimize import brentq, least_squares

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.yin_design import (
    OUTPUTS,
    STEERING_RATIO,
    YinModel,
    control_gains,
    observer_gains,
    printed_weights,
)
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_env.physics.vehicles import VEHICLES

CONTROL: Floats = np.array([0.2994, 2.0638, -13.5262, -0.5271])
OBSERVER: Floats = np.array(
    [
        [0.0051, -0.0049, -0.0593],
        [0.0020, -0.0018, -0.0216],
        [-0.0018, 0.0061, 0.0844],
        [-0.0216, 0.0844, 2.0538],
        [0.0051, -0.0049, -0.0593],
    ]
)
STATES, MEASURED = ("δ_L", "ψ'", "θ_d", "y_d", "δ_s"), ("ψ'", "θ_d", "y_d")
LAST_DIGIT = 1e-4
#: Speed of the printed gains, m/s, and the car's b2, 1/s².
SPEED, B2 = 25.0, 1.8612
#: The decoded car, its stiffnesses to a digit more than the shipped one's.
CAR = replace(VEHICLES["yin"], front_cornering_stiffness=61850.0, rear_cornering_stiffness=107665.0)


def gains(found: Replication) -> None:
    """All 19 printed gains, from the decoded car and weights at 25 m/s; and the speed that they force."""
    model = YinModel.of(CAR)
    feedback, correction = control_gains(model, SPEED), observer_gains(model, SPEED, printed_weights)
    for state, printed, here in zip(STATES[:4], CONTROL, feedback, strict=True):
        found.rows.append(Row(f"k_c of {state}", "last slide", float(printed), float(here), "", 4))
    for i, state in enumerate(STATES):
        for j, measured in enumerate(MEASURED):
            quantity = f"k_o of {state} by {measured}"
            found.rows.append(Row(quantity, "last slide", float(OBSERVER[i, j]), float(correction[i, j]), "", 4))
    speed, either_side = forced_speed()
    quantity = f"speed that k_o forces, ± {either_side:.2f} by its digits"
    found.rows.append(Row(quantity, "(θ_d, y_d) of k_o's Riccati equation, checked", 24.97, speed, "m/s", 2))


def forced_speed() -> tuple[float, float]:
    """Return v and its uncertainty, m/s: -P_ry + v P_θθ = sum of P_θj P_jy, whose every entry is printed."""

    def solved(printed: Floats) -> float:
        block = 0.5 * (printed[1:4] + printed[1:4].T)
        return float((block[1] @ block[:, 2] + block[0, 2]) / block[1, 1])

    most = 0.0
    for i, j in ((1, 1), (1, 2), (2, 2), (0, 2), (0, 1)):
        moved = OBSERVER.copy()
        moved[1 + i, j] += 0.5 * LAST_DIGIT
        if i != j:
            moved[1 + j, i] += 0.5 * LAST_DIGIT
        most += abs(solved(moved) - solved(OBSERVER))
    return solved(OBSERVER), most


@dataclass(frozen=True)
class Decoded:
    """One car and one set of weights that give the printed gains: b_w 1/s, a22/v 1/s, weights of δ_L, θ_d and y_d."""

    actuator: float
    yaw: float
    weights: tuple[float, float, float]

    def model(self) -> YinModel:
        """Return the design model; what the gains do not tell is the shipped car's."""
        return replace(YinModel.of(CAR), a22=self.yaw * SPEED, b2=B2, actuator_rate=self.actuator)


def decoded(steering_weight: float) -> Decoded:
    """Solve the entries of k_c's Riccati equation for a weight on δ_L and `B2`.

    P's first row is k_c/b_w. (δ, δ) gives b_w, then (δ, r), (δ, θ) and (r, r) give a22/v, and the others the weights.
    """
    k1, k2, k3, k4 = CONTROL
    actuator = B2 * 2.0 * k2 / (k1 * k1 + 2.0 * k1 - steering_weight)

    def yaw_entry(yaw: float) -> float:
        p22 = (k2 + k1 * k2 - yaw * k2 / actuator + k3 / actuator) / B2
        p23 = (k3 * (1.0 + k1) - SPEED * k4 / actuator) / B2
        return float(2.0 * (yaw * p22 - p23) - k2 * k2)

    # The quadratic's root on the side of a car that damps its yaw rate.
    yaw = brentq(yaw_entry, -8.0, -3.0)
    p24 = k4 * (1.0 + k1) / B2
    heading = k3 * k3 - 2.0 * SPEED * (yaw * p24 - k2 * k4)
    return Decoded(float(actuator), float(yaw), (steering_weight, float(heading), float(k4 * k4)))


def misses(one: Decoded) -> tuple[float, float]:
    """Return the largest miss of k_c and of k_o, in last digits; k_o's weights fitted."""
    model = one.model()
    delta, heading, lateral = one.weights
    feedback, _, _ = control.lqr(*model.plant(SPEED), np.diag([delta, 0.0, heading, lateral]), np.eye(1))
    a, _ = model.disturbed_plant(SPEED)

    def off(logarithms: Floats) -> Floats:
        correction, _, _ = control.lqr(a.T, OUTPUTS.T, np.diag(np.exp(logarithms)), np.eye(3))
        return np.ravel(correction.T - OBSERVER) / LAST_DIGIT

    fitted = least_squares(off, np.log(np.diag(printed_weights(SPEED)[0])))
    return float(np.abs(np.ravel(feedback) - CONTROL).max() / LAST_DIGIT), float(np.abs(fitted.fun).max())


def open_numbers(found: Replication) -> None:
    """The family over b_w: the printed gains do not tell how quick the actuator is."""
    rows = []
    for weight in (0.0, 0.05, 0.1, 0.2, 0.3):
        one = decoded(weight)
        of_control, of_observer = misses(one)
        numbers = (f"{weight:g}", f"{one.actuator:.2f}", f"{B2:.4f}", f"{one.yaw:.3f}", f"{one.weights[1]:.2f}")
        rows.append((*numbers, f"{of_control:.2f}", f"{of_observer:.2f}"))
    found.tables.append(
        Table(
            "What the printed gains leave open: cars and weights that give them (25 m/s, b_w = −a_w)",
            (
                "weight of δ_L",
                "b_w [1/s]",
                "b2 [1/s²]",
                "a22/v [1/s]",
                "weight of θ_d",
                "k_c misses by [last digits]",
                "k_o misses by [last digits]",
            ),
            tuple(rows),
        )
    )


def steady_errors(found: Replication) -> None:
    """Steady lateral error in a curve of 0.003 1/m at 25 m/s on the reduced plant, with the printed gains."""
    model, curvature = YinModel.of(CAR, STEERING_RATIO), 0.003
    a, b = model.plant(SPEED)
    road = np.array([0.0, 0.0, SPEED * curvature, 0.0])
    alone = np.linalg.solve(a - b @ CONTROL[None], -road)
    observed, inputs = model.disturbed_plant(SPEED)
    outputs = OUTPUTS[:, :4]
    # Plant and observer: u = -k_c x - δ_s, which is the observer's fifth state.
    fifth = np.eye(5)[4][None]
    above = np.hstack([a - b @ CONTROL[None], -b @ fifth])
    below = np.hstack([OBSERVER @ outputs - inputs @ CONTROL[None], observed - OBSERVER @ OUTPUTS - inputs @ fifth])
    both = np.linalg.solve(np.vstack([above, below]), -np.concatenate([road, np.zeros(5)]))
    source = "printed gains on the reduced plant, checked"
    for name, expected, state in (("LQR", 0.804, alone), ("LQR with observer", 0.413, both)):
        quantity = f"steady lateral error of the {name}, 0.003 1/m, 25 m/s"
        found.rows.append(Row(quantity, source, expected, abs(float(state[3])), "m", 3))
