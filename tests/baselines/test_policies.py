"""What every policy promises: purity, rows independent to the last bit, both actions, clear errors."""

from __future__ import annotations

import copy
import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_baselines
from lanekeep_baselines.table import Table, weighted_sum
from lanekeep_env.scenario import CameraLaneScenario, LaneKeepScenario

SCENARIO = LaneKeepScenario(preview=11)
CAMERA = CameraLaneScenario()
SCENARIOS = {name: scenario for scenario in (SCENARIO, CAMERA) for name in lanekeep_baselines.names(scenario)}
POLICIES = {name: lanekeep_baselines.make(name, scenario) for name, scenario in SCENARIOS.items()}
every_policy = pytest.mark.parametrize("name", POLICIES)


def rows(name: str, seed: int, n: int, steps: int = 1) -> np.ndarray:
    """Observations (steps, n, channels), float32, spread over most of what a drive can show to the policy."""
    random = np.random.default_rng(seed)
    channels = [channel.name for channel in SCENARIOS[name].channels]
    spread = {"lateral_error": 2.0, "heading_error": 0.3, "yaw_rate": 0.5, "edge_distance": 1.0}
    spread |= {"steering_angle": 0.15, "steering_command": 0.15}
    curved = 0.02 if SCENARIOS[name] is SCENARIO else 0.07
    observation = random.normal(size=(steps, n, len(channels))) * [spread.get(channel, curved) for channel in channels]
    fastest = 65.0 if SCENARIOS[name] is SCENARIO else 6.0
    observation[..., channels.index("speed")] = random.uniform(0.0, fastest, size=(steps, n))
    if "edge_valid" in channels:
        observation[..., channels.index("edge_distance")] += CAMERA.set_distance
        observation[..., channels.index("edge_valid")] = random.random(size=(steps, n)) < 0.6
    return observation.astype(np.float32)


def column(name: str, channel: str) -> int:
    """Return the place of a channel in what the policy observes."""
    return [one.name for one in SCENARIOS[name].channels].index(channel)


def run(policy, observations, starts=None):
    """Return the actions and the last state of a sequence of observations."""
    state, actions = None, []
    for i, observation in enumerate(observations):
        action, state = policy.predict(observation, state, None if starts is None else starts[i])
        actions.append(action)
    return np.array(actions), state


def bits(array):
    return None if array is None else array.tobytes()


@every_policy
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32), n=st.integers(1, 70), cut=st.integers(0, 69))
def test_rows_do_not_know_of_each_other(name: str, seed: int, n: int, cut: int) -> None:
    cut = min(cut, n - 1)
    policy, observations = POLICIES[name], rows(name, seed, n, steps=4)
    actions, state = run(policy, observations)
    assert actions.shape == (4, n, 1) and actions.dtype == np.float32
    part, part_state = run(policy, observations[:, cut:])
    alone, alone_state = run(policy, observations[:, cut])
    assert bits(part) == bits(actions[:, cut:]) and bits(alone) == bits(actions[:, cut])
    assert alone.shape == (4, 1)
    if state is not None:
        assert bits(part_state) == bits(state[cut:]) and bits(alone_state) == bits(state[cut])


@every_policy
def test_a_large_batch_equals_its_rows(name: str) -> None:
    observations = rows(name, 0, 1024, steps=3)
    actions, _ = run(POLICIES[name], observations)
    for i in (0, 1, 7, 511, 1023):
        assert bits(run(POLICIES[name], observations[:, i])[0]) == bits(actions[:, i])


@every_policy
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_left_and_right_are_alike(name: str, seed: int) -> None:
    """A camera in the mirror looks at the left edge; distance, validity and speed are the same there."""
    observations = rows(name, seed, 5, steps=4)
    mirrored, other = -observations, POLICIES[name]
    for same in {"speed", "edge_distance", "edge_valid"} & {channel.name for channel in SCENARIOS[name].channels}:
        mirrored[..., column(name, same)] *= -1.0
    if SCENARIOS[name] is CAMERA:
        other = lanekeep_baselines.make(name, replace(CAMERA, camera=replace(CAMERA.camera, edge="left")))
    np.testing.assert_array_equal(run(other, mirrored)[0], -run(POLICIES[name], observations)[0])


@every_policy
def test_pure(name: str) -> None:
    policy = POLICIES[name]
    first, second, other = rows(name, 1, 6, steps=3)
    _, state = policy.predict(first)
    for array in (first, second) if state is None else (first, second, state):
        array.setflags(write=False)
    action, following = policy.predict(second, state)
    policy.predict(other, following)
    again, following_again = policy.predict(second, state)
    assert bits(action) == bits(again) and bits(following) == bits(following_again)
    assert following is None or not np.shares_memory(following, state)


@every_policy
def test_episode_start_resets_just_those_rows(name: str) -> None:
    policy = POLICIES[name]
    observations = rows(name, 2, 6, steps=5)
    if SCENARIOS[name] is CAMERA:
        observations[2:, :, column(name, "edge_valid")] = 1.0  # an edge that comes back would start anew as well
    observations[:, [1, 4], column(name, "speed")] = 1.0  # where every memory counts
    starts = np.zeros((5, 6), dtype=bool)
    starts[3, [1, 4]] = True
    plain, _ = run(policy, observations)
    reset, _ = run(policy, observations, starts)
    fresh, _ = run(policy, observations[3:])
    started = [1, 4]
    others = [0, 2, 3, 5]
    assert bits(reset[:, others]) == bits(plain[:, others])
    assert bits(reset[3:, started]) == bits(fresh[:, started])
    if policy.memory:
        assert (reset[3:, started] != plain[3:, started]).any(axis=0).all()
    one, state = policy.predict(observations[0, 0])
    assert bits(policy.predict(observations[1, 0], state, True)[0]) == bits(policy.predict(observations[1, 0])[0])
    assert one.shape == (1,)


# To model predictive control the largest rate is one more limit.
@pytest.mark.parametrize("name", sorted(POLICIES.keys() - {"mpc-preview"}))
def test_steering_rate_asks_for_the_same_angle(name: str) -> None:
    scenario = replace(SCENARIOS[name], action="steering_rate", max_steering_rate=0.3)
    policy = lanekeep_baselines.make(name, scenario)
    observations = rows(name, 3, 20, steps=4)
    angles = run(POLICIES[name], observations)[0][..., 0] * scenario.max_steering_angle
    rates = run(policy, observations)[0][..., 0] * scenario.max_steering_rate
    before = observations[..., column(name, "steering_command")]
    np.testing.assert_allclose(before + rates * scenario.control_step, angles, rtol=1e-4, atol=1e-6)


@every_policy
def test_steering_column_gear_changes_nothing(name: str) -> None:
    geared = replace(SCENARIOS[name], vehicle=replace(SCENARIOS[name].vehicle, steering_ratio=1.0))
    observations = rows(name, 4, 5, steps=3)
    assert bits(run(lanekeep_baselines.make(name, geared), observations)[0]) == bits(
        run(POLICIES[name], observations)[0]
    )


@every_policy
def test_copies_and_pickles(name: str) -> None:
    observations = rows(name, 5, 3, steps=2)
    for policy in (copy.deepcopy(POLICIES[name]), pickle.loads(pickle.dumps(POLICIES[name]))):
        assert bits(run(policy, observations)[0]) == bits(run(POLICIES[name], observations)[0])


def test_every_policy_has_its_scenario() -> None:
    """Others are held to the same in `test_knightriders`, `test_werling`, `test_lane_support` and `test_highway`."""
    others = "knightriders", "werling", "lane-support", "highway"
    elsewhere = {name for name in lanekeep_baselines.names() if name.startswith(others)}
    assert set(SCENARIOS) == set(lanekeep_baselines.names()) - elsewhere
    assert not set(lanekeep_baselines.names(SCENARIO)) & set(lanekeep_baselines.names(CAMERA))


def test_unknown_name_names_the_nearest() -> None:
    with pytest.raises(
        ValueError, match=r"'yin-lqr-obsever' is unknown \(did you mean 'yin-lqr-observer'\?\); allowed: pd"
    ):
        lanekeep_baselines.make("yin-lqr-obsever", SCENARIO)


def test_missing_channel_says_what_to_do() -> None:
    with pytest.raises(ValueError, match=r"curvature_preview_0.*preview=1 or more"):
        lanekeep_baselines.make("yin-lqr-feedforward", LaneKeepScenario())
    with pytest.raises(ValueError, match=r"'traechtler-pd' needs the channel 'edge_distance'.*channels: lateral_error"):
        lanekeep_baselines.make("traechtler-pd", SCENARIO)


@pytest.mark.parametrize("package", ["control", "scipy"])
def test_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModuleNotFoundError, match=rf'the package \'{package}\': pip install "lanekeep\[baselines\]"'):
        lanekeep_baselines.make("yin-lqr-observer", SCENARIO)
    assert lanekeep_baselines.make("pd", SCENARIO).name == "pd"
    assert "pd" in lanekeep_baselines.names(SCENARIO) and "yin-lqr" not in lanekeep_baselines.names(SCENARIO)
    assert lanekeep_baselines.names(CAMERA) == tuple(name for name in SCENARIOS if name.startswith("traechtler"))


@every_policy
def test_wrong_shapes_are_refused(name: str) -> None:
    policy = POLICIES[name]
    channels = len(SCENARIOS[name].channels)
    for shape in [(channels - 1,), (3, channels + 1), (2, 3, channels), ()]:
        with pytest.raises(ValueError, match="observation has shape"):
            policy.predict(np.zeros(shape, dtype=np.float32))
    with pytest.raises(ValueError, match="state has shape"):
        policy.predict(rows(name, 0, 4)[0], np.zeros((3, policy.memory)))


@given(at=st.floats(-100.0, 100.0))
def test_table_is_clamped_linear_interpolation(at: float) -> None:
    grid = np.linspace(15.0, 50.0, 8)
    values = np.sin(grid)
    np.testing.assert_allclose(
        Table(grid, values[:, None])(np.array([at]))[0, 0], np.interp(at, grid, values), atol=1e-12
    )


@given(seed=st.integers(0, 2**32), m=st.integers(1, 13), k=st.integers(1, 4))
def test_weighted_sum(seed: int, m: int, k: int) -> None:
    random = np.random.default_rng(seed)
    weights, values = random.normal(size=(3, m, k)), random.normal(size=(3, m))
    np.testing.assert_allclose(weighted_sum(weights, values), np.einsum("nmk,nm->nk", weights, values), atol=1e-12)
    np.testing.assert_allclose(
        weighted_sum(weights[..., 0], values), (weights[..., 0] * values).sum(axis=1), atol=1e-12
    )


@pytest.mark.parametrize("name", ["stanley", "pure-pursuit", "pure-pursuit-understeer"])
def test_a_car_that_stands_keeps_its_wheels_and_one_that_rolls_turns_them_as_it_goes(name):
    """Of a constant wish the wheels lack exp(-way / 0.1 m), as the control step tends to nothing."""
    scenario = LaneKeepScenario(control_step=0.001)
    policy, at = lanekeep_baselines.make(name, scenario), [channel.name for channel in scenario.channels]
    observation = np.zeros((3, len(at)), dtype=np.float32)
    observation[:, at.index("lateral_error")] = 0.2
    observation[:, at.index("speed")] = 0.0, 0.5, 5.0
    observation[:, at.index("steering_command")] = 0.01
    wanted = policy.wanted({name: column for name, column in zip(at, observation.T.astype(float), strict=True)})
    state, actions = None, []
    for _ in range(400):
        action, state = policy.predict(observation, state)
        actions.append(action[:, 0] * scenario.max_steering_angle)
    missing = (np.array(actions) - wanted) / (0.01 - wanted)
    np.testing.assert_allclose(missing[:, 0], 1.0, atol=1e-5)
    way = np.arange(1, 401)[:, None] * 0.001 * np.array([0.5, 5.0])
    np.testing.assert_allclose(missing[:, 1:], np.exp(-way / 0.1), atol=0.02)
