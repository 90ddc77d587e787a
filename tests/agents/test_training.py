"""The parts of a training run, each against what it stands for: bounds, loops over single environments, numpy."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("stable_baselines3")
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize

import lanekeep_agents
import lanekeep_baselines
import lanekeep_env
from lanekeep_agents.training.evaluation import HeldOut
from lanekeep_agents.training.imitation import _returns, imitate
from lanekeep_agents.training.normalisation import Normalised
from lanekeep_agents.training.residual import Corrections
from lanekeep_agents.training.rewards import LearnersRewards
from lanekeep_agents.training.run import _model
from lanekeep_agents.training.settings import settings_for
from lanekeep_agents.vec_env import CarVecEnv

IDS = sorted(lanekeep_env.ENVIRONMENTS)


class Replay(VecEnv):
    """One car that gives the rewards of a list; its last one ends the episode."""

    def __init__(self, rewards):
        space = gym.spaces.Box(-1.0, 1.0, (1,), np.float32)
        super().__init__(1, space, space)
        self._rewards, self._at = rewards, 0

    def reset(self):
        return np.zeros((1, 1), np.float32)

    def step_async(self, actions):
        pass

    def step_wait(self):
        reward = self._rewards[self._at]
        self._at += 1
        return self.reset(), np.array([reward], np.float64), np.array([self._at == len(self._rewards)]), [{}]

    def close(self):
        pass

    def get_attr(self, attr_name, indices=None):
        return [None]

    def set_attr(self, attr_name, value, indices=None):
        raise NotImplementedError

    def env_method(self, method_name, *args, indices=None, **kwargs):
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class, indices=None):
        return [False]


def as_the_learner_sees(rewards, largest, gamma, scale):
    """Rewards behind the wrapper, and the info of the end."""
    car = LearnersRewards(Replay(rewards), largest, gamma, scale)
    car.reset()
    steps = [car.step(np.zeros((1, 1))) for _ in rewards]
    return np.array([reward[0] for _, reward, _, _ in steps]), steps[-1][3][0]


def discounted(rewards, gamma):
    return float(np.dot(rewards, gamma ** np.arange(len(rewards))))


@given(
    costs=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=300),
    share=st.floats(0.0, 1.0),
    gamma=st.floats(0.01, 0.9999),
    largest=st.floats(1e-3, 10.0),
    scale=st.floats(1e-3, 1e3),
)
def test_leaving_is_never_better_than_staying_at_any_cost(costs, share, gamma, largest, scale):
    """An episode of any costs, and one that leaves the lane somewhere in it, charged for the rest as the task says."""
    stays = [-largest * cost for cost in costs]
    at = int(share * (len(costs) - 1))
    charge = -largest * (1 + len(costs) - at - 1)
    leaves = [*stays[:at], charge]
    wanted, _ = as_the_learner_sees(stays, largest, gamma, scale)
    found, end = as_the_learner_sees(leaves, largest, gamma, scale)
    np.testing.assert_allclose(wanted, np.array(stays) * scale, rtol=1e-12)  # what stays inside is only scaled
    floor = -scale * largest / (1.0 - gamma)
    assert found.min() >= floor * (1.0 + 1e-12)
    assert discounted(found, gamma) <= discounted(wanted, gamma) + 1e-9 * abs(floor)
    assert discounted(found, gamma) >= floor * (1.0 + 1e-9)  # returns have one scale
    assert end["episode"]["l"] == at + 1
    assert end["episode"]["r"] == pytest.approx(sum(leaves), rel=1e-9)


@given(costs=st.lists(st.floats(0.0, 50.0), min_size=1, max_size=50), share=st.floats(0.01, 1.0))
def test_a_learner_is_told_no_more_than_the_largest_cost(costs, share):
    """Of each step; and of an end no more than that largest cost for ever."""
    rewards = [-cost for cost in costs]
    found, _ = as_the_learner_sees(rewards, share, 0.9, 1.0)
    np.testing.assert_array_equal(found[:-1], np.clip(rewards[:-1], -share, None))
    assert found[-1] == max(rewards[-1], -share / (1.0 - 0.9))


@pytest.mark.parametrize("env_id", IDS)
def test_a_step_that_does_not_end_costs_at_most_what_the_scenario_says(env_id):
    """The bound rests on that; and an episode's score is the plain sum of its rewards."""
    gamma, scale, cars = 0.98, 3.0, 16
    plain = CarVecEnv(env_id, cars, max_episode_steps=150)
    scenario = plain.env.unwrapped.scenario
    largest = scenario.largest_cost * scenario.control_step
    seen = LearnersRewards(CarVecEnv(env_id, cars, max_episode_steps=150), largest, gamma, scale)
    for env in (plain, seen):
        env.seed(5)
        env.reset()
    rng = np.random.default_rng(0)
    returns, ended, charged = np.zeros(cars), 0, 0
    for _ in range(200):
        actions = rng.uniform(-1.0, 1.0, (cars, *plain.action_space.shape)).astype(np.float32)
        _, raw, dones, infos = plain.step(actions)
        _, rewards, _, told = seen.step(actions)
        np.testing.assert_allclose(rewards, np.maximum(raw, -largest / (1.0 - gamma)) * scale, rtol=1e-12)
        left = np.array([bool(info) and not info["TimeLimit.truncated"] for info in infos])
        assert (raw[~left] >= -largest * (1.0 + 1e-6)).all()
        charged += int((raw < -largest * 1.5).sum())
        returns += raw
        for car in np.flatnonzero(dones):
            assert told[car]["episode"]["r"] == pytest.approx(returns[car], rel=1e-12)
            returns[car] = 0.0
            ended += 1
    assert ended >= cars
    assert charged > 0 or env_id != "lanekeep/LaneKeep-v0"


class Applied(VecEnvWrapper):
    """Keeps the actions that reach the cars."""

    def reset(self):
        return self.venv.reset()

    def step_async(self, actions):
        self.actions = actions
        self.venv.step_async(actions)

    def step_wait(self):
        return self.venv.step_wait()


def corrected(base, cars, bound=0.2, **keywords):
    applied = Applied(CarVecEnv("lanekeep/LaneKeep-v0", cars, **keywords))
    env = Corrections(applied, applied.venv.env.unwrapped.scenario, base, bound)
    env.seed(3)
    return env, applied


# The printed gains fail, each car at another time, and the observer has a memory.
BASES = ["yin-lqr-observer", "yin-lqr-observer-printed", "stanley"]


@pytest.mark.parametrize("base", BASES)
def test_a_zero_correction_drives_as_the_base_does_to_the_last_bit(base):
    cars, keywords = 24, {"max_episode_steps": 300, "preview": 3, "dtype": "float32"}
    env, _ = corrected(base, cars, **keywords)
    alone = CarVecEnv("lanekeep/LaneKeep-v0", cars, **keywords)
    alone.seed(3)
    observation, seen = alone.reset(), env.reset()
    policy = lanekeep_baselines.make(base, alone.env.unwrapped.scenario)
    memory, starts, ends = None, np.ones(cars, dtype=bool), 0
    nothing = np.zeros((cars, 1), dtype=np.float32)
    for _ in range(700):
        np.testing.assert_array_equal(seen[:, :-1], observation)
        action, memory = policy.predict(observation, memory, starts)
        np.testing.assert_array_equal(seen[:, -1:], np.clip(action, -1.0, 1.0))
        observation, rewards, starts, infos = alone.step(action)
        seen, found, dones, told = env.step(nothing)
        np.testing.assert_array_equal(found, rewards)
        np.testing.assert_array_equal(dones, starts)
        for car in np.flatnonzero(dones):
            last = infos[car]["terminal_observation"]
            np.testing.assert_array_equal(told[car]["terminal_observation"][:-1], last)
            # The base goes on where the episode ends, and is new where the next one starts.
            row = None if memory is None else memory[car : car + 1]
            wanted = policy.predict(last[None], row, np.zeros(1, dtype=bool))[0]
            np.testing.assert_array_equal(told[car]["terminal_observation"][-1:], np.clip(wanted[0], -1.0, 1.0))
            fresh = policy.predict(observation[car])[0]
            np.testing.assert_array_equal(seen[car, -1:], np.clip(fresh, -1.0, 1.0))
            ends += 1
    assert ends >= cars


def test_corrections_keep_their_bound_whatever_is_asked():
    bound = 0.15
    env, applied = corrected("yin-lqr-observer", 16, bound, max_episode_steps=80, action="steering_rate")
    seen = env.reset()
    assert env.observation_space.shape == (seen.shape[1],) and env.observation_space.contains(seen[0])
    rng = np.random.default_rng(0)
    farthest = 0.0
    for step in range(200):
        base = seen[:, -1:]
        asked = np.float32([-1e6, 0.0, 1e6, np.inf])[rng.integers(4, size=(16, 1))]
        if step % 2:
            asked = rng.uniform(-1.0, 1.0, (16, 1)).astype(np.float32)
        seen, *_ = env.step(asked)
        np.testing.assert_allclose(
            applied.actions, np.clip(base + bound * np.clip(asked, -1.0, 1.0), -1.0, 1.0), atol=1e-6
        )
        assert np.abs(applied.actions - base).max() <= bound + 1e-6
        farthest = max(farthest, float(np.abs(applied.actions - base).max()))
    assert farthest > 0.9 * bound


class Seen(VecEnvWrapper):
    """Keeps every observation that was shown."""

    def __init__(self, venv):
        super().__init__(venv)
        self.rows = []

    def reset(self):
        self.rows.append(self.venv.reset())
        return self.rows[-1]

    def step_wait(self):
        told = self.venv.step_wait()
        self.rows.append(told[0])
        return told


@pytest.mark.parametrize("algorithm", [PPO, SAC, TD3])
def test_a_clone_acts_as_its_teacher_on_fresh_episodes(algorithm):
    """Where the clone itself drives: RMS difference below a tenth of the RMS action, and the lane kept as well."""
    torch.set_num_threads(1)
    cars, gamma = 64, 0.98
    keywords = {"preview": 10, "max_episode_steps": 300, "dtype": "float32"}
    inner = Seen(CarVecEnv("lanekeep/LaneKeep-v0", cars, **keywords))
    inner.seed(100)
    env = VecNormalize(inner, norm_reward=False, clip_obs=10.0, epsilon=1e-8)
    extra = {} if algorithm is PPO else {"buffer_size": cars}
    network = {"net_arch": [64, 64]}
    model = algorithm("MlpPolicy", env, gamma=gamma, policy_kwargs=network, device="cpu", seed=0, **extra)
    teacher = lanekeep_baselines.make("yin-lqr-feedforward", inner.venv.env.unwrapped.scenario)
    imitate(model, env, teacher, gamma, seed=1)

    rows = np.concatenate(inner.rows[:-1]).astype(np.float64)  # the last one was not acted on
    np.testing.assert_allclose(env.obs_rms.mean, rows.mean(axis=0), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(env.obs_rms.var, rows.var(axis=0), rtol=1e-6, atol=1e-12)
    assert env.obs_rms.count == len(rows)

    def drive(driver):
        """Actions of teacher and clone and lateral errors where one of them drives."""
        envs = gym.make_vec("lanekeep/LaneKeep-v0", cars, vectorization_mode="vector_entry_point", **keywords)
        observation, _ = envs.reset(seed=10_000)
        memory, starts, told = None, np.ones(cars, dtype=bool), []
        for _ in range(300):
            action, memory = teacher.predict(observation, memory, starts)
            both = np.clip(action, -1.0, 1.0), model.predict(env.normalize_obs(observation), deterministic=True)[0]
            observation, _, terminated, truncated, info = envs.step(both[driver])
            starts = terminated | truncated
            told.append((both[0][:, 0], both[1][:, 0], info["lateral_error"]))
        return np.array(told).swapaxes(0, 1)

    def rms(values):
        return float(np.sqrt(np.mean(np.square(values))))

    wanted, found, errors = drive(1)
    assert rms(wanted) > 0.01
    assert rms(found - wanted) < 0.1 * rms(wanted)
    assert rms(errors) < 1.1 * rms(drive(0)[2])
    if algorithm is TD3:
        for name, tensor in model.policy.actor.state_dict().items():
            assert torch.equal(tensor, model.policy.actor_target.state_dict()[name])


def test_returns_are_the_sums_that_they_stand_for():
    rng = np.random.default_rng(0)
    gamma, steps, cars = 0.9, 12, 3
    rewards, ends = rng.normal(size=(steps, cars)), rng.random((steps, cars)) < 0.2
    assert ends[:-1].any() and not ends[-1].all()
    wanted = np.zeros((steps, cars))
    for car in range(cars):
        for start in range(steps):
            factor = 1.0
            for step in range(start, 2000):
                wanted[start, car] += factor * rewards[min(step, steps - 1), car]
                factor *= gamma
                if step < steps and ends[step, car]:
                    break
    found = _returns(list(rewards), list(ends), gamma)
    np.testing.assert_allclose(found, wanted.reshape(-1, 1), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    ("env_id", "name", "keywords"),
    [
        ("lanekeep/LaneKeep-v0", "yin-lqr-observer", {"max_episode_steps": 200, "preview": 2}),
        ("lanekeep/LaneKeep-v0", "yin-lqr-observer-printed", {"max_episode_steps": 600, "speed": 45.0}),
        ("lanekeep/Circuit-v0", "knightriders-circuit", {"max_episode_steps": 300}),
    ],
)
def test_the_score_is_that_of_a_plain_loop_over_episodes(env_id, name, keywords):
    episodes, seed = 6, 321
    returns, failures, squares = [], [], []
    for i in range(episodes):
        env = gym.make(env_id, **keywords)
        policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
        observation, _ = env.reset(seed=seed + i)
        memory, total, over = None, 0.0, False
        while not over:
            action, memory = policy.predict(observation, memory)
            observation, reward, terminated, truncated, info = env.step(action)
            total += reward
            squares.append(info["lateral_error"] ** 2)
            over = terminated or truncated
        returns.append(total)
        failures.append(not info["is_success"])
    held_out = HeldOut(env_id, keywords, episodes, seed)
    for _ in range(2):  # the same episodes each time
        score = held_out.score(policy)
        assert score.mean_return == pytest.approx(np.mean(returns), rel=1e-12)
        assert score.failure_rate == pytest.approx(np.mean(failures))
        assert score.rms_lateral_error == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-12)
    assert np.any(failures) or name == "yin-lqr-observer"
    assert np.std(returns) > 0.0


def test_the_learning_rate_falls_to_its_last_value_and_no_further():
    settings = settings_for("ppo", "LaneKeep-v0", num_envs=2, learning_rate=0.01, final_learning_rate=0.0)
    env = VecNormalize(CarVecEnv(settings.env_id, settings.num_envs, **settings.env))
    schedule = _model(settings, env).lr_schedule
    # A rollout that ends beyond the steps asked for leaves a negative share.
    assert [schedule(left) for left in (1.0, 0.5, 0.0, -0.1)] == pytest.approx([0.01, 0.005, 0.0, 0.0])


def test_a_channel_that_never_varies_in_training_does_not_drown_the_others_elsewhere():
    """RoadWorks is driven at one speed: another one within a per cent stays within a standard deviation."""
    cars = CarVecEnv("lanekeep/RoadWorks-v0", 4, dtype="float32")
    env, plain = Normalised(cars), VecNormalize(cars, norm_reward=False, clip_obs=10.0, epsilon=1e-8)
    env.reset()
    for _ in range(20):
        env.step(np.zeros((4, 1), dtype=np.float32))
    plain.obs_rms = env.obs_rms
    seen = env.get_original_obs()
    speed = [channel.name for channel in cars.env.unwrapped.scenario.channels].index("speed")
    varies = env.obs_rms.var > (0.01 * env.obs_rms.mean) ** 2
    assert varies.any() and not varies[speed]
    np.testing.assert_array_equal(env.normalize_obs(seen)[:, varies], plain.normalize_obs(seen)[:, varies])
    faster = seen.copy()
    faster[:, speed] *= 1.009
    assert (np.abs(env.normalize_obs(faster)[:, speed]) < 1.0).all()
    assert (np.abs(plain.normalize_obs(faster)[:, speed]) > 5.0).all()


def test_callbacks_of_stable_baselines3_are_called_and_log(tmp_path):
    from stable_baselines3.common.callbacks import BaseCallback

    seen = []

    class Mine(BaseCallback):
        def _on_step(self) -> bool:
            seen.append(self.num_timesteps)
            self.logger.record("mine/steps", self.num_timesteps)
            return True

    few = {"steps": 64, "num_envs": 16, "evaluation_episodes": 2}
    lanekeep_agents.train("ppo", "lanekeep/LaneKeep-v0", tmp_path / "run", **few, callback=[Mine()])
    assert seen[0] == 16 and seen[-1] >= 64
