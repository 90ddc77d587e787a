"""The vehicle models: one row each. What a kernel, a start or a scenario must know of a model stands here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

from lanekeep_env.physics import load_transfer
from lanekeep_env.physics import single_track as cars
from lanekeep_env.physics.integrate import DRIVEN, HELD, PACED, PROFILE, integrator, named, shower
from lanekeep_env.physics.side_forces import pushed


@dataclass(frozen=True, eq=False)
class CarModel:
    """A vehicle model.

    Attributes:
        name: of its compiled functions.
        rates: of the state in path coordinates, a function of `single_track`.
        outputs: sideslip, yaw rate and lateral acceleration that it shows, a function of `single_track`.
        pace: where its speed comes from: the road's `PROFILE`, set speeds that it approaches (`PACED`), a powertrain
            (`DRIVEN`), or a driver who holds the profile against what cornering costs (`HELD`).
        slips: whether it has tyres, or rolls where its wheels point.
        saturates: whether these know friction: the car may spin, and a speed profile must know it too.
        front_speed: whether its speed is the front wheels', not the reference point's.
        tyres: what acceleration makes of them, a function of `load_transfer`.
        drag: deceleration by cornering where that is not imposed, a function of `single_track`.
        pushed: whether forces from outside push it; see `side_forces`.
    """

    name: str
    rates: Callable[..., Any]
    outputs: Callable[..., Any]
    pace: int = PROFILE
    slips: bool = False
    saturates: bool = False
    front_speed: bool = False
    tyres: Callable[..., Any] = load_transfer.unchanged
    drag: Callable[..., Any] = cars.no_drag
    pushed: bool = False

    @property
    def transfers_load(self) -> bool:
        """Whether acceleration changes its tyres."""
        return self.tyres is not load_transfer.unchanged

    @cached_property
    def advance(self) -> Callable[..., Any]:
        """Compiled loop that advances a block of cars by a sub-step."""
        return integrator(
            self.rates, self.pace, self.slips, self.saturates, self.name, self.tyres, self.drag, self.pushed
        )

    @cached_property
    def show(self) -> Callable[..., Any]:
        """Compiled loop that writes what a block of cars shows."""
        return shower(self.outputs, self.pace, self.name, self.tyres, self.pushed)


@cache
def with_pushes(model: CarModel) -> CarModel:
    """Return a model with tyres that a bank and the wind push as well."""
    name = f"{model.name}_pushed"
    rates, outputs = pushed(model.rates, model.outputs, not model.saturates, named(name))
    return replace(model, name=name, rates=rates, outputs=outputs, pushed=True)


KINEMATIC = CarModel("kinematic", cars.kinematic, cars.kinematic_outputs)
LINEAR = CarModel("linear", cars.dynamic_linear, cars.linear_outputs, slips=True)
MAGIC_FORMULA = CarModel(
    "magic_formula", cars.dynamic_magic_formula, cars.magic_formula_outputs, slips=True, saturates=True
)
FRONT_DRIVEN = CarModel("front_driven", cars.front_driven, cars.front_driven_outputs, PACED, front_speed=True)
KINEMATIC_PACED = CarModel("kinematic_paced", cars.kinematic, cars.kinematic_outputs, PACED)
LINEAR_PACED = CarModel("linear_paced", cars.dynamic_linear, cars.linear_outputs, PACED, slips=True)
POWERED = CarModel("powered", cars.dynamic_both_ways, cars.both_ways_outputs, DRIVEN, slips=True, saturates=True)
MAGIC_FORMULA_HELD = replace(MAGIC_FORMULA, name="magic_formula_held", pace=HELD, drag=cars.cornering_drag)
LOAD_SENSITIVE = replace(MAGIC_FORMULA, name="load_sensitive", rates=cars.load_sensitive, tyres=load_transfer.braked)
LOAD_SENSITIVE_HELD = replace(LOAD_SENSITIVE, name="load_sensitive_held", pace=HELD, drag=cars.cornering_drag)
LOAD_SENSITIVE_POWERED = replace(
    POWERED, name="load_sensitive_powered", rates=cars.load_sensitive_both_ways, tyres=load_transfer.driven
)
