"""Drives of the camera-guided van, recorded, and the linear simulation of the same drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_baselines.traechtler import TraechtlerPd
from lanekeep_baselines.traechtler_model import CameraModel
from lanekeep_env.roads import Road
from lanekeep_env.scenario import CameraLaneScenario

Floats = NDArray[np.float64]

#: The article's van without backlash, of which its linear model knows nothing.
NO_BACKLASH = {
    "base": "van",
    "steering": {"lag": 0.25, "rate_limit": math.radians(20.0), "angle_limit": 0.6, "backlash": 0.0},
}


@dataclass(frozen=True)
class Drive:
    """One drive, a value a control step, (n,): the state in which a command was given, and that command.

    time s; station of the rear axle m; lateral error m and heading error rad of the rear axle; edge distance m as
    observed; whether it was valid; whether the controller used it (switch S1); steering angle, command rad; steering
    rate rad/s, of the step before; edge distance asked for m.
    """

    scenario: CameraLaneScenario
    road: Road
    time: Floats
    station: Floats
    lateral: Floats
    heading: Floats
    edge: Floats
    valid: NDArray[np.bool_]
    closed: NDArray[np.bool_]
    steer: Floats
    command: Floats
    rate: Floats
    wanted: Floats


def drive(
    env_id: str,
    policy: str | type[TraechtlerPd],
    seconds: float,
    design: dict[str, Any] | None = None,
    offset: float = 0.0,
    **keywords: Any,
) -> Drive:
    """Drive the van from the start of its road, ``offset`` metres left of the lane's centre.

    ``design``: keywords of the scenario that the policy believes in, where that is another one.
    """
    step = keywords.get("control_step", 0.04)
    keywords = {
        "departure": "off",
        "start_lateral_error": 0.0,
        "start_course_error": 0.0,
        "episode_steps": math.ceil(seconds / step),
        "observation": "full",
        **keywords,
    }
    env = gym.make(f"lanekeep/{env_id}", max_episode_steps=keywords["episode_steps"], **keywords)
    scenario: CameraLaneScenario = env.unwrapped.scenario  # type: ignore[attr-defined]
    believed = scenario if design is None else type(scenario).from_keywords(**{**keywords, **design})
    controller = lanekeep_baselines.make(policy, believed) if isinstance(policy, str) else policy(believed)
    column = {channel.name: k for k, channel in enumerate(scenario.channels)}
    observation, info = env.reset(seed=0, options={"arc_length": 0.0, "lateral_error": offset})
    rows: list[tuple[float, ...]] = []
    state, over = None, False
    while not over:
        action, state = controller.predict(observation, state)
        seen = (float(observation[column[name]]) for name in ("edge_distance", "edge_valid", "steering_angle"))
        command = float(np.clip(action[0], -1.0, 1.0)) * scenario.max_steering_angle
        truth = (info[name] for name in ("arc_length", "lateral_error", "heading_error", "steering_rate"))
        # The simulating controller's switch is the last number that it remembers; the others use what they see.
        closed = state[-1] if state is not None and policy == "traechtler-blind" else observation[column["edge_valid"]]
        wanted = observation[column["set_distance"]] if "set_distance" in column else scenario.set_distance
        rows.append((*truth, *seen, closed, command, wanted))
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    columns: list[Floats] = list(np.array(rows, dtype=np.float64).T)
    station, lateral, heading, rate, edge, valid, steer, closed, commands, asked = columns
    road = env.unwrapped.road_set()[0][0]  # type: ignore[attr-defined]
    env.close()
    time: Floats = scenario.control_step * np.arange(len(rows), dtype=np.float64)
    return Drive(
        scenario, road, time, station, lateral, heading, edge, valid > 0.5, closed > 0.5, steer, commands, rate, asked
    )


@dataclass(frozen=True)
class LinearDrive:
    """The linear simulation: edge distance m, steering angle and its set-point rad, (n,)."""

    edge: Floats
    steer: Floats
    command: Floats


def simulate(driven: Drive, speed: float) -> LinearDrive:
    """Simulate the article's linear loop over the curvature that the look-ahead point of a drive met.

    (10) with PD controller and PT1 actuator, the edge visible all along, at constant ``speed``, from the drive's start.
    """
    scenario = driven.scenario
    model = CameraModel(scenario.vehicle.wheelbase, scenario.camera.look_ahead, scenario.vehicle.steering.lag)
    h = scenario.control_step
    curvature = driven.road.curvature(driven.station + model.reach)
    e, heading, steer = (np.zeros(1) for _ in range(3))
    v = np.array([speed])
    found = []
    for kappa in curvature:
        rate = model.rate(heading, steer, v)
        command = -model.proportional_gain * e - model.derivative_gain * rate
        found.append((e[0] + scenario.set_distance, steer[0], command[0]))
        e, heading, steer = model.advance(e, heading, steer, command, np.array([kappa]), v, h)
    return LinearDrive(*np.array(found).T)
