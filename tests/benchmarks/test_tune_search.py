"""What `lanekeep tune` tries: ranges, a known optimum, and nothing but the history behind it."""

import math

import pytest

from lanekeep_benchmarks.tune.search import suggest
from lanekeep_benchmarks.tune.space import Range, Space, is_learned, space_of
from lanekeep_env import ENVIRONMENTS

#: The optimum is known: gain 0.5, offset 0.3, and 64.
SPACE = Space(
    {"gain": Range(0.01, 10.0), "offset": Range(0.0, 1.0, log=False), "size": Range(choices=(16, 64, 256))},
    {"gain": 0.02, "offset": 0.9, "size": 16},
)


def _quadratic(values):
    return -(math.log10(values["gain"] / 0.5) ** 2) - 4.0 * (values["offset"] - 0.3) ** 2 - 0.3 * (values["size"] != 64)


def _searched(trials, seed, score=_quadratic):
    history = []
    for _ in range(trials):
        values = suggest(SPACE, history, seed)
        history.append((values, score(values)))
    return history


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_known_optimum_is_found(seed):
    """What is near enough is a 200th of the space: of 60 trials by chance one would be in one search of four."""
    values, score = max(_searched(60, seed), key=lambda one: one[1])
    assert values["size"] == 64
    assert abs(math.log10(values["gain"] / 0.5)) < 1.0 / 7.0
    assert abs(values["offset"] - 0.3) < 0.08
    assert score == _quadratic(values)


def test_what_is_tried_hangs_on_the_history_alone():
    whole = _searched(14, 5)
    assert whole[0][0] == SPACE.start
    for done in (1, 9, 13):  # as after a kill
        assert suggest(SPACE, whole[:done], 5) == whole[done][0]
    assert suggest(SPACE, whole[:9], 6) != whole[9][0]
    for values, _ in whole:
        assert set(values) == set(SPACE.ranges)
        assert all(SPACE.ranges[name].holds(value) for name, value in values.items())


def test_trials_that_failed_are_left_behind():
    history = _searched(20, 0, lambda values: None if values["offset"] > 0.5 else _quadratic(values))
    assert sum(score is None for _, score in history) >= 1
    assert len({tuple(values.values()) for values, _ in history}) == 20


@pytest.mark.parametrize("policy", ["pd", "stanley", "pure-pursuit", "pure-pursuit-understeer", "mpc-preview", "lqg"])
def test_controllers_start_within_their_ranges(policy):
    space = space_of(policy, "lanekeep/LaneKeep-v0")
    assert space.ranges and all(one.holds(space.start[name]) for name, one in space.ranges.items())


@pytest.mark.parametrize("algorithm", ["ppo", "sac", "td3"])
def test_hyper_parameters_start_within_their_ranges_on_every_id(algorithm):
    assert is_learned(algorithm)
    for env_id in ENVIRONMENTS:
        space = space_of(algorithm, env_id)
        assert space.start.keys() == space.ranges.keys()
        wrong = [name for name, one in space.ranges.items() if not one.holds(space.start[name])]
        assert not wrong, (env_id, wrong)
        # Whose cost has no such term has none to search.
        charges = "cost_weight" not in _without_effect(env_id)
        assert ("env.cost_weight" in space.ranges) == charges, env_id


def _without_effect(env_id):
    """Keywords that an environment refuses, as `gym.make` tells it."""
    import gymnasium as gym

    try:
        gym.make(env_id, cost_weight=2.0)
    except (TypeError, ValueError) as error:
        return str(error)
    return ""
