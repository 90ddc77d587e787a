"""Vehicles by name, with their sources, and how users describe one of their own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from lanekeep_env.checks import from_mapping, nearest, shown, shown_path
from lanekeep_env.physics.parameters import GRAVITY, SteeringActuator, VehicleParameters
from lanekeep_env.physics.vehicle_file import ENDINGS, read_vehicle_file


def _commonroad(
    number: int,
    mass: float,
    inertia: float,
    front: float,
    rear: float,
    size: tuple[float, float],
    angle: float,
    roll: tuple[float, float, float],
) -> VehicleParameters:
    """A CommonRoad vehicle; its normalised stiffness C_S becomes C = mu C_S m g l_other / l, mu C_S = -p_ky1.

    ``roll`` is h_cg, the mean of T_f and T_r, and the front's share of K_s T²/2 - K_ts; its tyres are proportional to
    their load.
    """
    scale = 21.92 * mass * GRAVITY / (front + rear)
    return VehicleParameters(
        name=f"commonroad-{number}",
        mass=mass,
        yaw_inertia=inertia,
        cg_to_front_axle=front,
        cg_to_rear_axle=rear,
        front_cornering_stiffness=scale * rear,
        rear_cornering_stiffness=scale * front,
        steering=SteeringActuator(rate_limit=0.4, angle_limit=angle),
        length=size[0],
        width=size[1],
        cg_height=roll[0],
        track_width=roll[1],
        front_roll_stiffness=roll[2],
        friction_load_sensitivity=0.0,
        stiffness_load_sensitivity=0.0,
        source=f"CommonRoad vehicle models 2020a, vehicle {number} (Althoff, Koschi, Manzinger 2017)",
    )


_COMMONROAD: tuple[tuple[Any, ...], ...] = (
    (1, 1225.8878467253344, 1538.8533713561394, 0.88392, 1.50876, (4.298, 1.674), 0.91, (0.558, 1.407, 0.605)),
    (
        2,
        1093.2952334674046,
        1791.5995300122856,
        1.1561957064,
        1.4227170936,
        (4.508, 1.61),
        1.066,
        (0.575, 1.375, 0.593),
    ),
    (
        3,
        1478.8979637767998,
        2473.1176915564442,
        1.1507916024,
        1.3211363976,
        (4.569, 1.844),
        1.023,
        (0.748, 1.559, 0.582),
    ),
)

VEHICLES: dict[str, VehicleParameters] = {
    car.name: car
    for car in (
        VehicleParameters(
            name="yin",
            mass=1700.0,
            yaw_inertia=2700.0,
            cg_to_front_axle=1.3,
            cg_to_rear_axle=1.5,
            front_cornering_stiffness=61850.0,
            rear_cornering_stiffness=107665.0,
            steering_ratio=16.0,
            steering=SteeringActuator(lag=1.0 / 11.16),
            source=(
                "Yin 2010, a physical car decoded from the printed gains at 25 m/s (b2 = 1.861 1/s², "
                "a22 = -128.4 m/s²); stiffnesses within that rounding that give all printed digits of k_c"
            ),
        ),
        VehicleParameters(
            name="van",
            mass=2500.0,
            yaw_inertia=4500.0,
            cg_to_front_axle=1.4,
            cg_to_rear_axle=1.6,
            front_cornering_stiffness=90_000.0,
            rear_cornering_stiffness=90_000.0,
            steering_ratio=18.0,
            steering=SteeringActuator(
                lag=0.25, rate_limit=math.radians(20.0), angle_limit=0.6, backlash=math.radians(2.0)
            ),
            length=4.6,
            width=1.9,
            source=(
                "Trächtler, Lohmann, Struck 1992: lag 0.25 s. The article gives no other number: wheelbase 3 m, motor "
                "20 deg/s and gap 2 deg at the road wheel, body and masses are stated here as those of such a van"
            ),
        ),
        VehicleParameters(
            name="passat",
            mass=1950.0,
            yaw_inertia=3200.0,
            cg_to_front_axle=1.20,
            cg_to_rear_axle=1.51,
            front_cornering_stiffness=90_000.0,
            rear_cornering_stiffness=120_000.0,
            steering_ratio=15.7,
            steering=SteeringActuator(lag=0.05, angle_limit=0.6),
            length=4.77,
            width=1.82,
            wheel_radius=0.316,
            source=(
                "VW Passat Variant 2.0 FSI with 250 kg load (Werling, Gröll, Bretthauer 2008): wheelbase 2.71 m. "
                "Masses, stiffnesses and the actuator's 50 ms are those with which the article's figures were checked"
            ),
        ),
        VehicleParameters(
            name="knightriders",
            mass=5.0,
            yaw_inertia=0.1,
            cg_to_front_axle=0.175,
            cg_to_rear_axle=0.175,
            front_cornering_stiffness=120.0,
            rear_cornering_stiffness=130.0,
            steering=SteeringActuator(angle_limit=math.radians(22.0)),
            length=0.532,
            width=0.265,
            wheel_radius=0.033,
            source=(
                "Team KnightRiders 2017: wheelbase 0.35 m. The report gives no other number: steering limit (22 deg), "
                "body, wheel, mass and tyres are assumptions, those of a 1:10 car with a Kinect"
            ),
        ),
        VehicleParameters(
            name="pses",
            mass=4.0,
            yaw_inertia=0.06,
            cg_to_front_axle=0.129,
            cg_to_rear_axle=0.129,
            front_cornering_stiffness=100.0,
            rear_cornering_stiffness=110.0,
            steering=SteeringActuator(angle_limit=math.atan(0.258 / 0.93)),
            length=0.44,
            width=0.265,
            wheel_radius=0.033,
            source=(
                "PSES platform as documented: wheelbase 0.258 m, body 0.44 x 0.265 m, rear axle's turning radius "
                "0.93 m; wheel, mass and tyres are stated here as those of a 1:10 car"
            ),
        ),
        VehicleParameters(
            name="f1tenth",
            mass=3.74,
            yaw_inertia=0.04712,
            cg_to_front_axle=0.15875,
            cg_to_rear_axle=0.17145,
            front_cornering_stiffness=1.0489 * 4.718 * 3.74 * GRAVITY * 0.17145 / 0.3302,
            rear_cornering_stiffness=1.0489 * 5.4562 * 3.74 * GRAVITY * 0.15875 / 0.3302,
            steering=SteeringActuator(rate_limit=3.2, angle_limit=0.4189),
            length=0.58,
            width=0.31,
            wheel_radius=0.05,
            cg_height=0.074,
            source=(
                "F1TENTH, 1:10: the identified parameters of f1tenth_gym (O'Kelly, Zheng, Karthik, Mangharam 2020, "
                "PMLR 123), axle stiffness = mu C_S times the axle's load; its friction is 1.0489, its largest "
                "acceleration 9.51 m/s²; the wheel's radius is stated here"
            ),
        ),
        *(_commonroad(*row) for row in _COMMONROAD),
    )
}


#: What cars are often given by, and of what it is made here.
_MADE_OF = {"wheelbase": " (it is cg_to_front_axle + cg_to_rear_axle)"}


def vehicle_from(value: str | Path | Mapping[str, Any] | VehicleParameters) -> VehicleParameters:
    """Read a vehicle: a name, a record, a file, or a mapping of changes to one of these (``base``, "yin" if absent).

    A mapping under ``steering`` is one of changes, too. A file is YAML or JSON (see `read_vehicle_file`).

    Raises:
        ValueError: unknown name or field (the nearest valid one is named), or a value out of range.
    """
    if isinstance(value, VehicleParameters):
        return value
    if isinstance(value, Path) or (isinstance(value, str) and value.lower().endswith(ENDINGS)):
        changes = read_vehicle_file(value)
        if isinstance(changes.get("base"), str) and changes["base"] not in VEHICLES:
            raise ValueError(
                f"vehicle file {str(value)!r}: base={shown(changes['base'])} is unknown"
                f"{nearest(changes['base'], VEHICLES)}; allowed: {', '.join(VEHICLES)}"
            )
        try:
            return vehicle_from(changes)
        except ValueError as error:
            raise ValueError(f"vehicle file {shown_path(value)!r}: {error}") from None
    if isinstance(value, str):
        if value not in VEHICLES:
            raise ValueError(
                f"vehicle={shown(value)} is unknown{nearest(value, VEHICLES)}; allowed: {', '.join(VEHICLES)}, "
                f"or a file ({', '.join(ENDINGS)})"
            )
        return VEHICLES[value]
    if not isinstance(value, Mapping):
        raise ValueError(
            f"vehicle={shown(value)} must be a name, a file (.yaml, .json), a mapping of fields or VehicleParameters"
        )
    changes = dict(value)
    base = vehicle_from(changes.pop("base", "yin"))
    if isinstance(changes.get("steering"), Mapping):
        gear = {**asdict(base.steering), **changes["steering"]}
        changes["steering"] = from_mapping(SteeringActuator, gear, "vehicle.steering")
    if "name" in changes:  # which would hide what it was
        changes.setdefault("source", f"changes to {base.name}: {base.source}"[:1000])
    changes.setdefault("name", f"{base.name} (changed)" if changes else base.name)
    unknown = [key for key in changes if key not in VehicleParameters.__dataclass_fields__]
    if unknown:
        fields = VehicleParameters.__dataclass_fields__
        near = _MADE_OF.get(unknown[0]) or nearest(unknown[0], fields)
        raise ValueError(f"vehicle has no field {shown(unknown[0])}{near}; allowed: base, {', '.join(fields)}")
    return replace(base, **changes)
