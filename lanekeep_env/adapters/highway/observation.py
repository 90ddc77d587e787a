"""What our controllers read, seen in their worlds: the channels of `lanekeep/LaneKeep-v0`, in our signs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from highway_env.envs.common.observation import ObservationType
from numpy.typing import NDArray

from lanekeep_env import layout as at
from lanekeep_env.adapters.highway.axes import turned
from lanekeep_env.adapters.highway.configuration import check_keys
from lanekeep_env.adapters.highway.path import curvatures, foot, lane_of
from lanekeep_env.adapters.highway.scenario import HighwayScenario
from lanekeep_env.adapters.highway.vehicle import EgoVehicle
from lanekeep_env.checks import known

#: What it is called in ``config["observation"]["type"]``.
OBSERVATION = "LanekeepObservation"


def look(
    env: Any, vehicle: Any, preview: int, interval: float, index: tuple[str, str, int] | None = None
) -> dict[str, float]:
    """Return each channel's value by name, true values.

    Args:
        env: theirs, unwrapped.
        vehicle: who looks: any of theirs, or ours.
        preview: number of curvature samples, ``interval`` s apart at the present speed, the first one at the vehicle.
        index: of the lane to follow, by default that of `lane_of`.
    """
    index = lane_of(env, vehicle) if index is None else index
    s, lateral, heading = foot(env.road.network.get_lane(index), vehicle.position)
    angle, command = _steering(vehicle)
    ahead = curvatures(env, vehicle, index, s, max(vehicle.speed, 0.0) * interval)
    return {
        "lateral_error": lateral,
        "heading_error": wrapped(turned(vehicle.heading) - heading),
        "yaw_rate": _yaw_rate(vehicle),
        "speed": float(vehicle.speed),
        "steering_angle": angle,
        "steering_command": command,
        **{f"curvature_preview_{k}": kappa for k, kappa in enumerate(islice(ahead, preview))},
    }


def wrapped(angle: float) -> float:
    """Return an angle from -pi to pi, rad."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _steering(vehicle: Any) -> tuple[float, float]:
    """Road wheel and command, rad; theirs have no actuator."""
    if isinstance(vehicle, EgoVehicle):
        return float(vehicle.car[at.STEER, 0]), float(vehicle.car[at.COMMAND, 0])
    asked = turned(float(vehicle.action["steering"]))
    return asked, asked


def _yaw_rate(vehicle: Any) -> float:
    """rad/s; of their plain `Vehicle` what its `step` adds to the heading."""
    if hasattr(vehicle, "yaw_rate"):
        return turned(float(vehicle.yaw_rate))
    slip = math.atan(0.5 * math.tan(turned(float(vehicle.action["steering"]))))
    return float(vehicle.speed) * math.sin(slip) / (vehicle.LENGTH / 2)


class EgoObservation(ObservationType):
    """``config={"observation": {"type": "LanekeepObservation", "preview": 12, "preview_interval": 0.1}}``.

    A box of the channels that `HighwayScenario` names, float32, clipped to their bounds.
    """

    def __init__(self, env: Any, preview: int = 12, preview_interval: float = 0.1, **others: Any) -> None:
        super().__init__(env)
        check_keys(env.config, env.default_config())
        known(OBSERVATION, others, ("type", "preview", "preview_interval"), "keyword")
        self.scenario = HighwayScenario.of(env, preview=preview, preview_interval=preview_interval)

    def space(self) -> Box:
        """A box of the channels' bounds."""
        low, high = self.scenario.channel_bounds().T
        return Box(low.copy(), high.copy(), dtype=np.float32)

    def observe(self) -> NDArray[np.float32]:
        """Return the channels, (channels,)."""
        scenario = self.scenario
        if self.observer_vehicle is None:
            return np.zeros(len(scenario.channels), dtype=np.float32)
        return row(look(self.env, self.observer_vehicle, scenario.preview, scenario.preview_interval), scenario)


def row(seen: Mapping[str, float], scenario: Any) -> NDArray[np.float32]:
    """Return what was seen in the order of a scenario's channels, within their bounds, (channels,)."""
    values = np.array([seen[channel.name] for channel in scenario.channels], dtype=np.float32)
    low, high = scenario.channel_bounds().T
    return values.clip(low, high)
