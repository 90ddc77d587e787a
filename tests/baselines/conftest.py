"""Independent linear single-track cars, from forces and moments or from geometry, to judge the controllers by."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import pytest
from scipy.linalg import expm

import lanekeep_baselines
import lanekeep_env  # noqa: F401  (registers the environments)
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.roads.generators import RoadRecord
from lanekeep_env.roads.road import Road
from lanekeep_env.scenario import LaneKeepScenario


class LinearCar:
    """The linear car in path coordinates at constant speed, ISO signs, for n cars at once.

    States (road wheel, sideslip, yaw rate, heading error, lateral error), inputs (command, road curvature), both held
    over the step. ``sideslip=False`` gives Yin's reduced car, whose body never slips.
    """

    def __init__(self, car: VehicleParameters, speed: float, step: float, sideslip: bool = True) -> None:
        self.speed, self.lag = speed, car.steering.lag
        f, r = car.cg_to_front_axle, car.cg_to_rear_axle
        a, b = np.zeros((5, 5)), np.zeros((5, 2))
        # Slip of each axle as a row over the states; force = stiffness times slip.
        front = car.front_cornering_stiffness * np.array([1.0, -1.0, -f / speed, 0.0, 0.0])
        rear = car.rear_cornering_stiffness * np.array([0.0, -1.0, r / speed, 0.0, 0.0])
        if not sideslip:
            front[1] = rear[1] = 0.0
        else:
            a[1] = (front + rear) / (car.mass * speed)
            a[1, 2] -= 1.0
        a[2] = (f * front - r * rear) / car.yaw_inertia
        a[3, 2], b[3, 1] = 1.0, -speed
        a[4, 3] = speed
        a[4, 1] = speed if sideslip else 0.0
        if self.lag > 0.0:
            a[0, 0], b[0, 0] = -1.0 / self.lag, 1.0 / self.lag
        else:  # the road wheel is the command: hold it over the step
            b[:, 0], a[:, 0] = a[:, 0], 0.0
        block = expm(np.block([[a, b], [np.zeros((2, 7))]]) * step)
        self.a, self.b = block[:5, :5], block[:5, 5:]

    def advance(self, states: np.ndarray, command: np.ndarray, curvature: np.ndarray) -> np.ndarray:
        """Return the states (n, 5) one step later."""
        after = states @ self.a.T + np.stack([command, curvature], axis=1) @ self.b.T
        if self.lag == 0.0:
            after[:, 0] = command
        return after

    def observe(
        self, scenario: LaneKeepScenario, states: np.ndarray, command: np.ndarray, curvature: np.ndarray
    ) -> np.ndarray:
        """Return the observations (n, channels), float64; every preview sample shows the present curvature."""
        values = dict(zip(("steering_angle", "_", "yaw_rate", "heading_error", "lateral_error"), states.T, strict=True))
        values |= {"speed": np.full(len(states), self.speed), "steering_command": command}
        columns = [values.get(channel.name, curvature) for channel in scenario.channels]
        return np.stack(columns, axis=1)


class KinematicCar(LinearCar):
    """The same without slip: course along the wheels, so that yaw rate and sideslip follow the road wheel at once."""

    def __init__(self, car: VehicleParameters, speed: float, step: float) -> None:
        self.speed, self.lag = speed, car.steering.lag
        self.turn = np.array([car.cg_to_rear_axle, speed]) / car.wheelbase  # sideslip and yaw rate per road wheel
        a, b = np.zeros((3, 3)), np.zeros((3, 2))  # road wheel, heading error, lateral error
        a[1, 0], b[1, 1] = self.turn[1], -speed
        a[2] = speed * self.turn[0], speed, 0.0
        if self.lag > 0.0:
            a[0, 0], b[0, 0] = -1.0 / self.lag, 1.0 / self.lag
        else:
            b[:, 0], a[:, 0] = a[:, 0], 0.0
        block = expm(np.block([[a, b], [np.zeros((2, 5))]]) * step)
        self.a, self.b = block[:3, :3], block[:3, 3:]

    def advance(self, states: np.ndarray, command: np.ndarray, curvature: np.ndarray) -> np.ndarray:
        after = states[:, [0, 3, 4]] @ self.a.T + np.stack([command, curvature], axis=1) @ self.b.T
        if self.lag == 0.0:
            after[:, 0] = command
        return np.stack([after[:, 0], *(self.turn[:, None] * after[:, 0]), after[:, 1], after[:, 2]], axis=1)


def drive(
    policy: Any,
    scenario: LaneKeepScenario,
    car: LinearCar,
    curvature: Callable[[float], np.ndarray],
    seconds: float,
    start: float = 0.0,
) -> np.ndarray:
    """Return the states over time, (steps, n, 5), from ``start`` m off; curvature(t) has a value a car."""
    step = scenario.control_step
    n = len(curvature(0.0))
    states, command, memory = np.zeros((n, 5)), np.zeros(n), None
    states[:, 4] = start
    history = []
    for i in range(round(seconds / step)):
        history.append(states)
        kappa = curvature((i + 0.5) * step)
        observation = car.observe(scenario, states, command, curvature(i * step)).astype(np.float32)
        action, memory = policy.predict(observation, memory)
        command = action[:, 0].astype(np.float64) * scenario.max_steering_angle
        states = car.advance(states, command, kappa)
    return np.array(history)


def closed_loop(policy: Any, scenario: LaneKeepScenario, car: LinearCar) -> np.ndarray:
    """Return the matrix of one control step of car and policy together, linearised about straight driving."""
    small = 1e-6
    states = small * np.eye(6 + policy.memory)
    names = [channel.name for channel in scenario.channels]
    columns = car.observe(scenario, states[:, :5], states[:, 5], np.zeros(len(states))).T
    command, memory = policy.command(dict(zip(names, columns, strict=True)), states[:, 6:], False)
    after = car.advance(states[:, :5], command, np.zeros(len(states)))
    if memory is None:
        memory = np.zeros((len(states), 0))
    return np.concatenate([after, command[:, None], memory], axis=1).T / small


@dataclass(frozen=True)
class Bend(RoadRecord):
    """A straight of ``before`` metres, an arc (radius in m, left positive; by ``turn`` rad), a straight of 200 m."""

    kind: ClassVar[str] = "bend"
    before: float
    radius: float
    turn: float = math.pi / 2
    marked: bool = True

    def build(self) -> tuple[Road, ...]:
        arc = abs(self.radius) * self.turn
        curvature = np.array([0.0, 1.0 / self.radius, 0.0])
        road = Road("bend", np.array([self.before, arc, 200.0]), curvature, curvature)
        return (road if self.marked else road.without_marking([[self.before, self.before + arc + 200.0]]),)


def drive_van(
    policy: Any, seconds: float, env: str = "CameraLane", start: tuple[float, float] = (0.0, 0.0), **scenario: Any
) -> SimpleNamespace:
    """Drive an environment from the road's beginning; ``policy`` is a name or one that was made.

    Returns:
        What the policy saw and what was true, a value a control step: seen (n, channels), lateral, heading (of the
        rear axle), station, command (rad) and the policy's state (n, memory); and the scenario.
    """
    scenario = {"departure": "off", "episode_steps": 100_000, **scenario}
    made = gym.make(f"lanekeep/{env}-v0", disable_env_checker=True, **scenario).unwrapped
    if isinstance(policy, str):
        policy = lanekeep_baselines.make(policy, made.scenario)
    seen, info = made.reset(seed=0, options={"lateral_error": start[0], "heading_error": start[1], "arc_length": 0.0})
    state, rows = None, []
    for _ in range(round(seconds / made.scenario.control_step)):
        action, state = policy.predict(seen, state)
        command = float(action[0]) * made.scenario.max_steering_angle
        rows.append((seen, info["lateral_error"], info["heading_error"], info["arc_length"], command, state))
        seen, _, _, _, info = made.step(np.clip(action, -1.0, 1.0))
    made.close()
    names = ("seen", "lateral", "heading", "station", "command", "state")
    columns = {name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}
    return SimpleNamespace(scenario=made.scenario, **columns)


@pytest.fixture(scope="session")
def bench() -> SimpleNamespace:
    """The tools above, as importlib mode lets no test import this file."""
    return SimpleNamespace(
        LinearCar=LinearCar,
        KinematicCar=KinematicCar,
        drive=drive,
        closed_loop=closed_loop,
        Bend=Bend,
        drive_van=drive_van,
    )


@pytest.fixture(scope="session")
def oracle() -> ModuleType:
    """The camera-guided van, simulated without any of the project's code."""
    spec = importlib.util.spec_from_file_location("traechtler_oracle", Path(__file__).parent / "traechtler_oracle.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def werling() -> ModuleType:
    """Werling's car, simulated without any of the project's code."""
    spec = importlib.util.spec_from_file_location("werling_oracle", Path(__file__).parent / "werling_oracle.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
