"""The lane-keeping task: starts, costs, endings, channels, errors."""

import os
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env
from lanekeep_env import LaneKeepScenario, Termination
from lanekeep_env.families.road.cars import road_tables
from lanekeep_env.roads import sets

ID = "lanekeep/LaneKeep-v0"


def step(env, value):
    return env.step(np.array([value], np.float32))


def test_starts_cover_the_promised_range_on_straights_and_in_curves():
    for limit in (0.5, 1.0):
        env = gym.make_vec(ID, 4000, "vector_entry_point", start_lateral_error=limit, observation="full")
        observation, infos = env.reset(seed=0)
        names = [c.name for c in env.unwrapped.channels]
        lateral, course = infos["lateral_error"], infos["heading_error"] + observation[:, names.index("sideslip")]
        assert np.abs(lateral).max() <= limit and np.abs(course).max() <= np.radians(2.0) + 1e-6
        # uniform: mean 0, standard deviation limit / sqrt(3), within five standard errors
        assert abs(lateral.mean()) < 5 * limit / np.sqrt(3 * 4000)
        assert lateral.std() == pytest.approx(limit / np.sqrt(3), rel=0.05)
        curvature = np.abs(observation[:, names.index("curvature")])
        assert 0.05 < (curvature < 1e-6).mean() < 0.9 and (curvature > 0.005).mean() > 0.05


def test_start_is_steady_driving():
    """Started without errors in the middle of a circle, holding the steering keeps the car on it."""
    for keywords in ({}, {"dynamics": "kinematic"}):
        env = gym.make(ID, road={"kind": "circle", "radius": 150.0}, observation="full", **keywords)
        observation, info = env.reset(seed=0, options={"lateral_error": 0.0, "arc_length": 5.0})
        sideslip = observation[[c.name for c in env.unwrapped.channels].index("sideslip")]
        observation, info = env.reset(
            seed=0, options={"lateral_error": 0.0, "arc_length": 5.0, "heading_error": -float(sideslip)}
        )
        for _ in range(100):
            info = step(env, observation[4] / 0.15)[4]
        assert abs(info["lateral_error"]) < 0.02


def test_cost_is_the_documented_formula():
    env = gym.make(ID, cost_weight=2.0, reference_steering_rate=0.2)
    env.reset(seed=1)
    for value in (0.1, 0.12, 0.1):
        _, reward, _, _, info = step(env, value)
        cost = (info["lateral_error"] / 0.5) ** 2 + 2.0 * (info["steering_rate"] / 0.2) ** 2
        assert reward == pytest.approx(-min(16.0, cost) * 0.05, rel=1e-12)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6), leave=st.integers(1, 80), steps=st.integers(60, 200), dt=st.sampled_from([0.05, 0.1])
)
def test_returns_rank_a_departure_below_every_drive_inside_the_lane(seed, leave, steps, dt):
    """The dearest survivor pays the cap at every step; who leaves, whenever, gets no more than he."""
    env = gym.make(ID, episode_steps=steps, control_step=dt, road="straight", speed=20.0)
    observation, _ = env.reset(seed=seed)
    total, count, done = 0.0, 0, False
    while not done:
        steer = -0.03 * observation[0] - 0.6 * observation[1]
        observation, reward, terminated, truncated, info = step(env, steer / 0.15 if count < leave else 1.0)
        total, count, done = total + reward, count + 1, terminated or truncated
    if terminated:
        assert info["termination"] == Termination.LANE_DEPARTURE and not info["is_success"]
        survivor_at_the_cap_from_then_on = -16.0 * dt * (steps - count + 1)
        assert reward == pytest.approx(survivor_at_the_cap_from_then_on, rel=1e-9)
        assert total >= -16.0 * dt * steps - 1e-9
    else:
        assert leave + 20 > steps and info["is_success"]


def test_departure_modes():
    ends = gym.make(ID)
    goes_on = gym.make(ID, departure="cost")
    ignores = gym.make(ID, departure="off")
    for env in (ends, goes_on, ignores):
        env.reset(seed=0)
    for _ in range(200):
        last = step(ends, 1.0)
        if last[2]:
            break
    assert last[2] and abs(last[4]["lateral_error"]) > 1.75 and last[4]["cost"] == 1.0
    for _ in range(200):
        charged, free = step(goes_on, 1.0), step(ignores, 1.0)
    assert not charged[2] and charged[4]["cost"] == 1.0 and not charged[4]["is_success"]
    assert charged[1] == pytest.approx(-16.0 * 0.05)
    assert not free[2] and free[4]["cost"] == 0.0 and free[4]["is_success"]


def test_preview_reads_the_road_ahead():
    env = gym.make(ID, preview=12, preview_interval=0.25, road="random", departure="off")
    geometry_set = env.unwrapped.road_set()
    for seed in range(5):
        observation, info = env.reset(seed=seed, options={"road_index": seed})
        road = geometry_set[seed][0]
        for _ in range(40):
            names = [c.name for c in env.unwrapped.channels]
            got = observation[names.index("curvature_preview_0") :]
            ahead = info["arc_length"] + info["speed"] * 0.25 * np.arange(12)
            np.testing.assert_allclose(got, road.curvature(ahead), atol=2e-7)
            observation, _, _, _, info = step(env, 0.0)


def test_values_outside_the_box_are_clipped_and_counted():
    env = gym.make(ID, vehicle={"steering": {"lag": 0.0}})
    env.reset(seed=0)
    assert step(env, 7.0)[0][4] == pytest.approx(0.15)
    step(env, -1.0)
    assert step(env, -np.inf)[0][4] == pytest.approx(-0.15)
    assert env.unwrapped.clipped_actions == 2
    vector = gym.make_vec(ID, 3, "vector_entry_point")
    vector.reset(seed=0)
    vector.step(np.array([[0.0], [1.5], [-9.0]], np.float32))
    np.testing.assert_array_equal(vector.unwrapped.clipped_actions, [0, 1, 1])


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"vehicel": "yin"}, ["vehicel", "vehicle"]),
        ({"dtyp": "float32"}, ["dtyp", "did you mean 'dtype'"]),
        ({"vehicle": {"steering": 0.1}}, ["vehicle.steering", "mapping"]),
        ({"road": {"kind": ["sine"]}}, ["road", "sine"]),
        ({"road": {"kind": "circle", "radius": 1e12}}, ["radius", "<= 1000000"]),
        ({"speed": True}, ["speed", "True"]),
        ({"vehicle": "yinn"}, ["yinn", "yin", "commonroad-1"]),
        ({"vehicle": {"mass": -1.0}}, ["vehicle.mass", "-1.0", "kg", ">= "]),
        ({"vehicle": {"mas": 1.0}}, ["mas", "mass"]),
        ({"vehicle": {"steering": {"lagg": 1.0}}}, ["lagg", "lag"]),
        ({"vehicle": {"steering": {"delay": 0.013}}}, ["delay", "0.013", "0.01"]),
        ({"road": "randm"}, ["randm", "random"]),
        ({"road": {"kind": "circle", "radius": 1.0}}, ["radius"]),
        ({"tyre": "magic"}, ["tyre", "magic_formula"]),
        ({"dynamics": "dynamc"}, ["dynamics", "dynamic"]),
        ({"friction": 0.0}, ["friction", ">= "]),
        ({"control_step": 0.0001}, ["control_step", "0.0001", ">= 0.001"]),
        ({"departure": "stop"}, ["departure", "terminate"]),
        ({"preview": -1}, ["preview", ">= 0"]),
        ({"preview": 2.5}, ["preview", "whole"]),
        ({"speed": -3.0}, ["speed", "-3.0"]),
        ({"speed": float("nan")}, ["speed", "nan"]),
        ({"dtype": "float16"}, ["dtype", "float32"]),
        ({"start_lateral_error": 5.0}, ["start_lateral_error", "1.75"]),
        ({"render_mode": "rgb"}, ["render_mode", "rgb_array"]),
    ],
)
def test_wrong_configurations_are_named_in_one_line(keywords, words):
    for make in (lambda: gym.make(ID, **keywords), lambda: gym.make_vec(ID, 2, "vector_entry_point", **keywords)):
        with pytest.raises((ValueError, TypeError)) as caught:
            make()
        message = str(caught.value)
        assert "\n" not in message
        for word in words:
            assert word in message


def test_wrong_actions_are_named():
    env = gym.make(ID)
    with pytest.raises(gym.error.ResetNeeded):
        env.unwrapped.step(np.zeros(1, np.float32))
    env.reset(seed=0)
    for bad in (np.zeros(2, np.float32), np.float32(0.0), np.zeros((1, 1), np.float32)):
        with pytest.raises(ValueError, match=r"shape \(1,\)"):
            env.unwrapped.step(bad)
    with pytest.raises(ValueError, match="NaN"):
        step(env, np.nan)
    unlike = [[None], ["left"], ["0.5"], [b"0.5"], [0.5j], np.array(["2026-01-01"], "M8[D]"), np.array([5], "m8[s]")]
    for bad in map(np.asarray, unlike):
        with pytest.raises(ValueError, match="not a number"):
            env.unwrapped.step(bad)
    assert np.isfinite(step(env, 0.0)[0]).all()
    vector = gym.make_vec(ID, 3, "vector_entry_point")
    vector.reset(seed=0)
    with pytest.raises(ValueError, match=r"shape \(3,\); they must have shape \(3, 1\)"):
        vector.step(np.zeros(3, np.float32))
    before = vector.unwrapped._core.cars.copy()
    for bad in map(np.asarray, unlike[1:]):  # of None NumPy makes NaN
        with pytest.raises(ValueError, match="are not numbers"):
            vector.step(np.stack([bad] * 3))
    with pytest.raises(ValueError, match="car 1 is NaN"):
        vector.step(np.array([[0], [np.nan], [0]], np.float32))
    np.testing.assert_array_equal(before, vector.unwrapped._core.cars)


def test_wrong_reset_options_are_named():
    env = gym.make(ID)
    for options, word in (
        ({"lateral": 1.0}, "lateral_error"),
        ({"road_index": 10**6}, "road_index"),
        ({"arc_length": -5.0}, "arc_length"),
        ({"lateral_error": "x"}, "lateral_error"),
        ({"lateral_error": float("nan")}, "must be finite"),
    ):
        with pytest.raises(ValueError, match=word):
            env.reset(seed=0, options=options)


def test_a_car_that_starts_anew_ignores_its_action():
    """Next-step autoreset: the action of the step that only resets is neither counted nor checked."""
    env = gym.make_vec(ID, 2, "vector_entry_point", max_episode_steps=3)
    env.reset(seed=0)
    for _ in range(3):
        env.step(np.zeros((2, 1), np.float32))
    env.step(np.array([[np.nan], [7.0]], np.float32))
    np.testing.assert_array_equal(env.unwrapped.clipped_actions, [0, 0])
    with pytest.raises(ValueError, match="car 0 is NaN"):
        env.step(np.array([[np.nan], [0.0]], np.float32))


def test_after_the_end_nothing_is_charged_again():
    for env in (gym.make(ID), gym.make_vec(ID, 1, "vector_entry_point", autoreset_mode="disabled")):
        env.reset(seed=0)
        action = np.ones(env.action_space.shape, np.float32)
        while not np.all(env.step(action)[2]):
            pass
        assert float(np.asarray(env.step(action)[1]).item()) == 0.0


def test_numpy_numbers_and_whole_floats_are_plain_ones():
    plain = LaneKeepScenario.from_keywords(preview=3, lane_width=3.0, road={"kind": "circle", "radius": 150.0})
    other = LaneKeepScenario.from_keywords(
        preview=np.int64(3), lane_width=np.float32(3), road={"kind": "circle", "radius": 150}
    )
    assert plain == other and plain.hash == other.hash
    assert gym.make(ID, preview=3.0).observation_space.shape == (9,)
    assert LaneKeepScenario(vehicle="commonroad-1", road="yin", speed=20.0).speed.speed == 20.0
    gym.make(ID).reset(seed=np.int64(5))
    gym.make_vec(ID, 2, "vector_entry_point").reset(seed=np.arange(2))


def test_the_hash_is_the_same_in_every_process():
    code = "import lanekeep_env; print(lanekeep_env.LaneKeepScenario().hash)"
    hashes = {
        subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, text=True
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert hashes == {LaneKeepScenario().hash}


def test_a_road_file_that_changes_is_refused(tmp_path):
    path = tmp_path / "road.csv"
    path.write_text("\n".join(f"{5 * k}, {(k / 20) ** 2}" for k in range(60)))
    env = gym.make(ID, road=str(path))
    env.reset(seed=0)
    saved, before = pickle.dumps(env.unwrapped), env.unwrapped.scenario.hash
    path.write_text("\n".join(f"{5 * k}, {(k / 10) ** 2}" for k in range(60)))
    assert env.unwrapped.scenario.hash == before and gym.make(ID, road=str(path)).unwrapped.scenario.hash != before
    road_tables.cache_clear(), sets._built.cache_clear()
    with pytest.raises(ValueError, match="has changed"):
        pickle.loads(saved)


def test_scenario_is_frozen_and_hash_is_stable():
    scenario = LaneKeepScenario()
    with pytest.raises(AttributeError):
        scenario.lane_width = 2.0  # type: ignore[misc]
    assert scenario.hash == LaneKeepScenario.from_keywords().hash
    assert scenario.hash != LaneKeepScenario.from_keywords(lane_width=3.0).hash


def test_random_driving_never_leaves_the_numbers():
    """Random actions over options: finite, inside the bounds."""
    rng = np.random.default_rng(0)
    for keywords in (
        {"departure": "off"},
        {"departure": "off", "tyre": "magic_formula", "friction": 0.2},
        {"departure": "cost", "dynamics": "kinematic", "max_steering_angle": 1.0},
        {"departure": "off", "speed": 0.0},
        {"departure": "off", "vehicle": {"rear_cornering_stiffness": 3e4}, "speed": 50.0, "road": "straight"},
        {"departure": "off", "vehicle": "commonroad-1", "max_steering_angle": 0.9, "dtype": "float32"},
    ):
        env = gym.make_vec(ID, 64, "vector_entry_point", observation="full", preview=3, **keywords)
        env.reset(seed=1)
        for _ in range(300):
            observation, reward, _, _, infos = env.step(rng.uniform(-1, 1, (64, 1)).astype(np.float32))
            assert env.observation_space.contains(observation)
            assert np.isfinite(reward).all() and all(np.isfinite(v).all() for v in infos.values())


def test_public_names():
    assert lanekeep_env.__version__
    assert set(lanekeep_env.VEHICLES) == {
        "yin",
        "van",
        "passat",
        "knightriders",
        "pses",
        "f1tenth",
        *(f"commonroad-{k}" for k in (1, 2, 3)),
    }
