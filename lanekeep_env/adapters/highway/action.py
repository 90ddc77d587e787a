"""The action type for their configuration: our car is what is steered."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from highway_env.envs.common.action import ContinuousAction

from lanekeep_env.adapters.highway.axes import turned
from lanekeep_env.adapters.highway.plant import FreeScenario, Plant
from lanekeep_env.adapters.highway.vehicle import EgoVehicle
from lanekeep_env.checks import nearest, shown
from lanekeep_env.physics.parameters import vehicle_from
from lanekeep_env.roads import ConstantSpeed, StraightRoad

#: What it is called in ``config["action"]["type"]``.
ACTION = "LanekeepAction"
_KEYWORDS = ("vehicle", "dynamics", "friction", "longitudinal", "lateral", "acceleration_range", "max_steering_angle")


class EgoAction(ContinuousAction):
    """``config={"action": {"type": "LanekeepAction", "vehicle": "yin", ...}}``.

    An action is [steering, acceleration] in [-1, 1] as everywhere in lanekeep, steering to the left positive, or one of
    both alone. (That of ``ContinuousAction`` is [acceleration, steering], to the right positive.)

    Args:
        env: theirs.
        vehicle: as in `lanekeep/LaneKeep-v0`: a name, a file, or a mapping of changes to a named one.
        dynamics: "dynamic" (saturating tyres) or "kinematic" (rolls without slip).
        friction: of the road; "dynamic" only.
        longitudinal, lateral: whether there is an acceleration, a steering angle to choose.
        acceleration_range: m/s², at -1 and 1.
        max_steering_angle: of the road wheel, rad, at 1; by default theirs, pi/4, or the vehicle's limit if less.

    Raises:
        ValueError: an unknown keyword (the nearest one is named) or a value that is not allowed.
    """

    def __init__(self, env: Any, **config: Any) -> None:
        given = {name: value for name, value in config.items() if name != "type"}
        for name in given:
            if name not in _KEYWORDS:
                raise ValueError(
                    f"{ACTION} has no keyword {shown(name)}{nearest(name, _KEYWORDS)}; allowed: {', '.join(_KEYWORDS)}"
                )
        car = {name: given.pop(name) for name in _KEYWORDS[:3] if name in given}
        largest = given.pop("max_steering_angle", None)
        super().__init__(env, **given)
        self.plant = plant_of(car, largest, 1.0 / env.config["simulation_frequency"])
        limit = self.plant.scenario.max_steering_angle
        self.steering_range = (-limit, limit)

    def get_action(self, action: Any) -> dict[str, float]:
        """Return what `EgoVehicle` is told, in their order and signs."""
        asked: dict[str, float] = super().get_action(np.asarray(action, dtype=np.float64)[::-1])
        return {**asked, "steering": turned(asked["steering"])}

    @property
    def vehicle_class(self) -> type[EgoVehicle]:
        """Our car."""
        return _class_of(self.plant)


def plant_of(car: Mapping[str, Any], max_steering_angle: float | None, step: float) -> Plant:
    """Return the plant of a car for a simulation step, s."""
    vehicle = vehicle_from(car.get("vehicle", "yin"))
    limit = vehicle.steering.angle_limit or math.inf
    largest = min(math.pi / 4, limit) if max_steering_angle is None else max_steering_angle
    return _plant(vehicle, car.get("dynamics", "dynamic"), float(car.get("friction", 1.0)), largest, step)


@lru_cache(maxsize=64)
def _plant(vehicle: Any, dynamics: str, friction: float, max_steering_angle: float, step: float) -> Plant:
    return Plant(
        FreeScenario(
            vehicle=vehicle,
            dynamics=dynamics,
            tyre="magic_formula",
            friction=friction,
            max_steering_angle=max_steering_angle,
            control_step=step,
            road=StraightRoad(),
            speed=ConstantSpeed(EgoVehicle.MAX_SPEED),
        )
    )


@lru_cache(maxsize=64)
def _class_of(plant: Plant) -> type[EgoVehicle]:
    return EgoVehicle.of(plant)


def extended(factory: Callable[..., Any], name: str, kind: Callable[..., Any]) -> Callable[..., Any]:
    """Return their factory of action or observation types, with one more."""

    def make(env: Any, config: Mapping[str, Any]) -> Any:
        return kind(env, **config) if config["type"] == name else factory(env, config)

    return make
