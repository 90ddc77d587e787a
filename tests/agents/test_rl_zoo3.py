"""Our hyper-parameters in the format of RL Baselines3 Zoo; its training script reads them in tests/clients."""

from __future__ import annotations

import importlib
import runpy

import pytest

pytest.importorskip("stable_baselines3")
import yaml
from torch import nn

import lanekeep_env
from lanekeep_agents.training.rl_zoo3 import zoo_settings
from lanekeep_agents.training.run import network_of
from lanekeep_agents.training.settings import settings_for


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3"])
@pytest.mark.parametrize("env_id", lanekeep_env.ENVIRONMENTS)
def test_an_entry_says_what_training_takes(algorithm, env_id):
    entry, settings = zoo_settings(algorithm, env_id), settings_for(algorithm, env_id)
    assert yaml.safe_load(yaml.safe_dump(entry)) == entry
    assert eval(entry["policy_kwargs"], {"nn": nn}) == network_of(settings)  # as the zoo does
    assert (entry["n_timesteps"], entry["n_envs"], entry["gamma"]) == (
        settings.steps,
        settings.num_envs,
        settings.gamma,
    )
    assert ("noise_std" in entry) == (algorithm == "td3")
    ((wrapper, keywords),) = entry["vec_env_wrapper"][0].items()
    module, _, name = wrapper.rpartition(".")
    assert keywords["gamma"] == settings.gamma and isinstance(getattr(importlib.import_module(module), name), type)


@pytest.mark.filterwarnings("ignore:.*found in sys.modules")
def test_the_file_has_every_id(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["rl_zoo3", "sac"])
    runpy.run_module("lanekeep_agents.training.rl_zoo3", run_name="__main__")
    assert list(yaml.safe_load(capsys.readouterr().out)) == list(lanekeep_env.ENVIRONMENTS)
