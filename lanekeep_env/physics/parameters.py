"""The numbers of a single-track car and of its steering.

Every record is frozen and checked when it is built, so that a wrong number is found where it was
written and not a thousand steps later as a NaN.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from lanekeep_env.checks import choose, plain_numbers, require, require_line, shown

GRAVITY = 9.81
#: Density of air, kg/m³.
AIR_DENSITY = 1.2
#: Lag that is not none, s: less is no actuator's, and divides numbers beyond what floats hold.
LEAST_LAG = 1e-6
#: A car's side area over length times width, and centre of wind pressure ahead of the middle over the wheelbase.
_SIDE_SHARE, _WIND_SHARE = 0.62, 0.17


@dataclass(frozen=True)
class SteeringActuator:
    """What stands between the steering command and the road wheel; everything is off by default.

    Attributes:
        lag: time constant of the first-order lag (PT1) in s, 0 for none, else at least `LEAST_LAG`.
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
        require("vehicle.steering.lag", self.lag, "s", at_least=0.0, at_most=100.0)
        require("vehicle.steering.rate_limit", self.rate_limit, "rad/s", at_least=1e-4, at_most=1e4, optional=True)
        require("vehicle.steering.angle_limit", self.angle_limit, "rad", at_least=1e-4, at_most=1.5, optional=True)
        require("vehicle.steering.delay", self.delay, "s", at_least=0.0, at_most=2.0)
        require("vehicle.steering.backlash", self.backlash, "rad", at_least=0.0, at_most=0.5)
        choose("vehicle.steering.feedback", self.feedback, ("road_wheel", "motor"))
        require("vehicle.steering.gain", self.gain, "", at_least=0.05, at_most=20.0)
        require("vehicle.steering.offset", self.offset, "rad", at_least=-0.5, at_most=0.5)
        if 0.0 < self.lag < LEAST_LAG:
            raise ValueError(
                f"vehicle.steering.lag={self.lag!r} s is not allowed: it must be 0, or at least {LEAST_LAG:g} s"
            )
        if self.backlash > 0.0 and self.lag == 0.0:
            raise ValueError(
                f"vehicle.steering.backlash={self.backlash!r} is not allowed with lag=0: a loop of infinite gain would "
                "chatter in the gap; give a lag > 0 s"
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
