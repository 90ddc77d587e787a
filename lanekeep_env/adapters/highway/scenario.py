"""What a controller may know of a task of highway-env's: car, channels, control step, scale of the actions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator
from highway_env.envs.common.action import ContinuousAction

from lanekeep_env.adapters.highway.action import ACTION, plant_of
from lanekeep_env.adapters.highway.configuration import check_keys
from lanekeep_env.adapters.highway.vehicle import EgoVehicle
from lanekeep_env.checks import choose, require, shown
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.plain import json_able
from lanekeep_env.roads import ConstantSpeed, StraightRoad
from lanekeep_env.scenario import Channel, LaneKeepScenario
from lanekeep_env.scenario.base import ScenarioRecord
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.integration import Integration
from lanekeep_env.scenario.lane_keep import PREVIEW_INTERVAL

#: Their cars. Theirs with tyres has 1 kg, and only ratios to the mass count: here it has 1000.
THEIR_CAR = VehicleParameters(
    name="highway-env",
    mass=1000.0,
    yaw_inertia=1000.0 * 29.0 / 12.0,
    cg_to_front_axle=2.5,
    cg_to_rear_axle=2.5,
    front_cornering_stiffness=30_000.0,
    rear_cornering_stiffness=30_000.0,
    length=5.0,
    width=2.0,
    source="highway_env.vehicle.dynamics.BicycleVehicle of highway-env 1.12, times 1000; Vehicle has the same axles",
)
#: What the observation shows: what the adapter sees of their world, or what their own lane keeping returns.
OBSERVATIONS = ("exact", "theirs")
_LANE_KEEPING = "lane-keeping-v0"
#: What is read of their configuration.
_READ = ("action", "simulation_frequency", "policy_frequency")


def _config_from(value: Any) -> Any:
    if not isinstance(value, Mapping):
        raise ValueError(f"config={shown(value)} is not allowed: it must be a mapping of changes to theirs")
    return json_able(value)


@dataclass(frozen=True)
class HighwayScenario(ScenarioRecord):
    """A task of highway-env's, as it is or with changes of its configuration.

    Attributes:
        env: its id, e.g. "lane-keeping-v0".
        config: changes of its ``config``, JSON-able; our car where its action is of type "LanekeepAction".
        observation: "exact", or "theirs" (lane-keeping-v0): errors and yaw rate as its own observation has them, with
            its noise and a step late.
        preview, preview_interval: as of `lanekeep/LaneKeep-v0`.
        episode_steps: after which an episode is truncated where theirs goes on.
        reference_lateral_error, cost_weight, reference_steering_rate: of the cost that controllers weigh errors and
            steering by, as of `lanekeep/LaneKeep-v0`. The reward is theirs.

    The control step is theirs, 1 / policy_frequency, which has to divide simulation_frequency.
    """

    env: str = _LANE_KEEPING
    config: Mapping[str, Any] = field(default_factory=dict)
    observation: str = "exact"
    preview: int = 12
    preview_interval: float = 0.1
    episode_steps: int = 200
    reference_lateral_error: float = 0.5
    cost_weight: float = 1.0
    reference_steering_rate: float = 0.1

    _needs: ClassVar[tuple[Need, ...]] = (PREVIEW_INTERVAL,)
    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {"config": _config_from}
    #: The action is a road-wheel angle.
    action: ClassVar[str] = "steering_angle"
    max_steering_rate: ClassVar[float] = 0.4

    @classmethod
    def of(cls, env: Any, **keywords: Any) -> Self:
        """Return the scenario of one of their environments, unwrapped."""
        name = type(env).__name__ if env.spec is None else env.spec.id
        return cls(env=name, config={key: env.config[key] for key in _READ}, **keywords)

    def _settle(self) -> None:
        simulated, asked = (self._configured[name] for name in _READ[1:])
        for name, frequency in zip(_READ[1:], (simulated, asked), strict=True):
            require(f"config.{name}", frequency, "Hz", above=0.0, at_most=1e4)
        # Theirs takes the whole number of simulation steps below, and none at all where there is none.
        if simulated % asked:
            raise ValueError(
                f"config.policy_frequency={asked!r} is not allowed with simulation_frequency={simulated!r}: "
                "it must divide it"
            )
        theirs = 1.0 / asked
        if self.control_step not in (ScenarioRecord.control_step, theirs):
            raise ValueError(
                f"control_step={self.control_step!r} is not allowed: it is theirs, {theirs!r} s; "
                "config={'policy_frequency': ...} changes it"
            )
        object.__setattr__(self, "control_step", theirs)

    def _check(self) -> None:
        choose("observation", self.observation, OBSERVATIONS)
        if self.observation == "theirs" and self.env != _LANE_KEEPING:
            raise ValueError(f"observation='theirs' is not allowed with env={self.env!r}; allowed: {_LANE_KEEPING}")
        if self.sensors:
            raise ValueError(f"sensors={shown(self.sensors)} is not allowed: nothing is measured there but by them")
        require("episode_steps", self.episode_steps, "steps", at_least=1, at_most=10_000_000, whole=True)
        _ = self._believed

    @cached_property
    def _configured(self) -> dict[str, Any]:
        """Their configuration, as far as it is read here."""
        if self.config.keys() >= set(_READ):
            return dict(self.config)
        if self.env not in gym.registry or "highway_env" not in str(gym.registry[self.env].entry_point):
            known = [name for name, spec in gym.registry.items() if "highway_env" in str(spec.entry_point)]
            choose("env", self.env, known)
        entry: Any = load_env_creator(str(gym.registry[self.env].entry_point))
        defaults = entry.default_config()
        check_keys(self.config, defaults)
        return {**defaults, **self.config}

    @cached_property
    def _believed(self) -> LaneKeepScenario:
        """The same car and channels in a task of ours."""
        action, step = self._configured["action"], self._configured["simulation_frequency"]
        kind = action.get("type") if isinstance(action, Mapping) else action
        if kind not in (ACTION, "ContinuousAction") or not action.get("lateral", True):
            raise ValueError(
                f"action type {shown(kind)} of {self.env} is not allowed: nothing is steered there; allowed: "
                f"config={{'action': {{'type': 'ContinuousAction'}}}}, or {ACTION!r} for our cars"
            )
        if kind == ACTION:
            ours = plant_of(action, 1.0 / step).scenario
            vehicle, dynamics, largest = ours.vehicle, ours.dynamics, ours.max_steering_angle
        else:
            vehicle, dynamics = THEIR_CAR, "dynamic" if action.get("dynamical") else "kinematic"
            low, largest = action.get("steering_range") or ContinuousAction.STEERING_RANGE
            if low != -largest:
                raise ValueError(f"steering_range={shown((low, largest))} is not allowed: it must be symmetric")
        return LaneKeepScenario(
            vehicle=vehicle,
            dynamics=dynamics,
            max_steering_angle=largest,
            control_step=self.control_step,
            road=StraightRoad(),
            speed=ConstantSpeed(EgoVehicle.MAX_SPEED),
            preview=self.preview,
            preview_interval=self.preview_interval,
            reference_lateral_error=self.reference_lateral_error,
            cost_weight=self.cost_weight,
            reference_steering_rate=self.reference_steering_rate,
        )

    @cached_property
    def integration(self) -> Integration:
        """Theirs; our cars have their own below it."""
        return Integration(1.0 / self._configured["simulation_frequency"])

    @property
    def vehicle(self) -> VehicleParameters:
        """The car that is steered."""
        return self._believed.vehicle

    @property
    def dynamics(self) -> str:
        """Whether it has tyres, "dynamic", or rolls without slip, "kinematic"."""
        return self._believed.dynamics

    @property
    def max_steering_angle(self) -> float:
        """Road-wheel angle that action 1 asks for, rad."""
        return self._believed.max_steering_angle

    @property
    def num_actions(self) -> int:
        """Steering, or acceleration and steering."""
        action = self._configured["action"]
        return sum(bool(action.get(name, True)) for name in ("longitudinal", "lateral"))

    def _channels(self) -> list[Channel]:
        return [replace(channel, source=None, sensor=None) for channel in self._believed.channels]
