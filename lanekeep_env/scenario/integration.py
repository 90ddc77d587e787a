"""How a scenario's cars are integrated: step and slip-speed floor, or why they cannot be."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

from lanekeep_env.checks import shown
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters
from lanekeep_env.physics.single_track import SLIP_SPEED_FLOOR
from lanekeep_env.physics.stability import LARGEST_PRODUCT, LARGEST_TURN, MOST_DIVISIONS, Cars
from lanekeep_env.randomisation import Randomisation

#: Sum of squared orders of magnitude by which a car's proportions are off from which a mistaken unit is warned of.
ODD = 4.0
#: Orders of magnitude by which a single proportion is off from which it is told.
_ODD_ALONE = 0.7
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
_AXLES = ("cg_to_front_axle", "cg_to_rear_axle")
_TYRES = ("front_cornering_stiffness", "rear_cornering_stiffness")
#: Fields that are given in a mistaken unit, alone or together, that unit, and the factor that puts it right.
_MISTAKES: tuple[tuple[tuple[str, ...], str, float], ...] = (
    (("mass",), "t", 1e3),
    (("mass",), "g", 1e-3),
    (("yaw_inertia",), "t m²", 1e3),
    (("yaw_inertia",), "g m²", 1e-3),
    (("yaw_inertia",), "kg cm²", 1e-4),
    (("yaw_inertia",), "kg mm²", 1e-6),
    (("mass", "yaw_inertia"), "t and t m²", 1e3),
    (("mass", "yaw_inertia"), "g and g m²", 1e-3),
    *((fields, "mm", 1e-3) for fields in (_AXLES[:1], _AXLES[1:], _AXLES)),
    *((fields, "cm", 1e-2) for fields in (_AXLES[:1], _AXLES[1:], _AXLES)),
    *((fields, "km", 1e3) for fields in (_AXLES[:1], _AXLES[1:], _AXLES)),
    *((fields, "kN/rad", 1e3) for fields in (_TYRES[:1], _TYRES[1:], _TYRES)),
    *((fields, "N/deg", math.degrees(1.0)) for fields in (_TYRES[:1], _TYRES[1:], _TYRES)),
    *((fields, "mN/rad", 1e-3) for fields in (_TYRES[:1], _TYRES[1:], _TYRES)),
)


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
            f"angle of {steering_angle:g} rad it must be >= {shortest:.3g} m (or lower speed or max_steering_angle)"
        )
    return Integration(step / divisions)


def slipping(
    vehicle: VehicleParameters,
    drawn: Randomisation,
    step: float,
    slowest: Callable[[], float],
    fastest: float,
    pull: float | None = None,
) -> Integration:
    """Return the integration of a car on tyres, so that no car that is drawn leaves RK4's region of stability.

    Args:
        vehicle: the nominal car.
        drawn: what the cars of the episodes differ in.
        step: s, divided as often as need be.
        slowest: the lowest speed of all episodes, m/s; asked only where standstill would need a shorter step.
        fastest: the largest one.
        pull: largest acceleration along that changes the tyres' loads, m/s²; None where it does not.

    Raises:
        ValueError: the step would have to be divided more than `MOST_DIVISIONS` times, or the centre of gravity leaves
            the wheelbase.
    """
    _check_shift(vehicle, drawn)

    def bound(car: VehicleParameters) -> _Bound:
        cars = Cars.drawn(car, drawn)
        if pull is None:
            return _Bound(cars, cars.slip_speed_floor())
        return _Bound(cars.on_loads(car, (-pull, 0.0, pull)), cars.on_loads(car, (0.0,)).slip_speed_floor())

    found = bound(vehicle)
    floor = found.floor
    divisions = found.divisions(step, 0.0, fastest)
    if divisions > 1:
        low = slowest()
        divisions = found.divisions(step, low, fastest)
        if divisions > MOST_DIVISIONS:
            raise ValueError(_refusal(vehicle, bound, step, low, fastest))
    _warn_of_odd(vehicle)
    return Integration(step / divisions, floor)


@dataclass(frozen=True)
class _Bound:
    """The cars that can occur, and their slip-speed floor, m/s."""

    cars: Cars
    floor: float

    def fastest_mode(self, slowest: float, fastest: float) -> float:
        """Largest |eigenvalue| between two speeds (m/s), 1/s."""
        return self.cars.largest_eigenvalue(slowest, fastest, self.floor)

    def divisions(self, step: float, slowest: float, fastest: float) -> int:
        """Into how many steps one (s) is divided between two speeds, m/s."""
        return _divisions(self.fastest_mode(slowest, fastest) * step / LARGEST_PRODUCT)


def _divisions(times: float) -> int:
    return max(1, math.ceil(min(times, 1e9) - 1e-9))


def _check_shift(vehicle: VehicleParameters, drawn: Randomisation) -> None:
    least = NEAREST_AXLE * vehicle.wheelbase
    low, high = drawn.cg_shift
    front, rear = vehicle.cg_to_front_axle - least, vehicle.cg_to_rear_axle - least
    if high > max(front, 0.0) or -low > max(rear, 0.0):
        raise ValueError(
            f"randomisation.cg_shift={drawn.cg_shift!r} is not allowed: the centre of gravity of "
            f"{shown(vehicle.name)} must stay between the axles, {-rear:.3g} to {front:.3g} m"
        )


def _refusal(
    vehicle: VehicleParameters,
    bound: Callable[[VehicleParameters], _Bound],
    step: float,
    slowest: float,
    fastest: float,
) -> str:
    """Name the fields that are most likely wrong, what they may be, and the unit that they may have been given in."""
    fields, guess = _suspects(vehicle)
    given = " and ".join(f"vehicle.{field}={shown(getattr(vehicle, field))}" for field in fields)
    others = ", ".join(f"{name}={getattr(vehicle, name):g}" for name in _UNITS if name not in fields)
    answer = 1.0 / bound(vehicle).fastest_mode(slowest, fastest)

    def borne(factor: float) -> bool:
        return bound(_changed(vehicle, fields, factor)).divisions(step, slowest, fastest) <= MOST_DIVISIONS

    return (
        f"{given} is not allowed: with {others} the car answers within {answer:.1e} s at {slowest:g} m/s, too fast to "
        f"be integrated; {_nearest_allowed(vehicle, fields, borne)}{guess}"
    )


def _nearest_allowed(vehicle: VehicleParameters, fields: tuple[str, ...], borne: Callable[[float], bool]) -> str:
    """Say which values of ``fields`` next to their own could be integrated, with all others as they are."""
    falls = "stiffness" in fields[0]
    sign = -1.0 if falls else 1.0
    high = next((float(power) for power in range(1, 13) if borne(10.0 ** (sign * power))), 0.0)
    if not high:
        return "no value of it alone would do"
    low = 0.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if borne(10.0 ** (sign * middle)) else (middle, high)
    factor = 10.0 ** (sign * high)
    allowed = [f"{getattr(vehicle, field) * factor:.3g} {_UNITS[field]}" for field in fields]
    return f"it must be {'<=' if falls else '>='} {' and '.join(allowed)}"


def _suspects(vehicle: VehicleParameters) -> tuple[tuple[str, ...], str]:
    """Return the fields that are most likely wrong, and a guess at the unit that they were given in."""
    fields: tuple[str, ...] = ("mass",)
    best, guess = 0.8 * _oddness(vehicle), ""
    for candidates, unit, factor in _MISTAKES:
        changed = _changed(vehicle, candidates, factor)
        if _oddness(changed) < best:
            best, fields = _oddness(changed), candidates
            right = " and ".join(f"{getattr(changed, field):g} {_UNITS[field]}" for field in fields)
            guess = f" (was it given in {unit}? That would be {right})" if best < 1.0 else ""
    return fields, guess


def _warn_of_odd(vehicle: VehicleParameters) -> None:
    """Warn of a car that can be integrated and whose proportions are those of a mistaken unit."""
    if _oddness(vehicle) > ODD:
        fields, guess = _suspects(vehicle)
        if guess:
            given = " and ".join(f"vehicle.{field}={getattr(vehicle, field):g}" for field in fields)
            warnings.warn(f"{given} is unlike any car's{guess}", stacklevel=2)


def _changed(vehicle: VehicleParameters, fields: tuple[str, ...], factor: float) -> VehicleParameters:
    """A car with some numbers times ``factor``, whether they are allowed or not."""
    changed = copy(vehicle)
    for field in fields:
        object.__setattr__(changed, field, getattr(vehicle, field) * factor)
    return changed


def oddities(vehicle: VehicleParameters) -> list[str]:
    """Return what does not go together in a car's numbers: proportions unlike any car's, and a mistaken unit."""
    found = [
        f"{name} is {value:.3g}, usual is about {usual:g}"
        for name, value, usual in _proportions(vehicle)
        if abs(math.log10(value / usual)) > _ODD_ALONE
    ]
    if found or _oddness(vehicle) > ODD:
        fields, guess = _suspects(vehicle)
        if guess:
            found.append(f"{' and '.join(fields)} may be in a mistaken unit{guess}")
    if vehicle.length < vehicle.wheelbase:
        found.append(f"the body of {vehicle.length:g} m is shorter than the wheelbase of {vehicle.wheelbase:g} m")
    return found


def _proportions(vehicle: VehicleParameters) -> tuple[tuple[str, float, float], ...]:
    """What compares cars of all sizes: what it is, its value, and what it usually is."""
    front, rear, base = vehicle.cg_to_front_axle, vehicle.cg_to_rear_axle, vehicle.wheelbase
    weight = vehicle.mass * GRAVITY
    return (
        (
            "front cornering stiffness over the front axle's load",
            vehicle.front_cornering_stiffness * base / (weight * rear),
            8.0,
        ),
        (
            "rear cornering stiffness over the rear axle's load",
            vehicle.rear_cornering_stiffness * base / (weight * front),
            8.0,
        ),
        ("yaw inertia over mass and axle distances", vehicle.yaw_inertia / (vehicle.mass * front * rear), 0.8),
        ("mass over the cube of the wheelbase", vehicle.mass / base**3, 90.0),
        ("front over rear axle distance", front / rear, 1.0),
        ("length over wheelbase", vehicle.length / base, 1.6),
    )


def _oddness(vehicle: VehicleParameters) -> float:
    """How far the proportions are from any car's, full-size or model: a sum of squared orders of magnitude."""
    return sum(math.log10(value / usual) ** 2 for _, value, usual in _proportions(vehicle))
