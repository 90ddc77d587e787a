"""RLlib trains PPO on an id of lanekeep's."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("ray.rllib")
import ray
from ray.rllib.algorithms.ppo import PPOConfig


@pytest.fixture(scope="module", autouse=True)
def cluster():
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


def test_ppo_trains(env_id):
    settings = (
        PPOConfig()
        .environment(f"lanekeep_env:{env_id}")
        .env_runners(num_env_runners=0, num_envs_per_env_runner=2)
        .training(train_batch_size=256, minibatch_size=64, num_epochs=2)
    )
    algorithm = settings.build_algo()
    try:
        before = algorithm.get_module().get_state()
        found = algorithm.train()
        after = algorithm.get_module().get_state()
    finally:
        algorithm.stop()
    assert found["env_runners"]["num_env_steps_sampled"] >= 256
    assert all(np.isfinite(array).all() for array in after.values())
    assert any((before[name] != after[name]).any() for name in after)
