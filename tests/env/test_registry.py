"""One smoke test over the registry: a new id is tested by being registered."""

import copy
import dataclasses
import itertools
import json
import pickle
import re
import subprocess
import sys
import warnings

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from registry_options import COMPILED_OR_NOT, FAMILIES, OPTIONS, alone, decides_what_is_compiled, options_of
from with_effect import with_effect

import lanekeep_env

pytestmark = pytest.mark.long
IDS = sorted(lanekeep_env.ENVIRONMENTS)


def checked(env, drawn=False):
    """Gymnasium's checker with its warnings as errors; ``drawn`` with pictures, at most of the time."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*render.*")
        check_env(env.unwrapped, skip_render_check=not drawn)


@pytest.mark.parametrize("name", IDS)
def test_defaults_run_vector_pickle_and_copy(name):
    env = gym.make(name)
    checked(env, drawn=True)
    env.reset(seed=5)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(60)]
    for action in actions[:20]:
        env.step(action)
    twins = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]
    for action in actions[20:]:
        expected = env.step(action)
        for twin in twins:
            got = twin.step(action)
            np.testing.assert_array_equal(got[0], expected[0])
            assert got[1:] == expected[1:]
    vector = gym.make_vec(name, num_envs=3, vectorization_mode="vector_entry_point")
    observation, _ = vector.reset(seed=5)
    assert vector.observation_space.contains(observation)
    assert observation.shape == (3, len(vector.unwrapped.channels))
    again = pickle.loads(pickle.dumps(vector))
    sample = vector.action_space.sample()
    np.testing.assert_array_equal(vector.step(sample)[0], again.step(sample)[0])


@pytest.mark.parametrize("name", IDS)
def test_the_row_names_the_scenario_and_all_forms_have_its_length(name):
    row = lanekeep_env.ENVIRONMENTS[name]
    single, vector = gym.make(name), gym.make_vec(name, 2, "vector_entry_point")
    for env in (single, vector):
        assert type(env.unwrapped).scenario_class is row.scenario is type(env.unwrapped.scenario)
        assert env.spec.max_episode_steps == env.unwrapped.scenario.episode_steps  # which no wrapper cuts short
        assert env.unwrapped.channels == single.unwrapped.channels
    lengths = re.findall(r"Truncated after\s+`episode_steps` \((\d+)\)", type(single.unwrapped).__doc__)
    assert lengths == [str(row.scenario().episode_steps)]


@pytest.mark.parametrize("name", IDS)
def test_the_vector_form_is_a_class_that_pickles_copies_and_tells_what_it_is(name):
    env = gym.make_vec(name, 2, "vector_entry_point")
    single = type(gym.make(name).unwrapped)
    assert type(env).__name__ == single.__name__.removesuffix("Env") + "VectorEnv"
    assert f"`{single.__name__}`" in type(env).__doc__ and single.__doc__.strip().startswith("## Description")
    assert pickle.loads(pickle.dumps(type(env))) is type(env)
    assert pickle.loads(cloudpickle.dumps(type(env))) is type(env)
    public = {attribute for attribute in dir(single) if not attribute.startswith("_")}
    family = {attribute for attribute in public if attribute.endswith("_set")}  # road_set, world_set
    assert family and family <= set(dir(env))
    twin = copy.deepcopy(env)
    env.reset(seed=3), twin.reset(seed=3)
    actions = env.action_space.sample()
    for ours, theirs in zip(env.step(actions)[:4], twin.step(actions)[:4], strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_kernels_are_imported_with_the_first_environment():
    """An import of the package, and of all pages, needs none of the modules with kernels."""
    code = (
        "import sys, pkgutil, lanekeep_env\n"
        "for row in lanekeep_env.ENVIRONMENTS.values(): pkgutil.resolve_name(row.page)\n"
        "print(*(name for name in sys.modules if name.startswith('lanekeep_env.envs.')))\n"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "lanekeep_env.envs.lane_keep" in loaded
    assert "kernel" not in loaded and "cars" not in loaded


@pytest.mark.parametrize("name", IDS)
def test_a_step_before_reset_is_refused_and_a_fault_inside_a_step_is_not_taken_for_one(name, monkeypatch):
    env = gym.make(name).unwrapped
    action = np.zeros(env.action_space.shape, dtype=np.float32)
    for fresh in (env, copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        with pytest.raises(gym.error.ResetNeeded, match="reset"):
            fresh.step(action)
    env.reset(seed=0)

    def broken(*_):
        return None.missing

    monkeypatch.setattr(env, "_step", broken)
    with pytest.raises(AttributeError, match="missing"):
        env.step(action)


@pytest.mark.parametrize("name", IDS)
def test_the_options_here_are_all_there_are(name):
    fields = {field.name for field in dataclasses.fields(gym.make(name).unwrapped.scenario)}
    assert set(OPTIONS[name]) == fields | {"dtype"}


@pytest.mark.parametrize("name", IDS)
def test_channels_name_the_observation(name):
    env = gym.make(name)
    space = env.observation_space
    channels = env.unwrapped.channels
    assert space.shape == (len(channels),) and np.isfinite(space.low).all() and np.isfinite(space.high).all()
    assert len({c.name for c in channels}) == len(channels)
    np.testing.assert_array_equal(space.low, np.float32([c.low for c in channels]))


def each_option_and_pairs(name, compiled=True):
    """Each value alone, then few keyword sets among which every pair of values occurs, defaults included.

    Without ``compiled`` no pairs of what decides what is compiled, and that alone of one id a family.
    """
    options = {key: values for key, values in OPTIONS[name].items() if compiled or not decides_what_is_compiled(key)}
    yield from alone(options_of(name, compiled), OPTIONS[name])
    places = {
        key: range(len(values) + 1) for key, values in options.items()
    }  # the last one is the default, which wins ties: fewer kernels
    spots = [(key, place) for key in places for place in places[key]]
    missing = dict.fromkeys((a, b) for a, b in itertools.combinations(spots, 2) if a[0] != b[0])
    while missing:
        row = dict(next(iter(missing)))
        for key in [key for key in places if key not in row]:
            pairs = {
                place: sum((a, (key, place)) in missing or ((key, place), a) in missing for a in row.items())
                for place in places[key]
            }
            row[key] = max(reversed(pairs), key=pairs.__getitem__)
        missing = {(a, b): None for a, b in missing if row[a[0]] != a[1] or row[b[0]] != b[1]}
        yield {key: options[key][place] for key, place in row.items() if place < len(options[key])}


def test_every_pair_of_values_is_tried():
    for name in IDS:
        tried = [{key: repr(value) for key, value in chosen.items()} for chosen in each_option_and_pairs(name)]
        assert len(tried) - len([*alone(OPTIONS[name])]) < 40  # pairs of many options fit into few rows
        for (a, some), (b, others) in itertools.combinations(OPTIONS[name].items(), 2):
            for first, second in itertools.product([*map(repr, some), None], [*map(repr, others), None]):
                assert any(row.get(a) == first and row.get(b) == second for row in tried), (a, first, b, second)


@COMPILED_OR_NOT
@pytest.mark.parametrize("name", IDS)
def test_check_env_passes_for_each_option_alone_and_in_pairs(name, compiled):
    for chosen in each_option_and_pairs(name, compiled):
        try:
            checked(gym.make(name, **with_effect(name, chosen)))
        except Exception as error:
            raise AssertionError(f"{name} with {chosen}: {error}") from error


@COMPILED_OR_NOT
@pytest.mark.parametrize("name", IDS)
def test_stable_baselines_check_passes_for_each_option_alone_and_in_pairs(name, compiled):
    check = pytest.importorskip("stable_baselines3.common.env_checker").check_env
    for chosen in each_option_and_pairs(name, compiled):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check(gym.make(name, **with_effect(name, chosen)).unwrapped)


@COMPILED_OR_NOT
@pytest.mark.parametrize("name", IDS)
def test_specs_and_scenarios_round_trip_through_json(name, compiled):
    for chosen in alone(OPTIONS[name]):
        env = gym.make(name, **chosen)
        spec = EnvSpec.from_json(env.spec.to_json())
        twin = gym.make(spec)
        assert twin.unwrapped.scenario == env.unwrapped.scenario
        if options_of(name, compiled).keys() >= chosen.keys():
            np.testing.assert_array_equal(twin.reset(seed=1)[0], env.reset(seed=1)[0])
        scenario = env.unwrapped.scenario
        back = type(scenario).from_keywords(**json.loads(json.dumps(scenario.to_dict())))
        assert back == scenario and back.hash == scenario.hash


@pytest.mark.parametrize("name", IDS)
def test_the_hash_sees_every_option(name):
    """Scenarios are equal where their hashes are, and nowhere else; a value may be the default of another id."""
    scenario = lanekeep_env.ENVIRONMENTS[name].scenario
    found = [scenario()]
    for key, values in OPTIONS[name].items():
        if key != "dtype":
            found += [scenario(**{key: value}) for value in values]
    for first, second in itertools.combinations(found, 2):
        assert (first == second) == (first.hash == second.hash)


@pytest.mark.parametrize(
    "name", [name if name in FAMILIES else pytest.param(name, marks=pytest.mark.slow) for name in IDS]
)
def test_async_vector_env_works_after_a_threaded_call(name):
    """A child forked behind an OpenMP region must not touch it: single environments never do."""
    threaded = gym.make_vec(name, num_envs=1024, vectorization_mode="vector_entry_point", num_threads=2)
    threaded.reset(seed=0)
    threaded.step(threaded.action_space.sample())
    envs = gym.make_vec(name, num_envs=2, vectorization_mode="async")
    first, _ = envs.reset(seed=9)
    for _ in range(3):
        observation = envs.step(envs.action_space.sample())[0]
    envs.close()
    assert np.isfinite(observation).all()
    np.testing.assert_array_equal(first[1], gym.make(name).reset(seed=10)[0])
