"""The linear car in discrete time, against integration of its forces, scipy's discretisation and the environment."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete

import lanekeep_env  # noqa: F401  (registers the environments)
from lanekeep_baselines.lq_model import STATES, StepModel, steady_sideslip
from lanekeep_env.physics.parameters import VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES

STEP = 0.05
YIN = VEHICLES["yin"]


def actuated(lag: float, delay: float) -> VehicleParameters:
    """Return Yin's car with another actuator."""
    return replace(YIN, steering=replace(YIN.steering, lag=lag, delay=delay))


def rates(car: VehicleParameters, v: float, x: np.ndarray, command: float, offsets: np.ndarray, kappa: float):
    """Return x' from forces and moments; without a lag the road wheel is the command."""
    steer, beta, r, theta, _ = x
    steer = steer if car.steering.lag else command
    front = car.front_cornering_stiffness * (steer + offsets[0] - beta - car.cg_to_front_axle * r / v)
    rear = car.rear_cornering_stiffness * (offsets[1] - beta + car.cg_to_rear_axle * r / v)
    return np.array(
        [
            (command - steer) / car.steering.lag if car.steering.lag else 0.0,
            (front + rear) / (car.mass * v) - r,
            (car.cg_to_front_axle * front - car.cg_to_rear_axle * rear) / car.yaw_inertia,
            r - v * kappa,
            v * (theta + beta),
        ]
    )


@pytest.mark.parametrize("speed", [1.0, 7.3, 20.0, 55.0])
@pytest.mark.parametrize("lag", [0.0, 0.0896])
@pytest.mark.parametrize("delay", [0.0, 0.02, 0.05, 0.13])
def test_a_step_is_exact(speed: float, lag: float, delay: float) -> None:
    """Commands u[0], u[-1] ... held from their instants, late by the delay; the curvature runs linearly."""
    car, random = actuated(lag, delay), np.random.default_rng(0)
    x, offsets, kappa = random.normal(size=5), random.normal(size=2), random.normal(size=2)
    commands = random.normal(size=8)
    model = StepModel.of(car, speed, STEP)

    def command(t: float) -> float:
        return commands[int(-np.floor((t - delay) / STEP + 1e-9))]

    edges = sorted({0.0, round(delay % STEP, 9) % STEP, STEP})
    truth = x
    for begin, end in pairwise(edges):
        acting = command(begin)
        truth = solve_ivp(
            lambda t, x, acting=acting: rates(
                car, speed, x, acting, offsets, kappa[0] + (kappa[1] - kappa[0]) * t / STEP
            ),
            (begin, end),
            truth,
            method="Radau",
            rtol=1e-10,
            atol=1e-12,
        ).y[:, -1]
        truth[0] = truth[0] if lag else acting
    found = model.a @ x + model.b @ commands[: model.b.shape[1]] + model.offsets @ offsets + model.curvature @ kappa
    np.testing.assert_allclose(found, truth, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("speed", [1.0, 20.0, 55.0])
def test_a_step_is_the_zero_order_hold_of_scipy(speed: float) -> None:
    unit, none = np.eye(STATES), np.zeros(2)
    a = np.stack([rates(YIN, speed, column, 0.0, none, 0.0) for column in unit], axis=1)
    zero = np.zeros(STATES)
    inputs = [rates(YIN, speed, zero, 1.0, none, 0.0), rates(YIN, speed, zero, 0.0, none, 1.0)]
    inputs += [rates(YIN, speed, zero, 0.0, offset, 0.0) for offset in np.eye(2)]
    a, b, *_ = cont2discrete((a, np.stack(inputs, axis=1), unit, np.zeros((STATES, 4))), STEP)
    model = StepModel.of(YIN, speed, STEP)
    np.testing.assert_allclose(model.a, a, atol=1e-12)
    np.testing.assert_allclose(model.b[:, 0], b[:, 0], atol=1e-12)
    np.testing.assert_allclose(model.curvature.sum(axis=1), b[:, 1], atol=1e-10)
    np.testing.assert_allclose(model.offsets, b[:, 2:], atol=1e-10)


@pytest.mark.parametrize("speed", [1.0, 10.0, 25.0])
@pytest.mark.parametrize("lag", [0.0, 0.0896])
def test_stiff_tyres_are_a_car_without_slip(bench, speed: float, lag: float) -> None:
    car = actuated(lag, 0.0)
    rolling, model = bench.KinematicCar(car, speed, STEP), StepModel.of(car, speed, STEP, slip=False)
    states, x, history = np.zeros((1, 5)), np.zeros(5), []
    for i in range(100):
        command, kappa = 0.02 * np.sin(0.1 * i), 0.002
        states = rolling.advance(states, np.array([command]), np.array([kappa]))
        x = model.a @ x + model.b[:, 0] * command + model.curvature @ [kappa, kappa]
        history.append((states[0], x))
    truth, found = np.moveaxis(history, 1, 0)
    assert (np.abs(found - truth).max(axis=0) < 0.01 * np.abs(truth).max(axis=0)).all()


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.05, 0.12])
def test_the_environment_drives_this_car(delay: float) -> None:
    """Random small commands on a straight and a curve: what the model says of the next step is what happens."""
    keywords = {"speed": 25.0, "observation": "full", "departure": "off", "preview": 1}
    keywords |= {"vehicle": {"steering": {"lag": 0.0896, "delay": delay}}}
    env = gym.make(
        "lanekeep/LaneKeep-v0", road={"kind": "sine", "wavelength": 4000.0, "peak_curvature": 1e-4}, **keywords
    )
    scenario = env.unwrapped.scenario
    order = [channel.name for channel in scenario.channels]
    names = ("steering_angle", "sideslip", "yaw_rate", "heading_error", "lateral_error")
    columns = [order.index(name) for name in names]
    model, random = StepModel.of(scenario.vehicle, 25.0, scenario.control_step), np.random.default_rng(0)
    seen, _ = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    sent = [float(seen[order.index("steering_command")])] * model.b.shape[1]
    for step in range(60):
        command = np.float32(random.uniform(-0.02, 0.02))
        before, kappa = seen[columns].astype(float), [float(seen[order.index("curvature")])]
        sent = [float(command) * scenario.max_steering_angle, *sent[:-1]]
        seen, *_ = env.step(np.array([command]))
        kappa.append(float(seen[order.index("curvature")]))
        if step >= len(sent):
            following = model.a @ before + model.b @ sent + model.curvature @ kappa
            np.testing.assert_allclose(following, seen[columns], rtol=1e-4, atol=1e-5)
    env.close()


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.12])
def test_commands_on_their_way_are_states(delay: float) -> None:
    model, random = StepModel.of(actuated(0.0896, delay), 20.0, STEP), np.random.default_rng(1)
    a, b, known = model.with_commands()
    m = model.b.shape[1] - 1
    x, sent, both = np.zeros(5), np.zeros(m), np.zeros(5 + m)
    for _ in range(12):
        u, constants, kappa = random.normal(), random.normal(size=2), random.normal(size=2)
        both = a @ both + b[:, 0] * u + known @ [*constants, *kappa]
        x = model.a @ x + model.b @ [u, *sent] + model.offsets @ constants + model.curvature @ kappa
        sent = np.array([u, *sent])[:m]
        np.testing.assert_allclose(both, [*x, *sent], atol=1e-9)


@pytest.mark.parametrize("speed", [5.0, 20.0, 50.0])
def test_steady_sideslip_is_that_of_balanced_forces(speed: float) -> None:
    """Unknown road wheel, sideslip and heading in a curve of 0.001 1/m with everything at rest."""
    kappa = 1e-3
    names = [0, 1, 3]
    zero = rates(YIN, speed, np.array([0.0, 0.0, speed * kappa, 0.0, 0.0]), 0.0, np.zeros(2), kappa)[[1, 2, 4]]
    columns = [rates(YIN, speed, one, 0.0, np.zeros(2), 0.0)[[1, 2, 4]] for one in np.eye(5)[names]]
    _, sideslip, _ = np.linalg.solve(np.stack(columns, axis=1), -zero)
    base, square = steady_sideslip(YIN, slip=True)
    assert (base + square * speed**2) * kappa == pytest.approx(sideslip, rel=1e-9)
    assert steady_sideslip(YIN, slip=False)[0] == YIN.cg_to_rear_axle
