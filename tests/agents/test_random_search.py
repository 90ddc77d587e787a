"""The random search climbs, and drives as the policy that it writes."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.export import versions
from lanekeep_agents.policy_record import Training
from lanekeep_agents.training.random_search import CHARGE, Corrected, ascend, search

DRIVE, KEYWORDS = "lanekeep/LaneKeep-v0", {"episode_steps": 60}
READS, BOUND, CARS = ["yaw_rate", "lateral_error"], 0.3, 16
SEEDS = [3, 5, 7, 11]


def made(cars=CARS, **keywords):
    return Corrected(DRIVE, "stanley", READS, BOUND, cars, {**KEYWORDS, **keywords})


def driven(policy, cars, seeds, **keywords):
    """Returns of cars and whether they left the lane, one after the other in single environments."""
    found = []
    for seed in seeds[:cars]:
        env = gym.make(DRIVE, **KEYWORDS, **keywords)
        (observation, _), state, total, over = env.reset(seed=seed), None, 0.0, False
        while not over:
            action, state = policy(env.unwrapped.scenario).predict(observation, state)
            observation, reward, left, truncated, _ = env.step(action)
            total, over = total + reward, left or truncated
        found.append((total, left))
    return np.array(found).T


def test_it_climbs_to_the_top_of_a_paraboloid():
    top, width, rng = np.array([[1.0, -2.0], [0.5, 0.0]]), np.array([[0.1], [0.05]]), np.random.default_rng(0)
    weights = np.zeros((2, 2))

    def returns(found):
        return -(((found - top) / width) ** 2).sum(axis=(1, 2))

    for k in range(800):
        weights = ascend(weights, width, returns, 8, 1.0 - k / 800, rng)
    assert returns(weights[None])[0] > 1e-4 * returns(np.zeros((1, 2, 2)))[0]


def test_who_corrects_nothing_is_the_classical_policy_and_leaving_the_lane_is_charged():
    for width in (3.5, 2.2):
        returns, left = driven(
            lambda scenario: lanekeep_baselines.make("stanley", scenario), 4, SEEDS, lane_width=width
        )
        found = made(lane_width=width).returns(np.zeros((4, 1, 4)), SEEDS)
        np.testing.assert_allclose(found, (returns - CHARGE * left).mean(), rtol=1e-9)
    assert left.any()


def test_the_file_drives_as_the_search_did(tmp_path):
    cars, rng = made(), np.random.default_rng(1)
    cars.normalise(range(CARS))
    candidates = 0.3 * rng.standard_normal((4, 1, 4))
    wanted = cars.returns(candidates, SEEDS)
    told = Training("python mine.py", {}, 0, 1, 1.0, versions(), {})
    for k, weights in enumerate(candidates):
        record = cars.save(tmp_path / f"{k}.json", weights, told)
        assert (record.algorithm, record.base, record.env_id) == ("ARS", "stanley", DRIVE)
        policy = lanekeep_agents.load(tmp_path / f"{k}.json", cars.scenario)
        returns, left = driven(lambda _, policy=policy: policy, 4, SEEDS)
        assert (returns - CHARGE * left).mean() == pytest.approx(wanted[k], rel=1e-4)
    with pytest.raises(ValueError, match="exists"):
        cars.save(tmp_path / "0.json", weights, told)


def test_a_search_gains_and_is_the_same_again():
    found = [search([made()], np.array([[0.1]]), 2, 40 * CARS * 60, np.random.default_rng(2)) for _ in range(2)]
    (weights, steps), (again, _) = found
    assert (weights == again).all() and steps == 40 * CARS * 60
    cars = made()
    cars.normalise(np.random.default_rng(2).integers(1 << 31, size=CARS))
    candidates = np.stack([np.zeros_like(weights), weights])
    before, after = cars.returns(candidates, range(100, 108))
    assert after > before
