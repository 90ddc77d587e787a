"""What tyres that saturate slip more than linear ones in a steady bend, as slip offsets of `lq_model`.

The axles of a car that corners steadily at a bear F_f = m a l_r / l and F_r = m a l_f / l, whatever its tyres are. The
linear tyre has the slip F / C; the magic formula, D sin(C atan(B alpha)), has more, and more still on the loads that
`load_transfer` leaves. With o = F / C - alpha the linear car of `lq_model` corners as the other does.
"""

from __future__ import annotations

import numpy as np

from lanekeep_baselines.policy import Floats
from lanekeep_env.physics.load_transfer import numbers_of, on_loads, read
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters
from lanekeep_env.physics.tyres import MAGIC_FORMULA_SHAPE

#: Share of the peak, D, up to which axles are followed; beyond it, no slip gives the force that is asked for.
MOST_USED = 0.95
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
        base, weight = car.wheelbase, car.mass * GRAVITY
        shares = np.array([car.cg_to_rear_axle, car.cg_to_front_axle]) / base
        nominal = np.array([car.front_cornering_stiffness, car.rear_cornering_stiffness])
        one = np.ones_like(_GRID)
        stiffness, peak = np.outer(nominal, one), np.outer(friction * weight * shares, one)
        if transfers_load:
            axles = car.cg_to_front_axle * one, car.cg_to_rear_axle * one, one / car.mass, one / car.yaw_inertia
            tyres = on_loads((*axles, *stiffness, *peak, None), one, tuple(peak), 0.0 * one, _GRID, read(numbers_of(car)))
            stiffness, peak = np.array(tyres[4:6]), np.array(tyres[6:8])
        force = np.outer(car.mass * shares, _GRID)
        used = np.minimum(force / peak, MOST_USED)
        slip = MAGIC_FORMULA_SHAPE * peak / stiffness * np.tan(np.arcsin(used) / MAGIC_FORMULA_SHAPE)
        self._offsets: Floats = used * peak / nominal[:, None] - slip

    def __call__(self, lateral_acceleration: Floats) -> tuple[Floats, Floats]:
        """Return o_f and o_r, rad, for accelerations in m/s² of any shape."""
        size, sign = np.abs(lateral_acceleration), np.sign(lateral_acceleration)
        front, rear = (sign * np.interp(size, _GRID, one) for one in self._offsets)
        return front, rear
