"""An LQ controller's gains and filters over the speed, designed once for all scenarios that ask for equal ones.

Roads, tyres and friction are nothing that the linear designs know of: a suite's scenarios, and policies that differ in
what they make of a design, share it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from lanekeep_baselines.lq_design import Cost, Estimated, Measuring, Weights, gains
from lanekeep_baselines.lq_model import STATES, StepModel
from lanekeep_baselines.lq_reserve import Loop, least_share, moved
from lanekeep_baselines.policy import Floats
from lanekeep_env.physics.parameters import VehicleParameters

#: Speeds of the design points, m/s.
SPEEDS: Floats = np.arange(1.0, 60.1, 1.0)
#: Those of them at which margins are judged; between two of them weights are those of the one that takes more.
JUDGED: Floats = np.array([1.0, 5.0, 10.0, 12.0, 14.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 50.0, 60.0])
#: The least standard deviations that a filter assumes of the measured states (rad, rad/s, rad, m): a tenth of those of
#: production sensors.
LEAST_NOISE = (2e-5, 5e-4, 3e-4, 3e-3)
#: Below this speed, m/s, the filters take the road wheel to follow its model to within `FOLLOWING` (rad a step). The
#: optimum adds to the angle that is, as an integrator; with the measured angle it has the actuator's gain in it, which
#: a slow car does not correct in time (Ms 7 to 14 at 1 m/s, 1.2 to 1.8 with the model's angle).
SLOW, FOLLOWING = 15.0, 1e-6


class Point(NamedTuple):
    """The design at a speed.

    Attributes:
        states: gains of what is estimated and of the commands on their way, side by side, shape (n + m,).
        curvature: gains of the curvature now and in each step to come, shape (steps,).
        filtering: F of `Estimated.filter`.
        on_the_way: m.
    """

    states: Floats
    curvature: Floats
    filtering: Floats
    on_the_way: int


@dataclass(frozen=True)
class Design:
    """What gains and filters follow from, beside weights and sensors.

    Attributes:
        vehicle: the nominal car.
        time: factor of the weights' lag: a model car is quicker than a full-size one.
        step: the control step, s.
        slip: whether its tyres slip.
        cost: of a step.
        steps: at how many of them the curvature is known.
        estimated: what the filter finds out.
    """

    vehicle: VehicleParameters
    time: float
    step: float
    slip: bool
    cost: Cost
    steps: int
    estimated: Estimated

    def reserving(self, weights: Weights) -> VehicleParameters:
        """Return the car with the lag that the design takes it to have."""
        steering = self.vehicle.steering
        return replace(self.vehicle, steering=replace(steering, lag=steering.lag + weights.lag * self.time))

    def at(self, speed: float, weights: Weights, measuring: Measuring) -> Point:
        """Design for a speed in m/s."""
        model = StepModel.of(self.reserving(weights), speed, self.step, self.slip)
        found = gains(model, self.cost, self.step, self.steps)
        parts = [found.state[:STATES]]
        if self.estimated.offsets:
            parts.append(found.offsets)
        if self.estimated.curvature:
            parts.append(found.constant)
        on_the_way = found.state[STATES:]
        trusting = weights if speed >= SLOW else replace(weights, steer=min(weights.steer, FOLLOWING))
        filtering = self.estimated.filter(model, trusting, measuring, speed, self.step)
        point = Point(np.concatenate([*parts, on_the_way]), found.curvature, filtering, len(on_the_way))
        for shared in point[:3]:
            shared.setflags(write=False)
        return point

    def sensitivity(self, tuned: Weights, speed: float, share: float) -> float:
        """Return Ms of car and actuator at a speed, m/s, with weights that have gone ``share`` of the way.

        Sensors are on time: a late camera is no fault of theirs.
        """
        point = self.at(speed, moved(tuned, share), Measuring(LEAST_NOISE, (0,) * len(LEAST_NOISE)))
        model = StepModel.of(self.vehicle, speed, self.step, self.slip)
        return Loop(model, point.states, point.filtering, not self.estimated.curvature).sensitivity()


@lru_cache(maxsize=32)
def reserved(design: Design, tuned: Weights) -> tuple[Weights, ...]:
    """Return the weights of each of `SPEEDS`: the tuned ones, moved as far as the margins ask for."""
    shares = np.array([least_share(partial(design.sensitivity, tuned, float(speed))) for speed in JUDGED])
    above = np.searchsorted(JUDGED, SPEEDS)
    below = np.searchsorted(JUDGED, SPEEDS, side="right") - 1
    return tuple(moved(tuned, float(share)) for share in np.maximum(shares[above], shares[below]))


@lru_cache(maxsize=32)
def points(design: Design, weights: tuple[Weights, ...], measuring: Measuring) -> tuple[Point, ...]:
    """Return the design at each of `SPEEDS`, with its weights."""
    return tuple(design.at(float(speed), used, measuring) for speed, used in zip(SPEEDS, weights, strict=True))
