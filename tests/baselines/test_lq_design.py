"""Gains and filters against python-control, minimisation by brute force and the textbook's recursion."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

from lanekeep_baselines.lq import LqPreview
from lanekeep_baselines.lq_design import Cost, Estimated, Gains, Measuring, Weights, doubled, gains, on_samples
from lanekeep_baselines.lq_model import LATERAL, STATES, STEER, StepModel
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import EvasiveScenario

STEP = 0.05
COST = Cost(lateral=0.5, weight=2.0, rate=0.1)
speeds = pytest.mark.parametrize("speed", [5.0, 20.0, 50.0])
delays = pytest.mark.parametrize("delay", [0.0, 0.05, 0.13])


def model_of(speed: float, delay: float = 0.0, lag: float = 0.0896) -> StepModel:
    """Return the model of Yin's car with another actuator."""
    return StepModel.of(
        replace(VEHICLES["yin"], steering=replace(VEHICLES["yin"].steering, lag=lag, delay=delay)), speed, STEP
    )


def simulate(
    model: StepModel, x: np.ndarray, sent: np.ndarray, u: np.ndarray, offsets: np.ndarray, kappa: np.ndarray
) -> np.ndarray:
    """Return the states (steps + 1, 5) of commands u (steps,) after ``sent``, newest first; kappa (steps + 1,)."""
    history, states = list(sent), [x]
    for k in range(len(u)):
        history.insert(0, u[k])
        acting = model.b @ history[: model.b.shape[1]]
        states.append(model.a @ states[-1] + acting + model.offsets @ offsets + model.curvature @ kappa[k : k + 2])
    return np.array(states)


def residuals(states: np.ndarray) -> np.ndarray:
    """Return what the cost is the sum of squares of."""
    rate = np.diff(states[:, STEER]) / STEP
    return np.concatenate([states[:-1, LATERAL] / COST.lateral, np.sqrt(COST.weight) * rate / COST.rate])


def best_commands(
    model: StepModel, x: np.ndarray, sent: np.ndarray, offsets: np.ndarray, kappa: np.ndarray
) -> np.ndarray:
    """Return the commands of least cost over len(kappa) - 1 steps, by least squares over all of them at once."""
    n, none = len(kappa) - 1, np.zeros(2)
    impulse = simulate(model, np.zeros(5), np.zeros(len(sent)), np.eye(n)[0], none, np.zeros(n + 1))
    shifted = [residuals(np.concatenate([np.zeros((k, 5)), impulse[: n + 1 - k]])) for k in range(n)]
    free = residuals(simulate(model, x, sent, np.zeros(n), offsets, kappa))
    return np.linalg.lstsq(np.stack(shifted, axis=1), -free, rcond=None)[0]


def command(found: Gains, x: np.ndarray, sent: np.ndarray, offsets: np.ndarray, road: np.ndarray) -> float:
    """Return the command of the gains for the curvatures of the road now and ahead."""
    return float(-found.state @ [*x, *sent] - found.offsets @ offsets - found.curvature @ road)


@speeds
@delays
def test_feedback_is_that_of_python_control(speed: float, delay: float) -> None:
    model = model_of(speed, delay)
    a, b, _ = model.with_commands()
    n = len(a)
    # The road wheel's step as a row over states and input.
    moves = np.concatenate([a[STEER] - np.eye(n)[STEER], b[STEER]])
    joint = COST.weight / (STEP * COST.rate) ** 2 * np.outer(moves, moves)
    joint[LATERAL, LATERAL] += 1.0 / COST.lateral**2
    # dlqr wants a positive input weight; with a whole step of delay a command moves no road wheel at once.
    small = 1e-9
    gain, _, poles = control.dlqr(a, b, joint[:n, :n], joint[n:, n:] + small, joint[:n, n:])
    found = gains(model, COST, STEP)
    np.testing.assert_allclose(found.state, gain[0], rtol=1e-5, atol=1e-5)
    assert np.abs(poles).max() < 1.0


@speeds
@delays
@pytest.mark.parametrize("lag", [0.0, 0.0896])
def test_no_sequence_of_commands_costs_less(speed: float, delay: float, lag: float) -> None:
    """Known curvature for two seconds, held behind them; states, commands on their way and offsets at random."""
    model, random = model_of(speed, delay, lag), np.random.default_rng(0)
    steps, m = 40, model.b.shape[1] - 1
    found = gains(model, COST, STEP, steps)
    for _ in range(3):
        x, sent, offsets = 0.02 * random.normal(size=5), 0.02 * random.normal(size=m), 0.01 * random.normal(size=2)
        road = 0.02 * random.normal(size=steps)
        kappa = np.concatenate([road, np.full(400, road[-1])])
        best = best_commands(model, x, sent, offsets, kappa)
        assert command(found, x, sent, offsets, road) == pytest.approx(best[0], rel=1e-4, abs=1e-5)


@speeds
def test_a_constant_curvature_is_a_preview_that_stays(speed: float) -> None:
    model = model_of(speed, 0.05)
    for steps in (1, 7, 40):
        found = gains(model, COST, STEP, steps)
        assert found.curvature.shape == (steps,)
        assert found.curvature.sum() == pytest.approx(found.constant[0], rel=1e-9)


@pytest.mark.parametrize("interval", [0.05, 0.1, 0.13])
def test_gains_of_samples_answer_a_road_that_is_linear_between_them(interval: float) -> None:
    """Beyond the last sample the road keeps its curvature."""
    random = np.random.default_rng(2)
    curvature, samples = random.normal(size=40), 12
    found = on_samples(curvature, STEP, samples, interval)
    seen = random.normal(size=samples)
    road = np.interp(STEP * np.arange(40), interval * np.arange(samples), seen)
    assert found @ seen == pytest.approx(curvature @ road)


KINDS = [Estimated(offsets=False, curvature=False), Estimated(offsets=True, curvature=False), Estimated(True, True)]
WEIGHTS = Weights(rate=1.0, slip=2e-3, steer=4e-4, drift=5e-3, bend=0.3)
SENSORS = (2e-4, 5e-3, 3e-3, 0.03)
#: What the sensors measure of (steer, sideslip, yaw rate, heading, lateral error).
ROWS = [0, 2, 3, 4]


def truth(kind: Estimated, model: StepModel, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Return transition and process noise of what ``kind`` estimates, from the weights' words."""
    n = kind.states
    a, noise, both = np.eye(n), np.zeros((n, n)), model.curvature @ [1.0, 1.0]
    a[:STATES, :STATES] = model.a
    bend = WEIGHTS.bend / max(speed, 10.0) ** 2
    noise[STEER, STEER] = WEIGHTS.steer**2
    for axle in range(2):
        new = np.zeros(n)
        new[:STATES] = WEIGHTS.slip * model.offsets[:, axle]
        noise += np.outer(new, new)
        if kind.offsets:
            a[:STATES, STATES + axle] = model.offsets[:, axle]
            noise[STATES + axle, STATES + axle] = WEIGHTS.drift**2 * STEP
    if kind.curvature:
        a[:STATES, -1] = both
        noise[-1, -1] = bend**2 * STEP
    else:
        new = np.zeros(n)
        new[:STATES] = bend * both
        noise += np.outer(new, new)
    return a, noise


@pytest.mark.parametrize("kind", KINDS, ids=str)
@pytest.mark.parametrize("speed", [5.0, 30.0])
@pytest.mark.parametrize("delay", [0.0, 0.13])
@pytest.mark.parametrize("late", [(0, 0, 0, 0), (0, 1, 0, 2)], ids=str)
def test_the_filter_is_the_recursion_of_the_textbook(
    kind: Estimated, speed: float, delay: float, late: tuple[int, ...]
) -> None:
    """Predict and update step by step, one scalar measurement after the other, until the covariance has settled.

    Here a late sensor measures the whole state of some steps ago, which is kept.
    """
    model, random = model_of(speed, delay), np.random.default_rng(3)
    found = kind.filter(model, WEIGHTS, Measuring(SENSORS, late), speed, STEP)
    n, taps, kept = kind.states, model.b.shape[1], max(late)
    known = 0 if kind.curvature else 2
    steady = np.zeros(n + sum(late))
    assert found.shape == (len(steady), len(steady) + known + taps + 4)
    a, noise = np.eye(n * (1 + kept), k=-n), np.zeros((n * (1 + kept), n * (1 + kept)))
    a[:n, :n], noise[:n, :n] = truth(kind, model, speed)
    x, covariance = np.zeros(len(a)), np.eye(len(a))
    for step in range(1500):
        kappa, commands, measured = random.normal(size=known), random.normal(size=taps), random.normal(size=4)
        forced = np.zeros(len(a))
        forced[:STATES] = model.b @ commands + (model.curvature @ kappa if known else 0.0)
        if step == 1400:
            steady[:n] = x[:n]
            steady[n:] = [x[n * ago + row] for row, most in zip(ROWS, late, strict=True) for ago in range(1, 1 + most)]
        steady = found @ [*steady, *kappa, *commands, *measured]
        x, covariance = a @ x + forced, a @ covariance @ a.T + noise
        for row, ago, value, sensor in zip(ROWS, late, measured, SENSORS, strict=True):
            seen = n * ago + row
            gain = covariance[:, seen] / (covariance[seen, seen] + sensor**2)
            x = x + gain * (value - x[seen])
            covariance = covariance - np.outer(gain, covariance[seen])
        if step >= 1400:
            np.testing.assert_allclose(steady[:n], x[:n], rtol=1e-6, atol=1e-6 * np.abs(x).max())


def without_scipy_s_solver(*_: object, **__: object) -> None:
    raise ValueError("cannot be ordered")


@speeds
@pytest.mark.parametrize("delay", [0.0, 0.05, 0.13, 0.2])
@pytest.mark.parametrize("lag", [0.0, 0.0896])
def test_doubling_gives_the_same_gains(speed: float, delay: float, lag: float, monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of(speed, delay, lag)
    wanted = gains(model, COST, STEP, 20)
    monkeypatch.setattr("scipy.linalg.solve_discrete_are", without_scipy_s_solver)
    found = gains(model, COST, STEP, 20)
    for field in ("state", "offsets", "constant", "curvature"):
        np.testing.assert_allclose(getattr(found, field), getattr(wanted, field), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS, ids=str)
@pytest.mark.parametrize("late", [(0, 0, 0, 0), (0, 1, 0, 2), (1, 0, 3, 4)], ids=str)
def test_doubling_gives_the_same_filter(
    kind: Estimated, late: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, measuring = model_of(30.0, 0.13), Measuring(SENSORS, late)
    wanted = kind.filter(model, WEIGHTS, measuring, 30.0, STEP)
    monkeypatch.setattr("scipy.linalg.solve_discrete_are", without_scipy_s_solver)
    np.testing.assert_allclose(kind.filter(model, WEIGHTS, measuring, 30.0, STEP), wanted, rtol=1e-6, atol=1e-8)


def test_late_sensors_that_scipy_may_not_order_are_designed_for() -> None:
    """Ten late samples at 50 Hz: at one of the speeds scipy's ordered eigenvalues are too far from where they were."""
    policy = LqPreview(EvasiveScenario(sensors="poor", preview_interval=0.2))
    assert policy.memory == 5 + 10 + 1


def test_an_equation_without_a_solution_is_said_in_a_line() -> None:
    """What wanders and is not measured becomes ever less known."""
    one, none = np.eye(1), np.zeros((1, 1))
    with pytest.raises(ValueError, match=r"^the Riccati equation has no solution"):
        doubled(one, none, one)
