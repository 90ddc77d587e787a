"""What tyres that saturate slip more than linear ones in a steady bend, as slip offsets of `lq_model`.

The axles of a car that corners steadily at a bear F_f = m a l_r / l and F_r = m a l_f / l. Where `load_transfer` leaves
the loads, the front one bears more: steered wheels turn the car out of its bend (by the angle that wide bends take).
The linear tyre has the slip F / C; the magic formula, D sin(C atan(B alpha)), has more. With o = F / C - alpha, F
without that share, the linear car of `lq_model` corners as the other does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_env.physics.load_transfer import numbers_of, on_loads, read
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters
from lanekeep_env.physics.tyres import slip_at

#: Share of the peak, D, up to which axles are followed; beyond it, no slip gives the force that is asked for.
MOST_USED = 0.95
#: Rounds in which the steering's part of the front axle's force settles.
ROUNDS = 8
#: Lateral accelerations of the table, m/s².
_GRID: Floats = np.linspace(0.0, 30.0, 601)


class SlipOffsets:
    """o_f and o_r over lateral acceleration.

    Args:
        car: the nominal one.
        friction: of its tyres.
        transfers_load: whether acceleration changes them.
    """

    def __init__(self, car: VehicleParameters, friction: float, transfers_load: bool) -> None:
        front, rear, base = car.cg_to_front_axle, car.cg_to_rear_axle, car.wheelbase
        nominal = np.array([[car.front_cornering_stiffness], [car.rear_cornering_stiffness]])
        peak = np.array([[rear], [front]]) * friction * car.mass * GRAVITY / base * np.ones_like(_GRID)
        stiffness, beside = nominal * np.ones_like(_GRID), np.zeros_like(_GRID)
        if transfers_load:
            loads: Callable[..., Any] = on_loads  # without types, being compiled elsewhere
            body = (front, rear, 1.0 / car.mass, 1.0 / car.yaw_inertia, *stiffness, *peak, None)
            tyres = loads(body, np.ones_like(_GRID), peak, np.zeros_like(_GRID), _GRID, _numbers(car))
            stiffness, peak, beside = np.array(tyres[4:6]), np.array(tyres[6:8]), tyres[9]
        slip = np.zeros_like(peak)
        for _ in range(ROUNDS if transfers_load else 1):
            cosine, sine = np.cos(slip[0] - slip[1]), np.sin(slip[0] - slip[1])
            force = car.mass * _GRID * rear / (base * cosine - beside * sine)
            asked = np.array([force, car.mass * _GRID - force * cosine])
            given = np.minimum(asked, MOST_USED * peak)
            slip = slip_at(given, stiffness, peak)
        level = car.mass * _GRID / base * np.array([[rear], [front]])
        self._offsets: Floats = (level - (asked - given)) / nominal - slip

    def __call__(self, lateral_acceleration: Floats) -> tuple[Floats, Floats]:
        """Return o_f and o_r, rad, for accelerations in m/s² of any shape."""
        size, sign = np.abs(lateral_acceleration), np.sign(lateral_acceleration)
        front, rear = (sign * np.interp(size, _GRID, one) for one in self._offsets)
        return front, rear


def _numbers(car: VehicleParameters) -> Any:
    numbers: Callable[..., Any] = read
    return numbers(numbers_of(car))
