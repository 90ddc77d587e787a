"""Margins against the frequency response of driven cars: a sine on the steering, and what becomes of it in the loop."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_env  # noqa: F401  (registers the environments)
from lanekeep_baselines.margins import Loop, margins
from lanekeep_env.physics.vehicles import VEHICLES

STEP, SHOWN, SIZE = 0.05, 800, 1e-3
#: Whole periods of the sines within `SHOWN` steps: 0.1 to 4 Hz.
PERIODS = np.array([4, 8, 12, 16, 20, 28, 40, 60, 80, 120, 160])
DESIGNS = (
    "pd",
    "pure-pursuit",
    "pure-pursuit-understeer",
    "stanley",
    "yin-lqr",
    "yin-lqr-feedforward",
    "yin-lqr-observer-printed",
    "yin-lqr-observer",
    "lq-preview",
    "lq-preview-offset-free",
    "lq-preview-trimmed",
    "mpc-preview",
    "lqg",
)


def driven(env: gym.vector.VectorEnv, policy: object, settled: int) -> np.ndarray:
    """|what the car is told / what is added to it| at the frequencies of `PERIODS`, a row each, from driving."""
    scenario = env.unwrapped.scenario
    command = [channel.name for channel in scenario.channels].index("steering_command")
    observation, _ = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    state, told, added = None, [], []
    before = np.zeros(len(PERIODS))
    for k in range(settled + SHOWN):
        seen = np.array(observation, dtype=np.float64)
        seen[:, command] -= before  # the policy sees what it told, the car gets more
        action, state = policy.predict(seen, state)
        before = SIZE * np.sin(2.0 * math.pi * PERIODS * k / SHOWN)
        total = action + before[:, None] / scenario.max_steering_angle
        observation = env.step(total)[0]
        told.append(total[:, 0])
        added.append(before / scenario.max_steering_angle)
    waves = np.exp(-2j * math.pi * np.outer(PERIODS, np.arange(settled, settled + SHOWN)) / SHOWN)
    sums = [(waves * np.array(one[settled:]).T).sum(axis=1) for one in (told, added)]
    return np.abs(sums[0] / sums[1])


def agrees(name: str, vehicle: str, speed: float, delay: float, settled: int) -> bool:
    """Whether the loop is stable; if it is, its driven response is the one that its margins are read from."""
    env = gym.make_vec(
        "lanekeep/LaneKeep-v0",
        num_envs=len(PERIODS),
        vectorization_mode="vector_entry_point",
        dtype="float64",
        autoreset_mode="disabled",
        road={"kind": "straight", "length": 8000.0},
        speed=speed,
        preview=20,
        departure="cost",
        episode_steps=settled + SHOWN,
        # Neither gap nor rate limit is linear: one swallows small sines, the other takes time for any change.
        vehicle={"base": vehicle, "steering": {"delay": delay, "backlash": 0.0, "rate_limit": None}},
    )
    scenario = env.unwrapped.scenario
    policy = lanekeep_baselines.make(name, scenario)
    found = margins(policy, scenario, speed)
    if not found.stable or found.damping < 0.03:  # it would take minutes to settle
        return False
    loop = Loop.of(policy, scenario, speed)
    expected = 1.0 / np.abs(1.0 + loop.at(2.0 * math.pi * PERIODS / (SHOWN * STEP)))
    np.testing.assert_allclose(driven(env, policy, settled), expected, rtol=0.02)
    assert expected.max() <= 1.001 * found.sensitivity
    return True


@pytest.mark.parametrize("name", DESIGNS)
def test_a_driven_car_answers_a_sine_as_its_margins_say(name: str) -> None:
    assert agrees(name, "yin", 20.0, 0.05, 500)


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("name", DESIGNS)
def test_every_design_on_every_car(name: str, vehicle: str) -> None:
    fastest = 40.0 if VEHICLES[vehicle].wheelbase > 2.0 else 8.0
    assert any(
        [agrees(name, vehicle, speed, delay, 1200) for speed in (0.2 * fastest, fastest) for delay in (0.0, 0.05)]
    )
