"""A car whose tyres know their loads, pushed by bank and wind, written for the tests with numpy and scipy alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from two_track_oracle import GRAVITY, SHAPE, tyre

STATE = ("lateral_error", "heading_error", "sideslip", "yaw_rate", "speed")
_SECANT = (1.0 + 2.0 / SHAPE**2) / 3.0


class LoadedAxles:
    """Both wheels of an axle have one slip angle; their loads are those of a rigid body, solved with the forces.

    ``wind`` is (speed to the left, density/2 times area, lever); ``holds`` the speed that a driver makes up for, or
    None where it is imposed. ``mass``, ``friction``, ``front`` and ``rear`` are factors that may change on the way.
    """

    def __init__(self, car: Any, bank: float, wind: tuple[float, float, float], holds: float | None) -> None:
        self.car, self.bank, self.wind, self.holds = car, bank, wind, holds
        self.mass = self.friction = self.front = self.rear = 1.0
        self._across = self._drag = 0.0

    def step(self, state: Any, steer: float, seconds: float) -> Any:
        """The state (d, theta, beta, r, v) on a straight road ``seconds`` later."""
        return solve_ivp(self._rates, (0.0, seconds), state, args=(steer,), rtol=1e-8, atol=1e-10).y[:, -1]

    def _axle(self, axle: int, slip: float, pull: float) -> tuple[float, float]:
        """Forces of the left and the right wheel, N; by their peaks of that of the axle."""
        car, mass = self.car, self.mass * self.car.mass
        arms = car.cg_to_rear_axle, car.cg_to_front_axle
        share = (car.front_roll_stiffness, 1.0 - car.front_roll_stiffness)[axle]
        weight = 0.5 * GRAVITY / car.wheelbase * arms[axle]
        moved = (pull - self._drag) * car.height / car.wheelbase / 2.0 * (-1.0, 1.0)[axle]
        half = mass * (weight * math.cos(self.bank) + moved)
        lift = share * mass * self._across * car.height / car.track
        u = pull / (self.friction * GRAVITY * math.cos(self.bank))
        left = math.sqrt(1.0 - u * u)
        own = 0.5 * (self.front * car.front_cornering_stiffness, self.rear * car.rear_cornering_stiffness)[axle]
        stiffness, peaks = 0.0, []
        for load in (half - lift, half + lift):
            n = load / (car.mass * weight)
            lost = car.stiffness_load_sensitivity * (n - 1.0)
            stiffness += own * n * (1.0 - lost) * (1.0 - _SECANT * (1.0 - left))
            peaks.append(self.friction * (1.0 - car.friction_load_sensitivity * (n - 1.0)) * load * left)
        force = tyre(slip, stiffness, sum(peaks)) / sum(peaks)
        return force * peaks[0], force * peaks[1]

    def _rates(self, _: float, state: Any, steer: float) -> list[float]:
        _, theta, beta, r, v = state
        car, mass = self.car, self.mass * self.car.mass
        along, across = v * math.cos(beta), v * math.sin(beta)
        a, b = car.cg_to_front_axle, car.cg_to_rear_axle
        slips = steer - math.atan2(across + a * r, along), -math.atan2(across - b * r, along)
        pull = 0.0 if self.holds is None else self.holds - v
        for _ in range(60):  # the loads follow from the forces that follow from the loads
            wheels = [self._axle(axle, slips[axle], pull) for axle in (0, 1)]
            front, rear = sum(wheels[0]), sum(wheels[1])
            before = self._across
            self._across = (front * math.cos(steer - beta) + rear * math.cos(beta)) / mass
            if self.holds is not None:
                self._drag = (front * math.sin(steer - beta) - rear * math.sin(beta)) / mass
            if abs(self._across - before) < 1e-9:
                break
        crosswind, area, lever = self.wind
        blown = area * math.hypot(along, crosswind - across) * (crosswind - across)
        push = blown - mass * GRAVITY * math.sin(self.bank)
        turn = a * front * math.cos(steer) - b * rear + blown * lever
        turn += 0.5 * car.track * math.sin(steer) * (wheels[0][0] - wheels[0][1])
        turning = (self._across + push * math.cos(beta) / mass) / v - r
        slowed = 0.0 if self.holds is None else pull - self._drag
        return [v * math.sin(theta + beta), r, turning, turn / (self.mass * car.yaw_inertia), slowed]


def off(found: Any, expected: Any) -> Any:
    """Largest difference over the largest value, by column."""
    found, expected = np.array(found, dtype=float), np.array(expected, dtype=float)
    return np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)
