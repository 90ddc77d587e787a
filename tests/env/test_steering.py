"""The steering actuator against closed forms, through `gym.make`."""

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env  # noqa: F401


def wheel(actions, steering, dt=0.05, **keywords):
    """Road-wheel angle at the end of each step, for actions in units of 0.1 rad."""
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        max_episode_steps=len(actions) + 1,
        road="straight",
        speed=10.0,
        control_step=dt,
        departure="off",
        max_steering_angle=0.1,
        vehicle={"steering": steering},
        **keywords,
    )
    env.reset(seed=0)
    return np.array([env.step(np.array([a], np.float32))[0][4] for a in actions], dtype=float)


def test_everything_off_follows_at_once():
    np.testing.assert_allclose(wheel([1, -0.5, 0.25], {"lag": 0.0}), [0.1, -0.05, 0.025], atol=1e-9)


@pytest.mark.parametrize("lag", [0.02, 0.0896, 0.5])
def test_lag_is_the_exact_first_order_response(lag):
    time = 0.05 * np.arange(1, 41)
    np.testing.assert_allclose(wheel(np.ones(40), {"lag": lag}), 0.1 * (1 - np.exp(-time / lag)), atol=2e-8)


def test_rate_limit_alone_is_a_ramp():
    time = 0.05 * np.arange(1, 21)
    np.testing.assert_allclose(
        wheel(np.ones(20), {"lag": 0.0, "rate_limit": 0.16}), np.minimum(0.1, 0.16 * time), atol=2e-8
    )


def test_rate_limited_lag_leaves_the_limit_where_it_should():
    """Slope = limit until (command - angle)/lag falls to it, then the exponential."""
    lag, limit, command = 0.1, 0.4, 0.1
    leave = (command - limit * lag) / limit
    time = 0.05 * np.arange(1, 31)
    expected = np.where(time < leave, limit * time, command - limit * lag * np.exp(-(time - leave) / lag))
    np.testing.assert_allclose(wheel(np.ones(30), {"lag": lag, "rate_limit": limit}), expected, atol=2e-4)


def test_angle_limit_bounds_the_command():
    assert wheel(np.ones(5), {"lag": 0.0, "angle_limit": 0.03})[-1] == pytest.approx(0.03, abs=1e-8)


@settings(max_examples=25, deadline=None)
@given(steps=st.integers(0, 23), seed=st.integers(0, 1000))
def test_delay_shifts_the_response_by_exactly_that_time(steps, seed):
    """Any multiple of the 10 ms integration step, also when the control step is longer."""
    actions = np.random.default_rng(seed).uniform(-1, 1, 12)
    fine = np.repeat(actions, 5)
    undelayed = wheel(fine, {"lag": 0.08}, dt=0.01)
    shifted = np.concatenate([np.zeros(steps), undelayed])[: len(fine)]
    got = wheel(actions, {"lag": 0.08, "delay": steps * 0.01})
    np.testing.assert_allclose(got, shifted[4::5], atol=1e-8)


def test_steering_rate_action_integrates_and_stops_at_the_limit():
    got = wheel([1, 1, -1, 0, 1, 1, 1], {"lag": 0.0}, action="steering_rate", max_steering_rate=0.5)
    np.testing.assert_allclose(got, [0.025, 0.05, 0.025, 0.025, 0.05, 0.075, 0.1], atol=1e-8)
    assert wheel(np.ones(9), {"lag": 0.0}, action="steering_rate", max_steering_rate=0.5)[-1] == pytest.approx(0.1)
