"""The action type for their configuration: our car is what is steered."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from highway_env.envs.common.action import ContinuousAction

from lanekeep_env.adapters.highway.axes import turned
from lanekeep_env.adapters.highway.configuration import check_keys, check_world
from lanekeep_env.adapters.highway.plant import FreeScenario, Plant
from lanekeep_env.adapters.highway.vehicle import EgoVehicle
from lanekeep_env.checks import known, shown
from lanekeep_env.physics.vehicles import vehicle_from
from lanekeep_env.roads import ConstantSpeed, StraightRoad
from lanekeep_env.scenario.disturbances import bounds_from

#: What it is called in ``config["action"]["type"]``.
ACTION = "LanekeepAction"
_KEYWORDS = (
    "type",
    "vehicle",
    "dynamics",
    "friction",
    "longitudinal",
    "lateral",
    "acceleration_range",
    "max_steering_angle",
)


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
        ValueError: an unknown keyword, here or in the environment's configuration (the nearest one is named), a value
            that is not allowed, or an environment whose reward asks for another car.
    """

    def __init__(self, env: Any, **config: Any) -> None:
        check_keys(env.config, env.default_config())
        self.plant = plant_of(config, 1.0 / env.config["simulation_frequency"])
        theirs: dict[str, Any] = {name: config[name] for name in ("longitudinal", "lateral") if name in config}
        for name, value in theirs.items():
            if not isinstance(value, bool):
                raise ValueError(f"{name}={shown(value)} is not allowed: it must be True or False")
        if "acceleration_range" in config:
            theirs["acceleration_range"] = bounds_from(
                "acceleration_range", "m/s²", -100.0, 100.0, config["acceleration_range"]
            )
        super().__init__(env, **theirs)
        check_world(env, self.size)
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


def plant_of(config: Mapping[str, Any], step: float) -> Plant:
    """Return the plant of an action's configuration for a simulation step, s; ValueError as of `EgoAction`."""
    known(ACTION, config, _KEYWORDS, "keyword")
    vehicle = vehicle_from(config.get("vehicle", "yin"))
    largest = config.get("max_steering_angle")
    if largest is None:
        largest = min(math.pi / 4, vehicle.steering.angle_limit or math.inf)
    scenario = FreeScenario(
        vehicle=vehicle,
        dynamics=config.get("dynamics", "dynamic"),
        tyre="magic_formula",
        friction=config.get("friction", 1.0),
        max_steering_angle=largest,
        control_step=step,
        road=StraightRoad(),
        speed=ConstantSpeed(EgoVehicle.MAX_SPEED),
    )
    if scenario.friction != 1.0 and not scenario.model.slips:
        raise ValueError(f"friction={scenario.friction!r} has no effect with dynamics='kinematic', which has no tyres")
    return _plant(scenario)


_plant = lru_cache(maxsize=64)(Plant)


@lru_cache(maxsize=64)
def _class_of(plant: Plant) -> type[EgoVehicle]:
    return EgoVehicle.of(plant)


def extended(factory: Callable[..., Any], name: str, kind: Callable[..., Any]) -> Callable[..., Any]:
    """Return their factory of action or observation types, with one more."""

    def make(env: Any, config: Mapping[str, Any]) -> Any:
        return kind(env, **config) if config["type"] == name else factory(env, config)

    return make
