"""What scenarios of a single car share, on roads and between walls: vehicle, action, cost, randomisation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, require
from lanekeep_env.physics.integrate import DRIVEN, HELD, LARGEST_SPEED, PROFILE
from lanekeep_env.physics.models import CarModel
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES, vehicle_from
from lanekeep_env.randomisation import (
    CENTRE_OF_GRAVITY,
    FRICTION,
    LAG,
    OFFSET,
    RANDOMISATIONS,
    SPEED,
    TYRES,
    Randomisation,
    randomisation_from,
)
from lanekeep_env.roads.speed import LimitedSpeed, SetSpeeds, SpeedSpec
from lanekeep_env.scenario.base import ScenarioRecord
from lanekeep_env.scenario.effects import Need

ACTIONS = {"steering_angle": at.STEERING_ANGLE, "steering_rate": at.STEERING_RATE}
#: Whose speed costs.
EFFORTS = ("road_wheel", "motor")
#: Shortest control step, s.
SHORTEST_STEP = 0.001
#: Longest episode, control steps.
_LONGEST = 10_000_000
#: Largest angle of the road wheel, whatever it is told, rad.
LARGEST_ANGLE = 1.5
#: What a departure or a contact does.
DEPARTURES = {"terminate": at.TERMINATE, "cost": at.COST, "off": at.OFF}

#: Why randomised numbers have no effect where a scenario has not what they take, and whether it has.
NEEDED: dict[str, tuple[str, Callable[[Any], bool]]] = {
    TYRES: ("the car rolls without slip, so neither its mass nor its tyres move it", lambda s: s.model.slips),
    FRICTION: ("only saturating tyres know friction, and this car has none", lambda s: s.model.saturates),
    CENTRE_OF_GRAVITY: ("errors are the rear axle's, wherever the centre of gravity is", lambda s: s.axles[1] > 0.0),
    SPEED: ("the car's speed follows from the actions", lambda s: s.sets_speed),
    LAG: ("the steering of the vehicle has no lag to multiply", lambda s: s.vehicle.steering.lag > 0.0),
    OFFSET: ("the scenario's own steering_offset bounds it there", lambda s: not hasattr(s, "steering_offset")),
}


def _varies(scenario: Any) -> bool:
    """Whether set speeds differ, if speeds are set."""
    return not isinstance(scenario.speed, SetSpeeds) or scenario.speed.varies


def _accelerates(scenario: Any) -> bool:
    """Whether the speed changes within an episode."""
    speed = scenario.speed
    if not isinstance(speed, SetSpeeds):
        return True
    slows = scenario.slows_for_bends and speed.lateral_limit > 0.0
    return slows or scenario.stops or (speed.varies and speed.hold is not None)


@dataclass(frozen=True)
class CarScenario(ScenarioRecord):
    """A car; every field is a keyword of ``gym.make``. Subclasses add where it drives, and what their task needs.

    Attributes:
        vehicle: a name (`VEHICLES`), a mapping of changes to a named one (``{"base": "yin", "mass": 2000.0}``)
            or `VehicleParameters`.
        speed: m/s, or a mapping; see the subclass.
        action: "steering_angle" (the action is the road-wheel angle asked for) or "steering_rate".
        max_steering_angle: road-wheel angle that action 1 asks for, rad; also bounds the command in rate mode.
        max_steering_rate: road-wheel speed that action 1 asks for, rad/s (rate mode).
        reference_lateral_error: m, of the running cost min(cost_cap, (lateral error / reference_lateral_error)² +
            cost_weight (road-wheel speed / reference_steering_rate)²), 1/s.
        cost_weight: of the running cost's second term, without unit.
        reference_steering_rate: of the road wheel, rad/s, in the running cost's second term.
        cost_cap: 1/s, the most that the running cost is.
        effort: whose speed the running cost's second term counts: "road_wheel", or the steering's "motor" (in terms of
            the road wheel), which moves inside the gear's gap as well. With backlash only.
        observation: "measured" (what sensors give) or "full" (adds channels of the true state).
        randomisation: what differs from episode to episode: "nominal", "mismatch", "stress" or a mapping of
            bounds (see `Randomisation`).
        episode_steps: control steps of an episode: it is truncated after them, and a departure or a contact is charged
            for the rest of them; "lap" for as many as one pass of the road, or of all ``laps``, takes.
            ``max_episode_steps`` of ``gym.make`` can only shorten an episode.
    """

    vehicle: VehicleParameters = VEHICLES["yin"]
    speed: SpeedSpec = field(default_factory=LimitedSpeed)
    action: str = "steering_angle"
    max_steering_angle: float = 0.15
    max_steering_rate: float = 0.4
    reference_lateral_error: float = 0.5
    cost_weight: float = 1.0
    reference_steering_rate: float = 0.1
    cost_cap: float = 16.0
    effort: str = "road_wheel"
    observation: str = "measured"
    randomisation: Randomisation = field(default_factory=Randomisation)
    episode_steps: int = 600

    #: Whether set speeds may be those of either way.
    both_ways: ClassVar[bool] = False
    #: Bound of the channel that shows the speed, m/s.
    largest_observed_speed: ClassVar[float] = LARGEST_SPEED
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {"vehicle": vehicle_from, "randomisation": randomisation_from}
    _sets: ClassVar[dict[str, Iterable[Any]]] = {"randomisation": RANDOMISATIONS.values()}
    _needs: ClassVar[tuple[Need, ...]] = (
        Need(
            "max_steering_rate",
            "road-wheel speed that action 1 asks for",
            "the action is an angle; action='steering_rate' has a rate",
            lambda s: s.action == "steering_rate",
        ),
        Need(
            "reference_steering_rate",
            "of the running cost's second term",
            "cost_weight=0 takes that term away",
            lambda s: s.cost_weight > 0.0,
        ),
        Need(
            "effort",
            "whose speed costs",
            "vehicle.steering.backlash=0 leaves motor and road wheel no gap",
            lambda s: s.vehicle.steering.backlash > 0.0,
        ),
        Need("effort", "whose speed costs", "cost_weight=0 takes that term away", lambda s: s.cost_weight > 0.0),
        Need("speed.hold", "time of a set speed", "all set speeds are the same", _varies, neutral=(None,)),
        Need(
            "speed.lateral_acceleration",
            "limit that slows the car down before bends",
            "backwards, and between walls, the car does not know of bends before it is in them",
            lambda s: s.slows_for_bends,
            neutral=(None,),
        ),
        Need(
            "speed.acceleration", "largest change of speed", "an episode has one speed, reached at once", _accelerates
        ),
        *(
            Need(f"randomisation.{f.name}", f.metadata["what"], *NEEDED[f.metadata["needs"]])
            for f in fields(Randomisation)
            if f.metadata["needs"]
        ),
    )

    def _settle(self) -> None:
        super()._settle()
        if isinstance(self.episode_steps, str):
            choose("episode_steps", self.episode_steps, ("lap",))
            require("control_step", self.control_step, "s", above=0.0, at_most=1.0)
            seconds = self._lap()
            if not seconds / self.control_step <= _LONGEST:
                raise ValueError(
                    f"episode_steps='lap' is not allowed: a lap takes {seconds:.3g} s; give a number of steps"
                )
            object.__setattr__(self, "episode_steps", max(1, math.ceil(seconds / self.control_step)))

    def _lap(self) -> float:
        """Seconds that a lap takes at the most; ValueError where there is none."""
        raise ValueError("episode_steps='lap' is not allowed: there is no lap to drive; give a number of steps")

    def _check(self) -> None:
        choose("action", self.action, ACTIONS)
        require("max_steering_angle", self.max_steering_angle, "rad", at_least=1e-6, at_most=1.5)
        self._check_angles()
        require("max_steering_rate", self.max_steering_rate, "rad/s", at_least=1e-4, at_most=1e3)
        require("reference_lateral_error", self.reference_lateral_error, "m", at_least=1e-4, at_most=1e3)
        require("cost_weight", self.cost_weight, "", at_least=0.0, at_most=1e6)
        require("reference_steering_rate", self.reference_steering_rate, "rad/s", at_least=1e-4, at_most=1e3)
        require("cost_cap", self.cost_cap, "1/s", at_least=1e-6, at_most=1e6)
        choose("effort", self.effort, EFFORTS)
        choose("observation", self.observation, ("measured", "full"))
        require("control_step", self.control_step, "s", at_least=SHORTEST_STEP, at_most=1.0)
        multiple_of_step("vehicle.steering.delay", self.vehicle.steering.delay, self.base_step)
        check_speed(self.speed.largest, self.randomisation, self.largest_observed_speed)
        self._check_hold()
        slowest = getattr(self.speed, "minimum", None)
        if slowest is not None and not self.both_ways:
            require("speed.minimum", slowest, "m/s", at_least=0.0)
        require("episode_steps", self.episode_steps, "steps", at_least=1, at_most=_LONGEST, whole=True)

    def _check_angles(self) -> None:
        """Command and offset together must leave the wheel short of standing across."""
        if self.widest_angle > LARGEST_ANGLE:
            raise ValueError(
                f"max_steering_angle={self.max_steering_angle!r} is not allowed: with gain and offset of the steering "
                f"the road wheel turns to {self.widest_angle:.3g} rad, and it must be <= {LARGEST_ANGLE} rad in all"
            )

    def _check_hold(self) -> None:
        """Set speeds change at control steps."""
        hold = getattr(self.speed, "hold", None)
        steps = 1.0 if hold is None else hold / self.control_step
        if steps < 0.5 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"speed.hold={hold!r} is not allowed: it must be a multiple of the control step, {self.control_step} s"
            )

    @property
    def model(self) -> CarModel:
        """The vehicle model."""
        raise NotImplementedError

    @property
    def axles(self) -> tuple[float, float]:
        """Distance of the front and the rear axle from the reference point, whose errors are lateral and heading, m."""
        return self.vehicle.cg_to_front_axle, self.vehicle.cg_to_rear_axle

    @property
    def sets_speed(self) -> bool:
        """Whether the environment sets the speed, and not an action."""
        return True

    @property
    def slows_for_bends(self) -> bool:
        """Whether the road's bends limit the speed."""
        return True

    @property
    def stops(self) -> bool:
        """Whether something stops the car within an episode."""
        return False

    @property
    def largest_angle(self) -> float:
        """Largest angle of the road wheel that can be commanded, rad."""
        return min(self.max_steering_angle, self.vehicle.steering.angle_limit or math.inf)

    @property
    def motor_costs(self) -> bool:
        """Whether the motor's way costs, and not the road wheel's, which is another one."""
        return self.effort == "motor" and self.vehicle.steering.backlash > 0.0

    @property
    def widest_angle(self) -> float:
        """Largest angle that the road wheel turns to, rad, with gain and offset of the steering."""
        return self.largest_gain * self.largest_angle + self._largest_offset

    @property
    def largest_gain(self) -> float:
        """Of the road wheel's angle over the one that is asked for."""
        return self.vehicle.steering.gain * self.randomisation.steering_gain[1]

    @property
    def _largest_offset(self) -> float:
        """Of the road wheel to either side, rad."""
        return max(abs(self.vehicle.steering.offset + bound) for bound in self.randomisation.steering_offset)

    @property
    def largest_cost(self) -> float:
        """What a second costs at most, 1/s."""
        return self.cost_cap

    @property
    def num_actions(self) -> int:
        """Steering only."""
        return 1

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`: a number, or those of this row and the following ones."""
        car, steering, step = self.vehicle, self.vehicle.steering, self.integration.step
        substeps = round(self.control_step / step)
        longest = steering.delay + self.randomisation.steering_delay[1]
        rate_mode = self.action == "steering_rate"
        return {
            at.STEP_TIME: step,
            at.SUBSTEPS: substeps,
            at.SLIPS: self.model.slips,
            at.SATURATES: self.model.saturates and self.model.pace in (PROFILE, HELD),
            at.FRONT_SPEED: self.model.front_speed,
            at.POWERED: self.model.pace == DRIVEN,
            at.IDEAL_STEERING: steering.lag == 0.0 and steering.rate_limit is None,
            at.ACTION_KIND: ACTIONS[self.action],
            at.ACTION_SCALE: self.max_steering_rate if rate_mode else self.max_steering_angle,
            at.COMMAND_LIMIT: self.largest_angle,
            at.COST_LATERAL: self.reference_lateral_error,
            at.COST_WEIGHT: self.cost_weight,
            at.COST_RATE: self.reference_steering_rate,
            at.COST_CAP: self.cost_cap,
            at.FULL: self.observation == "full",
            at.MASS: car.mass,
            at.INERTIA: car.yaw_inertia,
            at.NOMINAL_FRONT: self.axles[0],
            at.NOMINAL_REAR: self.axles[1],
            at.NOMINAL_FRONT_STIFFNESS: car.front_cornering_stiffness,
            at.NOMINAL_REAR_STIFFNESS: car.rear_cornering_stiffness,
            at.FRICTION: self._friction,
            at.LAG: steering.lag,
            at.RATE_LIMIT: math.inf if steering.rate_limit is None else steering.rate_limit,
            at.NOMINAL_DELAY: steering.delay,
            at.STEERING_GAIN: steering.gain,
            at.RANGES: self.randomisation.bounds(),
            at.DELAY_DEPTH: round(longest / step) // substeps + 2 if longest > 0.0 else 0,
            at.HORIZON: self.episode_steps,
            at.LARGEST_COST: self.largest_cost,
            **self.speed.numbers(self.control_step, step),
        }

    @property
    def _friction(self) -> float:
        """Road friction coefficient."""
        return 1.0


def check_speed(largest: float, drawn: Randomisation, limit: float) -> None:
    """Raise ValueError where an episode's car would go faster than ``limit``, m/s."""
    require("speed (its largest)", largest, "m/s", at_most=limit)
    if largest * drawn.speed[1] > limit:
        raise ValueError(
            f"randomisation.speed={drawn.speed!r} is not allowed: of {largest:g} m/s that is more than "
            f"{limit:g} m/s; it must be <= {limit / largest:.3g}"
        )


def multiple_of_step(name: str, seconds: float, step: float) -> None:
    """Raise ValueError unless ``seconds`` is a multiple of ``step``."""
    steps = round(seconds / step)
    if abs(seconds - steps * step) > 1e-5 * step:
        raise ValueError(
            f"{name}={seconds!r} is not allowed: it must be a multiple of {step:.7g} s (the nearest is "
            f"{max(steps, 1) * step:.7g} s)"
        )
