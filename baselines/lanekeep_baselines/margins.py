"""How far a loop is from instability: gain, phase, delay and camera-latency margin, sensitivity and damping.

    >>> from lanekeep_baselines import make
    >>> from lanekeep_env.scenario import LaneKeepScenario
    >>> scenario = LaneKeepScenario()
    >>> found = margins(make("yin-lqr", scenario), scenario, speed=25.0)
    >>> found.stable, found.phase > 1.0
    (True, True)

The loop is broken at the car's input, behind the channel that shows the command: an actuator that turns the road wheel
further or later than it was told is what gain, phase and delay margin speak of. All of it is in discrete time, as the
loop is; frequencies go up to half the rate of the control steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.linearised import CAMERA, System, called, car_of, policy_of
from lanekeep_baselines.lq_model import LATERAL, SLOWEST
from lanekeep_baselines.policy import Floats
from lanekeep_env.checks import require
from lanekeep_env.physics.integrate import LARGEST_SPEED

#: Points of the grid between the slowest frequency (rad/s) and half the rate of the control steps.
_POINTS, _LOWEST = 4000, 1e-3
#: A mode is part of the loop if a disturbance of the command reaches it, and the command or the lateral error show it.
_SEEN = 1e-9
#: Modes that die within a step or two have no damping of interest.
_GONE = 1e-3


@dataclass(frozen=True)
class Margins:
    """Of one loop at one speed; what does not exist (no such frequency) is infinite, or 0 for ``lowest_gain``.

    Attributes:
        speed: m/s.
        stable: whether the loop is. Where it is not, the margins are those of its curve, and say little.
        damping: the least damping ratio of its modes, negative where it is unstable.
        gain: factor of the actuator's gain at which the loop becomes unstable, above 1.
        lowest_gain: the same below 1.
        phase: rad that the loop may lose.
        delay: s that the actuator may be late, beyond what the car is known to have.
        camera_delay: s that lateral and heading error may be late, beyond what the sensors are known to be.
        sensitivity: the largest |1/(1 + L)|, Ms.
    """

    speed: float
    stable: bool
    damping: float
    gain: float
    lowest_gain: float
    phase: float
    delay: float
    camera_delay: float
    sensitivity: float


def check_speed(speed: float) -> None:
    """Raise ValueError for a speed (m/s) at which there is no linear car."""
    require("speed", speed, "m/s", at_least=SLOWEST, at_most=LARGEST_SPEED)


def margins(policy: Any, scenario: Any, speed: float) -> Margins:
    """Return the margins of a policy on the nominal car of ``scenario`` around straight driving.

    Args:
        policy: any object with ``predict(observation, state, episode_start)``, classical, learned or your own.
        scenario: of `LaneKeep-v0`, or of another id whose channels straight driving decides; its ``sensors`` and its
            steering are part of the loop.
        speed: m/s.

    Raises:
        ValueError: a speed below 1 or above 100 m/s, or a loop that cannot be linearised there (see `linearised`).
    """
    check_speed(speed)
    loop = Loop.of(policy, scenario, speed)
    grid = np.geomspace(_LOWEST, math.pi / loop.step, _POINTS)
    curve, seen = loop.at(grid), loop.camera_at(grid)
    gains = _gains(loop.at, grid, curve)
    above, below = [one for one in gains if one > 1.0], [one for one in gains if one < 1.0]
    phase, delay = _phase_and_delay(loop.at, grid, curve)
    damping = loop.damping()
    return Margins(
        speed=speed,
        stable=damping > 0.0,
        damping=damping,
        gain=min(above, default=math.inf),
        lowest_gain=max(below, default=0.0),
        phase=phase,
        delay=delay,
        camera_delay=_phase_and_delay(loop.camera_at, grid, seen)[1],
        sensitivity=_sensitivity(loop.at, grid, curve),
    )


@dataclass(frozen=True, eq=False)
class Loop:
    """A car and its policy; 1 + L = 0 is the closed loop's equation."""

    car: System
    policy: System
    camera: NDArray[np.bool_]

    @classmethod
    def of(cls, policy: Any, scenario: Any, speed: float) -> Loop:
        """Linearise both."""
        known, channels = policy_of(policy, scenario, speed)
        if not channels:
            raise ValueError(f"policy {called(policy)!r} reads nothing of the car: there is no loop")
        return cls(car_of(scenario, speed, channels), known, np.array([name in CAMERA for name in channels]))

    @property
    def step(self) -> float:
        """Control step, s."""
        return self.car.step

    def at(self, frequencies: Floats) -> NDArray[np.complex128]:
        """L, broken at the car's input, at ``frequencies`` (rad/s), shape (n,)."""
        return -(self.policy.response(frequencies) @ self.car.response(frequencies))[:, 0, 0]

    def camera_at(self, frequencies: Floats) -> NDArray[np.complex128]:
        """L, broken at the camera, with the other sensors' loop closed."""
        parts = self.policy.response(frequencies)[:, 0, :] * self.car.response(frequencies)[:, :, 0]
        return -parts[:, self.camera].sum(axis=1) / (1.0 - parts[:, ~self.camera].sum(axis=1))

    def closed(self) -> Floats:
        """A of the closed loop: states of the car, then of the policy."""
        car, policy = self.car, self.policy
        return np.block(
            [
                [car.a + car.b @ policy.d @ car.c, car.b @ policy.c],
                [policy.b @ car.c, policy.a],
            ]
        )

    def damping(self) -> float:
        """Least damping ratio of the modes that a disturbance of the command moves and that can be seen."""
        closed = self.closed()
        n = len(self.car.a)
        values, right = np.linalg.eig(closed)
        left = np.linalg.pinv(right)
        disturbed = np.concatenate([self.car.b[:, 0], np.zeros(len(closed) - n)])
        shown = np.zeros((2, len(closed)))
        shown[0, :n], shown[0, n:] = (self.policy.d @ self.car.c)[0], self.policy.c[0]
        shown[1, LATERAL] = 1.0
        share = np.abs(left @ disturbed) * np.abs(shown @ right).max(axis=0)
        counted = values[(share > _SEEN * share.max()) & (np.abs(values) > _GONE)]
        poles = np.log(counted.astype(complex))
        return float((-poles.real / np.maximum(np.abs(poles), 1e-12)).min(initial=1.0))


_Response = Callable[[Floats], NDArray[np.complex128]]


def _gains(response: _Response, grid: Floats, curve: NDArray[np.complex128]) -> list[float]:
    """Factors that bring the curve through -1."""
    crossings = [
        _root(lambda w: float(response(np.array([w]))[0].imag), grid[i], grid[i + 1])
        for i in _changes(curve.imag)
        if min(curve[i].real, curve[i + 1].real) < 0.0
    ]
    # At the end of the grid the response of a loop in discrete time is real.
    values = [complex(response(np.array([w]))[0]) for w in crossings] + [complex(curve[-1])]
    return [1.0 / abs(value) for value in values if value.real < 0.0]


def _phase_and_delay(response: _Response, grid: Floats, curve: NDArray[np.complex128]) -> tuple[float, float]:
    """The least phase (rad) and delay (s) that bring the curve through -1."""
    phase, delay = math.inf, math.inf
    for i in _changes(np.abs(curve) - 1.0):
        w = _root(lambda w: float(np.abs(response(np.array([w]))[0])) - 1.0, grid[i], grid[i + 1])
        left = (math.pi + float(np.angle(response(np.array([w]))[0]))) % (2.0 * math.pi)
        phase = min(phase, left, 2.0 * math.pi - left)
        delay = min(delay, left / w)
    return phase, delay


def _sensitivity(response: _Response, grid: Floats, curve: NDArray[np.complex128]) -> float:
    from scipy.optimize import minimize_scalar

    i = int(np.abs(1.0 + curve).argmin())
    ends = grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)]
    found = minimize_scalar(lambda w: float(np.abs(1.0 + response(np.array([w]))[0])), bounds=ends, method="bounded")
    return 1.0 / min(float(found.fun), float(np.abs(1.0 + curve[i])))


def _changes(values: Floats) -> NDArray[np.intp]:
    return np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)


def _root(of: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq  # here, so that what a policy declares can be read without it

    return float(brentq(of, low, high))
