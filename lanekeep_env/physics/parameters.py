"""Vehicles: the numbers of a single-track car and of its steering, with their sources.

Every record is frozen and checked when it is built, so that a wrong number is found where it was
written and not a thousand steps later as a NaN.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from lanekeep_env.checks import choose, from_mapping, nearest, plain_numbers, require, require_line, shown, shown_path
from lanekeep_env.physics.vehicle_file import ENDINGS, read_vehicle_file

GRAVITY = 9.81
#: Density of air, kg/m³.
AIR_DENSITY = 1.2
#: A car's side area over length times width, and centre of wind pressure ahead of the middle over the wheelbase.
_SIDE_SHARE, _WIND_SHARE = 0.62, 0.17


@dataclass(frozen=True)
class SteeringActuator:
    """What stands between the steering command and the road wheel; everything is off by default.

    Attributes:
        lag: time constant of the first-order lag (PT1) in s, 0 for none.
        rate_limit: largest speed of the road wheel in rad/s, None for none.
        angle_limit: largest road-wheel angle in rad, either side, None for none.
        delay: transport delay of the command in s, a multiple of 10 ms, or of 5 ms between walls.
        backlash: play of the steering gear between motor and road wheel, the whole gap in rad of the road wheel. The
            lag is then that of a P loop which sets the motor's speed, (command - measured angle) / lag within the rate
            limit; see `advance_gear`.
        feedback: the angle which that loop measures, "road_wheel" (behind the gear) or "motor".
        gain: road-wheel angle over the one that the actuator is told; a policy that knows the car counts on 1.
        offset: what the road wheel has more than that, rad; such a policy counts on none.
    """

    lag: float = 0.0
    rate_limit: float | None = None
    angle_limit: float | None = None
    delay: float = 0.0
    backlash: float = 0.0
    feedback: str = "road_wheel"
    gain: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        require("steering.lag", self.lag, "s", at_least=0.0, at_most=100.0)
        require("steering.rate_limit", self.rate_limit, "rad/s", at_least=1e-4, at_most=1e4, optional=True)
        require("steering.angle_limit", self.angle_limit, "rad", at_least=1e-4, at_most=1.5, optional=True)
        require("steering.delay", self.delay, "s", at_least=0.0, at_most=2.0)
        require("steering.backlash", self.backlash, "rad", at_least=0.0, at_most=0.5)
        choose("steering.feedback", self.feedback, ("road_wheel", "motor"))
        require("steering.gain", self.gain, "", at_least=0.05, at_most=20.0)
        require("steering.offset", self.offset, "rad", at_least=-0.5, at_most=0.5)
        if self.backlash > 0.0 and self.lag == 0.0:
            raise ValueError(
                f"steering.backlash={self.backlash!r} is not allowed with lag=0: a loop of infinite gain would chatter "
                "in the gap; give a lag > 0 s"
            )
        plain_numbers(self)


@dataclass(frozen=True)
class VehicleParameters:
    """A single-track car (axles, not wheels; SI units; ISO 8855 axes).

    Attributes:
        name: what tables and files call it.
        mass: kg.
        yaw_inertia: about the vertical axis through the centre of gravity, kg m².
        cg_to_front_axle: distance from the centre of gravity to the front axle, m.
        cg_to_rear_axle: distance from the centre of gravity to the rear axle, m.
        front_cornering_stiffness: of the whole front axle, N/rad.
        rear_cornering_stiffness: of the whole rear axle, N/rad.
        steering_ratio: steering-wheel angle over road-wheel angle.
        steering: the actuator between the command and the road wheel.
        length, width: of the body, m (pictures and clearances).
        wheel_radius: m (encoders).
        side_area: of the wind's side force over its pressure and the sine of its angle, m²: side-force coefficient a
            radian times reference area. None for 0.62 of length times width, 5 m² of a passenger car (stated here).
        wind_lever: centre of wind pressure ahead of the centre of gravity, m; None for 0.17 of the wheelbase ahead of
            the middle between the axles (stated here).
        cg_height: of the centre of gravity above the road, m; None for a fifth of the wheelbase. This and the following
            are read by ``tyre="load_sensitive"`` alone.
        track_width: between the wheels of an axle, m; None for 0.85 of the body's width.
        front_roll_stiffness: share of the front axle in the car's roll stiffness.
        friction_load_sensitivity: share of the tyres' friction that is lost as their load doubles from that of the car
            at rest; linear in the load.
        stiffness_load_sensitivity: the same of their cornering stiffness over load.
        source: where the numbers come from.
    """

    name: str
    mass: float
    yaw_inertia: float
    cg_to_front_axle: float
    cg_to_rear_axle: float
    front_cornering_stiffness: float
    rear_cornering_stiffness: float
    steering_ratio: float = 1.0
    steering: SteeringActuator = field(default_factory=SteeringActuator)
    length: float = 4.5
    width: float = 1.8
    wheel_radius: float = 0.3
    side_area: float | None = None
    wind_lever: float | None = None
    cg_height: float | None = None
    track_width: float | None = None
    front_roll_stiffness: float = 0.55
    friction_load_sensitivity: float = 0.15
    stiffness_load_sensitivity: float = 0.25
    source: str = "user"

    def __post_init__(self) -> None:
        require("vehicle.mass", self.mass, "kg", at_least=1e-3, at_most=1e6)
        require("vehicle.yaw_inertia", self.yaw_inertia, "kg m²", at_least=1e-7, at_most=1e8)
        require("vehicle.cg_to_front_axle", self.cg_to_front_axle, "m", at_least=1e-3, at_most=100.0)
        require("vehicle.cg_to_rear_axle", self.cg_to_rear_axle, "m", at_least=1e-3, at_most=100.0)
        for axle in ("front", "rear"):
            name = f"{axle}_cornering_stiffness"
            require(f"vehicle.{name}", getattr(self, name), "N/rad", at_least=1e-2, at_most=1e9)
        require("vehicle.steering_ratio", self.steering_ratio, "", at_least=1e-3, at_most=1e3)
        require("vehicle.length", self.length, "m", at_least=1e-3, at_most=100.0)
        require("vehicle.width", self.width, "m", at_least=1e-3, at_most=100.0)
        require("vehicle.wheel_radius", self.wheel_radius, "m", at_least=1e-3, at_most=10.0)
        require("vehicle.side_area", self.side_area, "m²", at_least=0.0, at_most=1e3, optional=True)
        require("vehicle.wind_lever", self.wind_lever, "m", at_least=-100.0, at_most=100.0, optional=True)
        require("vehicle.cg_height", self.cg_height, "m", at_least=0.0, at_most=20.0, optional=True)
        require("vehicle.track_width", self.track_width, "m", at_least=1e-3, at_most=100.0, optional=True)
        require("vehicle.front_roll_stiffness", self.front_roll_stiffness, "(a share)", at_least=0.0, at_most=1.0)
        for name in ("friction_load_sensitivity", "stiffness_load_sensitivity"):
            require(f"vehicle.{name}", getattr(self, name), "(a share)", at_least=0.0, at_most=0.3)
        for name in ("name", "source"):
            require_line(f"vehicle.{name}", getattr(self, name))
        if not isinstance(self.steering, SteeringActuator):
            raise ValueError(f"vehicle.steering={shown(self.steering)} must be a mapping of SteeringActuator's fields")
        plain_numbers(self)

    @property
    def wheelbase(self) -> float:
        """Distance between the axles, m."""
        return self.cg_to_front_axle + self.cg_to_rear_axle

    @property
    def wind(self) -> tuple[float, float]:
        """Side area, m², and lever of the wind, m, with what stands for None."""
        middle = 0.5 * (self.cg_to_front_axle - self.cg_to_rear_axle)
        area = _SIDE_SHARE * self.length * self.width if self.side_area is None else self.side_area
        return area, middle + _WIND_SHARE * self.wheelbase if self.wind_lever is None else self.wind_lever

    @property
    def height(self) -> float:
        """Of the centre of gravity above the road, m."""
        return 0.2 * self.wheelbase if self.cg_height is None else self.cg_height

    @property
    def track(self) -> float:
        """Between the wheels of an axle, m."""
        return 0.85 * self.width if self.track_width is None else self.track_width


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
                f"vehicle={shown(value)} is unknown{nearest(value, VEHICLES)}; allowed: {', '.join(VEHICLES)}"
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
        raise ValueError(
            f"vehicle has no field {shown(unknown[0])}{nearest(unknown[0], fields)}; allowed: base, {', '.join(fields)}"
        )
    return replace(base, **changes)
