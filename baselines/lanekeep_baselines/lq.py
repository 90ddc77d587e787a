"""LQ controllers of the benchmark's own cost: with preview of the road, free of offsets, and without the road.

What optimal linear control makes of what a learned policy is given: the nominal car, the cost, the channels. Gains and
filters are designed at many speeds and interpolated between them (`lq_model`, `lq_design`); sideslip, which no sensor
measures, comes from a Kalman filter. All of them know the scenario's nominal car only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.lq_design import Cost, Estimated, Gains, Measuring, Weights, gains, on_samples
from lanekeep_baselines.lq_model import STATES, StepModel, steady_sideslip
from lanekeep_baselines.lq_reserve import Loop, least_share, moved
from lanekeep_baselines.policy import Floats, LaneScenario, PreviewScenario, SteeringPolicy
from lanekeep_baselines.table import Table, weighted_sum
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.sensing.faults import Sensors

#: Speeds of the design points, m/s.
SPEEDS: Floats = np.arange(1.0, 60.1, 1.0)
#: Those of them at which margins are judged; between two of them weights are those of the one that takes more.
JUDGED: Floats = np.array([1.0, 5.0, 10.0, 12.0, 14.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 50.0, 60.0])
#: Channels of the measured states, in the order of `lq_design.MEASURED`, and the least standard deviations that a
#: filter assumes of them (rad, rad/s, rad, m): a tenth of those of production sensors.
MEASURED_CHANNELS = ("steering_angle", "yaw_rate", "heading_error", "lateral_error")
LEAST_NOISE: Floats = np.array([2e-5, 5e-4, 3e-4, 3e-3])
#: Below this speed, m/s, the filters take the road wheel to follow its model to within `FOLLOWING` (rad a step). The
#: optimum adds to the angle that is, as an integrator; with the measured angle it has the actuator's gain in it, which
#: a slow car does not correct in time (Ms 7 to 14 at 1 m/s, 1.2 to 1.8 with the model's angle).
SLOW, FOLLOWING = 15.0, 1e-6
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
    #: What `python -m lanekeep_baselines.tuning` found.
    weights: ClassVar[Weights]

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
        self._time = math.sqrt(length)
        weight = tuned.rate * scenario.cost_weight
        cost = Cost(scenario.reference_lateral_error * length, weight, scenario.reference_steering_rate / self._time)
        measuring = _measuring(scenario.sensors, step)
        steps = 2 + int(reach / step) if known else 1
        self._vehicle, self._step, self._cost, self._steps, self._slip = scenario.vehicle, step, cost, steps, slip
        self._sideslip = steady_sideslip(scenario.vehicle, slip)
        self._moved = self._reserved(tuned) if weights is None else [tuned] * len(SPEEDS)
        feedback, filters = [], []
        for speed, used in zip(SPEEDS, self._moved, strict=True):
            parts, found, filtering = self._designed(float(speed), used, measuring)
            if known:
                parts.append(on_samples(found.curvature, step, len(self._samples), interval))
            feedback.append(-np.concatenate(parts))
            filters.append(filtering.T)
        self._feedback, self._filter = Table(SPEEDS, np.stack(feedback)), Table(SPEEDS, np.stack(filters))
        self._on_the_way = len(parts[-1 - known])
        self._late = measuring.late
        self._followed = self.estimated.states + sum(measuring.late)
        self.memory = self._followed + known + self._on_the_way

    def _designed(self, speed: float, weights: Weights, measuring: Measuring) -> tuple[list[Floats], Gains, Floats]:
        """Return gains of estimates and commands on their way, all gains, and the filter, at a speed in m/s."""
        model = StepModel.of(self._reserving(weights), speed, self._step, self._slip)
        found = gains(model, self._cost, self._step, self._steps)
        parts = [found.state[:STATES]]
        if self.estimated.offsets:
            parts.append(found.offsets)
        if self.estimated.curvature:
            parts.append(found.constant)
        parts.append(found.state[STATES:])
        trusting = weights if speed >= SLOW else replace(weights, steer=min(weights.steer, FOLLOWING))
        return parts, found, self.estimated.filter(model, trusting, measuring, speed, self._step)

    def _reserving(self, weights: Weights) -> VehicleParameters:
        """Return the car with the lag that the design takes it to have."""
        steering = self._vehicle.steering
        return replace(self._vehicle, steering=replace(steering, lag=steering.lag + weights.lag * self._time))

    def _reserved(self, tuned: Weights) -> list[Weights]:
        """Return the weights of each design speed: the tuned ones, moved as far as the margins ask for.

        Judged are car and actuator, with sensors that are on time: a late camera is no fault of theirs.
        """
        on_time = Measuring(LEAST_NOISE, (0,) * len(MEASURED_CHANNELS))

        def sensitivity(speed: float, share: float) -> float:
            parts, _, filtering = self._designed(speed, moved(tuned, share), on_time)
            model = StepModel.of(self._vehicle, speed, self._step, self._slip)
            return Loop(model, np.concatenate(parts), filtering, not self.estimated.curvature).sensitivity()

        shares = np.array([least_share(partial(sensitivity, float(speed))) for speed in JUDGED])
        above = np.searchsorted(JUDGED, SPEEDS)
        below = np.searchsorted(JUDGED, SPEEDS, side="right") - 1
        return [moved(tuned, float(share)) for share in np.maximum(shares[above], shares[below])]

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
    noise, late = LEAST_NOISE.copy(), [0] * len(MEASURED_CHANNELS)
    for channel, sensor in sensors:
        if channel in MEASURED_CHANNELS:
            i = MEASURED_CHANNELS.index(channel)
            noise[i] = max(noise[i], math.hypot(sensor.noise, sensor.resolution / math.sqrt(12.0)))
            late[i] = round(sensor.delay / step)
    return Measuring(noise, tuple(late))


class LqPreview(LinearQuadratic):
    """`lq-preview`: the optimum of the running cost for the nominal car on the road that the previews show.

    The road wheel is taken to follow its model at every speed: nothing is lost by it on the nominal car, and Ms is 2
    instead of 2.5 to 14.
    """

    name = "lq-preview"
    uses = ("curvature_preview_*",)
    needs = (_PREVIEW,)
    estimated = Estimated(offsets=False, curvature=False)
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
