"""sb3-contrib's RecurrentPPO and TQC, on Stable-Baselines3's own vector environment and on the compiled one."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("sb3_contrib")
import torch
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3.common.env_util import make_vec_env

import lanekeep_agents

CASES = {
    "RecurrentPPO": (RecurrentPPO, "MlpLstmPolicy", {"n_steps": 32, "batch_size": 64, "n_epochs": 1}),
    "TQC": (TQC, "MlpPolicy", {"learning_starts": 100, "batch_size": 32, "buffer_size": 1000}),
}


@pytest.mark.parametrize("make", [make_vec_env, lanekeep_agents.sb3_vec_env], ids=["their own", "compiled"])
@pytest.mark.parametrize("algorithm", CASES)
def test_it_trains(env_id, algorithm, make):
    kind, policy, options = CASES[algorithm]
    model = kind(policy, make(env_id, 4), seed=0, device="cpu", **options)
    before = [tensor.clone() for tensor in model.policy.parameters()]
    model.learn(256)
    after = list(model.policy.parameters())
    assert model.num_timesteps == 256
    assert all(torch.isfinite(tensor).all() for tensor in after)
    assert not all(map(torch.equal, before, after))


def test_a_file_holds_an_actor_of_tqc_and_none_with_a_memory(env_id, tmp_path):
    envs = make_vec_env(env_id, 2, seed=0)
    model = TQC("MlpPolicy", envs, device="cpu", buffer_size=1000)
    lanekeep_agents.save(tmp_path / "tqc.json", model)
    policy = lanekeep_agents.load(tmp_path / "tqc.json", gym.make(env_id).unwrapped.scenario)
    seen = envs.reset()
    np.testing.assert_allclose(policy.predict(seen)[0], model.predict(seen, deterministic=True)[0], atol=1e-5)
    with pytest.raises(ValueError, match="recurrent"):
        lanekeep_agents.save(tmp_path / "lstm.json", RecurrentPPO("MlpLstmPolicy", envs, device="cpu"))
