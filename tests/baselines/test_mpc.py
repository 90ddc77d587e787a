"""Model predictive control: its program against rolled-out costs and another solver, its drives against the optimum."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import Bounds, LinearConstraint, minimize

import lanekeep_baselines
import lanekeep_env  # noqa: F401  (registers the environments)
from lanekeep_baselines.lq_design import Cost, gains
from lanekeep_baselines.lq_model import LATERAL, STEER, StepModel
from lanekeep_baselines.mpc import MpcPreview
from lanekeep_baselines.mpc_problem import Limits, Problem
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import LaneKeepScenario

STEP, STEPS = 0.05, 21
COST = Cost(0.5, 1.0, 0.1)


def car_with(delay: float) -> Any:
    yin = VEHICLES["yin"]
    return replace(yin, steering=replace(yin.steering, delay=delay))


@pytest.mark.parametrize("speed", [2.0, 25.0, 55.0])
@pytest.mark.parametrize("delay", [0.0, 0.02, 0.13])
@pytest.mark.parametrize("slip", [True, False])
def test_without_a_limit_its_first_command_is_that_of_the_riccati_equation(speed: float, delay: float, slip: bool):
    car = car_with(delay)
    problem = Problem.of(car, speed, STEP, slip, COST, STEPS, Limits(math.inf))
    found = gains(StepModel.of(car, speed, STEP, slip), COST, STEP, STEPS)
    expected = -np.concatenate([found.state, found.offsets, found.curvature])
    states, offsets, curvature = np.split(problem.free[0], [len(found.state), -STEPS])
    shown = np.concatenate([states, offsets.reshape(STEPS, 2).sum(axis=0), curvature])
    np.testing.assert_allclose(shown, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


def rolled_out(commands: np.ndarray, t: np.ndarray, speed: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Cost of driving the model with ``commands`` and then as the optimum does, moves of the road wheel, slips."""
    car = car_with(0.0)
    model, found = StepModel.of(car, speed, STEP), gains(StepModel.of(car, speed, STEP), COST, STEP, STEPS)
    x, offset, curvature = t[:5].copy(), t[5:-STEPS].reshape(STEPS, 2), t[-STEPS:]
    cost, moves, slips = 0.0, [], []
    for k in range(STEPS - 1 + 4000):
        now, then = curvature[min(k, STEPS - 1)], curvature[min(k + 1, STEPS - 1)]
        offsets = offset[min(k, STEPS - 1)]
        u = commands[k] if k < STEPS - 1 else -(found.state @ x + found.offsets @ offsets + found.constant[0] * now)
        before = x[STEER]
        cost += (x[LATERAL] / COST.lateral) ** 2
        x = model.a @ x + model.b[:, 0] * u + model.offsets @ offsets + model.curvature @ [now, then]
        cost += COST.weight * ((x[STEER] - before) / (STEP * COST.rate)) ** 2
        if k < STEPS - 1:
            moves.append(x[STEER] - before)
            slips.append(
                [
                    x[0] - x[1] - car.cg_to_front_axle * x[2] / speed,
                    -x[1] + car.cg_to_rear_axle * x[2] / speed,
                ]
            )
    return cost, np.array(moves), np.array(slips)


def some_state(seed: int, scale: float = 1.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    bend = np.cumsum(random.normal(size=STEPS)) * 1e-3
    offsets = np.cumsum(random.normal(size=(STEPS, 2)), axis=0) * 1e-3
    # Both end at none: a bend without end would cost without end.
    road = np.concatenate([(offsets - offsets[-1]).ravel(), bend - bend[-1]])
    return scale * np.concatenate([random.normal(size=5) * [0.01, 0.01, 0.05, 0.02, 0.5], road])


@pytest.mark.parametrize("seed", range(3))
def test_the_program_is_the_rolled_out_cost(seed: int) -> None:
    """Differences of costs, the cost of what cannot be changed aside."""
    problem, t = Problem.of(car_with(0.0), 20.0, STEP, True, COST, STEPS, Limits(math.inf)), some_state(seed)
    random = np.random.default_rng(100 + seed)
    one, other = random.normal(size=(2, STEPS - 1)) * 0.02

    def quadratic(u: np.ndarray) -> float:
        return float(u @ problem.hessian @ u + 2.0 * u @ problem.linear @ t)

    expected = rolled_out(one, t, 20.0)[0] - rolled_out(other, t, 20.0)[0]
    assert quadratic(one) - quadratic(other) == pytest.approx(expected, rel=1e-6)


def test_its_limits_are_moves_and_slips_of_the_rolled_out_car() -> None:
    car, t = car_with(0.0), some_state(0)
    problem = Problem.of(car, 20.0, STEP, True, COST, STEPS, Limits(0.1, rate=0.4, friction=0.5))
    commands = np.random.default_rng(1).normal(size=STEPS - 1) * 0.02
    _, moves, slips = rolled_out(commands, t, 20.0)
    shown = (problem.rows @ commands + problem.known @ t).reshape(-1, 3)
    np.testing.assert_allclose(shown[:, 0], moves, atol=1e-12)
    stiffness = [car.front_cornering_stiffness, car.rear_cornering_stiffness]
    np.testing.assert_allclose(shown[:, 1:], slips * stiffness, rtol=1e-9, atol=1e-6)
    limit = problem.limit.reshape(-1, 3)
    assert limit[0, 0] == pytest.approx(0.4 * STEP)
    # The magic formula's peak, by looking for it.
    slip = np.linspace(0.0, 1.0, 200_001)
    peak = 0.5 * car.mass * GRAVITY * car.cg_to_rear_axle / car.wheelbase
    force = peak * np.sin(1.5 * np.arctan(stiffness[0] * slip / (1.5 * peak)))
    assert limit[0, 1] == pytest.approx(stiffness[0] * slip[force.argmax()], rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_another_solver_finds_the_same_command(seed: int) -> None:
    limits = Limits(0.01, rate=0.02)
    problem = Problem.of(car_with(0.0), 15.0, STEP, True, COST, STEPS, limits)
    t = some_state(seed, 4.0)
    t[:3] = 0.0  # a state from which the limits can be kept
    assert problem.meets(t)
    shift = problem.known @ t
    found = minimize(
        lambda u: 0.5 * u @ problem.hessian @ u + u @ problem.linear @ t,
        np.zeros(STEPS - 1),
        jac=lambda u: problem.hessian @ u + problem.linear @ t,
        method="SLSQP",
        bounds=Bounds(-limits.angle, limits.angle),
        constraints=LinearConstraint(problem.rows, -problem.limit - shift, problem.limit - shift),
        options={"ftol": 1e-14, "maxiter": 1000},
    )
    assert problem.limited(t) == pytest.approx(found.x[0], abs=1e-5)


def test_a_state_beyond_the_limits_has_a_command() -> None:
    problem = Problem.of(car_with(0.0), 15.0, STEP, True, COST, STEPS, Limits(0.03, rate=0.1, friction=0.1))
    for seed in range(20):
        assert abs(problem.limited(some_state(seed, 30.0))) <= 0.03 + 1e-9


@pytest.mark.parametrize("command", [0.001, 0.006, 0.02, -0.5])
def test_what_is_asked_of_a_limited_actuator_moves_it_as_meant(command: float) -> None:
    """Against the actuator's own law, integrated: as far as the program's lag goes, and no farther than the limit."""
    car = replace(VEHICLES["yin"], steering=replace(VEHICLES["yin"].steering, rate_limit=0.05))
    policy = MpcPreview(LaneKeepScenario(preview=20, vehicle=car))
    lag, angle = car.steering.lag, 0.003
    asked = policy._asked(command, angle)
    moved = solve_ivp(
        lambda _, y: np.clip((asked - y) / lag, -0.05, 0.05),
        (0.0, STEP),
        [angle],
        rtol=1e-10,
        atol=1e-13,
        max_step=1e-3,
    ).y[0, -1]
    meant = (command - angle) * (1.0 - math.exp(-STEP / lag))
    assert moved - angle == pytest.approx(np.clip(meant, -0.05 * STEP, 0.05 * STEP), abs=1e-7)


def returns(name: str, cars: int, **keywords: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return and success of each of ``cars`` episodes on the benchmark's roads."""
    env = gym.make_vec(
        "lanekeep/LaneKeep-v0",
        num_envs=cars,
        vectorization_mode="vector_entry_point",
        autoreset_mode="disabled",
        road={"kind": "random", "seed": 1},
        preview=20,
        departure="cost",
        **keywords,
    )
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
    observation, _ = env.reset(seed=0)
    state, total, info = None, np.zeros(cars), {}
    for _ in range(env.unwrapped.scenario.episode_steps):
        action, state = policy.predict(observation, state)
        observation, reward, _, _, info = env.step(np.clip(action, -1.0, 1.0).astype(np.float32))
        total += reward
    return total, info["is_success"]


def test_where_no_limit_is_met_it_is_the_optimum() -> None:
    np.testing.assert_array_equal(returns("mpc-preview", 16)[0], returns("lq-preview", 16)[0])


@pytest.mark.parametrize(
    "keywords",
    [
        {"vehicle": {"base": "yin", "steering": {"rate_limit": 0.05}}},
        {"action": "steering_rate", "max_steering_rate": 0.05},
        {"max_steering_angle": 0.035},
        {"tyre": "magic_formula", "friction": 0.45},
        {"tyre": "load_sensitive", "speed": {"lateral_acceleration": 6.5}},
    ],
    ids=["rate", "rate as action", "angle", "friction", "load transfer"],
)
def test_where_a_limit_is_met_it_costs_less_than_the_optimum_that_does_not_know_it(keywords: dict[str, Any]) -> None:
    found, stays = returns("mpc-preview", 48, **keywords)
    before, stayed = returns("lq-preview", 48, **keywords)
    assert found.mean() > before.mean() and stays.sum() >= stayed.sum()


def test_rows_do_not_depend_on_each_other() -> None:
    scenario = LaneKeepScenario(preview=20, tyre="magic_formula", friction=0.3)
    policy = MpcPreview(scenario)
    observation = np.random.default_rng(0).normal(size=(9, len(scenario.channels))) * 0.01
    observation[:, [c.name for c in scenario.channels].index("speed")] = np.linspace(2.0, 50.0, 9)
    action, memory = policy.predict(observation)
    for i in range(9):
        alone, remembered = policy.predict(observation[i])
        assert np.array_equal(alone, action[i]) and np.array_equal(remembered, memory[i])
