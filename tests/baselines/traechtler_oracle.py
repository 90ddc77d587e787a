"""The van of Trächtler, Lohmann, Struck 1992 once more, from its geometry alone: nothing of the project is used here.

Angles and errors are positive to the left; the camera looks at the right edge, `SET` from the path. The van rolls
without slip: its rear axle moves along the body's axis at v cos(delta), the body turns at v sin(delta)/l, v is the
front wheel's speed.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

WHEELBASE, AHEAD, LAG, SET = 3.0, 3.5, 0.25, 1.5
REACH = WHEELBASE + AHEAD
K2 = 2.0 * WHEELBASE / REACH**2
K3 = LAG * K2
MOTOR = math.radians(20.0)
GAP = math.radians(2.0)


def stationary(edge_radius: float, turn: int) -> float:
    """Return the rear wheel's steady distance left of the path, m, on a circular edge; turn is +1 to the left.

    On concentric circles: the rear wheel on a radius r, the body's axis along its tangent, the edge's radius seen REACH
    ahead on the line across the axis; the steering angle is the one that r needs and the one that K2 asks for.
    """
    across = math.sqrt(edge_radius**2 - REACH**2)

    def excess(r: float) -> float:
        return K2 * (SET - turn * (across - r)) - turn * math.atan(WHEELBASE / r)

    path = edge_radius - turn * SET
    return turn * (edge_radius - brentq(excess, path - 1.4, path + 1.4)) - SET


def damping(v: float, k2: float, k3: float, wheelbase: float, reach: float, lag: float) -> float:
    """Return the least damping of 1 + (K2 + K3 s) G(s)/(1 + T s), G = (l + f) v/(l s) + v²/(l s²)."""
    plant = np.array([reach * v, v * v]) / wheelbase
    poles = np.roots(np.polyadd([lag, 1.0, 0.0, 0.0], np.polymul([k3, k2], plant)))
    return float(np.min(-poles.real / np.abs(poles)))


class Gear:
    """A motor of limited speed, backlash behind it, and the P loop on the angle of the motor or of the road wheel."""

    def __init__(self, gap: float, on_motor: bool = False) -> None:
        self.half, self.on_motor, self.motor, self.wheel = gap / 2, on_motor, 0.0, 0.0

    def step(self, command: float, h: float) -> float:
        measured = self.motor if self.on_motor else self.wheel
        self.motor += h * max(-MOTOR, min(MOTOR, (command - measured) / LAG))
        self.wheel = min(max(self.wheel, self.motor - self.half), self.motor + self.half)
        return self.wheel


def roll(x: float, y: float, heading: float, v: float, delta: float, h: float) -> tuple[float, float, float]:
    """Return the rear axle's place and the heading after ``h`` seconds."""
    turned = h * v * math.sin(delta) / WHEELBASE
    way, middle = h * v * math.cos(delta), heading + 0.5 * turned
    return x + way * math.cos(middle), y + way * math.sin(middle), heading + turned


def limit_cycle(v: float, on_motor: bool, start: float, metres: float, sample: float, smooth: float) -> float:
    """Return half the peak-to-peak of the edge's distance, m, over the last 40 % of a straight road.

    Controller with a sample time (s) and an exactly discretised filter of the D part, of time constant ``smooth`` (s),
    true on a steady rate.
    """
    h, gear = 2e-3, Gear(GAP, on_motor)
    every, share = round(sample / h), 1.0 - math.exp(-sample / smooth)
    x, y, heading, command = 0.0, SET + start, 0.0, 0.0
    seen: list[float] = []
    filtered = None
    for i in range(round(metres / v / h)):
        distance = (y + REACH * math.sin(heading)) / math.cos(heading)
        if i % every == 0:
            filtered = distance if filtered is None else filtered
            rate = (distance - filtered) * share / sample
            filtered += share * (distance - filtered)
            command = K2 * (SET - distance) - K3 * rate
        seen.append(distance)
        x, y, heading = roll(x, y, heading, v, gear.step(command, h), h)
    last = seen[int(0.6 * len(seen)) :]
    return (max(last) - min(last)) / 2


def blind_turn(
    edge_radius: float, v: float, before: float, after: float, timed: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return station of the rear axle and its distance left of the path, m, over a right turn by 90 degrees.

    All blind (switch S2): the linear model under PD control, driven by the path's curvature REACH ahead of the rear
    axle, gives the command. Straights of ``before`` and ``after`` metres, no backlash; x along the first of them from
    the start of the turn, whose centre is at y = -r. ``timed``: the plan goes by as v t, as in the source, not with the
    rear axle's station.
    """
    h, gear, r = 2e-3 / v, Gear(0.0), edge_radius + SET
    x, y, heading, station = -before, 0.0, 0.0, -before
    e = theta = delta = 0.0  # of the model
    stations, errors = [], []
    while station < r * math.pi / 2 + after:
        if x < 0.0:
            station, error = x, y
        elif y > -r:
            angle = math.atan2(x, y + r)
            station, error = r * angle, math.hypot(x, y + r) - r
        else:
            station, error = r * math.pi / 2 - (y + r), x - r
        stations.append(station)
        errors.append(error)
        planned = (v * h * (len(errors) - 1) - before if timed else station) + REACH
        kappa = -1.0 / r if 0.0 <= planned < r * math.pi / 2 else 0.0
        rate = v * (theta + REACH / WHEELBASE * delta)
        command = -K2 * e - K3 * rate
        x, y, heading = roll(x, y, heading, v, gear.step(command, h), h)
        e += h * rate
        theta += h * v * (delta / WHEELBASE - kappa)
        delta += h * (command - delta) / LAG
    return np.array(stations) + before, np.array(errors)
