"""An exported policy against the model of Stable-Baselines3 that it came from."""

from __future__ import annotations

import functools

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.vec_env import VecNormalize

import lanekeep_agents
from lanekeep_agents.export import export_sb3
from lanekeep_agents.policy_file import write_policy


def build(algorithm, env_id="lanekeep/LaneKeep-v0", activation=torch.nn.ReLU, hidden=(32, 32), norm_obs=True, seed=0):
    """A model with random weights, and random statistics."""
    torch.set_num_threads(1)
    keywords = {"preview": 20} if env_id == "lanekeep/LaneKeep-v0" else {}
    env = VecNormalize(lanekeep_agents.sb3_vec_env(env_id, 2, **keywords), training=False, norm_obs=norm_obs)
    extra = {} if algorithm is PPO else {"buffer_size": 10}
    policy = {"net_arch": list(hidden), "activation_fn": activation}
    model = algorithm("MlpPolicy", env, policy_kwargs=policy, device="cpu", seed=seed, **extra)
    rng = np.random.default_rng(seed)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            size = 1.0 / np.sqrt(parameter.shape[-1])
            parameter.copy_(torch.as_tensor(rng.normal(size=tuple(parameter.shape)) * size))
    if norm_obs:
        channels = env.observation_space.shape[0]
        env.obs_rms.var = 10.0 ** rng.uniform(-6.0, 2.0, channels)
        env.obs_rms.mean = rng.normal(size=channels) * np.sqrt(env.obs_rms.var)
    return model, env


def observations(env, n, seed=1):
    """Random ones; one number in a hundred is so far off that it may be clipped."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(n, *env.observation_space.shape))
    if not env.norm_obs:
        return normal.astype(np.float32)
    normal[rng.random(normal.shape) < 0.01] *= 10.0
    return (env.obs_rms.mean + normal * np.sqrt(env.obs_rms.var)).astype(np.float32)


@pytest.mark.parametrize(
    ("algorithm", "settings"),
    [
        (PPO, {"activation": torch.nn.Tanh}),
        (PPO, {"hidden": (64, 64)}),
        (PPO, {"hidden": ()}),
        (PPO, {"norm_obs": False}),
        (PPO, {"env_id": "lanekeep/Drive-v0", "activation": torch.nn.Tanh}),
        (SAC, {}),
        (SAC, {"activation": torch.nn.Tanh, "hidden": (64, 64)}),
        (SAC, {"env_id": "lanekeep/Circuit-v0"}),
        (TD3, {}),
        (TD3, {"activation": torch.nn.Tanh, "hidden": (24,)}),
    ],
    ids=str,
)
def test_an_exported_policy_equals_the_model(algorithm, settings, tmp_path, make_record):
    model, env = build(algorithm, **settings)
    network, normalisation, tensors = export_sb3(model, env)
    scenario = env.get_attr("scenario")[0]
    changes = {"env_id": settings["env_id"]} if "env_id" in settings else {}
    record = make_record(scenario, network=network, normalisation=normalisation, **changes)
    write_policy(tmp_path / "policy.json", record, tensors)
    policy = lanekeep_agents.load(tmp_path / "policy.json")
    given = observations(env, 10_000)
    normalised = env.normalize_obs(given)
    if env.norm_obs:
        assert 100 < (np.abs(normalised) == 10.0).any(axis=1).sum() < 9_900
    wanted, _ = model.predict(normalised, deterministic=True)
    found, state = policy.predict(given)
    assert state is None and found.dtype == np.float32
    assert wanted.std() > 0.1 and (np.abs(wanted) < 1.0).mean() > 0.2  # neither constant nor all at the bounds
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(policy.predict(given[7])[0], found[7])


def test_a_channel_that_hardly_varies_equals_the_model(tmp_path, make_record):
    """A constant speed with rounding errors: its mean is a hundred thousand times its standard deviation."""
    model, env = build(PPO, activation=torch.nn.Tanh)
    place = [channel.name for channel in env.get_attr("scenario")[0].channels].index("speed")
    env.obs_rms.mean[place], env.obs_rms.var[place] = 15.277_777, 1.4e-4**2
    network, normalisation, tensors = export_sb3(model, env)
    record = make_record(env.get_attr("scenario")[0], network=network, normalisation=normalisation)
    write_policy(tmp_path / "policy.json", record, tensors)
    rng = np.random.default_rng(1)
    normal = rng.uniform(-3.0, 3.0, size=(10_000, *env.observation_space.shape))  # none is clipped
    given = (env.obs_rms.mean + normal * np.sqrt(env.obs_rms.var)).astype(np.float32)
    wanted, _ = model.predict(env.normalize_obs(given), deterministic=True)
    found, _ = lanekeep_agents.load(tmp_path / "policy.json").predict(given)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-6)


def test_actors_of_other_kinds_are_refused():
    for activation, name in ((torch.nn.GELU, "GELU"), (functools.partial(torch.nn.ELU, alpha=0.5), "ELU.alpha=0.5.")):
        model, env = build(PPO, activation=activation)
        with pytest.raises(ValueError, match=f"activation_fn={name}.* is not allowed: it must be one of ReLU, Tanh"):
            export_sb3(model, env)
    env = lanekeep_agents.sb3_vec_env("lanekeep/LaneKeep-v0", 2)
    noisy = SAC("MlpPolicy", env, use_sde=True, buffer_size=10, device="cpu")
    with pytest.raises(ValueError, match="it must be Linear"):
        export_sb3(noisy)


def test_an_actor_that_reads_something_else_than_the_observation_is_refused():
    """As that of sb3-contrib's RecurrentPPO does, behind its LSTM."""
    model, env = build(PPO)
    model.policy.mlp_extractor.policy_net[0] = torch.nn.Linear(256, 32)
    with pytest.raises(ValueError, match=r"policy=ActorCriticPolicy .*reads 256 numbers.*recurrent"):
        export_sb3(model, env)
