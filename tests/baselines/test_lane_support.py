"""Lane keeping support: how often, how hard and how smoothly `lane-support` intervenes."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_env import LaneKeepScenario, LaneSupportScenario

CARS, STEPS = 256, 1200
MINUTES = CARS * STEPS * 0.05 / 60.0


def drive(driver: object, assisted: bool, seed: int = 0, **keywords: object) -> dict[str, np.ndarray]:
    """Return departures and interventions of 256 episodes of a minute, and what was added, (steps, cars), rad."""
    settings = {"driver": driver, "departure": "cost", "autoreset_mode": "disabled", **keywords}
    env = gym.make_vec("lanekeep/LaneSupport-v0", CARS, "vector_entry_point", **settings).unwrapped  # type: ignore[arg-type]
    policy = lanekeep_baselines.make("lane-support", env.scenario)
    observation, _ = env.reset(seed=seed)
    state, departed, added = None, np.zeros(CARS, dtype=bool), [np.zeros(CARS)]
    for _ in range(STEPS):
        action, state = policy.predict(observation, state)
        observation, _, _, _, info = env.step(action if assisted else np.zeros_like(action))
        departed |= np.asarray(info["cost"]) > 0.0
        added.append(np.array(info["assistance"]))
    return {
        "departed": departed,
        "added": np.array(added),
        **{k: np.array(info[k]) for k in ("interventions", "handover_jump")},
    }


@pytest.mark.parametrize("sensors", [None, "production"])
def test_a_drowsy_driver_leaves_the_lane_without_it_and_not_with_it(sensors: str | None) -> None:
    alone, helped = (drive("drowsy", assisted, sensors=sensors) for assisted in (False, True))
    assert alone["departed"].mean() >= 0.2 and helped["departed"].mean() <= 0.01
    assert 0.0 < helped["interventions"].sum() / MINUTES < 2.0
    # At the road wheel; at any step, at hand-over or not, it changes by no more.
    assert np.degrees(helped["handover_jump"].max()) < 0.5
    assert np.degrees(np.abs(np.diff(helped["added"], axis=0)).max()) < 0.5


def test_an_attentive_driver_is_left_alone() -> None:
    helped = drive("attentive", True, seed=77, sensors="production")
    assert not helped["departed"].any() and helped["interventions"].sum() / MINUTES < 0.1


def test_cars_that_differ_are_kept_as_well() -> None:
    helped = drive("drowsy", True, seed=5, randomisation="mismatch", sensors="production")
    assert helped["departed"].mean() <= 0.01


def test_it_adds_nothing_where_nothing_is_wrong_and_is_for_drivers_only() -> None:
    scenario = LaneSupportScenario()
    policy = lanekeep_baselines.make("lane-support", scenario)
    row = np.zeros(len(scenario.channels), dtype=np.float32)
    row[scenario.column("speed")] = 30.0
    row[scenario.column("driver_steering")] = 0.01
    action, _ = policy.predict(row)
    assert action[1] == 0.0 and action[0] == pytest.approx(0.01 / scenario.max_steering_angle)
    assert "lane-support" not in lanekeep_baselines.names(LaneKeepScenario(preview=12))
    assert lanekeep_baselines.names(scenario) == ("lane-support",)


def test_rows_are_independent_mirrored_and_forget_where_an_episode_starts() -> None:
    scenario = LaneSupportScenario()
    policy = lanekeep_baselines.make("lane-support", scenario)
    rng, n = np.random.default_rng(4), 37
    rows = (rng.normal(size=(6, n, len(scenario.channels))) * 0.1).astype(np.float32)
    rows[..., scenario.column("lateral_error")] *= 6.0
    rows[..., [scenario.column(f"curvature_preview_{k}") for k in range(12)]] *= 0.01
    rows[..., scenario.column("speed")] = 25.0
    even = [channel.name in ("speed", "authority") for channel in scenario.channels]
    starts = rng.random((6, n)) < 0.2
    state = mirrored_state = None
    alone = [None] * n
    for observation, start in zip(rows, starts, strict=True):
        kept = None if state is None else state.copy()
        action, following = policy.predict(observation, state, start)
        assert state is None or (state == kept).all()
        mirrored, mirrored_state = policy.predict(np.where(even, observation, -observation), mirrored_state, start)
        np.testing.assert_array_equal(mirrored[:, 0], -action[:, 0])
        np.testing.assert_array_equal(mirrored[:, 1], action[:, 1])
        for i in range(n):
            one, alone[i] = policy.predict(observation[i], None if start[i] else alone[i])
            np.testing.assert_array_equal(one, action[i])
        state = following
    assert 0.0 < state[:, 0].mean() < 1.0
