"""Model predictive control with preview of the road: the optimum of the running cost within the limits of the car.

Tyres that saturate are taken about the steady driving that the road ahead asks for, where linear ones with slip offsets
corner as they do (`slip_offsets`): the model varies along the horizon, and its feedback is that of small slip.

The opponent that the field expects beside LQ and learned policies. Source of the form: Rawlings, Mayne, Diehl, "Model
Predictive Control", 2nd ed., 2017, chapters 1 and 2; the program is solved by daqp (Arnström, Bemporad, Axehill, "A
dual active-set solver for embedded quadratic programming using recursive LDL' updates", IEEE TAC 67(8), 2022).
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from lanekeep_baselines.lq import CostScenario, LqPreview
from lanekeep_baselines.lq_design import MEASURED, Weights
from lanekeep_baselines.lq_model import SIDESLIP, STATES, STEER, YAW_RATE, StepModel
from lanekeep_baselines.lq_schedule import SPEEDS
from lanekeep_baselines.mpc_problem import Limits, Problem
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.slip_offsets import SlipOffsets
from lanekeep_baselines.table import Table, weighted_sum


class LimitedScenario(CostScenario, Protocol):
    """What a controller that keeps within the car's limits may know besides."""

    @property
    def tyre(self) -> str: ...
    @property
    def friction(self) -> float: ...


class MpcPreview(LqPreview):
    """`mpc-preview`: `lq-preview` within the limits of steering angle, steering rate and friction.

    Where the optimum meets no limit within the horizon, which is the road ahead that is shown, it is the command; where
    it does, a quadratic program of the horizon's commands is solved, at the nearest design speed.
    """

    name = "mpc-preview"
    packages = (*LqPreview.packages, "daqp")

    def __init__(self, scenario: LimitedScenario, weights: Weights | None = None) -> None:
        super().__init__(scenario, weights)
        steering = scenario.vehicle.steering
        self._fastest = rate = math.inf if steering.rate_limit is None else steering.rate_limit
        if scenario.action == "steering_rate":
            rate = min(rate, scenario.max_steering_rate)
        angle = min(scenario.max_steering_angle, steering.angle_limit or math.inf)
        saturates = scenario.tyre != "linear" and self._design.slip
        self._limits = Limits(angle, rate, scenario.friction if saturates else math.inf)
        self._offsets = None
        if saturates:
            self._offsets = SlipOffsets(scenario.vehicle, scenario.friction, scenario.tyre == "load_sensitive")
        self._lag = steering.lag
        # From samples of the road to the curvature at the horizon's steps: linear between them, held behind.
        samples = len(self._samples)
        ends = self._design.step * np.arange(self._design.steps)
        places = scenario.preview_interval * np.arange(samples)
        self._ahead = np.array([np.interp(ends, places, one) for one in np.eye(samples)])
        if self._offsets is not None:
            self._design_offsets()

    def _design_offsets(self) -> None:
        """Design what slip offsets change of the estimates, and of the command."""
        on_time = np.array([steps == 0 for steps in self._late])[:, None]
        corrections = self._filter(SPEEDS)[:, -len(MEASURED) :]
        followed, asked = [], []
        for i, correction in enumerate(corrections):
            car, problem = self._design.reserving(self._moved[i]), self._problem(i)
            moves = StepModel.of(car, float(SPEEDS[i]), self._design.step, self._design.slip).offsets
            new = -correction.T @ (moves[list(MEASURED)] * on_time)
            new[:STATES] += moves
            followed.append(new.T)
            known = STATES + self._on_the_way
            asked.append(problem.free[0, known : known + 2 * self._design.steps])
        self._followed_offsets, self._asked_offsets = Table(SPEEDS, np.stack(followed)), Table(SPEEDS, np.stack(asked))

    def _start(self, measured: list[Floats], speed: Floats) -> list[Floats]:
        start = super()._start(measured, speed)
        if self._offsets is not None:
            start[SIDESLIP] = start[SIDESLIP] + self._offsets(speed * start[YAW_RATE])[1]
        return start

    def _follow(self, speed: Floats, inputs: list[Floats]) -> Floats:
        followed = super()._follow(speed, inputs)
        if self._offsets is not None:
            _, curvature, *_ = inputs
            offsets = self._offsets(speed * speed * 0.5 * (curvature[:, 0] + curvature[:, 1]))
            followed = followed + weighted_sum(self._followed_offsets(speed), np.stack(offsets, axis=1))
        return followed

    def steer(self, speed: Floats, seen: Floats) -> Floats:
        commands = super().steer(speed, seen)
        states = STATES + self._on_the_way
        ahead = np.array([one @ self._ahead for one in seen[:, states:]])
        offsets = np.zeros((len(seen), 2 * self._design.steps))
        if self._offsets is not None:
            middle = 0.5 * (ahead + np.concatenate([ahead[:, 1:], ahead[:, -1:]], axis=1))
            offsets[:, ::2], offsets[:, 1::2] = self._offsets((speed * speed)[:, None] * middle)
            commands = commands + weighted_sum(self._asked_offsets(speed), offsets)
        known = np.concatenate([seen[:, :states], offsets, ahead], axis=1)
        for i, nearest in enumerate(np.abs(speed[:, None] - SPEEDS).argmin(axis=1)):
            problem, t = self._problem(int(nearest)), known[i]
            if problem.meets(t):
                commands[i] = self._asked(problem.limited(t), t[STEER])
        return commands

    def _problem(self, design: int) -> Problem:
        of, speed = self._design, float(SPEEDS[design])
        car = of.reserving(self._moved[design])
        return Problem.of(car, speed, of.step, of.slip, of.cost, of.steps, self._limits)

    def _asked(self, command: float, angle: float) -> float:
        """Return what to ask of a rate-limited actuator, so that it goes as far in a step as ``command`` means it to.

        The program's actuator has a lag and no limit within the step. The true one goes no faster than it can before it
        lags, and would fall a little short.
        """
        rate, lag = self._fastest, self._lag
        if not (math.isfinite(rate) and lag > 0.0 and self._on_the_way == 0 and abs(command - angle) > rate * lag):
            return command
        from scipy.optimize import brentq

        step = self._design.step
        far = min(abs(command - angle) * -math.expm1(-step / lag) / rate, (1.0 - 1e-9) * step)
        # Fastest for a time t, then as the lag goes: t + lag (1 - exp(-(step - t) / lag)) = far, all in s.
        t = brentq(lambda t: t - lag * math.expm1((t - step) / lag) - far, 0.0, step)
        return angle + math.copysign(rate * (lag + t), command - angle)
