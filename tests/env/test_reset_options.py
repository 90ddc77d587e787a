"""What reset says of the episodes to come: numbers of the car, within the bounds that the scenario declares."""

import functools
import inspect
import re

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env

ID = "lanekeep/LaneKeep-v0"
DECLARED = {"mass": (0.8, 1.4), "friction": (0.4, 1.0), "speed": (0.5, 1.0), "steering_delay": (0.0, 0.1)}
TASK = {"tyre": "magic_formula", "road": "straight", "speed": 20.0, "randomisation": DECLARED}


def cars(n=16, **keywords):
    return gym.make_vec(ID, n, "vector_entry_point", **{**TASK, **keywords})


def test_what_is_fixed_is_driven_and_stays_until_reset_says_otherwise():
    """On a straight road with a constant speed the car's speed is the factor times that."""
    env = cars(8, episode_steps=5)
    _, info = env.reset(seed=0, options={"speed": 0.75})
    np.testing.assert_allclose(info["speed"], 15.0)
    for _ in range(12):  # into the third episode
        *_, info = env.step(np.zeros((8, 1), np.float32))
        np.testing.assert_allclose(info["speed"], 15.0)
    _, info = env.reset()
    np.testing.assert_allclose(info["speed"], 15.0)
    _, info = env.reset(options={"randomisation": None})
    assert len(set(info["speed"])) == 8 and (info["speed"] <= 20.0).all() and (info["speed"] >= 10.0).all()


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 1.0), st.floats(0.0, 1.0), st.integers(0, 2**31))
def test_draws_stay_within_the_narrowed_bounds(low, share, seed):
    high = low + share * (1.0 - low)
    _, info = cars().reset(seed=seed, options={"randomisation": {"speed": (low, high)}})
    assert (info["speed"] >= 20.0 * low - 1e-9).all() and (info["speed"] <= 20.0 * high + 1e-9).all()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_an_option_leaves_what_others_said_as_it_is(dtype):
    env = cars(8, dtype=dtype, randomisation={"mass": (0.7, 1.4), "speed": (0.5, 1.0)})
    env.reset(seed=0, options={"speed": 0.75})
    for options in ({"mass": 1.1}, {"mass": (0.7, 1.4)}, {}, None):
        _, info = env.reset(options=options)
        np.testing.assert_allclose(info["speed"], 15.0)
    _, info = env.reset(options={"randomisation": {"mass": 1.1}})  # which says all of it
    assert len(set(info["speed"])) == 8


def test_a_fixed_number_drives_like_a_scenario_that_has_it():
    """The other draws of an episode do not depend on it."""
    whole, fixed = {**DECLARED, "mass": 1.3}, cars(randomisation={**DECLARED, "mass": (1.3, 1.3)})
    told = cars()
    first, _ = fixed.reset(seed=4)
    second, _ = told.reset(seed=4, options={"mass": whole["mass"]})
    np.testing.assert_array_equal(first, second)
    for _ in range(30):
        action = fixed.action_space.sample()
        np.testing.assert_array_equal(fixed.step(action)[0], told.step(action)[0])


def test_the_same_words_fix_a_single_car_and_cars_between_walls():
    env = gym.make(ID, **TASK)
    _, info = env.reset(seed=0, options={"speed": 0.5, "road": 0, "lateral_error": 0.3})
    assert info["speed"] == 10.0 and info["lateral_error"] == 0.3
    env = gym.make("lanekeep/WallFollow-v0", speed=1.0, randomisation={"speed": (0.2, 1.0)})
    _, info = env.reset(seed=0, options={"speed": 0.4, "world": 0})
    assert info["speed"] == pytest.approx(0.4)


@pytest.mark.parametrize("form", ["vector_entry_point", "sync", "async"])
def test_a_curriculum_in_every_form(form):
    """Cars in the middle of an episode end it as it is; the next ones are within the new bounds."""
    env = gym.make_vec(ID, 2, form, **TASK, episode_steps=3)
    narrow = functools.partial(env.call, "narrow") if hasattr(env, "call") else env.unwrapped.narrow
    _, info = env.reset(seed=0, options={"speed": 0.9})
    seen = [info["speed"]]
    for step in range(8):
        if step == 1:
            narrow({"speed": 0.6})
        seen.append(env.step(np.zeros((2, 1), np.float32))[4]["speed"])
    env.close()
    np.testing.assert_allclose(seen[:4], 18.0)
    np.testing.assert_allclose(seen[4:], 12.0)


@pytest.mark.parametrize("env_id", sorted(lanekeep_env.ENVIRONMENTS))
def test_the_pages_have_the_options_that_are_taken(env_id):
    env = gym.make(env_id).unwrapped
    page = inspect.getdoc(env).partition("## Reset Options")[2].partition("##")[0]
    listed = re.findall(r"^\* (\w+):", page, re.MULTILINE)
    with pytest.raises(ValueError, match="unknown; allowed: ") as error:
        env.reset(options={"x": 0})
    assert set(listed) == set(str(error.value).partition("allowed: ")[2].split(", "))


def test_the_default_is_untouched():
    told, plain = cars(), cars()
    np.testing.assert_array_equal(told.reset(seed=3, options={"randomisation": {}})[0], plain.reset(seed=3)[0])


def test_a_state_keeps_the_bounds():
    env = cars(episode_steps=5)
    env.reset(seed=0, options={"speed": (0.5, 0.6)})
    other = cars(episode_steps=5)
    other.reset(seed=9)
    other.set_state(env.unwrapped.get_state())
    for _ in range(14):
        action = env.action_space.sample()
        np.testing.assert_array_equal(env.step(action)[0], other.step(action)[0])
    state = env.unwrapped.get_state()
    state["ranges"][:2] = 0.1, 3.0
    with pytest.raises(ValueError, match="within the scenario's randomisation"):
        env.unwrapped.set_state(state)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"friction": 0.2}, ["friction=0.2", "0.4 to 1", "declared when the environment is made"]),
        ({"friction": (0.3, 0.9)}, ["friction=(0.3, 0.9)", "0.4 to 1"]),
        ({"mass": [1.2, 0.9]}, ["mass", "low <= high"]),
        ({"cg_shift": 0.1}, ["cg_shift=0.1", "0 to 0"]),
        ({"randomisation": "stress"}, ["must be within"]),
        ({"randomisation": {"mas": 1.0}}, ["mas", "mass"]),
        ({"mas": 1.0}, ["'mas' is unknown", "mass"]),
        ({"mass": 1.6}, ["mass=1.6", "0.8 to 1.4 (a factor of the nominal value)"]),
        ({"steering_delay": 0.2}, ["steering_delay=0.2", "0 to 0.1 s"]),
        ({"road": 0, "road_index": 0}, ["'road_index' and 'road' are one"]),
        ({"mass": float("nan")}, ["mass", "finite"]),
        ({"randomisation": 3}, ["must be"]),
        ([("mass", 1.0)], ["must be a mapping"]),
        ({"mass": (0.9, 1.0, 1.1)}, ["mass=(0.9, 1.0, 1.1)", "(low, high) or one number"]),
        ({"mass": None}, ["mass=None", "(low, high) or one number"]),
        ({"lateral_error": -20.5}, ["lateral_error=-20.5", "within 20 m"]),
        ({"heading_error": 4}, ["heading_error=4", "within pi rad"]),
        ({"lateral_error": "1"}, ["lateral_error='1'", "must be a number"]),
        ({"road": True}, ["road_index=True", "must be a number"]),
        ({"road": 1}, ["road_index=1 ", "from 0 to 0"]),
        ({"road": 0.5}, ["road_index=0.5", "whole number"]),
        ({"arc_length": -5}, ["arc_length=-5 ", "must be from 0 to"]),
        ({"arc_length": 1e9}, ["arc_length=1000000000 ", "must be from 0 to"]),
    ],
    ids=str,
)
@pytest.mark.parametrize("vector", [False, True])
def test_what_is_not_allowed_is_one_line_and_changes_nothing(vector, options, words):
    env = cars(2, episode_steps=3) if vector else gym.make(ID, **TASK)
    env.reset(seed=1, options={"mass": 1.1})
    before = env.unwrapped._core.ranges.copy()
    with pytest.raises(ValueError) as error:
        env.reset(options=options)
    assert "\n" not in str(error.value)
    for word in words:
        assert word in str(error.value)
    np.testing.assert_array_equal(env.unwrapped._core.ranges, before)


def test_what_has_no_effect_is_refused():
    env = gym.make(ID, randomisation="mismatch")  # linear tyres do not know friction, and the set is taken all the same
    with pytest.raises(ValueError, match=r"friction=0\.8 has no effect"):
        env.reset(options={"friction": 0.8})
    env.reset(options={"mass": 1.1, "randomisation": "nominal"})
