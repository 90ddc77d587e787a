"""The source's car in world coordinates, to judge the laws by: forces in body axes, paths as curves in the plane."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

MASS, INERTIA, FRONT, REAR, FRONT_STIFFNESS, REAR_STIFFNESS = 1950.0, 3200.0, 1.20, 1.51, 90e3, 120e3
WHEELBASE = FRONT + REAR
LAG, STEP = 0.05, 0.02


def peaks(friction: float) -> tuple[float, float]:
    load = friction * MASS * 9.81 / WHEELBASE
    return load * REAR, load * FRONT


def tyre(slip, stiffness, peak):
    return peak * np.sin(1.5 * np.arctan(stiffness / (1.5 * peak) * slip))


def body_rates(beta, r, steer, v, friction=1.0):
    """Return beta', r' and the acceleration across the course, from the forces on the body."""
    front_peak, rear_peak = peaks(friction)
    forward, left = v * np.cos(beta), v * np.sin(beta)
    front = tyre(steer - np.arctan2(left + FRONT * r, forward), FRONT_STIFFNESS, front_peak)
    rear = tyre(-np.arctan2(left - REAR * r, forward), REAR_STIFFNESS, rear_peak)
    along, across = -front * np.sin(steer), front * np.cos(steer) + rear
    acceleration = (across * np.cos(beta) - along * np.sin(beta)) / MASS
    return acceleration / v - r, (FRONT * front * np.cos(steer) - REAR * rear) / INERTIA, acceleration


def world_rates(x, y, psi, beta, r, steer, v, friction=1.0):
    """Return the rates of (x, y, psi, beta, r)."""
    beta_rate, r_rate, _ = body_rates(beta, r, steer, v, friction)
    return v * np.cos(psi + beta), v * np.sin(psi + beta), r, beta_rate, r_rate


class LaneChange:
    """y = rise (10 t³ - 15 t⁴ + 6 t⁵), t = x/length from 0 to 1, straight before and behind."""

    def __init__(self, rise: float, length: float) -> None:
        t = np.polynomial.Polynomial([0.0, 1.0 / length])
        self._y = rise * (10.0 * t**3 - 15.0 * t**4 + 6.0 * t**5)
        self._slope, self._bend, self._rise, self._length = self._y.deriv(), self._y.deriv(2), rise, length

    def _at(self, x: float) -> tuple[float, float, float]:
        if 0.0 <= x <= self._length:
            return float(self._y(x)), float(self._slope(x)), float(self._bend(x))
        return (self._rise if x > 0.0 else 0.0), 0.0, 0.0

    def errors(self, x: float, y: float, psi: float, guess: float) -> tuple[float, float, float, float]:
        """Return lateral and heading error, curvature, and x of the nearest point."""
        for _ in range(20):
            height, slope, bend = self._at(guess)
            change = ((x - guess) + (y - height) * slope) / (1.0 + slope**2 - (y - height) * bend)
            guess += change
            if abs(change) < 1e-13:
                break
        height, slope, bend = self._at(guess)
        root = math.hypot(1.0, slope)
        return ((y - height) - (x - guess) * slope) / root, psi - math.atan(slope), bend / root**3, guess


class Circle:
    """Through the origin, to the left, as `LaneChange`."""

    def __init__(self, curvature: float) -> None:
        self._curvature = curvature

    def errors(self, x: float, y: float, psi: float, guess: float) -> tuple[float, float, float, float]:
        radius = 1.0 / self._curvature
        bearing = math.atan2(x, radius - y)
        error = math.remainder(psi - bearing, 2.0 * math.pi)
        return radius - math.hypot(x, radius - y), error, self._curvature, guess


class Drive(NamedTuple):
    """At each control step: d, beta, whether the law was limited; the largest lateral acceleration within."""

    d: np.ndarray
    beta: np.ndarray
    limited: np.ndarray
    acceleration: np.ndarray


#: (d, heading error, beta, r, v, kappa) to the steering and whether it is limited.
Law = Callable[[float, float, float, float, float, float], tuple[float, bool]]


def drive(law: Law, path, start: tuple[float, float], v: float, seconds: float, friction: float = 1.0) -> Drive:
    """Drive a path at 50 Hz through the lag, from (x, y) with no heading, by Runge-Kutta in steps of 2.5 ms."""
    state, steer, guess, rows = np.array([*start, 0.0, 0.0, 0.0]), 0.0, start[0], []
    h = STEP / 8.0
    for _ in range(round(seconds / STEP)):
        d, heading, curvature, guess = path.errors(*state[:3], guess)
        command, limited = law(d, heading, state[3], state[4], v, curvature)
        largest, beta = 0.0, state[3]
        for _ in range(8):
            middle = command + (steer - command) * math.exp(-0.5 * h / LAG)
            last = command + (steer - command) * math.exp(-h / LAG)
            largest = max(largest, abs(body_rates(state[3], state[4], steer, v, friction)[2]))
            a = np.array(world_rates(*state, steer, v, friction))
            b = np.array(world_rates(*(state + 0.5 * h * a), middle, v, friction))
            c = np.array(world_rates(*(state + 0.5 * h * b), middle, v, friction))
            e = np.array(world_rates(*(state + h * c), last, v, friction))
            state, steer = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + e), last
        rows.append((d, beta, limited, largest))
    return Drive(*np.array(rows).T)


def linear_car(v: float) -> np.ndarray:
    """A, B side by side, (4, 5): (d, heading, beta, r) on a straight with the road-wheel angle as input."""
    front = FRONT_STIFFNESS * np.array([0.0, 0.0, -1.0, -FRONT / v, 1.0])
    rear = REAR_STIFFNESS * np.array([0.0, 0.0, -1.0, REAR / v, 0.0])
    slip = (front + rear) / (MASS * v) - np.array([0.0, 0.0, 0.0, 1.0, 0.0])
    turn = (FRONT * front - REAR * rear) / INERTIA
    return np.array([[0.0, v, v, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0], slip, turn])


def gradient(law: Callable[[np.ndarray], float], size: int) -> np.ndarray:
    """Return the gains of a law about zero, by central differences."""
    return np.array([(law(1e-6 * e) - law(-1e-6 * e)) / 2e-6 for e in np.eye(size)])


def spectral_radius(law: Callable[[np.ndarray], float], v: float, delay: float) -> float:
    """Of the sampled loop through delay and lag; the law sees (d, heading, beta, r, steer, queued commands...)."""
    queued = round(delay / STEP)
    a = np.zeros((6, 6))
    a[:4, :5], a[4, 4:] = linear_car(v), (-1.0 / LAG, 1.0 / LAG)
    held = expm(a * STEP)[:5]
    loop = np.zeros((5 + queued, 5 + queued))
    loop[:5, :5] = held[:, :5]
    gains = gradient(law, 5 + queued)
    if queued:
        loop[:5, 5] = held[:, 5]
        loop[5:-1, 6:] = np.eye(queued - 1)
        loop[-1] = gains
    else:
        loop += np.outer(held[:, 5], gains)
    return float(np.abs(np.linalg.eigvals(loop)).max())


def reverse(law, curvature, v: float, seconds: float, lag: float) -> np.ndarray:
    """Back a slipless car up along curvature(s), s falling from 0, at 50 Hz through a lag; return d of the rear axle.

    The law sees (d, heading, s).
    """
    state, steer, h, found = np.zeros(3), math.atan(WHEELBASE * curvature(0.0)), STEP / 8.0, []

    def rates(x: np.ndarray, angle: float) -> np.ndarray:
        along = v * math.cos(x[2]) / (1.0 - x[1] * curvature(x[0]))
        return np.array([along, v * math.sin(x[2]), v * math.tan(angle) / WHEELBASE - curvature(x[0]) * along])

    for _ in range(round(seconds / STEP)):
        found.append(state[1])
        command = law(state[1], state[2], state[0])
        for _ in range(8):
            middle = command + (steer - command) * math.exp(-0.5 * h / lag)
            last = command + (steer - command) * math.exp(-h / lag)
            a = rates(state, steer)
            b = rates(state + 0.5 * h * a, middle)
            c = rates(state + 0.5 * h * b, middle)
            state, steer = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + rates(state + h * c, last)), last
    return np.array(found)
