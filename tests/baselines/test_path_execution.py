"""Planned segments driven on the product's rolling car: it ends where the plan says."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_baselines import path_planning as planning

#: Way of a control step at 1 m/s, m; wheelbase, m; cars.
WAY, WHEELBASE, CARS = 0.045, 0.35, 300
WIDE = {"kind": "circuit", "length": 80.0, "width": 80.0, "corridor": 20.0}
SQUARE_ON = {"lateral_error": 0.0, "heading_error": 0.0, "start_index": 0, "world_index": 0}


def driven(segments: np.ndarray) -> np.ndarray:
    """End poses, (n, 3), of the rear axle in the frame of its start; the car is at its speed before and behind."""
    steps = np.rint(np.abs(segments[..., 0]) / WAY).astype(int)
    np.testing.assert_allclose(steps * WAY, np.abs(segments[..., 0]), atol=1e-7)
    cars, direction = len(segments), np.sign(segments[:, 0, 0])
    settings = {"world": WIDE, "steering_offset": 0.0, "contact": "off", "max_speed": 1.0, "max_acceleration": 1000.0}
    env = gym.make_vec("lanekeep/Circuit-v0", cars, "vector_entry_point", dtype="float64", scan="none", **settings)
    limit = env.unwrapped.scenario.max_steering_angle
    env.reset(seed=0, options=SQUARE_ON)
    env.step(np.stack([0.0 * direction, direction], axis=1).astype(np.float32))
    start, ends = np.array([rear_axle(env, car) for car in range(cars)]), np.cumsum(steps, axis=1)
    end = np.zeros((cars, 3))
    for step in range(ends.max()):
        part = np.minimum((step >= ends).sum(axis=1), segments.shape[1] - 1)
        curvature = segments[np.arange(cars), part, 1]
        steering = np.arctan(WHEELBASE * curvature)
        assert np.abs(steering).max() < limit
        env.step(np.stack([steering / limit, direction], axis=1).astype(np.float32))
        for car in np.flatnonzero(ends[:, -1] == step + 1):
            end[car] = rear_axle(env, car)
    env.close()
    off, (cosine, sine) = end - start, (np.cos(start[:, 2]), np.sin(start[:, 2]))
    return np.stack([cosine * off[:, 0] + sine * off[:, 1], cosine * off[:, 1] - sine * off[:, 0], off[:, 2]], axis=1)


def rear_axle(env: gym.vector.VectorEnv, car: int) -> tuple[float, float, float]:
    pose = env.unwrapped._core.pose(car)
    back = 0.5 * WHEELBASE
    return pose.x - back * np.cos(pose.heading), pose.y - back * np.sin(pose.heading), pose.heading


def curves(seed: int, most: int = 26) -> tuple[np.ndarray, ...]:
    """Steps of an arc, of a straight and of the arc back, side, and the radii with which both arcs turn as far, m."""
    random = np.random.default_rng(seed)
    first, straight = random.integers(3, most, CARS), random.integers(1, 30, CARS)
    last = first + random.integers(0, 1 + first // 3)
    radius = random.uniform(0.9, 1.3, CARS)
    return first, straight, last, random.choice([-1.0, 1.0], CARS), radius, radius * last / first


def apart(end: np.ndarray, other: np.ndarray) -> None:
    assert np.abs(end[:, :2] - other[:, :2]).max() < 1e-4
    assert np.abs(np.angle(np.exp(1j * (end[:, 2] - other[:, 2])))).max() < 1e-4


@pytest.mark.parametrize("opposite", [True, False])
def test_evasions_end_at_their_targets(opposite: bool) -> None:
    """S-curves, and arcs with a straight where the target is too near for one; radii differ."""
    first, straight, last, side, radius, other = curves(1 + opposite)
    pieces = [np.stack([first * WAY, side / radius], axis=1), np.stack([straight * WAY, 0.0 * side], axis=1)]
    if opposite:
        pieces.append(np.stack([last * WAY, -side / other], axis=1))
    target = planning.drive(np.stack(pieces, axis=1), np.zeros((CARS, 3)))
    left, right = np.where(side > 0.0, radius, other), np.where(side > 0.0, other, radius)
    planner = planning.s_curve if opposite else planning.arc_and_straight
    segments, ok = planner(target[:, 0], target[:, 1], left, right)
    assert ok.all()
    apart(driven(segments), target)


@pytest.mark.parametrize("whole", [True, False])
def test_parking_ends_along_the_kerb(whole: bool) -> None:
    """Arcs of 45 degrees with a straight between them, and smaller ones without."""
    random = np.random.default_rng(5)
    if whole:
        right, left = 4.0 * WAY / np.pi * random.integers(16, 24, (2, CARS))
        shift = (right + left) * (1.0 - np.sqrt(0.5)) + random.integers(0, 20, CARS) * WAY * np.sqrt(0.5)
    else:
        first, _, _, _, right, left = curves(6, most=16)
        shift = (right + left) * (1.0 - np.cos(first * WAY / right))
    segments, travel, ok = planning.parallel_parking(shift, right, left)
    assert ok.all()
    apart(driven(segments), np.stack([-travel, -shift, 0.0 * shift], axis=1))
