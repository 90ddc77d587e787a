"""The example scripts run as they are, with a small budget, and leave a policy that drives."""

from __future__ import annotations

import runpy
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnvWrapper, VecNormalize

import lanekeep_agents
from lanekeep_agents.training import random_search

EXAMPLES = sorted((Path(__file__).parents[2] / "agents" / "examples").glob("*.py"))


class Briefly(random_search.Corrected):
    """Whole episodes are what the search learns from: shorter ones, whatever is asked for."""

    def __init__(self, *given):
        *others, keywords = given
        super().__init__(*others, {**keywords, "episode_steps": 100})


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_trains_saves_and_drives(example, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(random_search, "Corrected", Briefly)
    check(example, tmp_path, monkeypatch, capsys)


@pytest.mark.slow
def test_the_search_trains_saves_and_drives_as_it_is(tmp_path, monkeypatch, capsys):
    (search,) = (file for file in EXAMPLES if file.stem == "ars")
    check(search, tmp_path, monkeypatch, capsys)


def check(example, tmp_path, monkeypatch, capsys):
    torch.set_num_threads(1)
    entry_point = example.stem == "td3"
    out = tmp_path / ("run" if entry_point else "policy.json")
    monkeypatch.setattr("sys.argv", [str(example), "--steps", "2000", "--out", str(out)])
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out.startswith("return ")
    policy = lanekeep_agents.load(out / "td3-lane-keep-seed0.json" if entry_point else out)
    assert (
        policy.record.algorithm == ("PPO" if example.stem in ("curriculum", "highway") else example.stem.upper())
        and policy.record.training.steps >= 2000
    )
    assert len(example.read_text().splitlines()) < 40


def test_there_is_an_example_of_each_algorithm_a_curriculum_a_search_and_anothers_task():
    assert [file.stem for file in EXAMPLES] == ["ars", "curriculum", "highway", "ppo", "sac", "td3"]


@pytest.mark.parametrize("normalised", [True, False])
def test_a_saved_model_acts_as_it_did(normalised, tmp_path):
    env = lanekeep_agents.sb3_vec_env("lanekeep/LaneKeep-v0", 4, preview=3, lane_width=3.0)
    env = VecNormalize(env) if normalised else env
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=3, device="cpu").learn(128)
    file = tmp_path / "new" / "mine.json"
    record = lanekeep_agents.save(file, model)
    assert (record.name, record.algorithm, record.env_id) == ("mine", "PPO", "lanekeep/LaneKeep-v0")
    assert (record.training.seed, record.training.steps) == (3, 128)
    single = gym.make("lanekeep/LaneKeep-v0", preview=3, lane_width=3.0)
    assert record.scenario_hash == single.unwrapped.scenario.hash
    rows = np.stack([single.reset(seed=seed)[0] for seed in range(20)])
    wanted, _ = model.predict(env.normalize_obs(rows) if normalised else rows, deterministic=True)
    found, _ = lanekeep_agents.load(file, single.unwrapped.scenario).predict(rows)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-5)
    with pytest.raises(ValueError, match="exists"):
        lanekeep_agents.save(file, model)


def test_a_model_of_other_environments_is_not_saved(tmp_path):
    model = PPO("MlpPolicy", gym.make("Pendulum-v1"), device="cpu", n_steps=16, batch_size=16)
    with pytest.raises(ValueError, match="one of lanekeep's ids"):
        lanekeep_agents.save(tmp_path / "mine.json", model)
    assert list(tmp_path.iterdir()) == []


def test_a_layer_that_no_file_can_hold_is_named(tmp_path):
    class Half(VecEnvWrapper):
        def reset(self):
            return self.venv.reset()

        def step_async(self, actions):
            self.venv.step_async(0.5 * actions)

        def step_wait(self):
            return self.venv.step_wait()

    cars = lanekeep_agents.sb3_vec_env("lanekeep/LaneKeep-v0", 2, dtype="float32")
    model = PPO("MlpPolicy", VecNormalize(Half(cars)), n_steps=2, batch_size=4, device="cpu")
    with pytest.raises(ValueError, match="layer Half"):
        lanekeep_agents.save(tmp_path / "mine.json", model)
