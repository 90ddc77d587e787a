"""The Kalman filter along a wall."""

from __future__ import annotations

import control
import numpy as np
import pytest

from lanekeep_baselines.wall_design import WallCar
from lanekeep_baselines.wall_estimator import WallFilter, WallNoise

CAR = WallCar()


def drive_filter(speed: float, steps: int, noise: WallNoise, steering: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return memory and true (distance, heading) of a car with an offset of 2 degrees and a bias of 0.04 rad/s."""
    rng, offset, bias = np.random.default_rng(5), np.deg2rad(2.0), 0.04
    estimator, memory = WallFilter(CAR, noise), np.zeros((1, 20))
    y, phi, turned = 1.0, 0.1, 0.0
    for k in range(steps):
        side = y / np.cos(phi) + noise.side_distance * rng.standard_normal()
        rate = turned / CAR.step + bias + noise.yaw_rate * rng.standard_normal()
        told = steering if k else 0.0
        memory = estimator.update(memory, k == 0, *(np.array([value]) for value in (speed, told, side, rate)))
        # The car is steered straight by hand, with what the filter does not know.
        steering = float(np.clip(-np.sign(speed) * 2.0 * phi - 1.0 * (y - 1.0), -0.3, 0.3)) - offset
        curvature = np.tan(steering + offset) / CAR.wheelbase
        rear_y, turned = y - CAR.sensor * np.sin(phi), speed * CAR.step * curvature
        rear_y += speed * CAR.step * np.sinc(turned / 2.0 / np.pi) * np.sin(phi + turned / 2.0)
        phi += turned
        y = rear_y + CAR.sensor * np.sin(phi)
    return memory[0], np.array([y, phi])


@pytest.mark.parametrize("speed", [-0.5, 0.4, 1.0, 2.0])
def test_the_filter_finds_heading_offset_and_bias(speed: float) -> None:
    quiet = WallNoise(side_distance=1e-3, yaw_rate=2e-3)
    memory, _ = drive_filter(speed, 600, quiet)
    assert memory[2] == pytest.approx(np.deg2rad(2.0), abs=np.deg2rad(0.5))
    assert memory[3] == pytest.approx(0.04, abs=0.01)


@pytest.mark.parametrize("speed", [0.4, 2.0])
def test_its_covariance_ends_at_the_riccati_equation(speed: float) -> None:
    noise = WallNoise()
    estimator, memory = WallFilter(CAR), np.zeros((1, 20))
    for k in range(6000):
        memory = estimator.update(memory, k == 0, np.array([speed]), np.zeros(1), np.ones(1), np.zeros(1))
    a, b = CAR.plant(speed)
    system = np.eye(4)
    system[:2, :2], system[:2, 2:3] = a, b
    c = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, speed / 0.35, 1.0]])
    way = speed * CAR.step
    chance = np.diag([way * noise.distance**2, way * noise.heading**2, way * noise.steering_offset**2, 0.0])
    chance[3, 3] = CAR.step * noise.yaw_rate_bias**2
    r = np.diag([noise.side_distance**2, noise.yaw_rate**2])
    before, _, _ = control.dare(system.T, c.T, chance, r)
    after = before - before @ c.T @ np.linalg.inv(c @ before @ c.T + r) @ c @ before
    np.testing.assert_allclose(memory[0, :4], [1.0, 0.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(memory[0, 4:].reshape(4, 4), after, rtol=1e-3, atol=1e-9)


def test_at_standstill_heading_and_offset_rest() -> None:
    rng, estimator = np.random.default_rng(1), WallFilter(CAR)
    memory, _ = drive_filter(1.0, 300, WallNoise())
    rows = memory[None]
    for _ in range(5000):
        side, rate = 1.0 + 0.01 * rng.standard_normal(1), 0.04 + 0.02 * rng.standard_normal(1)
        rows = estimator.update(rows, False, np.zeros(1), np.zeros(1), side, rate)
    covariance = rows[0, 4:].reshape(4, 4)
    assert np.all(np.linalg.eigvalsh(covariance) > -1e-12)
    np.testing.assert_allclose(rows[0, 1:3], memory[1:3], atol=0.02)
    assert rows[0, 3] == pytest.approx(0.04, abs=0.01)


def test_rows_of_the_filter_are_independent_and_nothing_is_mutated() -> None:
    rng, rows, estimator = np.random.default_rng(3), 37, WallFilter(CAR)
    memory = estimator.update(np.zeros((rows, 20)), True, *rng.uniform(0.3, 1.0, (4, rows)))
    for _ in range(5):
        fresh, inputs = rng.random(rows) < 0.2, rng.uniform(-0.2, 1.0, (4, rows))
        kept = memory.copy()
        after = estimator.update(memory, fresh, *inputs)
        np.testing.assert_array_equal(memory, kept)
        for i in range(rows):
            one = slice(i, i + 1)
            alone = estimator.update(memory[one], fresh[one], *inputs[:, one])
            np.testing.assert_array_equal(alone, after[one])
        memory = after
