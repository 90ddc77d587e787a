"""Tianshou trains SAC on its Dummy, Subproc and Shmem vector environments of single ones."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("tianshou")
import torch
from tianshou.algorithm import SAC
from tianshou.algorithm.modelfree.sac import SACPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, ShmemVectorEnv, SubprocVectorEnv
from tianshou.trainer import OffPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic

HIDDEN = [32, 32]


@pytest.mark.parametrize("kind", [DummyVectorEnv, SubprocVectorEnv, ShmemVectorEnv], ids=lambda kind: kind.__name__)
def test_sac_trains(env_id, kind):
    single = gym.make(env_id)
    seen, acts = single.observation_space.shape, single.action_space.shape
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(state_shape=seen, hidden_sizes=HIDDEN),
        action_shape=acts,
        unbounded=True,
        conditioned_sigma=True,
    )
    critic = ContinuousCritic(preprocess_net=Net(state_shape=seen, action_shape=acts, hidden_sizes=HIDDEN, concat=True))
    algorithm = SAC(
        policy=SACPolicy(actor=actor, action_space=single.action_space),
        policy_optim=AdamOptimizerFactory(),
        critic=critic,
        critic_optim=AdamOptimizerFactory(),
    )
    before = [tensor.clone() for tensor in actor.parameters()]
    envs = kind([lambda: gym.make("lanekeep_env:" + env_id)] * 2)
    try:
        envs.seed(0)
        collector = Collector(algorithm, envs, VectorReplayBuffer(1000, 2))
        collector.reset()
        collector.collect(n_step=100)
        result = algorithm.run_training(
            OffPolicyTrainerParams(
                training_collector=collector,
                max_epochs=1,
                epoch_num_steps=100,
                collection_step_num_env_steps=10,
                batch_size=32,
                update_step_num_gradient_steps_per_sample=0.1,
                verbose=False,
                show_progress=False,
            )
        )
    finally:
        envs.close()
    assert result.update_step > 0 and np.isfinite(collector.buffer.rew).all()
    assert all(torch.isfinite(tensor).all() for tensor in actor.parameters())
    assert not all(map(torch.equal, before, actor.parameters()))
