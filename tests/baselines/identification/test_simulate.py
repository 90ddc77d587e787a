"""The model of the identification against scipy and against the environment, neither of which it shares code with."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lanekeep_baselines.identification import SensorNoise, excited_drive
from lanekeep_baselines.identification.simulate import Inputs, simulate
from lanekeep_baselines.yin_design import YinModel
from lanekeep_env.physics.vehicles import VEHICLES

MODEL = YinModel.of(VEHICLES["yin"])
TRUTH = np.array([MODEL.a11, MODEL.a12, MODEL.a21, MODEL.a22, MODEL.b1, MODEL.b2, 1.0 / 11.16])
SILENT = SensorNoise(speed=0.0, steering=0.0, yaw_rate=0.0, heading=0.0, position=0.0)


@pytest.mark.parametrize(("lag", "delay"), [(1.0 / 11.16, 0.0), (0.3, 0.03), (0.0, 0.0), (0.0, 0.12)])
@pytest.mark.parametrize("step", [0.01, 0.05])
def test_against_scipy(step: float, lag: float, delay: float) -> None:
    """The equations of Y10, written down again; the command held from `delay` after its sample, speed linear."""
    random = np.random.default_rng(0)
    count = 41
    times = np.arange(count) * step
    speed, command = 22.0 + 14.0 * np.sin(4.0 * times), random.normal(0.0, 0.5, count)
    start, anchor = np.array([0.2, -0.01, 0.1]), np.array([0.7, 3.0, -5.0])
    a11, a12, a21, a22, b1, b2, _ = TRUTH

    def rates(t: float, x: np.ndarray, held: float) -> list[float]:
        delta, beta, r, psi, _, _ = x
        v = np.interp(t, times, speed)
        delta = delta if lag else held
        return [
            (held - delta) / lag if lag else 0.0,
            a11 / v * beta + (a12 / v**2 - 1.0) * r + b1 / v * delta,
            a21 * beta + a22 / v * r + b2 * delta,
            r,
            v * np.cos(beta + psi),
            v * np.sin(beta + psi),
        ]

    x, expected = np.array([*start, *anchor]), []
    edges = np.unique(np.round(np.concatenate([times, times + delay]), 9))
    for begin, end in itertools.pairwise(edges):
        if begin in np.round(times, 9):
            expected.append(x)
        if begin > times[-2]:
            break
        held = command[max(int((begin - delay + 1e-9) // step), 0)]
        x = solve_ivp(rates, (begin, end), x, args=(held,), rtol=1e-10, atol=1e-12).y[:, -1]
    expected_rows = np.array(expected)
    parameters = np.array([*TRUTH[:6], lag])
    inputs = Inputs(speed, command, step, delay=delay)
    got = simulate(parameters[None], start[None], inputs, anchor=np.tile(anchor, (count, 1)))[0]
    known = slice(1, None) if lag == 0.0 else slice(0, None)  # without lag the angle is last step's command
    np.testing.assert_allclose(got[: len(expected), known], expected_rows[:, [0, 2, 3, 4, 5]][:, known], atol=3e-6)


def test_against_the_environment() -> None:
    """The truth's coefficients reproduce a recorded minute, up to corners of the speed between samples."""
    run = excited_drive(3, noise=SILENT)
    start = np.array([run.steering[0], 0.0, run.yaw_rate[0]])
    anchor = np.stack([run.heading, run.x, run.y], axis=1)
    got = simulate(TRUTH[None], start[None], Inputs(run.speed, run.command, run.step), anchor=anchor)[0]
    off = np.abs(got - np.stack([run.steering, run.yaw_rate, run.heading, run.x, run.y], axis=1)).max(axis=0)
    assert (off < [1e-6, 1e-5, 2e-5, 2e-3, 2e-3]).all(), off


def test_cars_are_independent_and_stretches_start_at_the_anchor() -> None:
    run = excited_drive(3, seconds=10.0, noise=SILENT)
    parameters = TRUTH * np.linspace(0.7, 1.3, 4)[:, None]
    start = np.zeros((4, 3))
    anchor = np.random.default_rng(0).normal(size=(len(run.speed), 3))
    inputs = Inputs(run.speed, run.command, run.step)
    together = simulate(parameters, start, inputs, anchor=anchor, stretch=300)
    for car in range(4):
        one = slice(car, car + 1)
        alone = simulate(parameters[one], start[one], inputs, anchor=anchor, stretch=300)
        assert together[car].tobytes() == alone[0].tobytes()
    np.testing.assert_array_equal(together[:, ::300, 2:], np.tile(anchor[::300], (4, 1, 1)))
    whole = simulate(parameters, start, inputs)
    np.testing.assert_array_equal(together[:, :, :2], whole[:, :, :2])  # steering and yaw rate run on
    shift = together[:, 300:600, 2] - together[:, 300:301, 2] - (whole[:, 300:600, 2] - whole[:, 300:301, 2])
    np.testing.assert_allclose(shift, 0.0, atol=1e-12)


def test_a_measured_angle_as_input_is_taken_linearly() -> None:
    """Second order in the step: half the step, a quarter of the error."""
    errors = []
    for step in (0.04, 0.02):
        times = np.arange(0.0, 2.0 + step / 2, step)
        angle = 0.3 * np.sin(2.0 * np.pi * times)
        speed = np.full(len(times), 25.0)
        got = simulate(TRUTH[None], np.zeros((1, 3)), Inputs(speed, angle, step, held=False))[0]
        np.testing.assert_allclose(got[1:, 0], angle[1:], atol=1e-15)
        a, b = np.array([[TRUTH[0] / 25, TRUTH[1] / 625 - 1], [TRUTH[2], TRUTH[3] / 25]]), TRUTH[4:6] / [25, 1]

        def rates(t: float, x: np.ndarray, a: np.ndarray = a, b: np.ndarray = b) -> np.ndarray:
            return a @ x + b * 0.3 * np.sin(2.0 * np.pi * t)

        exact = solve_ivp(rates, (0.0, 2.0), [0.0, 0.0], rtol=1e-10, atol=1e-12).y[1, -1]
        errors.append(abs(got[-1, 1] - exact))
    assert errors[1] < 0.3 * errors[0] < 1e-3
