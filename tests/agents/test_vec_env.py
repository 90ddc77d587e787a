"""The Stable-Baselines3 adapter against the single environments it stands for."""

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_env

pytest.importorskip("stable_baselines3")
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecVideoRecorder

from lanekeep_agents import sb3_vec_env


@pytest.mark.parametrize("name", sorted(lanekeep_env.ENVIRONMENTS))
def test_cars_are_the_single_environments(name):
    cars = 5
    venv = sb3_vec_env(name, cars, max_episode_steps=25)
    venv.seed(40)
    observation = venv.reset()
    singles = [gym.make(name, max_episode_steps=25) for _ in range(cars)]
    for i, env in enumerate(singles):
        np.testing.assert_array_equal(env.reset(seed=40 + i)[0], observation[i])
    rng = np.random.default_rng(0)
    endings = {True: 0, False: 0}
    for _ in range(80):
        actions = rng.uniform(-0.4, 0.4, (cars, *venv.action_space.shape)).astype(np.float32)
        observation, rewards, dones, infos = venv.step(actions)
        for i, env in enumerate(singles):
            alone, reward, terminated, truncated, info = env.step(actions[i])
            assert rewards[i] == reward and dones[i] == (terminated or truncated)
            if dones[i]:
                np.testing.assert_array_equal(infos[i]["terminal_observation"], alone)
                assert infos[i]["TimeLimit.truncated"] == (truncated and not terminated)
                assert infos[i]["lateral_error"] == info["lateral_error"]
                endings[terminated] += 1
                alone, _ = env.reset()
            np.testing.assert_array_equal(observation[i], alone)
    assert endings[False] > 0
    assert endings[True] > 0 or name != "lanekeep/LaneKeep-v0"  # the slower ones do not leave their lane that soon


def test_ppo_learns_from_it():
    """A trivial task: on a straight road PPO must at least halve the cost of doing nothing sensible."""
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    def make(seed):
        env = sb3_vec_env("lanekeep/LaneKeep-v0", 64, road="straight", speed=25.0, max_episode_steps=100)
        env.seed(seed)
        return VecMonitor(env)

    env = VecNormalize(make(0), norm_reward=True)
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=50,
        batch_size=640,
        n_epochs=5,
        gamma=0.98,
        seed=0,
        device="cpu",
        policy_kwargs={"log_std_init": -2.5, "net_arch": [32]},
        learning_rate=3e-3,
    )

    def mean_return(policy):
        test = make(10_000)
        observation = test.reset()
        total = np.zeros(64)
        alive = np.ones(64, dtype=bool)
        for _ in range(100):
            action = policy(observation)
            observation, rewards, dones, _ = test.step(action)
            total += rewards * alive
            alive &= ~dones
        return total.mean()

    before = mean_return(lambda o: model.predict(env.normalize_obs(o), deterministic=True)[0])
    model.learn(100_000)
    env.training = False
    after = mean_return(lambda o: model.predict(env.normalize_obs(o), deterministic=True)[0])
    assert after > 0.5 * before


def test_pictures_become_a_film(tmp_path):
    env = sb3_vec_env("lanekeep/LaneKeep-v0", 4, render_mode="rgb_array")
    film = VecVideoRecorder(env, str(tmp_path), record_video_trigger=lambda step: step == 0, video_length=5)
    film.reset()
    for _ in range(7):
        film.step(np.zeros((4, 1), np.float32))
    frames = env.get_images()
    assert len(frames) == 4 and all(frame.ndim == 3 for frame in frames)
    film.close()
    (file,) = tmp_path.glob("*.mp4")
    assert file.stat().st_size > 1000
    assert sb3_vec_env("lanekeep/LaneKeep-v0", 2).get_images() == [None, None]


def test_attributes_and_methods_are_the_cars():
    """As `DummyVecEnv` means them, whose cars are made one by one."""
    env = sb3_vec_env("lanekeep/LaneKeep-v0", 6, render_mode="rgb_array")  # six channels, too
    one_by_one = DummyVecEnv([lambda: gym.make("lanekeep/LaneKeep-v0", render_mode="rgb_array")] * 6)
    env.reset(), one_by_one.reset()
    for name in ("clipped_actions", "scenario", "channels"):
        for indices in (None, 1, [0, 2]):
            assert env.get_attr(name, indices) == one_by_one.get_attr(name, indices)
    pictures = env.env_method("render", indices=[2])
    assert len(pictures) == 1 and pictures[0].ndim == 3
    for indices in (None, [1]):
        assert len(env.env_method("road_set", indices=indices)) == (6 if indices is None else 1)
    env.set_attr("mine", 3)
    assert env.get_attr("mine", [0]) == [3]
    for name, indices in (("friction", None), ("mine", [1])):
        with pytest.raises(AttributeError, match=r"cannot be set"):
            env.set_attr(name, 0.3, indices)


def test_options_bound_what_the_cars_of_later_episodes_are():
    task = {"road": "straight", "speed": 20.0, "randomisation": {"speed": (0.5, 1.0)}, "episode_steps": 3}
    env = sb3_vec_env("lanekeep/LaneKeep-v0", 4, **task)
    env.set_options({"speed": (0.5, 0.6), "lateral_error": 0.1})
    env.reset()
    for _ in range(8):
        env.step(np.zeros((4, 1), np.float32))
        assert (env.truth["speed"] <= 12.0).all()
    for wrong in ([{"speed": 0.5}] * 3, {"speed": 3.0}, {"sped": 1.0}):
        with pytest.raises(ValueError, match="reset option"):
            env.set_options(wrong)
    env.reset()
    env.set_options({"lateral_error": 99.0})  # which a reset refuses, once
    with pytest.raises(ValueError, match="within 20 m"):
        env.reset()
    env.reset()
    with pytest.raises(AttributeError, match="some cars"):
        env.env_method("reset", indices=[0])
    with pytest.raises(ValueError, match="reset option speed"):
        env.set_options({"speed": (0.4, 0.6)})


def test_options_bound_episodes_that_begin_by_themselves_as_well():
    """A model resets its cars once; what a callback says in between holds from each car's next episode on."""
    task = {"road": "straight", "speed": 20.0, "randomisation": {"speed": (0.5, 1.0)}, "episode_steps": 3}
    env = sb3_vec_env("lanekeep/LaneKeep-v0", 4, **task)
    env.seed(0)
    env.reset()
    running = env.step(np.zeros((4, 1), np.float32)) and env.truth["speed"].copy()
    env.set_options({"speed": (0.5, 0.51)})
    env.step(np.zeros((4, 1), np.float32))
    assert running.max() > 10.2
    np.testing.assert_allclose(env.truth["speed"], running, atol=0.01)
    for _ in range(4):
        env.step(np.zeros((4, 1), np.float32))
        assert (env.truth["speed"] <= 10.2 + 1e-6).all()


def test_cars_one_by_one_are_bounded_by_their_method():
    """`DummyVecEnv` hands its options to a reset of all alone, which a model that goes on learning does not do."""
    task = {"road": "straight", "speed": 20.0, "randomisation": {"speed": (0.5, 1.0)}, "episode_steps": 3}
    env = make_vec_env("lanekeep/LaneKeep-v0", 3, env_kwargs=task)
    column = env.get_attr("scenario")[0].column("speed")
    env.reset()
    env.env_method("narrow", {"speed": 0.6})
    for step in range(8):
        observation, *_ = env.step(np.zeros((3, 1), np.float32))
        if step >= 2:
            np.testing.assert_allclose(observation[:, column], 12.0, rtol=1e-6)
    with pytest.raises(ValueError, match="reset option speed"):
        env.env_method("narrow", {"speed": 0.4})
