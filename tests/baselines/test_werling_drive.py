"""Werling's split range and its integrator: the static inverse, who brakes, and what saturation does to the sum."""

from __future__ import annotations

import numpy as np
import pytest

from lanekeep_baselines.werling_drive import AccelerationIntegrator, EngineMap, split_range

SPEEDS, THROTTLES = np.array([80.0, 250.0, 500.0]), np.array([0.0, 0.2, 0.6, 1.0])
VALUES = np.array([[-0.05, 0.1, 0.25, 0.3], [-0.1, 0.15, 0.35, 0.4], [-0.2, 0.05, 0.3, 0.35]])
ENGINE = EngineMap(SPEEDS, THROTTLES, VALUES)


def test_map_is_its_inverses_inverse() -> None:
    random = np.random.default_rng(0)
    speed, throttle = random.uniform(80.0, 500.0, 500), random.uniform(0.0, 1.0, 500)
    assert ENGINE.throttle(speed, ENGINE.value(speed, throttle)) == pytest.approx(throttle, abs=1e-12)
    grid = np.meshgrid(SPEEDS, THROTTLES, indexing="ij")
    assert ENGINE.value(grid[0].ravel(), grid[1].ravel()) == pytest.approx(VALUES.ravel())
    assert ENGINE.value(np.array([165.0]), np.array([0.1])) == pytest.approx([(-0.05 + 0.1 - 0.1 + 0.15) / 4.0])
    ends = ENGINE.throttle(np.array([10.0, 900.0]), np.array([-9.0, 9.0]))
    assert ends.tolist() == [0.0, 1.0]


def test_map_without_an_inverse_is_refused() -> None:
    with pytest.raises(ValueError, match="no inverse"):
        EngineMap(SPEEDS, THROTTLES, -VALUES)


def commanded(wanted: np.ndarray):
    n = len(wanted)
    return split_range(ENGINE, wanted, np.full(n, 250.0), np.full(n, 8.0), np.full(n, 0.15), 0.1, 60.0)


def test_throttle_and_brake_give_what_is_asked_for_and_never_work_against_each_other() -> None:
    wanted = np.linspace(-5.0, 2.5, 301)
    throttle, pressure, expected = commanded(wanted)
    assert expected == pytest.approx(wanted, abs=1e-12)
    given = 8.0 * ENGINE.value(np.full(301, 250.0), throttle) - 0.1 * pressure - 0.15
    assert given == pytest.approx(wanted, abs=1e-12)
    assert ((throttle == 0.0) | (pressure == 0.0)).all()
    dragging = 8.0 * -0.1 - 0.15
    assert (pressure[wanted < dragging - 1e-9] > 0.0).all() and (throttle[wanted > dragging + 1e-9] > 0.0).all()


def test_beyond_the_actuators_what_is_expected_says_so() -> None:
    _, pressure, expected = commanded(np.array([-20.0, 9.0]))
    assert expected == pytest.approx([8.0 * -0.1 - 0.1 * 60.0 - 0.15, 8.0 * 0.4 - 0.15])
    assert pressure.tolist() == [60.0, 0.0]


def drive(wanted: np.ndarray, slope: float, hold: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return measured acceleration and integrator state over steps of 20 ms, acceleration lagging by 0.1 s."""
    integrator, memory, a, found = AccelerationIntegrator(1.0, 0.02, bound=100.0), np.zeros((1, 1)), 0.0, []
    for i, target in enumerate(wanted):
        now = np.array([target])
        asked = integrator.asked(now, memory, i == 0)
        command = commanded(asked)
        expected = command.expected if hold else asked
        memory = integrator.advance(now, np.array([a]), asked, expected, False, memory, i == 0)
        a += (command.expected[0] - slope - a) * (1.0 - np.exp(-0.2))
        found.append((a, memory[0, 0]))
    return tuple(np.array(found).T)


def test_integrator_makes_a_slope_good() -> None:
    a, state = drive(np.full(750, 0.5), 0.6, True)
    assert a[-1] == pytest.approx(0.5, abs=1e-3)
    assert state[-1] == pytest.approx(0.6, abs=1e-3)


def test_integrator_does_not_wind_up() -> None:
    """10 s of more than the engine has, then a little: without anti-windup the car goes on accelerating."""
    wanted = np.where(np.arange(700) < 500, 4.0, 0.5)
    held, state = drive(wanted, 0.6, True)
    wound, _ = drive(wanted, 0.6, False)
    assert np.abs(state).max() < 1.0
    assert held[-1] == pytest.approx(0.5, abs=0.05)
    assert held[510] < 1.0 < wound[590]


def test_integrator_stands_still_under_manual_driving_and_in_fresh_rows() -> None:
    integrator = AccelerationIntegrator(1.0, 0.02)
    one, memory = np.ones(3), np.array([[0.4], [0.4], [0.4]])
    fresh = np.array([False, False, True])
    manual = np.array([True, False, False])
    following = integrator.advance(one, 0.0 * one, one, one, manual, memory, fresh)
    assert following[:, 0] == pytest.approx([0.4, 0.42, 0.02])
    assert integrator.asked(one, memory, fresh).tolist() == [1.4, 1.4, 1.0]
    assert (memory == 0.4).all()
