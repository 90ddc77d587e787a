"""skrl knows single and vector environments for Gymnasium's, and trains on them."""

from __future__ import annotations

import gymnasium as gym
import pytest

pytest.importorskip("skrl")
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.trainers.torch import SequentialTrainer
from skrl.utils.model_instantiators.torch import deterministic_model, gaussian_model

HIDDEN = [{"name": "net", "input": "OBSERVATIONS", "layers": [32, 32], "activations": "tanh"}]


@pytest.mark.parametrize("make", [gym.make, lambda env_id: gym.make_vec(env_id, 4)], ids=["single", "vector"])
def test_ppo_trains_on_what_is_wrapped_by_itself(env_id, make):
    env = wrap_env(make(env_id), verbose=False)
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space, "device": "cpu"}
    models = {
        "policy": gaussian_model(**spaces, network=HIDDEN, output="ACTIONS"),
        "value": deterministic_model(**spaces, network=HIDDEN, output="ONE"),
    }
    settings = PPO_CFG(rollouts=32, learning_epochs=2, experiment={"write_interval": 0, "checkpoint_interval": 0})
    agent = PPO(
        models=models, memory=RandomMemory(memory_size=32, num_envs=env.num_envs, device="cpu"), cfg=settings, **spaces
    )
    models["policy"].init_state_dict(role="policy")  # its layers are lazy
    before = [tensor.clone() for tensor in models["policy"].parameters()]
    quiet = {"disable_progressbar": True, "headless": True, "close_environment_at_exit": False}
    SequentialTrainer(env=env, agents=agent, cfg={"timesteps": 128, **quiet}).train()
    after = list(models["policy"].parameters())
    assert all(torch.isfinite(tensor).all() for tensor in after)
    assert not all(map(torch.equal, before, after))
