"""A vehicle file: how the linear single-track car steers and oscillates, and what does not go together in it."""

from __future__ import annotations

import math
import warnings

import numpy as np

from lanekeep_benchmarks.check.bends import Bends
from lanekeep_benchmarks.check.report import Report
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.scenario.integration import oddities

#: Speeds at which eigenvalues are told, m/s.
SPEEDS = (5.0, 15.0, 30.0, 50.0)


def eigenvalues(car: VehicleParameters, speed: float) -> np.ndarray:
    """Return both eigenvalues of sideslip and yaw rate of the linear single-track car at a speed (m/s), 1/s."""
    front, rear, stiff_f, stiff_r = (
        car.cg_to_front_axle,
        car.cg_to_rear_axle,
        car.front_cornering_stiffness,
        car.rear_cornering_stiffness,
    )
    moment = stiff_r * rear - stiff_f * front
    matrix = [
        [-(stiff_f + stiff_r) / (car.mass * speed), moment / (car.mass * speed**2) - 1.0],
        [moment / car.yaw_inertia, -(stiff_f * front**2 + stiff_r * rear**2) / (car.yaw_inertia * speed)],
    ]
    return np.linalg.eigvals(np.array(matrix))


def understeer_gradient(car: VehicleParameters) -> float:
    """Return the understeer gradient, rad of the road wheel for each m/s² of lateral acceleration."""
    front, rear = car.cg_to_front_axle, car.cg_to_rear_axle
    return car.mass / car.wheelbase * (rear / car.front_cornering_stiffness - front / car.rear_cornering_stiffness)


def check_vehicle(car: VehicleParameters, bends: Bends | None = None) -> Report:
    """Say how a car behaves, in ``bends`` as well, and what is odd about its numbers."""
    report = Report(f"vehicle {car.name}")
    report.add("mass", car.mass, "kg")
    report.add("wheelbase", car.wheelbase, "m")
    report.add("load on the front axle", car.cg_to_rear_axle / car.wheelbase, "(share)")
    gradient = understeer_gradient(car)
    report.add("understeer gradient", gradient, "rad/(m/s²)")
    if gradient > 0.0:
        report.add("characteristic speed", math.sqrt(car.wheelbase / gradient), "m/s")
    elif gradient < 0.0:
        report.add("critical speed", math.sqrt(-car.wheelbase / gradient), "m/s")
        report.notes.append("it oversteers: above its critical speed it is unstable")
    for speed in SPEEDS:
        pair = sorted(eigenvalues(car, speed), key=lambda value: value.imag)
        report.add(f"eigenvalues at {speed:g} m/s", ", ".join(_complex(value) for value in pair), "1/s")
    if bends is not None:
        for reached, error in bends.errors():
            report.add(f"single track too fast in bends, {reached:g} m/s² at {bends.speed:.3g} m/s", 100.0 * error, "%")
        report.add("largest lateral acceleration with load transfer", float(bends.honest.across.max()), "m/s²")
    angle = car.steering.angle_limit
    if angle is None:
        report.notes.append("steering has no angle limit: no turning circle")
    else:
        report.add("turning circle of the rear axle's middle", 2.0 * car.wheelbase / math.tan(angle), "m")
        outer = math.hypot(car.wheelbase, car.wheelbase / math.tan(angle) + 0.5 * car.width)
        report.add("turning circle of the outer front corner over the axle", 2.0 * outer, "m")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        report.notes += oddities(car)
    report.notes.append(f"source: {car.source}")
    return report


def _complex(value: complex) -> str:
    return f"{value.real:.3g}" if abs(value.imag) < 1e-9 else f"{value.real:.3g} {value.imag:+.3g}i"
