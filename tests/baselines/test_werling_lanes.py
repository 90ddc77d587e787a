"""`werling-traffic`: no contact that could have been avoided, and changes of lanes along the evasive path."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.lane_change import Room, passing_speed, quintic_at
from lanekeep_env import Termination
from lanekeep_env.roads.manoeuvres import quintic


def endings(situation: str, count: int, seed: int, steps: int = 1000):
    """How episodes end: terminations, whether a contact was avoidable, and changes of lanes, (count,) each."""
    env = gym.make_vec("lanekeep/Traffic-v0", count, "vector_entry_point", autoreset_mode="disabled", flow=situation)
    scenario = env.unwrapped.scenario
    policy, lane = lanekeep_baselines.make("werling-traffic", scenario), scenario.column("lane")
    observation, _ = env.reset(seed=seed)
    state, first, alive = None, np.ones(count, bool), np.ones(count, bool)
    found, avoidable, changes = np.zeros(count, int), np.zeros(count), np.zeros(count, int)
    for _ in range(steps):
        before = observation[:, lane]
        action, state = policy.predict(observation, state, first)
        first = np.zeros(count, bool)
        observation, _, terminated, truncated, info = env.step(action)
        changes += alive & (observation[:, lane] != before)
        new = alive & terminated
        found[new] = info["termination"][new]
        avoidable[new] = (info["avoidable_contact"] + info["avoidable_overrun"])[new]
        alive &= ~(terminated | truncated)
    return found, avoidable, changes


@pytest.mark.parametrize("count", [40, pytest.param(510, marks=pytest.mark.slow)])
@pytest.mark.parametrize("situation", ["braking_lead", "cut_in"])
def test_no_contact_in_avoidable_episodes(situation: str, count: int) -> None:
    found, avoidable, changes = endings(situation, count, seed=16)
    assert not avoidable.any() and set(found) <= {Termination.NONE, Termination.CONTACT}
    assert (found == Termination.NONE).sum() > 0.98 * count  # some cut-ins cannot be helped
    assert changes.sum() > 0.3 * count


def test_most_cars_whose_lane_ends_leave_it_and_none_passes_its_end() -> None:
    found, _, changes = endings("merging", 40, seed=3, steps=1500)
    assert (found == Termination.NONE).all() and (changes > 0).mean() > 0.5


def test_the_path_of_a_change_is_that_of_the_evasive_manoeuvre() -> None:
    """By arc length: position, heading and curvature of `EvasiveRoads`' quintic."""
    stations, curvatures, headings = quintic(3.5, 36.7)
    u = np.linspace(0.0, 1.0, len(stations))
    point = quintic_at(u, np.float64(3.5), np.float64(36.7))
    np.testing.assert_allclose(point.curvature, curvatures, atol=1e-12)
    np.testing.assert_allclose(np.arctan(point.slope), headings, atol=1e-12)
    assert point.lateral[[0, -1]] == pytest.approx([0.0, 3.5])
    rises = np.diff(point.lateral) / np.diff(stations)
    np.testing.assert_allclose(rises, np.sin((headings[1:] + headings[:-1]) / 2), atol=1e-4)


def test_room_and_speeds_in_closed_form() -> None:
    room = Room(gap=5.0, time=0.5, braking=2.0)
    v = np.array([20.0, 20.0])
    assert room.enough(np.array([15.1, 14.9]), v, v).tolist() == [True, False]
    assert room.enough(np.array([40.1, 39.9]), v, v - 10.0).tolist() == [True, False]
    # Half of the horizon until the car ahead is caught up with, then as fast as it.
    assert passing_speed(np.array([30.0]), np.array([50.0]), np.array([20.0]), 10.0) == pytest.approx(25.0)
    assert passing_speed(np.array([30.0]), np.array([np.inf]), np.array([0.0]), 10.0) == pytest.approx(30.0)
