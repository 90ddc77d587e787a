"""The search for the LQ controllers' weights: returns as single episodes give them, seeded, better than its start."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines import tuning

SETTINGS = {"preview": 12, "speed": 20.0}


class Straight:
    """Never steers: departs in the first curve."""

    name = "straight"

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros((len(observation), 1), dtype=np.float32), None


@pytest.mark.parametrize("name", ["straight", "lq-preview"])
def test_mean_return_is_that_of_single_episodes(name: str) -> None:
    envs = gym.make_vec(
        "lanekeep/LaneKeep-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        autoreset_mode="disabled",
        **SETTINGS,
    )
    scenario = envs.unwrapped.scenario
    policy = Straight() if name == "straight" else lanekeep_baselines.make(name, scenario)
    returns, departures = [], 0
    for seed in range(5, 8):
        env = gym.make("lanekeep/LaneKeep-v0", **SETTINGS)
        (observation, _), state, total, over = env.reset(seed=seed), None, 0.0, False
        while not over:
            action, state = policy.predict(observation[None], state)
            observation, reward, terminated, truncated, _ = env.step(np.clip(action[0], -1.0, 1.0))
            total, over = total + float(reward), terminated or truncated
        departures += terminated
        returns.append(total)
    assert departures == (3 if name == "straight" else 0)
    assert tuning.mean_return(envs, policy, 5) == pytest.approx(np.mean(returns), rel=1e-9)


def test_the_search_never_gets_worse_and_hangs_on_its_seed() -> None:
    task = tuning.TASKS["lq-preview"]
    budget = 4 * task.episodes * 600
    best, highest = tuning.tune("lq-preview", budget)
    start, reached = tuning.tune("lq-preview", budget // 4)
    assert start == task.start and highest >= reached
    assert (best, highest) == tuning.tune("lq-preview", budget)


@pytest.mark.parametrize("name", tuning.TASKS)
def test_the_weights_in_use_beat_the_start_on_other_training_roads(name: str) -> None:
    """In the mean over the scenarios, as the search counts; the weights were found on the seeds 0 to 127."""
    task, reached = tuning.TASKS[name], []
    for weights in (task.start, task.policy.weights):
        returns = []
        for scenario in task.scenarios:
            envs = gym.make_vec(
                "lanekeep/LaneKeep-v0",
                num_envs=128,
                vectorization_mode="vector_entry_point",
                dtype="float32",
                autoreset_mode="disabled",
                **scenario,
            )
            returns.append(tuning.mean_return(envs, task.policy(envs.unwrapped.scenario, weights), 1000))
        reached.append(np.mean(returns))
    assert reached[1] > reached[0]


def test_too_small_a_budget_is_refused() -> None:
    with pytest.raises(ValueError, match=r"budget=100 steps is not allowed: at least 38400"):
        tuning.tune("lq-preview", 100)


def test_the_command_prints_what_it_found(capsys: pytest.CaptureFixture[str]) -> None:
    tuning.main(["lq-preview", "--budget", "40000"])
    assert capsys.readouterr().out.splitlines()[-1].startswith("Weights(rate=1, slip=0.001, steer=0.001")
    with pytest.raises(SystemExit):
        tuning.main(["pd"])
