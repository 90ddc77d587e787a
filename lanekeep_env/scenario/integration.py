"""How a scenario's cars are integrated: step and slip-speed floor, or why they cannot be."""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

from lanekeep_env.checks import shown
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters
from lanekeep_env.physics.single_track import SLIP_SPEED_FLOOR
from lanekeep_env.physics.stability import LARGEST_PRODUCT, LARGEST_TURN, MOST_DIVISIONS, Cars
from lanekeep_env.randomisation import Randomisation

#: A randomised centre of gravity stays this share of the wheelbase away from either axle.
NEAREST_AXLE = 0.05

_UNITS = {
    "mass": "kg",
    "yaw_inertia": "kg m²",
    "cg_to_front_axle": "m",
    "cg_to_rear_axle": "m",
    "front_cornering_stiffness": "N/rad",
    "rear_cornering_stiffness": "N/rad",
}
#: Unit that a field is mistaken in, and the factor that puts it right.
_MISTAKES = {
    "mass": (("t", 1e3), ("g", 1e-3)),
    "yaw_inertia": (("t m²", 1e3), ("g m²", 1e-3), ("kg mm²", 1e-6), ("kg cm²", 1e-4)),
    "cg_to_front_axle": (("mm", 1e-3), ("cm", 1e-2), ("km", 1e3)),
    "cg_to_rear_axle": (("mm", 1e-3), ("cm", 1e-2), ("km", 1e3)),
    "front_cornering_stiffness": (("kN/rad", 1e3), ("N/deg", math.degrees(1.0)), ("mN/rad", 1e-3)),
    "rear_cornering_stiffness": (("kN/rad", 1e3), ("N/deg", math.degrees(1.0)), ("mN/rad", 1e-3)),
}


@dataclass(frozen=True)
class Integration:
    """What the kernel integrates with: ``step`` in s, and the slip-speed floor in m/s (see `single_track`)."""

    step: float
    slip_speed_floor: float = SLIP_SPEED_FLOOR

    @property
    def lowered_floor(self) -> float | None:
        """The floor where it is not the usual one: kernels have that as a constant."""
        return self.slip_speed_floor if self.slip_speed_floor < SLIP_SPEED_FLOOR else None


def rolling(vehicle: VehicleParameters, step: float, fastest: float, steering_angle: float) -> Integration:
    """Return the integration of a car without slip: it may turn by `LARGEST_TURN` in a step, not more.

    Args:
        vehicle: the car.
        step: s, divided as often as need be.
        fastest: speed, m/s.
        steering_angle: the road wheel's largest, rad.

    Raises:
        ValueError: the step would have to be divided more than `MOST_DIVISIONS` times.
    """
    turn = fastest * math.tan(steering_angle) / vehicle.wheelbase * step
    divisions = _divisions(turn / LARGEST_TURN)
    if divisions > MOST_DIVISIONS:
        shortest = vehicle.wheelbase * turn / (LARGEST_TURN * MOST_DIVISIONS)
        raise ValueError(
            f"the vehicle's wheelbase of {vehicle.wheelbase:g} m is not allowed: at {fastest:g} m/s and a steering "
            f"angle of {steering_angle:g} rad it must be >= {shortest:.3g} m (are both distances to the axles in m?)"
        )
    return Integration(step / divisions)


def slipping(
    vehicle: VehicleParameters, drawn: Randomisation, step: float, slowest: Callable[[], float], fastest: float
) -> Integration:
    """Return the integration of a car on tyres, so that no car that is drawn leaves RK4's region of stability.

    Args:
        vehicle: the nominal car.
        drawn: what the cars of the episodes differ in.
        step: s, divided as often as need be.
        slowest: the lowest speed of all episodes, m/s; asked only where standstill would need a shorter step.
        fastest: the largest one.

    Raises:
        ValueError: the step would have to be divided more than `MOST_DIVISIONS` times, or the centre of gravity leaves
            the wheelbase.
    """
    _check_shift(vehicle, drawn)
    cars = Cars.drawn(vehicle, drawn)
    floor = cars.slip_speed_floor()
    divisions = _needed(cars, step, 0.0, fastest, floor)
    if divisions > 1:
        low = slowest()
        divisions = _needed(cars, step, low, fastest, floor)
        if divisions > MOST_DIVISIONS:
            raise ValueError(_refusal(vehicle, drawn, step, low, fastest))
    return Integration(step / divisions, floor)


def _needed(cars: Cars, step: float, slowest: float, fastest: float, floor: float) -> int:
    return _divisions(cars.largest_eigenvalue(slowest, fastest, floor) * step / LARGEST_PRODUCT)


def _divisions(times: float) -> int:
    return max(1, math.ceil(min(times, 1e9) - 1e-9))


def _check_shift(vehicle: VehicleParameters, drawn: Randomisation) -> None:
    least = NEAREST_AXLE * vehicle.wheelbase
    low, high = drawn.cg_shift
    front, rear = vehicle.cg_to_front_axle - least, vehicle.cg_to_rear_axle - least
    if high > max(front, 0.0) or -low > max(rear, 0.0):
        raise ValueError(
            f"randomisation.cg_shift={drawn.cg_shift!r} is not allowed: the centre of gravity of {vehicle.name!r} must "
            f"stay between the axles, {-rear:.3g} to {front:.3g} m"
        )


def _refusal(vehicle: VehicleParameters, drawn: Randomisation, step: float, slowest: float, fastest: float) -> str:
    """Name the field that is most likely wrong, what it may be, and the unit that it may have been given in."""
    field, hint = _suspect(vehicle)
    value = getattr(vehicle, field)
    others = ", ".join(f"{name}={getattr(vehicle, name):g}" for name in _UNITS if name != field)
    allowed = _nearest_allowed(vehicle, field, drawn, step, slowest, fastest)
    return (
        f"vehicle.{field}={shown(value)} is not allowed: with {others} the car answers within "
        f"{_answer(vehicle, drawn, slowest, fastest):.1e} s at {slowest:g} m/s, too fast to be integrated; "
        f"{allowed}{hint}"
    )


def _answer(vehicle: VehicleParameters, drawn: Randomisation, slowest: float, fastest: float) -> float:
    cars = Cars.drawn(vehicle, drawn)
    return 1.0 / cars.largest_eigenvalue(slowest, fastest, cars.slip_speed_floor())


def _nearest_allowed(
    vehicle: VehicleParameters, field: str, drawn: Randomisation, step: float, slowest: float, fastest: float
) -> str:
    """Say which value of ``field`` next to its own could be integrated, with all others as they are."""
    value, unit = getattr(vehicle, field), _UNITS[field]

    def borne(power: float) -> bool:
        cars = Cars.drawn(_changed(vehicle, field, 10.0**power), drawn)
        return _needed(cars, step, slowest, fastest, cars.slip_speed_floor()) <= MOST_DIVISIONS

    falls = "stiffness" in field
    bad, good = 0.0, next((power for power in range(1, 13) if borne(-power if falls else power)), 0)
    if not good:
        return "no value of it alone would do"
    low, high = bad, float(good)
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if borne(-middle if falls else middle) else (middle, high)
    return f"it must be {'<=' if falls else '>='} {value * 10.0 ** (-high if falls else high):.3g} {unit}"


def _suspect(vehicle: VehicleParameters) -> tuple[str, str]:
    """Return the field that is most likely wrong, and a guess at the unit that it was given in."""
    best, choice = 0.8 * _oddness(vehicle), ("mass", "")
    for field, mistakes in _MISTAKES.items():
        for unit, factor in mistakes:
            changed = _changed(vehicle, field, factor)
            if _oddness(changed) < best:
                best, right = _oddness(changed), getattr(changed, field)
                guess = f" (was it given in {unit}? That would be {right:g} {_UNITS[field]})"
                choice = field, guess if best < 1.0 else ""
    return choice


def _changed(vehicle: VehicleParameters, field: str, factor: float) -> VehicleParameters:
    """A car with one number times ``factor``, whether it is allowed or not."""
    changed = copy(vehicle)
    object.__setattr__(changed, field, getattr(vehicle, field) * factor)
    return changed


def _oddness(vehicle: VehicleParameters) -> float:
    """How far the proportions are from any car's, full-size or model: a sum of squared orders of magnitude."""
    front, rear, base = vehicle.cg_to_front_axle, vehicle.cg_to_rear_axle, vehicle.wheelbase
    weight = vehicle.mass * GRAVITY
    proportions = (
        (vehicle.front_cornering_stiffness * base / (weight * rear), 8.0),
        (vehicle.rear_cornering_stiffness * base / (weight * front), 8.0),
        (vehicle.yaw_inertia / (vehicle.mass * front * rear), 0.8),
        (vehicle.mass / base**3, 90.0),
        (front / rear, 1.0),
        (vehicle.length / base, 1.6),
    )
    return sum(math.log10(value / usual) ** 2 for value, usual in proportions)
