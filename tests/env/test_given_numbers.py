"""Numbers that are handed in: what no float can hold is refused in one line wherever it is put, and so are states."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_env
from lanekeep_env import layout as at

IDS = sorted(lanekeep_env.ENVIRONMENTS)
HUGE = 10**400


def refusal(call):
    """The one short line that refuses."""
    with pytest.raises((ValueError, gym.error.Error)) as error:
        call()
    text = str(error.value)
    assert text and "\n" not in text and len(text) < 1500
    return text


def places(scenario):
    """Every keyword of a scenario, and every field of the records in it."""
    for field in (field for field in fields(scenario) if field.init):
        yield (field.name,)
        value = getattr(scenario, field.name)
        if is_dataclass(value):
            for inner in (inner for inner in fields(value) if inner.init):
                yield field.name, inner.name
                deepest = getattr(value, inner.name)
                if is_dataclass(deepest):
                    yield from ((field.name, inner.name, last.name) for last in fields(deepest) if last.init)


@pytest.mark.parametrize("env_id", IDS)
def test_a_number_of_400_digits_is_refused_in_every_keyword(env_id):
    scenario = gym.make(env_id).unwrapped.scenario
    found = 0
    for place in places(scenario):
        for value in (HUGE, [HUGE, HUGE], (0, HUGE)):
            given = value
            for name in reversed(place[1:]):
                given = {name: given}
            refusal(lambda given=given, name=place[0]: type(scenario).from_keywords((), **{name: given}))
            found += 1
    assert found > 100


def test_a_sensor_of_400_digits_is_refused():
    for field in ("noise", "bias", "period", "dropout"):
        assert "400 digits" in refusal(
            lambda field=field: gym.make("lanekeep/LaneKeep-v0", sensors={"yaw_rate": {field: HUGE}})
        )


@pytest.mark.parametrize("number", [HUGE, 10**12, 0, -1, 1.5, "3", True])
def test_a_number_of_cars_is_bounded(number):
    make = {"vectorization_mode": "vector_entry_point"}
    assert "num_envs=" in refusal(lambda: gym.make_vec("lanekeep/LaneKeep-v0", num_envs=number, **make))


@pytest.mark.parametrize("env_id", ["lanekeep/LaneKeep-v0", "lanekeep/WallFollow-v0"])
def test_seeds_are_whole_numbers_however_large(env_id):
    one = gym.make(env_id)
    many = gym.make_vec(env_id, num_envs=2, vectorization_mode="vector_entry_point")
    for seed in (HUGE, 2**64, np.int64(5), 0):
        first, _ = one.reset(seed=seed)
        cars, _ = many.reset(seed=seed)
        np.testing.assert_array_equal(cars[0], first)
        np.testing.assert_array_equal(many.reset(seed=[seed, None])[0][0], first)
    for seed in (-1, -HUGE, 1.5, float("nan"), "a", "12"):
        refusal(lambda seed=seed: one.reset(seed=seed))
        refusal(lambda seed=seed: many.reset(seed=seed))
        refusal(lambda seed=seed: many.reset(seed=[1, seed]))
    options = ("lateral_error", "heading_error", "world_index" if hasattr(one.unwrapped, "world_set") else "road_index")
    for name in options:
        for value in (HUGE, float("inf"), "x" * 100_000, [[1.0]] * 3):
            assert name in refusal(lambda name=name, value=value: one.reset(options={name: value}))
            assert name in refusal(lambda name=name, value=value: many.reset(options={name: value}))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("env_id", IDS)
def test_states_of_drives_are_taken_and_others_refused(env_id, dtype):
    """What `get_state` gives goes in again at any time; damaged states are refused, or driven on without a crash."""
    make = {"vectorization_mode": "vector_entry_point", "randomisation": "stress", "max_episode_steps": 40}
    env = gym.make_vec(env_id, num_envs=5, dtype=dtype, **make)
    cars, rng = env.unwrapped, np.random.default_rng(0)
    env.reset(seed=1)
    for _ in range(100):
        cars.set_state(cars.get_state())
        env.step(rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32))
    good, refused = cars.get_state(), 0
    driven = isinstance(cars.scenario, lanekeep_env.DriveScenario | lanekeep_env.TrafficScenario)
    values = [np.nan, np.inf, -np.inf, -1.0, 1e4, 1e9, 1e30, -1e30, 0.5]
    for _ in range(2 * at.CAR_ROWS):  # each row twice on average, most of which belong to others
        state = {name: array.copy() for name, array in good.items()}
        state["cars"][0, rng.integers(at.CAR_ROWS), rng.integers(5)] = rng.choice(values)
        refused += taken(cars, state)
    for row, size in ((at.SEGMENT, 10**6), (at.ROAD, 10**6), (at.TIMELINE, 10**6)):
        for value in (-1, size, 2**62, -(2**63)):
            state = {name: array.copy() for name, array in good.items()}
            state["counters"][row, 2] = value
            used = row != at.TIMELINE or driven
            assert taken(cars, state) == used
    assert refused > 10


def taken(cars, state):
    """Set a state and drive on; whether it was refused, which leaves the cars as they were."""
    before = cars.get_state()
    try:
        cars.set_state(state)
    except ValueError as error:
        assert str(error).startswith("state") and "\n" not in str(error)
        for name, array in cars.get_state().items():
            np.testing.assert_array_equal(array, before[name])
        return True
    for _ in range(2):
        cars.step(np.zeros(cars.action_space.shape, dtype=np.float32))
    return False


@pytest.mark.parametrize("given", [float("nan"), "", "a\nb", [1], "x" * 10_000])
def test_a_powertrain_has_a_name_of_one_line(given):
    assert "powertrain.name=" in refusal(lambda: gym.make("lanekeep/Drive-v0", powertrain={"name": given}))
