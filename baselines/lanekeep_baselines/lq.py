"""LQ controllers of the benchmark's own cost: with preview of the road, free of offsets, and without the road.

What optimal linear control makes of what a learned policy is given: the nominal car, the cost, the channels. Gains and
filters are designed at many speeds and interpolated between them (`lq_schedule`); sideslip, which no sensor
measures, comes from a Kalman filter. All of them know the scenario's nominal car only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.lq_design import Cost, Estimated, Measuring, Weights, on_samples
from lanekeep_baselines.lq_model import steady_sideslip
from lanekeep_baselines.lq_schedule import FOLLOWING, LEAST_NOISE, SPEEDS, Design, points, reserved
from lanekeep_baselines.policy import Floats, LaneScenario, PreviewScenario, SteeringPolicy
from lanekeep_baselines.table import Table, weighted_sum
from lanekeep_baselines.tunable import Tunable
from lanekeep_env.sensing.faults import Sensors

#: Channels of the measured states, in the order of `lq_design.MEASURED`.
MEASURED_CHANNELS = ("steering_angle", "yaw_rate", "heading_error", "lateral_error")
#: What is searched of their weights; `steer` is the margins' (`lq_reserve`).
_RATE, _SLIP = Tunable("rate", 0.1, 10.0, of="weights"), Tunable("slip", 1e-4, 1e-2, of="weights")
_DRIFT, _BEND = Tunable("drift", 1e-4, 0.1, of="weights"), Tunable("bend", 0.01, 3.0, of="weights")
_LAG = Tunable("lag", 0.0, 0.15, log=False, of="weights")
#: Wheelbase, m, from which on cars are as long as those that the weights were tuned on.
FULL_SIZE = 2.0
#: Least preview, s: behind it the curvature is taken to stay as it is.
SHORTEST_PREVIEW = 1.0


class CostScenario(LaneScenario, Protocol):
    """What a controller that is designed for the running cost may know besides."""

    @property
    def reference_lateral_error(self) -> float: ...
    @property
    def cost_weight(self) -> float: ...
    @property
    def reference_steering_rate(self) -> float: ...
    @property
    def sensors(self) -> Sensors: ...


def _samples(scenario: PreviewScenario) -> tuple[str, ...]:
    """Return the channels of the road ahead."""
    return tuple(channel.name for channel in scenario.channels if channel.name.startswith("curvature_preview_"))


def _reach(scenario: PreviewScenario) -> float:
    """Return how far the road ahead is shown, s."""
    return max(len(_samples(scenario)) - 1, 0) * scenario.preview_interval


def _lacking_preview(scenario: PreviewScenario) -> str:
    reach = _reach(scenario)
    if reach >= SHORTEST_PREVIEW - 1e-9:
        return ""
    least = 1 + math.ceil(SHORTEST_PREVIEW / scenario.preview_interval - 1e-9)
    return (
        f"{SHORTEST_PREVIEW:g} s of curvature preview, the scenario shows {reach:g} s: "
        f"make it with preview={least} or more"
    )


#: What those who know the road need.
_PREVIEW = Need(f"{SHORTEST_PREVIEW:g} s of curvature preview", _lacking_preview)


class LinearQuadratic(SteeringPolicy):
    """Kalman filter, then feedback of the estimates, of the commands on their way, and of the road.

    Memory: the estimates (x, slip offsets, curvature, what late sensors are still to tell), the curvature at the car
    where it is known, and the commands before the last one that are still on their way.
    """

    reads: ClassVar[tuple[str, ...]] = (
        "lateral_error",
        "heading_error",
        "yaw_rate",
        "speed",
        "steering_angle",
        "steering_command",
    )
    packages: ClassVar[tuple[str, ...]] = ("scipy",)
    estimated: ClassVar[Estimated]
    #: Of a (1+1) evolution strategy, 2 million steps on training roads; `lanekeep tune` starts from them.
    weights: ClassVar[Weights]
    tunable: ClassVar[tuple[Tunable, ...]] = (_RATE, _SLIP, _DRIFT, _BEND, _LAG)

    def __init__(self, scenario: CostScenario, weights: Weights | None = None) -> None:
        """Design for ``scenario``, with ``weights`` as they are, or with those of the class and a reserve."""
        super().__init__(scenario)
        tuned = self.weights if weights is None else weights
        self._samples = _samples(scenario)
        known = not self.estimated.curvature
        interval, reach = scenario.preview_interval, _reach(scenario)
        step, slip = scenario.control_step, scenario.dynamics != "kinematic"
        # A model car goes round bends as much tighter as it is shorter, in the square root of the time: allowed a
        # full-size car's lateral errors, and as slow a road wheel, the optimum would cut them beyond its lane.
        length = min(1.0, scenario.vehicle.wheelbase / FULL_SIZE)
        time = math.sqrt(length)
        weight = tuned.rate * scenario.cost_weight
        cost = Cost(scenario.reference_lateral_error * length, weight, scenario.reference_steering_rate / time)
        measuring = _measuring(scenario.sensors, step)
        steps = 2 + int(reach / step) if known else 1
        self._design = Design(scenario.vehicle, time, step, slip, cost, steps, self.estimated)
        self._sideslip = steady_sideslip(scenario.vehicle, slip)
        self._moved = reserved(self._design, tuned) if weights is None else (tuned,) * len(SPEEDS)
        found = points(self._design, self._moved, measuring)
        feedback = [point.states for point in found]
        if known:
            road = [on_samples(point.curvature, step, len(self._samples), interval) for point in found]
            feedback = [np.concatenate(both) for both in zip(feedback, road, strict=True)]
        self._feedback = Table(SPEEDS, -np.stack(feedback))
        self._filter = Table(SPEEDS, np.stack([point.filtering.T for point in found]))
        self._on_the_way = found[0].on_the_way
        self._late = measuring.late
        self._followed = self.estimated.states + sum(measuring.late)
        self.memory = self._followed + known + self._on_the_way

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        speed, applied = at["speed"], at["steering_command"]
        measured = [at[name] for name in MEASURED_CHANNELS]
        road = [at[name] for name in self._samples] if not self.estimated.curvature else []
        states = self._followed
        start = self._start(measured, speed)
        estimates = np.stack(start, axis=1)
        commands = np.stack([applied] * (1 + self._on_the_way), axis=1)
        if fresh is not True:
            started = np.asarray(fresh)[..., None]
            on_the_way = memory[:, memory.shape[1] - self._on_the_way :]
            commands = np.where(started, commands, np.concatenate([applied[:, None], on_the_way], axis=1))
            inputs = [memory[:, :states], commands, np.stack(measured, axis=1)]
            if road:
                inputs.insert(1, np.stack([memory[:, states], road[0]], axis=1))
            followed = self._follow(speed, inputs)
            estimates = np.where(started, estimates, followed)
        sent = commands[:, : self._on_the_way]
        seen = np.concatenate([estimates[:, : self.estimated.states], sent, *[one[:, None] for one in road]], axis=1)
        now = road[0][:, None] if road else np.zeros((len(speed), 0))
        return self.steer(speed, seen), np.concatenate([estimates, now, sent], axis=1)

    def _follow(self, speed: Floats, inputs: list[Floats]) -> Floats:
        """Return the next estimates from the last ones, the curvatures where they are known, commands and sensors."""
        return weighted_sum(self._filter(speed), np.concatenate(inputs, axis=1))

    def steer(self, speed: Floats, seen: Floats) -> Floats:
        """Return the command, rad, (n,), for estimates, commands on their way and the road ahead side by side."""
        return weighted_sum(self._feedback(speed), seen)

    def _start(self, measured: list[Floats], speed: Floats) -> list[Floats]:
        """Return the estimates at an episode's start: a car that drives steadily along its arc, as episodes begin."""
        steer, yaw_rate, heading, lateral = measured
        curvature = yaw_rate / np.maximum(speed, 1.0)
        sideslip = (self._sideslip[0] + self._sideslip[1] * speed * speed) * curvature
        start = [steer, sideslip, yaw_rate, heading, lateral]
        if self.estimated.offsets:
            start += [np.zeros_like(speed)] * 2
        if self.estimated.curvature:
            start.append(curvature)
        for value, steps in zip(measured, self._late, strict=True):
            start += [value] * steps
        return start


def _measuring(sensors: Sensors, step: float) -> Measuring:
    """Return white noise, quantisation and delay of the measured channels at control steps of ``step`` s."""
    noise, late = list(LEAST_NOISE), [0] * len(MEASURED_CHANNELS)
    for channel, sensor in sensors:
        if channel in MEASURED_CHANNELS:
            i = MEASURED_CHANNELS.index(channel)
            noise[i] = max(noise[i], math.hypot(sensor.noise, sensor.resolution / math.sqrt(12.0)))
            late[i] = round(sensor.delay / step)
    return Measuring(tuple(noise), tuple(late))


class LqPreview(LinearQuadratic):
    """`lq-preview`: the optimum of the running cost for the nominal car on the road that the previews show.

    The road wheel is taken to follow its model at every speed: nothing is lost by it on the nominal car, and Ms is 2
    instead of 2.5 to 14.
    """

    name = "lq-preview"
    uses = ("curvature_preview_*",)
    needs = (_PREVIEW,)
    estimated = Estimated(offsets=False, curvature=False)
    tunable = (_RATE, _SLIP, _BEND, _LAG)
    weights = Weights(rate=0.859, slip=1e-3, steer=FOLLOWING, drift=0.0, bend=0.3)


class LqPreviewOffsetFree(LinearQuadratic):
    """`lq-preview-offset-free`: the same with the axles' slip offsets estimated.

    In a steady curve any car of whatever mass and tyres is the nominal one with two slip offsets, so that it has no
    lateral error there; between curves the estimates follow.
    """

    name = "lq-preview-offset-free"
    uses = ("curvature_preview_*",)
    needs = (_PREVIEW,)
    estimated = Estimated(offsets=True, curvature=False)
    weights = Weights(rate=1.15, slip=1.12e-3, steer=1e-3, drift=3.31e-3, bend=0.0772, lag=0.0845)


class LinearQuadraticGaussian(LinearQuadratic):
    """`lqg`: without the road ahead; its curvature at the car is estimated as well, and taken to stay as it is."""

    name = "lqg"
    estimated = Estimated(offsets=True, curvature=True)
    weights = Weights(rate=0.795, slip=9.32e-4, steer=1e-3, drift=5.06e-3, bend=0.772, lag=0.0421)
