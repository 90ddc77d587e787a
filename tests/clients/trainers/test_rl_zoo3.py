"""RL Baselines3 Zoo's training script takes an id with our hyper-parameters; what it trained becomes a policy file."""

from __future__ import annotations

import runpy

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("rl_zoo3")
from rl_zoo3.utils import ALGOS
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize

import lanekeep_agents
from lanekeep_agents.training.rl_zoo3 import zoo_settings

SMALL = {
    "ppo": ["n_envs:4", "n_steps:32", "batch_size:64"],
    "sac": ["n_envs:4", "learning_starts:100", "batch_size:32"],
    "td3": ["n_envs:4", "learning_starts:100", "batch_size:32"],
}


@pytest.mark.parametrize("algorithm", SMALL)
def test_the_training_script_trains_what_a_file_then_holds(algorithm, env_id, tmp_path, monkeypatch, capsys):
    def python(module, *words):
        monkeypatch.setattr("sys.argv", [module, *words])
        runpy.run_module(module, run_name="__main__")
        return capsys.readouterr().out

    (tmp_path / "zoo.yml").write_text(python("lanekeep_agents.training.rl_zoo3", algorithm))
    task = ["--algo", algorithm, "--env", env_id, "--gym-packages", "lanekeep_env", "--conf-file", "zoo.yml"]
    budget = ["-n", "256", "--eval-freq", "128", "--eval-episodes", "1", "--device", "cpu", "--num-threads", "1"]
    python("rl_zoo3.train", *task, *budget, "--hyperparams", *SMALL[algorithm])
    (folder,) = (tmp_path / "logs" / algorithm).iterdir()
    model = ALGOS[algorithm].load(next(folder.glob("*v0.zip")), device="cpu")
    keywords = zoo_settings(algorithm, env_id)["env_kwargs"]
    cars = make_vec_env(env_id, 4, seed=0, env_kwargs=keywords)
    env = VecNormalize.load(str(next(folder.rglob("vecnormalize.pkl"))), cars)
    model.set_env(env)
    lanekeep_agents.save("mine.json", model)
    policy = lanekeep_agents.load("mine.json", gym.make(env_id, **keywords).unwrapped.scenario)
    seen = cars.reset()
    wanted, _ = model.predict(env.normalize_obs(seen), deterministic=True)
    np.testing.assert_allclose(policy.predict(seen)[0], wanted, rtol=0.0, atol=1e-5)
