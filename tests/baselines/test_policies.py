"""What every policy promises: purity, rows independent to the last bit, both actions, clear errors."""

from __future__ import annotations

import copy
import pickle
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_baselines
from lanekeep_baselines.table import Table, weighted_sum
from lanekeep_env.physics.parameters import vehicle_from
from lanekeep_env.scenario import LaneKeepScenario

SCENARIO = LaneKeepScenario(preview=2)
POLICIES = {name: lanekeep_baselines.make(name, SCENARIO) for name in lanekeep_baselines.names()}
every_policy = pytest.mark.parametrize("name", POLICIES)


def rows(seed: int, n: int, steps: int = 1) -> np.ndarray:
    """Observations (steps, n, channels), float32, spread over most of what a drive can show."""
    spread = [2.0, 0.3, 0.5, 0.0, 0.15, 0.15, 0.02, 0.02]
    random = np.random.default_rng(seed)
    observation = random.normal(size=(steps, n, 8)) * spread
    observation[..., 3] = random.uniform(0.0, 65.0, size=(steps, n))
    return observation.astype(np.float32)


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
    policy, observations = POLICIES[name], rows(seed, n, steps=4)
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
    observations = rows(0, 1024, steps=3)
    actions, _ = run(POLICIES[name], observations)
    for i in (0, 1, 7, 511, 1023):
        assert bits(run(POLICIES[name], observations[:, i])[0]) == bits(actions[:, i])


@every_policy
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_left_and_right_are_alike(name: str, seed: int) -> None:
    observations = rows(seed, 5, steps=4)
    mirrored = -observations
    mirrored[..., 3] *= -1.0
    np.testing.assert_array_equal(run(POLICIES[name], mirrored)[0], -run(POLICIES[name], observations)[0])


@every_policy
def test_pure(name: str) -> None:
    policy = POLICIES[name]
    first, second, other = rows(1, 6, steps=3)
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
    observations = rows(2, 6, steps=5)
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
        assert (reset[4, started] != plain[4, started]).all()
    one, state = policy.predict(observations[0, 0])
    assert bits(policy.predict(observations[1, 0], state, True)[0]) == bits(policy.predict(observations[1, 0])[0])
    assert one.shape == (1,)


@every_policy
def test_steering_rate_asks_for_the_same_angle(name: str) -> None:
    scenario = LaneKeepScenario(preview=2, action="steering_rate", max_steering_rate=0.3)
    policy = lanekeep_baselines.make(name, scenario)
    observations = rows(3, 20, steps=4)
    angles = run(POLICIES[name], observations)[0][..., 0] * SCENARIO.max_steering_angle
    rates = run(policy, observations)[0][..., 0] * scenario.max_steering_rate
    np.testing.assert_allclose(observations[..., 5] + rates * scenario.control_step, angles, rtol=1e-4, atol=1e-6)


@every_policy
def test_steering_column_gear_changes_nothing(name: str) -> None:
    geared = LaneKeepScenario(vehicle=vehicle_from({"steering_ratio": 1.0}), preview=2)
    observations = rows(4, 5, steps=3)
    assert bits(run(lanekeep_baselines.make(name, geared), observations)[0]) == bits(
        run(POLICIES[name], observations)[0]
    )


@every_policy
def test_copies_and_pickles(name: str) -> None:
    observations = rows(5, 3, steps=2)
    for policy in (copy.deepcopy(POLICIES[name]), pickle.loads(pickle.dumps(POLICIES[name]))):
        assert bits(run(policy, observations)[0]) == bits(run(POLICIES[name], observations)[0])


def test_unknown_name_names_the_nearest() -> None:
    with pytest.raises(
        ValueError, match=r"'yin-lqr-obsever' is unknown \(did you mean 'yin-lqr-observer'\?\); allowed: pd"
    ):
        lanekeep_baselines.make("yin-lqr-obsever", SCENARIO)


def test_missing_channel_says_what_to_do() -> None:
    with pytest.raises(ValueError, match=r"curvature_preview_0.*preview=1 or more"):
        lanekeep_baselines.make("yin-lqr-feedforward", LaneKeepScenario())


@pytest.mark.parametrize("package", ["control", "scipy.linalg"])
def test_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    for module in [m for m in sys.modules if m.startswith("lanekeep_baselines.yin")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModuleNotFoundError, match=r'pip install "lanekeep\[baselines\]"'):
        lanekeep_baselines.make("yin-lqr-observer", SCENARIO)
    assert lanekeep_baselines.make("pd", SCENARIO).name == "pd"


@every_policy
def test_wrong_shapes_are_refused(name: str) -> None:
    policy = POLICIES[name]
    for shape in [(7,), (3, 9), (2, 3, 8), ()]:
        with pytest.raises(ValueError, match="observation has shape"):
            policy.predict(np.zeros(shape, dtype=np.float32))
    with pytest.raises(ValueError, match="state has shape"):
        policy.predict(rows(0, 4)[0], np.zeros((3, policy.memory)))


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
