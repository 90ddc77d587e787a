"""What a drive has told of car, actuator and sensors so far, as arrays that fade: a row a car, no state of its own.

The road wheel's answer to the commands of three steps tells lag and delay; slip offsets and yaw rate over the lateral
acceleration tell mass and tyres; second differences of the lateral error tell its noise. What is older fades, so that a
car that changes is seen.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.physics.parameters import VehicleParameters

Floats = NDArray[np.float64]

#: Quantities, in the order of the columns. All are 0 for the nominal car, some thousandths to 4 for others: how much
#: faster the road wheel follows the command of this step and of the two before than the nominal actuator's, slip
#: offsets (in 0.01 s²/m of lateral acceleration), understeer, noise (small and large), and how far all that is sure.
IDENTIFIED = (
    *("response_now", "response_before", "response_earlier"),
    *("front_slip", "rear_slip", "understeer"),
    *("little_noise", "much_noise", "sure"),
)
#: Channels that are read.
READ = ("lateral_error", "yaw_rate", "speed", "steering_angle", "steering_command")

#: Numbers kept of each car: moments of the actuator (6 and 3), sums over the lateral acceleration (4), squared second
#: differences and the steps that they are of (2), what was seen last and before that (5), steps (1).
MEMORY = 21
#: Squares of steering angle (rad²) and lateral acceleration (m²/s⁴) that stand for what is not known yet.
_ANGLE_PRIOR, _ACCELERATION_PRIOR = 3e-6, 40.0
#: m/s, below which tyres tell nothing.
_SLOWEST = 6.0
_LARGEST = 4.0


class Seen(NamedTuple):
    """What a step shows, (n,) each: `READ`, and the estimated slip offsets of the axles, rad."""

    lateral_error: Floats
    yaw_rate: Floats
    speed: Floats
    steering_angle: Floats
    steering_command: Floats
    front_offset: Floats
    rear_offset: Floats


class Identifier:
    """Follows what is seen.

    Args:
        car: nominal.
        control_step: s.
        fade: seconds after which a share 1/e is left of what was seen.
    """

    def __init__(self, car: VehicleParameters, control_step: float, fade: float) -> None:
        lag = car.steering.lag
        self._response = -math.expm1(-control_step / lag) if lag > 0.0 else 1.0
        self._wheelbase, self._fade = car.wheelbase, math.exp(-control_step / fade)
        front, rear = car.cg_to_front_axle, car.cg_to_rear_axle
        self._understeer = (
            car.mass * (rear / car.front_cornering_stiffness - front / car.rear_cornering_stiffness) / car.wheelbase
        )

    def follow(self, memory: Floats, fresh: NDArray[np.bool_] | bool, seen: Seen) -> tuple[Floats, Floats]:
        """Return the quantities (n, `IDENTIFIED`) and the next memory (n, `MEMORY`).

        Args:
            memory: what the last call returned; meaningless in rows that are ``fresh``. Never written to.
            fresh: rows in which an episode starts, (n,), or one answer for all.
            seen: the present step.
        """
        kept = self._fade * memory
        steer, command, offset = seen.steering_angle, seen.steering_command, seen.lateral_error
        before, sent, sent_before, error, error_before, steps = memory[:, 15:].T
        x = (command - before, sent - before, sent_before - before)
        y = steer - before - self._response * x[0]
        acceleration = seen.speed * seen.yaw_rate
        turning = steer - self._wheelbase * seen.yaw_rate / np.maximum(seen.speed, _SLOWEST)
        second = np.where(steps > 1.0, offset - 2.0 * error + error_before, 0.0)
        new = (
            *(x[0] * x[0], x[0] * x[1], x[0] * x[2], x[1] * x[1], x[1] * x[2], x[2] * x[2]),
            *(x[0] * y, x[1] * y, x[2] * y),
            acceleration * acceleration,
            seen.front_offset * acceleration,
            seen.rear_offset * acceleration,
            (turning - self._understeer * acceleration) * acceleration,
            second * second,
            1.0,
        )
        following = np.empty_like(memory)
        for i, value in enumerate(new):
            following[:, i] = kept[:, i] + value
        started = np.broadcast_to(np.asarray(fresh), steer.shape)
        following[started, :15] = 0.0
        following[started, 14] = 1.0
        following[:, 15], following[:, 16], following[:, 18] = steer, command, offset
        following[:, 17] = np.where(started, command, sent)
        following[:, 19] = np.where(started, offset, error)
        following[:, 20] = np.where(started, 1.0, steps + 1.0)
        return _quantities(following), following


def _quantities(memory: Floats) -> Floats:
    a, b, c, d, e, f, p, q, r = memory[:, :9].T
    a, d, f = a + _ANGLE_PRIOR, d + _ANGLE_PRIOR, f + _ANGLE_PRIOR
    # Least squares of three: Cramer's rule, element by element, as rows are to be independent.
    aa, bb, cc = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * aa + b * bb + c * cc
    dd, ee, ff = a * f - c * c, b * c - a * e, a * d - b * b
    squares = memory[:, 9] + _ACCELERATION_PRIOR
    noise = memory[:, 13] / memory[:, 14]
    found = np.empty((len(memory), len(IDENTIFIED)))
    for i, value in enumerate(
        (
            5.0 * (aa * p + bb * q + cc * r) / determinant,
            5.0 * (bb * p + dd * q + ee * r) / determinant,
            5.0 * (cc * p + ee * q + ff * r) / determinant,
            100.0 * memory[:, 10] / squares,
            100.0 * memory[:, 11] / squares,
            100.0 * memory[:, 12] / squares,
            noise / (noise + 1e-4),
            noise / (noise + 1e-2),
            squares / (squares + 400.0) - _ACCELERATION_PRIOR / (_ACCELERATION_PRIOR + 400.0),
        )
    ):
        found[:, i] = value
    return found.clip(-_LARGEST, _LARGEST, out=found)
