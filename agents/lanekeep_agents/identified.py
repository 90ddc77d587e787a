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

# Indices instead of many small operations, which would take most of the time of a few cars. The sums are of products of
# two of these: the wheel's ways to the three commands, what of its way the nominal actuator leaves, lateral
# acceleration, both offsets, what of the turn the nominal car leaves, the second difference, and one.
_FACTORS, _SUMS = 10, 15
_FIRST = np.array([0, 0, 0, 1, 1, 2, 0, 1, 2, 4, 5, 6, 7, 8, 9])
_SECOND = np.array([0, 1, 2, 1, 2, 2, 3, 3, 3, 4, 4, 4, 4, 8, 9])
# Of the symmetric matrix (a b c, b d e, c e f): the minors a', b', ... are products of two less products of two; rows
# of its adjugate times the right side (the rows behind a to f), and times a b c: the determinant.
_MINORS = np.array([[[3, 2, 1, 0, 1, 0], [4, 1, 2, 2, 0, 1]], [[5, 4, 4, 5, 2, 3], [4, 5, 3, 2, 4, 1]]])
_ADJUGATE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5], [0, 1, 2]])
_SIDES = np.array([[6, 7, 8], [6, 7, 8], [6, 7, 8], [0, 1, 2]])
_PRIOR = _ANGLE_PRIOR * np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0])[:, None]
_NOISES = np.array([[1e-4], [1e-2]])


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
        """Return the quantities (`IDENTIFIED`, n) and the next memory (`MEMORY`, n).

        Args:
            memory: what the last call returned; meaningless in columns that are ``fresh``. Never written to.
            fresh: columns in which an episode starts, (n,), or one answer for all.
            seen: the present step.
        """
        steer, command, error = seen.steering_angle, seen.steering_command, seen.lateral_error
        before, sent, _, last, earlier, steps = memory[_SUMS:]
        factors = np.empty((_FACTORS, len(steer)))
        ways, rest, acceleration, turn, second = factors[:3], factors[3], factors[4], factors[7], factors[8]
        ways[0], ways[1:] = command, memory[_SUMS + 1 : _SUMS + 3]
        ways -= before
        np.subtract(steer, before, out=rest)
        rest -= self._response * ways[0]
        np.multiply(seen.speed, seen.yaw_rate, out=acceleration)
        factors[5], factors[6], factors[9] = seen.front_offset, seen.rear_offset, 1.0
        np.divide(seen.yaw_rate, np.maximum(seen.speed, _SLOWEST), out=turn)
        turn *= -self._wheelbase
        turn += steer
        turn -= self._understeer * acceleration
        np.subtract(error, last, out=second)
        second -= last
        second += earlier
        second *= steps > 1.0
        following = np.empty_like(memory)
        sums = following[:_SUMS]
        np.multiply(factors[_FIRST], factors[_SECOND], out=sums)
        sums += self._fade * memory[:_SUMS]
        if fresh is not False:
            started = np.broadcast_to(np.asarray(fresh), steer.shape)
            sums[:, started], sums[-1, started] = 0.0, 1.0
            sent, last = np.where(started, command, sent), np.where(started, error, last)
            steps = np.where(started, 0.0, steps)
        for row, value in enumerate((steer, command, sent, error, last, steps + 1.0), start=_SUMS):
            following[row] = value
        return _quantities(following), following


def _quantities(memory: Floats) -> Floats:
    found = np.empty((len(IDENTIFIED), memory.shape[1]))
    moments = memory[:9] + _PRIOR
    # Least squares of three: Cramer's rule, element by element, as cars are to be independent.
    products = np.multiply(*moments[_MINORS])
    parts = (products[0] - products[1])[_ADJUGATE]
    parts *= moments[_SIDES]
    solved = parts[:, 0] + parts[:, 1]
    solved += parts[:, 2]
    np.multiply(solved[:3], 5.0 / solved[3], out=found[:3])
    squares = memory[9] + _ACCELERATION_PRIOR
    np.multiply(memory[10:13], 100.0 / squares, out=found[3:6])
    noise = memory[13] / memory[14]
    np.divide(noise, noise + _NOISES, out=found[6:8])
    found[8] = squares / (squares + 400.0) - _ACCELERATION_PRIOR / (_ACCELERATION_PRIOR + 400.0)
    return np.minimum(np.maximum(found, -_LARGEST, out=found), _LARGEST, out=found)
