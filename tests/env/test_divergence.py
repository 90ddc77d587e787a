"""States that are no numbers any more: every step returns, and the episode ends as a failure, in every family."""

import signal
import subprocess
import sys
import time

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_env
from lanekeep_env import layout as at

IDS = sorted(lanekeep_env.ENVIRONMENTS)
ROWS = {"along": at.ALONG, "lateral": at.LATERAL, "heading": at.HEADING, "yaw_rate": at.YAW_RATE, "steer": at.STEER}

#: What a car that rolls, or an actuator without lag, knows anew in each step.
HEALS = ("yaw_rate", "steer")


def walled(env_id):
    return issubclass(lanekeep_env.ENVIRONMENTS[env_id].scenario, lanekeep_env.WallFollowScenario)


def broken(env_id, row, value, **keywords):
    """Three cars of which the second one's state is broken; return what the next step gives, and its duration."""
    envs = gym.make_vec(env_id, num_envs=3, vectorization_mode="vector_entry_point", **keywords)
    envs.reset(seed=0)
    actions = np.zeros(envs.action_space.shape, np.float32)
    envs.step(actions)
    envs.unwrapped._core.cars[0, ROWS[row], 1] = value  # `set_state` would refuse it
    began = time.perf_counter()
    told = envs.step(actions)
    return envs, told, time.perf_counter() - began


@pytest.mark.parametrize("departure", ["terminate", "cost", "off"])
@pytest.mark.parametrize("env_id", IDS)
def test_a_state_that_is_not_finite_ends_the_episode_as_a_failure(env_id, departure):
    keywords = {"contact" if walled(env_id) else "departure": departure}
    for row in ROWS:
        for value in (np.nan, np.inf, -np.inf):
            envs, (observation, reward, terminated, truncated, info), _ = broken(env_id, row, value, **keywords)
            assert envs.observation_space.contains(observation)
            assert np.isfinite(reward).all() and not truncated.any()
            for name, values in info.items():
                assert np.isfinite(np.asarray(values, dtype=np.float64)).all(), name
            if row in HEALS and not terminated[1]:
                continue
            assert terminated.tolist() == [False, True, False]
            assert info["termination"][1] == lanekeep_env.Termination.DIVERGED
            assert info["cost"].tolist() == [0.0, 1.0, 0.0]
            assert not info["is_success"][1]
            # As dear as leaving the lane for all that is left of the episode.
            scenario = envs.unwrapped.scenario
            left = scenario.episode_steps - 1
            assert reward[1] == pytest.approx(-scenario.largest_cost * scenario.control_step * left, rel=1e-12)


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("value", [np.inf, 1e30, -1e30, np.nan])
def test_no_loop_of_a_kernel_depends_on_a_state(env_id, value):
    keywords = {} if walled(env_id) else {"road": {"kind": "circle", "radius": 150.0}}  # a closed road has no end
    broken(env_id, "along", value, **keywords)  # compiled
    *_, seconds = broken(env_id, "along", value, **keywords)
    assert seconds < 1.0


STEPPING = """
import signal, gymnasium as gym, numpy as np, lanekeep_env
signal.signal(signal.SIGINT, signal.default_int_handler)  # who runs in the background inherits that it is ignored
envs = gym.make_vec("lanekeep/LaneKeep-v0", num_envs=4096, vectorization_mode="vector_entry_point", control_step=1.0)
envs.reset(seed=0)
actions = np.zeros((4096, 1), np.float32)
envs.step(actions)
print("steps", flush=True)
while True:
    envs.step(actions)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_an_interrupt_ends_a_run_of_steps_within_a_second():
    with subprocess.Popen(
        [sys.executable, "-c", STEPPING], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as stepping:
        try:
            assert stepping.stdout.readline() == b"steps\n"
            stepping.send_signal(signal.SIGINT)
            # A step of all cars takes a tenth of a second; a machine that others share may take longer.
            assert stepping.wait(timeout=5.0) != 0
        finally:
            stepping.kill()
