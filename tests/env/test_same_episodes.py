"""The comparison of two checkouts' episodes sees what differs, and how much."""

import importlib
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def comparing(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1]))
    return importlib.import_module("side_by_side.compare")


def test_an_id_that_the_old_checkout_lacks_is_no_difference_and_one_that_is_gone_is(comparing, monkeypatch):
    same_episodes = importlib.import_module("same_episodes")
    answers = {"new": ("NameNotFound: no `Mine`", {}), "gone": ({}, "NameNotFound: no `Mine`"), "equal": ({}, {})}
    monkeypatch.setattr(same_episodes, "both", lambda old, new, case: answers[case])
    findings = same_episodes.Findings()
    for case in answers:
        same_episodes.judge(case, None, None, findings)
    assert findings.count == {"new id": 1, "different": 1, "equal": 1}
    assert "1 of ids that old has not" in findings.summary()


def neighbour(value, steps):
    for _ in range(steps):
        value = np.nextafter(value, value.dtype.type(np.inf))
    return value


def record(columns, dtype="float64", seed=0):
    rng = np.random.default_rng(seed)
    steps = np.arange(101)
    return {
        "observation": (steps, rng.normal(size=(101, columns, 4)).astype(dtype)),
        "reward": (steps[1:], rng.normal(size=(100, columns))),
        "terminated": (steps[1:], rng.random((100, columns)) < 0.1),
        "reset.observation": (np.array([7, 30]), rng.normal(size=(2, columns, 4))),
    }


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_ulps_counts_neighbours(comparing, dtype):
    rng = np.random.default_rng(1)
    tiny = np.finfo(dtype).smallest_subnormal
    starts = [*(rng.normal(size=50) * 10.0 ** rng.integers(-30, 30, 50)), 0.0, -tiny, -2 * tiny, -1.0, 1.0]
    for start in np.array(starts, dtype=dtype):
        for steps in (0, 1, 3, 17):
            pair = np.array([start]), np.array([neighbour(start, steps)])
            assert comparing.ulps(*pair) == comparing.ulps(*pair[::-1]) == steps
    zeros = np.zeros(1, dtype)
    assert comparing.ulps(zeros, -zeros) == 1
    assert comparing.ulps(zeros, zeros * np.nan) == np.inf
    assert comparing.ulps(zeros * np.nan, zeros * np.nan) == 0
    assert comparing.ulps(-np.ones(1, dtype) * np.inf, np.ones(1, dtype) * np.inf) > 2**30


@pytest.mark.parametrize("columns", [1, 5])
@pytest.mark.parametrize("steps", [1, 4, 5, 1000])
def test_one_changed_number_is_found(comparing, columns, steps):
    old, new = record(columns), record(columns)
    assert comparing.compare(old, new, columns) is None
    _, values = new["reward"]
    values[41, -1] = neighbour(values[41, -1], steps)
    found = comparing.compare(old, new, columns)
    assert (found.quantity, found.others, found.step, found.ulp) == ("reward", 0, 42, steps)
    assert found.last_bit == (steps <= 4)
    values[42:, -1] += 1.0  # what follows from it
    assert comparing.compare(old, new, columns).last_bit == (steps <= 4)
    if columns > 1:
        values[60, 0] += 1e-9  # in a car that was equal until then
        assert not comparing.compare(old, new, columns).last_bit


def test_ends_types_and_missing_rows_are_differences(comparing):
    old = record(3)
    flipped, single, short = record(3), record(3, "float32"), record(3)
    flipped["terminated"][1][9, 2] ^= True
    short["reset.observation"] = tuple(rows[:1] for rows in short["reset.observation"])
    for new, quantity, step in (
        (flipped, "terminated", 10),
        (single, "observation", 0),
        (short, "reset.observation", 30),
    ):
        found = comparing.compare(old, new, 3)
        assert (found.quantity, found.step, found.last_bit) == (quantity, step, False)
    # A row more after an end that differs by the last bit is its consequence.
    short["reward"][1][5, 0] = neighbour(short["reward"][1][5, 0], 1)
    assert comparing.compare(old, short, 3).last_bit
