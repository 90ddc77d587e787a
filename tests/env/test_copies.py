"""Copies of environments in mid-episode go on like the original, however their arrays came to lie where they lie."""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium as gym
import numba
import numpy as np
import pytest

import lanekeep_env  # noqa: F401

IDS = ["lanekeep/LaneKeep-v0", "lanekeep/WallFollow-v0"]


def made(name: str, number: int) -> Any:
    if number == 1:
        return gym.make(name).unwrapped
    return gym.make_vec(name, num_envs=number, vectorization_mode="vector_entry_point").unwrapped


def through_shared_memory(env: Any) -> Any:
    """As ray and joblib send arrays: beside the pickle, and received where nobody may write, at any address."""
    beside: list[pickle.PickleBuffer] = []
    content = pickle.dumps(env, protocol=5, buffer_callback=beside.append)
    assert beside
    lies = [memoryview(b"\0" + bytes(one.raw()))[1:] for one in beside]
    return pickle.loads(content, buffers=lies)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("number", [1, 5])
def test_a_copy_through_shared_memory_goes_on(name: str, number: int) -> None:
    env = made(name, number)
    env.reset(seed=1)
    action = np.full(env.action_space.shape, 0.1, dtype=np.float32)
    env.step(action)
    copied = through_shared_memory(env)
    for _ in range(5):
        one, other = env.step(action), copied.step(action)
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


def test_who_is_told_of_a_copy_cannot_say_who_is_reset() -> None:
    """The mask of infos is that of resets: whoever has it must not write to it."""
    copied = pickle.loads(pickle.dumps(made(IDS[0], 3)))
    _, infos = copied.reset(seed=1)
    with pytest.raises(ValueError, match="read-only"):
        infos["_speed"][:] = False


def test_a_copy_takes_no_more_threads_than_its_computer_has() -> None:
    env = made(IDS[0], 300)
    env._threads = 4096  # of the computer that it comes from
    copied = pickle.loads(pickle.dumps(env))
    copied.reset(seed=1)
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    seen = copied.step(action)[0]
    assert copied._threads == numba.config.NUMBA_NUM_THREADS
    env._threads = 1
    env.reset(seed=1)
    np.testing.assert_array_equal(seen, env.step(action)[0])


def test_a_first_reset_that_fails_starts_nothing() -> None:
    for env in (made(IDS[0], 1), made(IDS[0], 3)):
        with pytest.raises(ValueError, match="road_index"):
            env.reset(seed=0, options={"road": 10**6})
        with pytest.raises(gym.error.ResetNeeded):
            env.step(np.zeros(env.action_space.shape, dtype=np.float32))


@pytest.mark.parametrize("value", [10**400, "left", b"\xff", None, 1j], ids=repr)
def test_actions_that_are_no_numbers_are_refused_in_one_line(value: object) -> None:
    for env in (made(IDS[0], 1), made(IDS[0], 3)):
        env.reset(seed=0)
        with pytest.raises(ValueError, match="action") as told:
            env.step(np.full(env.action_space.shape, value, dtype=object))
        assert "\n" not in str(told.value)
        assert len(str(told.value)) < 300
