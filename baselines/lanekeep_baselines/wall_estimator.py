"""The Kalman filter along a wall that Team KnightRiders name as the missing piece (3.5.7): heading and biases.

States: distance of the side sensor from the wall (m), heading away from it (rad), steering offset (what the road wheel
has more than it is told, rad), bias of the yaw rate (rad/s). Inputs: speed and steering over the step that just ended;
measurements: side distance in the ultrasonic's cone of 45 degrees and yaw rate. The report gives no filter: structure
and noise are choices of this project.

It is an extended filter with its covariance in the memory, row by row: the first seconds, when nothing is known of
heading and biases, ask for other gains than later ones, and so does every speed. The distance makes heading and offset
observable, in proportion to speed and to its square, the yaw rate then its bias. At standstill heading and offset rest,
with the certainty that they had.

Beyond half the cone the nearest point is on its rim, and a distance depends on the heading. That is taken for noise of
the distance and corrects no heading: a slow car that is uncertain of its heading otherwise finds a wrong pair of
distance and heading that explains what it hears, and turns round (11 of 400 cars met the wall at 0.1 m/s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats
from lanekeep_baselines.wall_design import WallCar
from lanekeep_env.sensing.ultrasonic import HALF_CONE

#: A heading is not believed beyond this, rad: the side sensor sees no wall at such an angle.
LARGEST_ESTIMATE = float(np.deg2rad(60.0))


@dataclass(frozen=True)
class WallNoise:
    """Standard deviations: of a measurement, of the states at the start, and of what they gain by chance.

    Attributes:
        side_distance: m.
        yaw_rate: rad/s.
        start: of distance (m), heading (rad), steering offset (rad) and yaw-rate bias (rad/s).
        distance: m after a metre's way.
        heading: rad after a metre's way.
        steering_offset: rad after a metre's way; the measured map from ticks to angles errs differently at every angle.
        yaw_rate_bias: rad/s after a second.
    """

    side_distance: float = 0.01
    yaw_rate: float = 0.02
    start: tuple[float, float, float, float] = (0.01, 0.35, 0.05, 0.05)
    distance: float = 0.005
    heading: float = 0.03
    steering_offset: float = 0.03
    yaw_rate_bias: float = 0.005


class WallFilter:
    """Estimates (distance, heading, steering offset, yaw-rate bias), row by row.

    Its memory has 20 columns: the four estimates and their covariance, row after row.
    """

    memory = 20

    def __init__(self, car: WallCar, noise: WallNoise | None = None) -> None:
        self._car = car
        self._noise = WallNoise() if noise is None else noise

    def update(
        self,
        memory: Floats,
        fresh: NDArray[np.bool_] | bool,
        speed: Floats,
        steering: Floats,
        side_distance: Floats,
        yaw_rate: Floats,
    ) -> Floats:
        """Return the next memory, (n, 20).

        Args:
            memory: the last one, (n, 20); never written to.
            fresh: rows that start: along the wall at the measured distance, without offset and bias.
            speed: mean over the step that ended, m/s, (n,); negative backwards.
            steering: what the road wheel was told over that step, rad, (n,).
            side_distance: now, of the nearest wall in the sensor's cone, m, 0 without an echo, (n,).
            yaw_rate: of that step, rad/s, (n,).
        """
        states, covariance = memory.T[:4], memory.T[4:].reshape(4, 4, -1)
        states, covariance, slope = self._predict(states, covariance, speed, steering)
        # The nearest point of the wall in the cone: straight across up to half its angle, along its rim beyond.
        beyond = np.sign(states[1]) * np.maximum(np.abs(states[1]) - HALF_CONE, 0.0)
        cosine, slant = np.cos(beyond), states[0] * np.tan(beyond)
        seen = states[0] / cosine
        toward = covariance[:, 0] / cosine
        heard = side_distance > 0.0
        spread = toward[0] / cosine + slant**2 * covariance[1, 1] + self._noise.side_distance**2
        spread = np.where(heard, spread, np.inf)
        turned = (states[1] - memory[:, 1]) / self._car.step  # before the correction: the turn that was predicted
        gain = toward / spread
        innovation = np.where(heard, side_distance - seen, 0.0)
        states = states + gain * innovation
        covariance = covariance - toward[:, None] * toward[None] / spread
        # Yaw rate: that of the predicted turn, as the offset's correction changes it, plus the bias.
        expected = turned + slope * gain[2] * innovation + states[3]
        toward = slope * covariance[:, 2] + covariance[:, 3]
        spread = slope * toward[2] + toward[3] + self._noise.yaw_rate**2
        states = states + toward / spread * (yaw_rate - expected)
        covariance = covariance - toward[:, None] * toward[None] / spread
        states[1] = np.clip(states[1], -LARGEST_ESTIMATE, LARGEST_ESTIMATE)
        now = np.concatenate([states, covariance.reshape(16, -1)]).T
        if fresh is False:
            return now
        return np.where(np.reshape(fresh, (-1, 1)), self._start(side_distance), now)

    def correct_offset(self, memory: Floats, offset: Floats, noise: float) -> Floats:
        """Return a memory (n, 20) corrected by a measured steering offset, rad, (n,), of that standard deviation."""
        states, covariance = memory.T[:4], memory.T[4:].reshape(4, 4, -1)
        gain = covariance[:, 2] / (covariance[2, 2] + noise**2)
        states = states + gain * (offset - states[2])
        covariance = covariance - gain[:, None] * covariance[2]
        return np.concatenate([states, covariance.reshape(16, -1)]).T

    def _predict(
        self, states: Floats, covariance: Floats, speed: Floats, steering: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return states (4, n) and covariance (4, 4, n) a step later, and the yaw rate per unit of the offset (n,)."""
        car, noise = self._car, self._noise
        distance, heading, offset, bias = states
        way = speed * car.step
        wheel = np.tan(steering + offset)
        turned = way * wheel / car.wheelbase
        after, middle = heading + turned, heading + turned / 2.0
        # The rear axle goes along the mean heading, the sensor l_H ahead of it.
        distance = distance + way * np.sin(middle) + car.sensor * (np.sin(after) - np.sin(heading))
        # Derivatives of the step: turn by offset, distance by heading and by offset.
        by_offset = way * (1.0 + wheel * wheel) / car.wheelbase
        by_heading = way * np.cos(middle) + car.sensor * (np.cos(after) - np.cos(heading))
        far = (way * np.cos(middle) / 2.0 + car.sensor * np.cos(after)) * by_offset
        half = covariance.copy()
        half[0] += by_heading * covariance[1] + far * covariance[2]
        half[1] += by_offset * covariance[2]
        grown = half.copy()
        grown[:, 0] += by_heading * half[:, 1] + far * half[:, 2]
        grown[:, 1] += by_offset * half[:, 2]
        length = np.abs(way)
        grown[0, 0] += noise.distance**2 * length
        grown[1, 1] += noise.heading**2 * length
        grown[2, 2] += noise.steering_offset**2 * length
        grown[3, 3] += noise.yaw_rate_bias**2 * car.step
        return np.stack([distance, after, offset, bias]), grown, by_offset / car.step

    def _start(self, side_distance: Floats) -> Floats:
        start = np.zeros((len(side_distance), self.memory))
        start[:, 0] = side_distance
        start[:, 4:] = np.diag(np.square(self._noise.start)).reshape(-1)
        return start
