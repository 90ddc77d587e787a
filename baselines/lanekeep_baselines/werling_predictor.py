"""`werling-lateral-predictor`, and what it knows of where the car will be when the command arrives.

An addition to Werling, Gröll, Bretthauer 2008, whose law knows no actuator. Above some 20 m/s its zero dynamics (sway
and yaw at constant d) are so weakly damped that 100 ms of delay leave no useful bandwidth. As in a Smith predictor the
law sees the state that the commands on their way will have led to when the next one takes effect; unlike one, the
prediction starts from the measured state at every step, through the nonlinear car (1), (3) itself, so that
it needs no stable model, and errors do not add up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.werling import GripScenario, WerlingLateral
from lanekeep_baselines.werling_lateral import SMALLEST, WerlingMeasured, blended_steering
from lanekeep_baselines.werling_tyres import WerlingCar, axle_force, slip_angles

#: Step of the integration at the most, s: at v_k the car's fastest pole is at some 50 1/s.
LONGEST = 0.02


class SteeringPath(NamedTuple):
    """Lag and delay of the steering actuator and the control step, s; the delay is rounded up to whole steps."""

    lag: float
    delay: float
    step: float

    @property
    def queued(self) -> int:
        """Commands that were given and have not reached the lag yet."""
        return math.ceil(self.delay / self.step - 1e-9)


def rates(car: WerlingCar, state: tuple[Floats, ...], steer: Floats, v: Floats, kappa: Floats) -> tuple[Floats, ...]:
    """Return the rates of (d, heading, beta, r) at constant speed, (n,) each: (1) and (3)."""
    d, heading, beta, r = state
    eta, rear_slip = slip_angles(beta, r, v, car.to_front, car.to_rear)
    front = axle_force(steer - beta + eta, car.front_stiffness, car.front_peak)
    rear = axle_force(rear_slip, car.rear_stiffness, car.rear_peak)
    across = front * np.cos(steer - beta) + rear * np.cos(beta)
    course = heading + beta
    along = v * np.cos(course) / np.maximum(1.0 - d * kappa, SMALLEST)
    moment = front * car.to_front * np.cos(steer) - rear * car.to_rear
    return v * np.sin(course), r - kappa * along, across / (car.mass * v) - r, moment / car.yaw_inertia


def _moved(state: tuple[Floats, ...], rate: tuple[Floats, ...], h: float) -> tuple[Floats, ...]:
    return tuple(x + h * change for x, change in zip(state, rate, strict=True))


def predict(
    car: WerlingCar, path: SteeringPath, at: WerlingMeasured, steer: Floats, commands: Floats, kappas: Floats
) -> tuple[WerlingMeasured, Floats]:
    """Return the measurements and the road-wheel angle once the queued commands have run, (n,) each.

    Runge-Kutta of fourth order, a control step each; the lag is solved exactly.

    Args:
        car: the car.
        path: of the command to the road wheel.
        at: measurements now; the speed is held.
        steer: road-wheel angle now, rad.
        commands: given and not arrived yet, the oldest first, rad, (n, m); m = 0 predicts nothing.
        kappas: the path's curvature where the car will be in the middle of each of these steps, 1/m, (n, m).
    """
    h, lag = path.step, path.lag
    half = math.exp(-0.5 * h / lag) if lag > 0.0 else 0.0
    state: tuple[Floats, ...] = (at.d, at.heading, at.beta, at.r)
    for command, kappa in zip(commands.T, kappas.T, strict=True):
        first = command if lag == 0.0 else steer
        middle, last = command + half * (first - command), command + half * half * (first - command)
        a = rates(car, state, first, at.v, kappa)
        b = rates(car, _moved(state, a, 0.5 * h), middle, at.v, kappa)
        c = rates(car, _moved(state, b, 0.5 * h), middle, at.v, kappa)
        e = rates(car, _moved(state, c, h), last, at.v, kappa)
        mean = tuple((w + 2.0 * x + 2.0 * y + z) / 6.0 for w, x, y, z in zip(a, b, c, e, strict=True))
        state, steer = _moved(state, mean, h), last
    d, heading, beta, r = state
    return WerlingMeasured(d, heading, beta, r, at.v), steer


def queue_of(memory: Floats, fresh: NDArray[np.bool_] | bool, steer: Floats) -> Floats:
    """Return the commands on their way, (n, m); rows that start have stood at the present road-wheel angle."""
    return np.where(np.atleast_1d(fresh)[:, None], steer[:, None], memory)


def advance_queue(queue: Floats, command: Floats) -> Floats:
    """Return the queue after ``command`` (n,) was given: the oldest has arrived, (n, m)."""
    return np.concatenate([queue, command[:, None]], axis=1)[:, 1:]


class WerlingLateralPredictor(WerlingLateral):
    """`werling-lateral-predictor`: the same law for the state and the curvature that its command will meet.

    Both are taken where the car will be after the nominal delay and lag and half a control step of held command; on
    the way it drives by the commands that were given, and then by the last of them. To the law the lag is delay as
    well: so regarded, the poles of the loop are the designed ones. Up to v_k the law sees the car where it is, up to
    v_d something between. Rate limits and other faults of the actuator are not foreseen.
    """

    name = "werling-lateral-predictor"
    ahead = True
    reads = (*WerlingLateral.reads, "steering_angle", "steering_command")
    uses = ("curvature_preview_*",)

    def __init__(self, scenario: GripScenario) -> None:
        super().__init__(scenario)
        steering, step = scenario.vehicle.steering, scenario.control_step
        self.memory = SteeringPath(steering.lag, steering.delay, step).queued
        rest, pieces = steering.lag + 0.5 * step, math.ceil(step / LONGEST - 1e-9)
        held = math.ceil(rest / LONGEST - 1e-9)
        self._pieces, self._held = pieces, held
        self._queued = SteeringPath(steering.lag, 0.0, step / pieces)
        self._answer = SteeringPath(steering.lag, 0.0, rest / held)
        arrives = self.memory * step
        self._late = arrives + rest
        # Middles of the pieces of the way.
        self._times = (np.arange(self.memory * pieces) + 0.5) * self._queued.step
        self._times = np.append(self._times, arrives + (np.arange(held) + 0.5) * self._answer.step)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        now = WerlingMeasured(*(at[name] for name in self.reads[:5]))
        # What entered the actuator, not what was asked for: the environment clips.
        last = at["steering_command"]
        queue = advance_queue(queue_of(memory, fresh, at["steering_angle"]), last)
        part = self.tuning.part(now.v)
        # As in the blend, rows that have no use for the prediction show it a harmless state.
        moves = part > 0.0
        start = now._replace(
            beta=np.where(moves, now.beta, 0.0), r=np.where(moves, now.r, 0.0), v=np.maximum(now.v, self.tuning.slow)
        )
        kappas = np.stack([self._curvature(at, np.full_like(last, time)) for time in self._times], axis=1)
        queued, held = np.repeat(queue, self._pieces, axis=1), np.repeat(last[:, None], self._held, axis=1)
        then, steer = predict(self._car, self._queued, start, at["steering_angle"], queued, kappas[:, : -self._held])
        then, _ = predict(self._car, self._answer, then, steer, held, kappas[:, -self._held :])
        seen = WerlingMeasured(*(np.where(moves, x + part * (y - x), x) for x, y in zip(now, then, strict=True)))
        kappa, early = self._curvature(at, part * self._late), self._curvature(at, np.full_like(last, self._late))
        steer, _ = blended_steering(self._car, self.tuning, seen, np.ones_like(kappa), kappa, early=early)
        return steer, queue if self.memory else None
