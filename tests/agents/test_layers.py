"""Models trained in Stable-Baselines3's own layers and vector environments: saved, and the same by numpy alone."""

from __future__ import annotations

import functools

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecCheckNan,
    VecEnvWrapper,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

import lanekeep_agents
from lanekeep_agents.activations import ACTIVATIONS
from lanekeep_agents.export import ACTIVATIONS as OF_TORCH

ID = "lanekeep/LaneKeep-v0"
LAYERS = {
    "normalised frames": lambda env: VecFrameStack(VecNormalize(env), 3),
    "frames normalised": lambda env: VecNormalize(VecFrameStack(VecMonitor(env), 4)),
    "frames": lambda env: VecFrameStack(env, 2),
    "nothing": lambda env: env,
}


def made(kind):
    if kind == "sb3_vec_env":
        return lanekeep_agents.sb3_vec_env(ID, 2, preview=2)
    if kind == "subproc":
        return SubprocVecEnv([functools.partial(gym.make, f"lanekeep_env:{ID}", preview=2)] * 2, start_method="spawn")
    return make_vec_env(ID, 2, env_kwargs={"preview": 2})


@pytest.mark.parametrize("kind", ["make_vec_env", "sb3_vec_env", "subproc"])
@pytest.mark.parametrize("layers", LAYERS)
def test_a_saved_model_acts_as_it_did_over_whole_episodes(kind, layers, tmp_path):
    if kind == "subproc" and layers != "frames normalised":
        pytest.skip("processes take seconds to start; one case of them is enough")
    torch.set_num_threads(1)
    env = LAYERS[layers](made(kind))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, n_epochs=2, seed=1, device="cpu").learn(256)
    record = lanekeep_agents.save(tmp_path / "mine.json", model)
    assert record.frames == {"normalised frames": 3, "frames normalised": 4, "frames": 2, "nothing": 1}[layers]
    policy = lanekeep_agents.load(tmp_path / "mine.json")
    for layer in (env, env.venv if hasattr(env, "venv") else env):
        if isinstance(layer, VecNormalize):
            layer.training = False
    steps = 5_000 if kind == "make_vec_env" else 300
    raw = raw_of(env.unwrapped)
    seen = env.reset()
    state, start, worst = None, np.ones(2, bool), 0.0
    for _ in range(steps):
        wanted, _ = model.predict(seen, deterministic=True)
        found, state = policy.predict(raw(), state, start)
        worst = max(worst, np.abs(found - np.clip(wanted, -1.0, 1.0)).max())
        seen, _, start, _ = env.step(wanted)
    assert worst < 1e-6
    env.close()


def raw_of(cars):
    """How to read the cars' observations below all layers."""
    if hasattr(cars, "buf_obs"):
        return lambda: cars.buf_obs[None].copy()
    latest = {}
    for name in ("reset", "step_wait"):
        kept = getattr(cars, name)

        def keep(kept=kept):
            result = kept()
            latest["observation"] = result[0] if isinstance(result, tuple) else result
            return result

        setattr(cars, name, keep)
    return lambda: latest["observation"]


def test_frames_of_rows_that_start_anew_are_forgotten_alone(make_record, make_tensors):
    scenario = gym.make(ID).unwrapped.scenario
    record = make_record(scenario, frames=3)
    policy = lanekeep_agents.LearnedPolicy(record, make_tensors(record), scenario)
    rng = np.random.default_rng(0)
    rows = 0.1 * rng.normal(size=(5, 6, len(scenario.channels))).astype(np.float32)
    state, actions = None, []
    for k, row in enumerate(rows):
        action, state = policy.predict(row, state, np.array([k == 3, False] * 3))
        actions.append(action)
    fresh = None
    for k in (3, 4):
        action, fresh = policy.predict(rows[k], fresh)
        np.testing.assert_array_equal(action[::2], actions[k][::2])
        assert (action[1::2] != actions[k][1::2]).all()
    one, following = policy.predict(rows[0, 0])
    again, _ = policy.predict(rows[1, 0], following)
    assert one.shape == again.shape == (1,) and following.shape == (2 * len(scenario.channels),)
    np.testing.assert_array_equal(again, actions[1][0])
    with pytest.raises(ValueError, match="state has shape"):
        policy.predict(rows[0], np.zeros((6, 3), np.float32))


@pytest.mark.parametrize("layer", OF_TORCH, ids=lambda layer: layer.__name__)
def test_activations_are_those_of_torch(layer):
    given = np.concatenate([np.linspace(-30.0, 30.0, 6001), [-1e4, 1e4, 0.0, -0.0]]).astype(np.float32)
    wanted = layer()(torch.as_tensor(given.copy())).numpy()
    found = given.copy()
    ACTIVATIONS[OF_TORCH[layer]](found)
    np.testing.assert_allclose(found, wanted, rtol=2e-6, atol=2e-6)
    assert set(OF_TORCH.values()) == set(ACTIVATIONS)


@pytest.mark.parametrize("layer", [torch.nn.SiLU, torch.nn.ELU], ids=lambda layer: layer.__name__)
def test_a_model_with_another_activation_is_saved(layer, tmp_path):
    env = lanekeep_agents.sb3_vec_env(ID, 2)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=16, policy_kwargs={"activation_fn": layer}, device="cpu")
    lanekeep_agents.save(tmp_path / "mine.json", model)
    rows = np.random.default_rng(0).normal(size=(1000, env.observation_space.shape[0])).astype(np.float32)
    wanted, _ = model.predict(rows, deterministic=True)
    np.testing.assert_allclose(lanekeep_agents.load(tmp_path / "mine.json").predict(rows)[0], wanted, atol=1e-6)


class Doubled(gym.RewardWrapper):
    """A reward of one's own."""

    def reward(self, reward):
        return 2.0 * reward


class Observed(gym.ObservationWrapper):
    """Observations of one's own, of the same shape."""

    def observation(self, observation):
        return 0.5 * observation


def test_a_reward_of_ones_own_is_kept_in_the_record(tmp_path):
    model = PPO("MlpPolicy", make_vec_env(ID, 1, wrapper_class=Doubled), n_steps=8, batch_size=8, device="cpu")
    record = lanekeep_agents.save(tmp_path / "mine.json", model)
    assert record.training.hyperparameters["rewards"] == [f"{__name__}:Doubled"]
    lanekeep_agents.load(tmp_path / "mine.json")


class Halved(VecEnvWrapper):
    """A layer that a policy file does not know."""

    def reset(self):
        return 0.5 * self.venv.reset()

    def step_wait(self):
        observation, *rest = self.venv.step_wait()
        return (0.5 * observation, *rest)


def test_what_changes_neither_observations_nor_actions_may_lie_between(tmp_path):
    rewards = {"wrapper_class": gym.wrappers.ClipReward, "wrapper_kwargs": {"min_reward": -1.0, "max_reward": 0.0}}
    for env in (VecCheckNan(VecMonitor(lanekeep_agents.sb3_vec_env(ID, 1))), make_vec_env(ID, 1, **rewards)):
        model = PPO("MlpPolicy", env, n_steps=8, batch_size=8, device="cpu")
        assert lanekeep_agents.save(tmp_path / "mine.json", model, overwrite=True).frames == 1


@pytest.mark.parametrize(
    ("env", "words"),
    [
        (lambda: make_vec_env("Pendulum-v1", 1), "one of lanekeep's ids"),
        (lambda: Halved(lanekeep_agents.sb3_vec_env(ID, 1)), "layer Halved"),
        (lambda: VecFrameStack(VecFrameStack(lanekeep_agents.sb3_vec_env(ID, 1), 2), 2), "two layers of VecFrameStack"),
        (lambda: make_vec_env(ID, 1, wrapper_class=gym.wrappers.NormalizeObservation), "NormalizeObservation"),
        (lambda: make_vec_env(ID, 1, wrapper_class=Observed), r"Observed.*derived from gymnasium\.RewardWrapper"),
        (
            lambda: make_vec_env(
                ID, 1, wrapper_class=gym.wrappers.RescaleAction, wrapper_kwargs={"min_action": -2.0, "max_action": 2.0}
            ),
            "RescaleAction",
        ),
        (lambda: DummyVecEnv([lambda: gym.make(ID), lambda: gym.make(ID, lane_width=3.0)]), "more than one scenario"),
    ],
)
def test_what_a_file_cannot_hold_is_named(env, words, tmp_path):
    model = PPO("MlpPolicy", env(), n_steps=8, batch_size=8, device="cpu")
    with pytest.raises(ValueError, match=words):
        lanekeep_agents.save(tmp_path / "mine.json", model)
    assert not list(tmp_path.iterdir())
