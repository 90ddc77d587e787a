"""Numbers below the smallest normal one: zeros in float32 kernels on x86, where they cost time, and nowhere else."""

from __future__ import annotations

import platform

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env import layout as at

X86 = platform.machine().lower() in ("x86_64", "amd64", "i386", "i686")


def subnormal(numbers: np.ndarray) -> np.ndarray:
    return (numbers != 0.0) & (np.abs(numbers) < np.finfo(numbers.dtype).tiny)


def after_a_step(dtype: str) -> np.ndarray:
    """Sideslips, which were subnormal, of cars after a step."""
    env = gym.make_vec("lanekeep/LaneKeep-v0", num_envs=4, vectorization_mode="vector_entry_point", dtype=dtype)
    env.reset(seed=0)
    state = env.unwrapped.get_state()
    tiny = np.finfo(dtype).tiny
    for row in (at.SIDESLIP, at.YAW_RATE, at.LATERAL, at.HEADING, at.STEER, at.COMMAND):
        state["cars"][:, row] = 0.0
    for row in (at.CURVATURE, at.CURVATURE_SLOPE):
        state["cars"][:, row] = 0.0
    state["cars"][:, at.SIDESLIP] = tiny / 64
    assert subnormal(state["cars"][:, at.SIDESLIP]).all()
    env.unwrapped._core.cars[...] = state["cars"]  # set_state would want the curvature of the road
    env.step(np.zeros((4, 1), dtype=np.float32))
    return env.unwrapped._core.cars


@pytest.mark.skipif(not X86, reason="left as they are on other processors")
def test_float32_kernels_leave_none() -> None:
    assert not subnormal(after_a_step("float32")[:, [at.SIDESLIP, at.YAW_RATE, at.HEADING]]).any()


def test_float64_kernels_keep_them() -> None:
    assert subnormal(after_a_step("float64")[:, [at.SIDESLIP, at.YAW_RATE, at.HEADING]]).any()


def test_the_callers_numbers_stay_what_they_are() -> None:
    small = np.float32(1e-38)
    before = small * np.float32(0.01)
    assert before > 0.0
    after_a_step("float32")
    assert small * np.float32(0.01) == before
    np.testing.assert_array_equal(np.full(64, small) * np.float32(0.01), np.full(64, before))
