"""Driving a camera-guided van where it sees no edge, by the planned curvature of the road.

Source: Trächtler, Lohmann, Struck, "Regelung der Querbewegung eines kamerageführten Straßenfahrzeugs", 1992, section 4
(model-based feedforward, switches S1 and S2); the exact inverse is an extension.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.traechtler import CameraScenario, TraechtlerPd
from lanekeep_env.sensing.faults import Sensors


class PlanScenario(CameraScenario, Protocol):
    """What a controller that knows the planned curvature may know besides."""

    @property
    def plan_spacing(self) -> float: ...


class ReckonedScenario(PlanScenario, Protocol):
    """What a controller that observes the camera's delay may know besides."""

    @property
    def sensors(self) -> Sensors: ...


def _plan(scenario: PlanScenario) -> list[str]:
    """Return the channels of the planned curvature."""
    return [channel.name for channel in scenario.channels if channel.name.startswith("planned_curvature_")]


def _lacking_plan(scenario: PlanScenario) -> str:
    samples, reach = len(_plan(scenario)), scenario.vehicle.wheelbase + scenario.camera.look_ahead
    if (samples - 1) * scenario.plan_spacing >= reach:
        return ""
    return (
        f"the planned curvature up to {reach:g} m ahead of the rear axle; plan={samples} samples of "
        f"plan_spacing={scenario.plan_spacing:g} m end before"
    )


def _lacking_middle(scenario: PlanScenario) -> str:
    if all(channel.name != "set_distance" for channel in scenario.channels):
        return ""
    return "the path of the plan to be the one that is to be driven: leave set_points out"


class Planned(TraechtlerPd):
    """What both policies share: the planned curvature, read where it is wanted."""

    reads = ("edge_distance", "edge_valid", "speed", "steering_angle")
    uses: ClassVar[tuple[str, ...]] = ("planned_curvature_*", "set_distance")
    needs: ClassVar[tuple[Need, ...]] = (Need("a plan up to the camera's point", _lacking_plan),)

    def __init__(self, scenario: PlanScenario) -> None:
        super().__init__(scenario)
        self._plan_names, self._spacing = _plan(scenario), scenario.plan_spacing

    def plan(self, at: Mapping[str, Floats]) -> Floats:
        """Return the planned curvature at the rear axle and ahead of it, 1/m, (n, samples)."""
        return np.stack([at[name] for name in self._plan_names], axis=1)

    def planned(self, plan: Floats, ahead: Floats | float) -> Floats:
        """Return the planned curvature ``ahead`` metres of the rear axle, 1/m, (n,), linear between the samples."""
        last = plan.shape[1] - 1.0
        place = np.clip(np.broadcast_to(np.asarray(ahead) / self._spacing, (len(plan),)), 0.0, last)
        first = np.minimum(place.astype(np.intp), plan.shape[1] - 2)
        rows, part = np.arange(len(plan)), place - first
        return (1.0 - part) * plan[rows, first] + part * plan[rows, first + 1]


class TraechtlerBlind(Planned):
    """`traechtler-blind`: the PD controller, and the simulated control loop where no edge is in sight.

    S1: the camera's deviation is fed back. S2: the deviation of the model, driven by the planned curvature at the
    look-ahead point, is; the same command steers the van. The model starts from the measured angle, the last seen
    deviation and its rate; when the edge comes back, the D part starts from the model's rate. So the command does not
    jump at the loss of the edge, and at its return only by K2 times what model and van have grown apart.
    """

    name = "traechtler-blind"
    # Deviation, heading and steering angle of the model, command and curvature that drive it, rate of the deviation,
    # filtered deviation, the distance asked for, whether the edge was in sight.
    memory = 9
    #: Below this speed the deviation's rate tells nothing about the heading, m/s.
    slowest: ClassVar[float] = 0.3
    #: Where the planned curvature changes just ahead, the edge is believed back once it is this near to where the model
    #: has it, in set distances: before, what the camera sees across a junction is the edge of the road behind the bend.
    believable: ClassVar[float] = 0.5
    #: What is a change of curvature, 1/m.
    change: ClassVar[float] = 0.01

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        model, v = self._model, at["speed"]
        wanted = np.broadcast_to(self.wanted(at), v.shape)
        seen = self._side * (at["edge_distance"] - wanted)
        steer = at["steering_angle"]
        # Where the model is now, if it went on from the last step; a new set point is a new deviation.
        e, heading, angle, command, plan = memory.T[:5]
        e, heading, angle = model.advance(e, heading, angle, command, plan, v, self._step)
        e = e - self._side * (wanted - memory[:, 7])
        ahead = self.plan(at)
        plan = self.planned(ahead, model.reach)
        near = np.abs(seen - e) <= self.believable * self._set_distance
        steady = np.abs(ahead[:, -1] - plan) <= self.change
        believed = fresh | (memory[:, 8] > 0.5) | near | steady
        valid = (at["edge_valid"] > 0.5) & believed  # the switch: S1 where true
        e, heading, angle = (
            np.where(fresh, new, old) for new, old in ((seen, e), (0.0 * seen, heading), (steer, angle))
        )
        simulated = model.rate(heading, angle, v)
        # In sight: the measured deviation and its filtered rate, which starts from the model's after a blind stretch.
        back = valid & (memory[:, 8] < 0.5)
        filtered = np.where(back, seen - self._smoothing * simulated, memory[:, 6])
        filtered = np.where(fresh, seen, filtered)
        measured = (seen - filtered) / self._smoothing
        filtered = filtered + self._follow * (seen - filtered)
        deviation, rate = np.where(valid, seen, e), np.where(valid, measured, simulated)
        slow = v < self.slowest
        turned = measured / np.where(slow, 1.0, v) - model.reach / model.wheelbase * steer
        heading = np.where(valid & ~slow, turned, heading)
        angle = np.where(valid, steer, angle)
        command = np.clip(self.feedback(deviation, rate, v), -self._limit, self._limit)
        return command, np.stack([deviation, heading, angle, command, plan, rate, filtered, wanted, valid], axis=1)


class TraechtlerInverse(Planned):
    """`traechtler-inverse`: the exact inverse of the van, and PD on a deviation that is known in sight and blind.

    An extension of the source. Feedforward: delta = atan(l kappa) keeps the rear axle on a path of curvature kappa
    exactly. Feedback: the source's PD on the deviation of the look-ahead point, but on the part of it that the planned
    path does not explain, as a dead-reckoning observer knows it. The observer integrates the measured speed and
    road-wheel angle along the plan to the rear axle's lateral and heading error, and is corrected by the camera, with
    its delay, whenever that sees the edge. Blind or not is all the same to the controller: nothing switches.

    The curvature is taken as far ahead of the rear axle as the van goes until the steering has answered, on average:
    with a motor of speed r and a step by a, a/(2 r) + r T²/(2 a), or T while the motor is not at its limit; and half a
    control step.
    """

    name = "traechtler-inverse"
    uses = ("planned_curvature_*", "edge_distance_new")
    needs = (*Planned.needs, Need("half the lane's width as set point", _lacking_middle))
    #: Way over which the observer forgets a wrong estimate, m: both poles at -1/way.
    way: ClassVar[float] = 4.0

    def __init__(self, scenario: ReckonedScenario) -> None:
        super().__init__(scenario)
        steering, sensor = scenario.vehicle.steering, dict(scenario.sensors).get("edge_distance")
        self._motor = np.inf if steering.rate_limit is None else steering.rate_limit
        self._late = steering.delay + 0.5 * scenario.control_step
        self._offset = -self._side * scenario.set_distance  # of the edge, left positive
        reach = self._model.reach
        self._correction = 2.0 / self.way - reach / self.way**2, 1.0 / self.way**2
        period, delay = sensor.numbers(scenario.control_step)[3:5] if sensor else (1, 0)
        self._period = float(period)
        self._new = "edge_distance_new" if "edge_distance_new" in self._order else None
        # Lateral and heading error, angle, speed and curvature of the last step, validity; expected deviations.
        self.memory = 6 + int(delay)

    def answer_time(self, step: Floats) -> Floats:
        """Return the mean delay (s) of the actuator's answer to a step of ``step`` rad, (n,)."""
        lag, motor = self._model.lag, self._motor
        if motor == np.inf or lag == 0.0:
            return np.full_like(step, lag)
        step = np.maximum(np.abs(step), motor * lag)
        return 0.5 * step / motor + 0.5 * motor * lag**2 / step

    def shown(self, plan: Floats) -> Floats:
        """Return the deviation e (m, (n,)) that the camera shows from a rear axle on the planned path, along it."""
        n, h = len(plan), self._spacing
        before, after = plan[:, :-1], plan[:, 1:]
        zero = np.zeros((n, 1))
        angle = np.concatenate([zero, np.cumsum(0.5 * h * (before + after), axis=1)], axis=1)
        middle = angle[:, :-1] + h * (3.0 * before + after) / 8.0
        first, last = angle[:, :-1], angle[:, 1:]
        along = h / 6 * (np.cos(first) + 4 * np.cos(middle) + np.cos(last))
        aside = h / 6 * (np.sin(first) + 4 * np.sin(middle) + np.sin(last))
        x = np.concatenate([zero, np.cumsum(along, axis=1)], axis=1) - self._offset * np.sin(angle)
        y = np.concatenate([zero, np.cumsum(aside, axis=1)], axis=1) + self._offset * np.cos(angle)
        beyond = x >= self._model.reach
        k = np.maximum(np.argmax(beyond, axis=1), 1)
        rows, found = np.arange(n), beyond.any(axis=1)
        part = (self._model.reach - x[rows, k - 1]) / np.where(found, x[rows, k] - x[rows, k - 1], 1.0)
        return np.where(found, self._offset - y[rows, k - 1] - part * (y[rows, k] - y[rows, k - 1]), 0.0)

    def reckon(self, at: Mapping[str, Floats], memory: Floats, curvature: Floats) -> tuple[Floats, Floats]:
        """Return lateral (m) and heading error (rad) of the rear axle one step after ``memory``, (n,)."""
        d, heading = memory[:, 0], memory[:, 1]
        steer, v, kappa = (
            0.5 * (new + old)
            for new, old in zip((at["steering_angle"], at["speed"], curvature), memory.T[2:5], strict=True)
        )
        moved = v * np.cos(steer) * self._step
        turned = v * np.sin(steer) * self._step / self._model.wheelbase
        way = moved * np.cos(heading) / np.maximum(1.0 - d * kappa, 0.1)
        after = heading + turned - kappa * way
        return d + moved * np.sin(0.5 * (heading + after)), after

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        model, plan, v, steer = self._model, self.plan(at), at["speed"], at["steering_angle"]
        valid = at["edge_valid"] > 0.5
        seen = self._side * (at["edge_distance"] - self._set_distance)
        curvature, shown = plan[:, 0], self.shown(plan)
        d, heading = self.reckon(at, memory, curvature)
        # Nothing is known at first: all of what the camera shows is taken for a lateral error.
        d = np.where(fresh, np.where(valid, seen - shown, 0.0), d)
        heading = np.where(fresh, 0.0, heading)
        expected = shown + d + model.reach * heading
        line = np.concatenate([memory[:, 6:], expected[:, None]], axis=1)
        line = np.where(np.broadcast_to(fresh, valid.shape)[:, None], expected[:, None], line)
        brings = valid if self._new is None else valid & (at[self._new] > 0.5)
        surprise = np.where(brings, seen - line[:, 0], 0.0)
        # The gains are for the way between two pictures, at the most a quarter of the observer's own.
        between = np.minimum(v * self._step * self._period, 0.25 * self.way)
        to_d, to_heading = (gain * between * surprise for gain in self._correction)
        d, heading = d + to_d, heading + to_heading
        line = line[:, 1:] + (to_d + model.reach * to_heading)[:, None]
        steepest = np.arctan(model.wheelbase * np.abs(plan).max(axis=1))
        ahead = v * (self.answer_time(steepest) + self._late)
        excess = steer - np.arctan(model.wheelbase * curvature)
        feedback = self.feedback(d + model.reach * heading, model.rate(heading, excess, v), v)
        command = np.arctan(model.wheelbase * self.planned(plan, ahead)) + feedback
        return command, np.concatenate([np.stack([d, heading, steer, v, curvature, valid], axis=1), line], axis=1)
