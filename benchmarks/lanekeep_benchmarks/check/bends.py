"""A car in steady bends up to its limit: how wrong the single track is that knows of no load transfer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.checks import require
from lanekeep_env.physics import models
from lanekeep_env.physics.load_transfer import numbers_of, read
from lanekeep_env.physics.models import CarModel
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters

Floats = NDArray[np.float64]

#: Speed of the bends for a car of this wheelbase, m/s and m; others' is similar (the same v²/l).
SPEED, WHEELBASE = 25.0, 2.8
#: Lateral accelerations at which errors are told, m/s².
TOLD = (2.0, 4.0, 6.0, 8.0)
#: Angle by which the road wheel is turned further from bend to bend, and the last one, rad.
_TURN, _LAST = 1e-3, 0.6


@dataclass(frozen=True)
class Bend:
    """Steady bends of a model, one an angle: road-wheel angle (rad), sideslip (rad), lateral acceleration (m/s²)."""

    steer: Floats
    sideslip: Floats
    across: Floats


@dataclass(frozen=True)
class Bends:
    """Steady bends of a car at a speed (m/s) by tyre: linear, saturating, and saturating with load transfer."""

    car: VehicleParameters
    speed: float
    linear: Bend
    plain: Bend
    honest: Bend

    def errors(self) -> list[tuple[float, float]]:
        """(lateral acceleration, m/s², by how much more the saturating tyre gives at the same angle, a share)."""
        reached = [one for one in TOLD if one < self.honest.across.max()]
        return [(one, float(np.interp(one, self.honest.across, self.excess(self.plain)))) for one in reached]

    def excess(self, other: Bend) -> Floats:
        """By how much more ``other`` corners than the honest car at its angles, a share; NaN where it has no bend."""
        there = np.interp(self.honest.steer, other.steer, other.across, right=np.nan)
        return there / self.honest.across - 1.0


def bends_of(car: VehicleParameters, speed: float | None = None, friction: float = 1.0) -> Bends:
    """Return a car's steady bends; ``speed`` (m/s) is by default that of a car of its size, `SPEED` for `WHEELBASE`.

    Raises:
        ValueError: a number that is not allowed, or the car has no steady bend at that speed, where it is unstable.
    """
    speed = SPEED * math.sqrt(car.wheelbase / WHEELBASE) if speed is None else speed
    require("speed", speed, "m/s", at_least=1.0, at_most=100.0)
    require("friction", friction, "", at_least=1e-3, at_most=2.0)
    kinds = models.LINEAR, models.MAGIC_FORMULA, models.LOAD_SENSITIVE
    return Bends(car, speed, *(_bend(model, car, speed, friction) for model in kinds))


def _bend(model: CarModel, car: VehicleParameters, speed: float, friction: float) -> Bend:
    """Turn the wheel further as long as that turns the car faster, each time from the last bend on."""
    load = friction * car.mass * GRAVITY / car.wheelbase
    body = (
        *(car.cg_to_front_axle, car.cg_to_rear_axle, 1.0 / car.mass, 1.0 / car.yaw_inertia),
        *(car.front_cornering_stiffness, car.rear_cornering_stiffness),
        *(load * car.cg_to_rear_axle, load * car.cg_to_front_axle, None),
    )
    numbers, state = read(numbers_of(car)), np.zeros(2)
    rows: list[tuple[float, float, float]] = []
    for steer in np.arange(_TURN, _LAST, _TURN).tolist():

        def rates(beta: float, r: float, steer: float = steer) -> Floats:
            tyres = model.tyres(body, None, 0.0, speed * r, numbers)
            return np.array(model.rates(0.0, 0.0, beta, r, steer, speed, 0.0, tyres)[3:])

        state, settled = _steady(rates, state)
        across = speed * float(state[1])
        if not settled or across <= (rows[-1][2] if rows else 0.0):
            break
        rows.append((steer, float(state[0]), across))
    if not rows:
        raise ValueError(f"vehicle {car.name!r} has no steady bend at {speed:.3g} m/s: it is unstable there")
    return Bend(*np.array(rows).T)


def _steady(rates: Any, state: Floats) -> tuple[Floats, bool]:
    """Newton's method for no rates of sideslip and yaw rate; whether it got there."""
    for _ in range(20):
        here, small = rates(*state.tolist()), 1e-7
        slope = [(rates(*(state + step).tolist()) - here) / small for step in small * np.eye(2)]
        step = np.linalg.solve(np.transpose(slope), here)
        state = state - step
        if np.abs(step).max() < 1e-9:
            return state, True
    return state, False
