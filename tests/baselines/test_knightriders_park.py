"""Parking: whole episodes, the shortest gap, the servo's map from driven half circles."""

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_baselines.path_planning import shortest_gap
from lanekeep_baselines.servo_map import ServoMap
from lanekeep_env.scenario import Servo

PARK = "lanekeep/ParallelPark-v0"
NOISY = {"sensors": "production", "encoder_ticks": 40}


def drive(name, rows, world, **keywords):
    """Return termination, success and smallest share of each row's first episode; a scan is not needed."""
    env = gym.make_vec(PARK, rows, "vector_entry_point", world=world, scan="none", **keywords)
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
    worlds = len(env.unwrapped.world_set())
    observation, info = env.reset(seed=2000, options={"world_index": np.arange(rows) % worlds})
    state, over = None, np.zeros(rows, dtype=bool)
    termination, success = np.zeros(rows, dtype=int), np.zeros(rows, dtype=bool)
    while not over.all():
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        now = (terminated | truncated) & ~over
        termination[now], success[now] = info["termination"][now], info["is_success"][now]
        over |= now
    return termination, success


@pytest.mark.parametrize("keywords", [{}, NOISY, {**NOISY, "servo": {"left": 0.36, "right": 0.4, "ticks": 50}}])
def test_every_random_row_is_parked_in(keywords):
    world = {"kind": "random-parking-rows", "count": 64, "seed": 2000}
    _, success = drive("knightriders-park", 64, world, **keywords)
    assert success.mean() >= 0.98


@pytest.mark.parametrize(
    ("vehicle", "overhang", "length", "radius"),
    [
        ("knightriders", 0.091, 0.532, 0.35 / np.tan(np.deg2rad(22.0))),
        ("pses", 0.091, 0.44, 0.93),
    ],
)
def test_the_shortest_gap_is_that_of_the_swept_body(vehicle, overhang, length, radius):
    """Boxes as wide as the car, no noise: always 5 cm beyond the shortest gap, never below it; no contact ever."""
    shortest = shortest_gap(overhang, length, 0.265, radius)
    for spare, parks in ((-0.01, False), (0.05, True), (0.3, True)):
        world = {"kind": "parking-row", "gaps": (0.4, shortest + spare), "width": 0.265}
        termination, success = drive("knightriders-park", 6, world, vehicle=vehicle, steering_offset=0.0)
        assert success.all() == success.any() == parks, spare
        assert (termination != 2).all()


def test_the_report_s_own_rule_finds_no_gap_that_is_only_as_long_as_needed():
    """Its gap length is the rear axle's travel, 1.33 m and more: the issue of (36)."""
    world = {"kind": "random-parking-rows", "count": 32, "seed": 2000}
    _, success = drive("knightriders-park-published", 32, world)
    assert not success.any()


def test_half_circles_give_the_servo_s_map_and_its_inverse():
    """A servo's half circles are driven; what they show is the map, to the arc's share of a step."""
    limit, angles = 0.38, (-0.42, -0.3, -0.17, -0.06, 0.02, 0.08, 0.19, 0.27, 0.33)
    commands = np.linspace(-limit, limit, len(angles))
    env = gym.make_vec(
        "lanekeep/Circuit-v0",
        len(angles),
        "vector_entry_point",
        dtype="float64",
        scan="none",
        steering_offset=0.0,
        world={"kind": "corridor", "length": 200.0, "width": 100.0},
        servo={"angles": angles},
        contact="off",
        max_steering_angle=limit,
        vehicle={"base": "knightriders", "steering": {"angle_limit": None}},
        max_acceleration=1000.0,
        start_heading_error=0.0,
        start_lateral_error=0.0,
        episode_steps=100_000,
    )
    _, info = env.reset(seed=0)
    actions = np.column_stack([commands / limit, np.full(len(angles), 0.5)]).astype(np.float32)
    turned, way = np.zeros(len(angles)), np.zeros(len(angles))
    for _ in range(300):
        before = info["heading_error"]
        *_, info = env.step(actions)
        turned += np.remainder(info["heading_error"] - before + np.pi, 2 * np.pi) - np.pi
        way += info["speed"] * 0.045
    # The speed is the centre of gravity's only where the car does not turn; the rear axle's is what the encoder tells.
    half = np.pi * way / turned
    shown = ServoMap.from_half_circles(commands, half, 0.35)
    np.testing.assert_allclose(shown.angle(commands), angles, atol=2e-3)
    wanted = np.linspace(angles[0], angles[-1], 50)
    known = ServoMap.of(Servo(angles=angles), limit)
    np.testing.assert_allclose(known.angle(known.command(wanted)), wanted, atol=1e-12)
    assert (known.left, known.right) == (0.33, 0.42)
    plain = ServoMap.of(Servo(), 0.3)
    np.testing.assert_array_equal(plain.command(wanted), np.clip(wanted, -0.3, 0.3))


def test_a_map_that_does_not_rise_is_refused():
    with pytest.raises(ValueError, match="must rise"):
        ServoMap([-1.0, 0.0, 1.0], [-0.1, 0.2, 0.1])
