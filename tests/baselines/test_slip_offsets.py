"""Slip offsets of saturating tyres: linear cars with them corner as the environment's cars do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import root

from lanekeep_baselines.lq_model import LATERAL, STATES, StepModel
from lanekeep_baselines.mpc import MpcPreview
from lanekeep_baselines.slip_offsets import SlipOffsets
from lanekeep_env.physics.load_transfer import numbers_of, on_loads, read
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.single_track import dynamic_magic_formula, load_sensitive
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import LaneKeepScenario

STEP = 0.05
#: Production sensors some of which are late by as many control steps as told.
LATE = {"lateral_error": {"delay": 0.1}, "heading_error": {"delay": 0.05}}


def corner(name: str, friction: float, tyre: str, speed: float, across: float) -> tuple[float, float]:
    """Steering angle and sideslip, rad, at which the environment's car drives steadily at ``across`` m/s²."""
    car, turn = VEHICLES[name], across / speed
    front, rear = car.cg_to_front_axle, car.cg_to_rear_axle
    peak = friction * car.mass * GRAVITY / car.wheelbase
    stiffness = car.front_cornering_stiffness, car.rear_cornering_stiffness
    body: tuple[Any, ...] = (front, rear, 1.0 / car.mass, 1.0 / car.yaw_inertia, *stiffness, peak * rear, peak * front)
    rates: Any = dynamic_magic_formula
    body = (*body, None)
    if tyre == "load_sensitive":
        loads: Any = on_loads
        numbers: Any = read
        rates = load_sensitive
        body = loads(body, 1.0, body[6:8], 0.0, across, numbers(numbers_of(car)))
    found = root(lambda x: rates(0.0, -x[1], x[1], turn, x[0], speed, turn / speed, body)[3:], [0.02, 0.0], tol=1e-12)
    assert found.success
    return float(found.x[0]), float(found.x[1])


@pytest.mark.parametrize("tyre", ["magic_formula", "load_sensitive"])
@pytest.mark.parametrize(
    ("name", "friction", "across"), [("yin", 1.0, 7.0), ("passat", 1.0, -6.0), ("commonroad-2", 0.45, 3.5)]
)
def test_the_linear_car_corners_as_the_environment_s(name: str, friction: float, tyre: str, across: float) -> None:
    """Angle and sideslip of steady bends that are wide: what the angle of narrow ones does to forces is left out."""
    speed, car = 60.0, VEHICLES[name]
    front, rear = (float(one) for one in SlipOffsets(car, friction, tyre == "load_sensitive")(np.array(across)))
    turn, force = across / speed, car.mass * across / car.wheelbase
    beta = car.cg_to_rear_axle * turn / speed + rear - force * car.cg_to_front_axle / car.rear_cornering_stiffness
    steer = beta + car.cg_to_front_axle * turn / speed + force * car.cg_to_rear_axle / car.front_cornering_stiffness
    expected = corner(name, friction, tyre, speed, across)
    assert (steer - front, beta) == pytest.approx(expected, rel=0.015)


@pytest.mark.parametrize("tyre", ["magic_formula", "load_sensitive"])
@pytest.mark.parametrize("speed", [10.0, 27.5])
@pytest.mark.parametrize(("delay", "sensors"), [(0.0, {}), (0.07, LATE)], ids=["on time", "late"])
def test_in_a_steady_bend_nothing_moves(tyre: str, speed: float, delay: float, sensors: dict[str, Any]) -> None:
    """The filter's estimates stay, and the command is the angle that holds the bend."""
    keywords: dict[str, Any] = {"vehicle": {"base": "yin", "steering": {"delay": delay}}, "sensors": sensors}
    policy = MpcPreview(LaneKeepScenario(preview=20, tyre=tyre, **keywords))
    bend, v = 3.0 / speed**2, np.array([speed])
    assert policy._offsets is not None
    offsets = np.array([float(one[0]) for one in policy._offsets(v * v * bend)])
    # From the model: what stays as it is with the lateral error at none.
    model = StepModel.of(policy._design.vehicle, speed, STEP)
    push = model.offsets @ offsets + model.curvature.sum(axis=1) * bend
    kept = np.delete(np.eye(STATES) - model.a, LATERAL, axis=1)
    *x, command = np.linalg.lstsq(np.column_stack([kept, -model.b.sum(axis=1)]), push, rcond=None)[0]
    state = np.array([*x, 0.0])
    measured = state[[0, 2, 3, 4]]
    late = np.repeat(measured, policy._late)
    commands = np.full(1 + policy._on_the_way, command)
    inputs = [np.concatenate([state, late]), np.array([bend, bend]), commands, measured]
    followed = policy._follow(v, [one[None] for one in inputs])[0]
    np.testing.assert_allclose(followed, inputs[0], atol=1e-5)
    seen = np.concatenate([state, commands[1:], np.full(len(policy._samples), bend)])
    assert policy.steer(v, seen[None])[0] == pytest.approx(command, rel=2e-3)
