"""Conventions that trainers and wrappers rely on."""

import pathlib
from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv

import lanekeep_env
from lanekeep_env import envs

ID, DRIVE = "lanekeep/LaneKeep-v0", "lanekeep/Drive-v0"
IDS = sorted(lanekeep_env.ENVIRONMENTS)
FORMS = ["single", "sync", "vector_entry_point"]


def made(form, env_id=ID, **keywords):
    return gym.make(env_id, **keywords) if form == "single" else gym.make_vec(env_id, 2, form, **keywords)


@pytest.mark.parametrize("form", FORMS)
def test_a_limit_that_episodes_do_not_reach_is_refused_and_a_shorter_one_obeyed(form):
    with pytest.raises(ValueError, match=r"max_episode_steps=2000 is not allowed.*episode_steps=2000"):
        made(form, max_episode_steps=2000)
    env = made(form, max_episode_steps=7, departure="off")
    env.reset(seed=0)
    ends = [bool(np.all(env.step(env.action_space.sample())[3])) for _ in range(7)]
    assert ends == [False] * 6 + [True]
    made(form, max_episode_steps=600)
    made(form, max_episode_steps=2000, episode_steps=2000)


@pytest.fixture
def own_id():
    """Somebody's own id for our environment, with a limit that its episodes do not reach."""
    gym.register(
        "mine/Lane-v0",
        entry_point="lanekeep_env.envs.lane_keep:LaneKeepEnv",
        vector_entry_point="lanekeep_env.envs.vector_twins:LaneKeepVectorEnv",
        max_episode_steps=2000,
    )
    yield "mine/Lane-v0"
    del gym.registry["mine/Lane-v0"]


@pytest.mark.parametrize("form", FORMS)
def test_a_limit_of_a_spec_is_refused_alike(form, own_id):
    changed = deepcopy(gym.spec(ID))
    changed.max_episode_steps = 2000
    for what in (changed, own_id):
        with pytest.raises(ValueError, match=r"max_episode_steps=2000 is not allowed.*episode_steps=2000"):
            made(form, what)
        assert made(form, what, episode_steps=2000).spec.max_episode_steps == 2000
    if form == "single":  # shorter ones than the spec says are what the call asks for
        assert made(form, own_id, episode_steps=30).unwrapped.spec.max_episode_steps == 30
        assert made(form, gym.make(ID).spec, episode_steps=30).unwrapped.spec.max_episode_steps == 30


def test_a_longer_limit_of_ones_own_wrapper_ends_nothing_and_hides_nothing():
    env = gym.wrappers.TimeLimit(gym.make(ID, episode_steps=20, departure="off"), 50)
    env.reset(seed=0)
    ends = [env.step(env.action_space.sample())[2:4] for _ in range(20)]
    assert ends == [(False, False)] * 19 + [(False, True)]


@pytest.mark.parametrize("env_id", [ID, DRIVE])
@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_single_and_vector_clip_infinite_actions_alike(env_id, value):
    single, vector = gym.make(env_id), gym.make_vec(env_id, 1, "vector_entry_point")
    single.reset(seed=0), vector.reset(seed=0)
    action = np.full(single.action_space.shape, value, np.float32)
    action[-1] = -value
    np.testing.assert_array_equal(single.step(action)[0], vector.step(action[None])[0][0])
    assert single.unwrapped.clipped_actions == vector.unwrapped.clipped_actions[0] == 1
    action[0] = np.nan
    for env, given in ((single, action), (vector, action[None])):
        with pytest.raises(ValueError, match="NaN"):
            env.step(given)


@pytest.mark.parametrize("env_id", [ID, "lanekeep/Circuit-v0"])
@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled"])
def test_what_is_handed_out_is_the_callers(env_id, mode):
    """Whatever is written into it: the next steps and masked resets are those of an environment left alone."""
    touched, alone = (gym.make_vec(env_id, 3, "vector_entry_point", autoreset_mode=mode) for _ in range(2))
    mask = np.array([True, False, False])
    for env in (touched, alone):
        env.reset(seed=0)
        env.action_space.seed(0)
    for _ in range(5):
        results = []
        for env in (touched, alone):
            observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
            again, _ = env.reset(options={"reset_mask": mask})
            results.append([part.copy() for part in (observation, reward, info["cost"], again)])
            if env is touched:
                for array in (observation, reward, terminated, truncated, again, *info.values()):
                    if array.flags.writeable:
                        array[...] = 1
        for one, other in zip(*results, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("form", FORMS)
def test_a_path_an_array_and_a_record_keep_the_spec_json(form, tmp_path):
    circle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    line = np.c_[100.0 * np.cos(circle), 100.0 * np.sin(circle)]
    np.savetxt(tmp_path / "road.csv", line, delimiter=",")
    for road in (tmp_path / "road.csv", line):
        keywords = {"road": road, "vehicle": lanekeep_env.VEHICLES["passat"], "sensors": {"speed": {"noise": 0.1}}}
        if form == "single":
            env = gym.make(ID, **keywords)
            twin = gym.make(EnvSpec.from_json(env.spec.to_json()))
            assert twin.unwrapped.scenario == env.unwrapped.scenario
        elif form == "vector_entry_point":
            env = gym.make_vec(ID, 2, form, **keywords)
            assert EnvSpec.from_json(env.spec.to_json()).kwargs["num_envs"] == 2


@pytest.mark.parametrize("env_id", IDS)
def test_a_scenario_is_taken_whole(env_id):
    row = lanekeep_env.ENVIRONMENTS[env_id]
    scenario = row.scenario(episode_steps=33)
    for env in (gym.make(env_id, scenario=scenario), gym.make_vec(env_id, 2, "vector_entry_point", scenario=scenario)):
        assert env.unwrapped.scenario is scenario
    env = gym.make(env_id, scenario=scenario)
    twin = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert twin.unwrapped.scenario == scenario and twin.spec.max_episode_steps == 33
    with pytest.raises(ValueError, match="no other keyword beside it, and episode_steps"):
        gym.make(env_id, scenario=scenario, episode_steps=44)
    with pytest.raises(ValueError, match=f"must be a {row.scenario.__name__}"):
        gym.make(env_id, scenario=lanekeep_env.Sensor())


@pytest.mark.parametrize("name", ["friction", "scenario", "speed", "vehicle", "randomisation", "channels"])
def test_what_would_change_nothing_cannot_be_set(name):
    for env in (gym.make(ID), gym.make_vec(ID, 2, "vector_entry_point")):
        with pytest.raises(AttributeError, match=r"settled.*reset\(options"):
            setattr(env.unwrapped, name, 0.5)
        env.unwrapped.mine = 3  # of somebody's own
        assert env.unwrapped.mine == 3
    wrapped = gym.wrappers.TimeLimit(gym.make(ID), 10)
    with pytest.raises(AttributeError, match="settled"):
        wrapped.set_wrapper_attr(name, 0.5)


@pytest.mark.parametrize("env_id", [ID, DRIVE, "lanekeep/Circuit-v0", "lanekeep/ReversePath-v0"])
@pytest.mark.parametrize("rate", [30, 24, 60, 200])
def test_cameras_and_loops_of_any_rate(env_id, rate):
    """The step divides the control step, so episodes of the same length in seconds end at the same place."""
    ends = []
    for step in (1.0 / rate, None):
        env = gym.make(env_id, **({} if step is None else {"control_step": step}))
        scenario = env.unwrapped.scenario
        ratio = scenario.control_step / scenario.integration.step
        assert abs(ratio - round(ratio)) < 1e-9 and scenario.integration.step <= scenario.longest_step + 1e-12
        env.reset(seed=0, options={"arc_length": 0.0} if env_id == ID else None)
        for _ in range(round(1.0 / scenario.control_step)):
            *_, info = env.step(np.zeros(env.action_space.shape, np.float32))
        ends.append(info["arc_length"])
    if env_id == ID:
        assert ends[0] == pytest.approx(ends[1], abs=0.01)


@pytest.mark.parametrize("env_id", IDS)
def test_environments_are_told_by_their_direct_bases(env_id):
    """skrl looks at those alone."""
    assert gym.Env in type(gym.make(env_id).unwrapped).__bases__
    assert VectorEnv in type(gym.make_vec(env_id, 1).unwrapped).__bases__


def test_other_names_of_frameworks_are_there():
    env = gym.make_vec(ID, 2, "vector_entry_point", autoreset_mode="same_step")
    assert env.unwrapped.autoreset_mode is env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    with pytest.raises(TypeError, match="got an unexpected keyword argument 'frameskip'"):  # TorchRL reads this
        gym.make(ID, frameskip=1)


def test_the_stub_names_the_derived_classes():
    text = (pathlib.Path(envs.__file__).parent / "vector_twins.pyi").read_text()
    rows = lanekeep_env.ENVIRONMENTS.values()
    assert text.count("class ") == len(rows)
    for row in rows:
        module, _, name = row.vector.partition(":")
        twin = getattr(__import__(module, fromlist=[name]), name)
        assert f"class {name}({twin.__bases__[0].__name__}, ManyEnvs): ..." in text
