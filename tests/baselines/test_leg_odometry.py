"""Which way round a circuit goes, by odometry: laps, cars that turn round, and no corridor that is left by swerving."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lanekeep_baselines.leg_odometry import LegOdometer, Way, wrapped

CORRIDOR, BODY = 2.0, 0.265
STEP = 0.05


def follow(ways: np.ndarray, turns: np.ndarray, seen: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Headings from the way along the leg, rad, and exits after each step of (steps,) ways and turns."""
    odometer, memory = LegOdometer(BODY), np.zeros((1, len(Way._fields)))
    true, headings, exits = 0.0, [], []
    for k, (way, turned) in enumerate(zip(ways, turns, strict=True)):
        true += turned
        measured, width = np.array([true if seen else np.nan]), np.array([0.0 if k else CORRIDOR])
        found, left = odometer.update(memory, k == 0, np.array([way]), np.array([turned]), measured, width, 0.0 * width)
        memory = np.stack(found, axis=1)
        headings.append(found.heading[0])
        exits.append(left[0])
    return np.array(headings), np.array(exits)


def path(*pieces: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Steps of pieces: (way, m; turn, rad) each, arcs of one radius of 0.9 m where the way is 0."""
    ways, turns = [], []
    for way, turn in pieces:
        way = way or 0.9 * abs(turn)
        count = round(way / STEP)
        ways += [way / count] * count
        turns += [turn / count] * count
    return np.array(ways), np.array(turns)


CORNER = 0.5 * np.pi


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("seen", [False, True])
def test_a_lap_leaves_four_legs_on_the_inner_side(side: float, seen: bool) -> None:
    headings, exits = follow(*path((4.0, 0.0), *[(0.0, side * CORNER), (7.0, 0.0)] * 4), seen)
    np.testing.assert_array_equal(exits[exits != 0.0], [side] * 4)
    assert abs(headings[-1]) < 1e-9


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("turn", [-1.0, 1.0])
def test_who_turns_round_drives_the_wrong_way_through_corners_until_turned_back(side: float, turn: float) -> None:
    """A three-point turn stays within the corridor, whichever way it turns."""
    round_ = [(0.5, turn * np.pi / 3), (-0.5, turn * np.pi / 3), (0.5, turn * np.pi / 3)]
    to = path((4.0, 0.0), (0.0, side * CORNER), (5.0, 0.0), *((abs(way), angle) for way, angle in round_))
    back = to[0].copy()
    back[-20:-10] *= -1.0
    headings, exits = follow(np.append(back, 4 * [STEP]), np.append(to[1], np.zeros(4)))
    assert exits.sum() == side and abs(wrapped(headings[-1:] - np.pi)[0]) < 1e-9
    # On through the corner that it came from, and turned round there.
    wrong = path((6.0, 0.0), (0.0, -side * CORNER), (3.0, 0.0))
    ways, turns = np.concatenate([back, wrong[0]]), np.concatenate([to[1], wrong[1]])
    headings, exits = follow(ways, turns)
    np.testing.assert_array_equal(exits[exits != 0.0], [side, side])
    assert abs(wrapped(headings[-1:] - np.pi)[0]) < 1e-9
    headings, _ = follow(np.concatenate([ways, back[-30:]]), np.concatenate([turns, to[1][-30:]]))
    assert abs(headings[-1]) < 1e-9


@given(st.lists(st.floats(-0.3, 0.3), min_size=20, max_size=200), st.floats(-0.8, 0.8))
def test_no_drive_within_a_corridor_leaves_it(turns: list[float], start: float) -> None:
    """Turns that would take the centre nearer to a wall than half a body are turned over."""
    y, heading, kept, room = start, 0.0, [], 0.5 * (CORRIDOR - BODY)
    for turn in turns:
        if abs(y + STEP * np.sin(heading + turn)) > room:
            turn = wrapped(np.array([-2.0 * heading - turn]))[0] + turn  # the direction mirrored
        heading += turn
        y += STEP * np.sin(heading)
        kept.append(turn)
    headings, exits = follow(np.full(len(kept), STEP), np.array(kept))
    assert not exits.any()
    assert abs(wrapped(headings[-1:] - heading)[0]) < 1e-9


@pytest.mark.parametrize("known", [True, False])
def test_no_bend_of_a_corridor_turns_a_car_round(known: bool) -> None:
    """Cars sway along straights and bends of 1.9 to 20 m radius, both walls beside: their way on is always ahead."""
    cars, steps, rng = 200, 1500, np.random.default_rng(0)
    bend = np.zeros((steps, cars))
    for k in range(cars):
        at = 0
        while at < steps:
            at += int(rng.uniform(0.0, 15.0) / STEP)
            radius, turn = np.exp(rng.uniform(np.log(1.9), np.log(20.0))), rng.uniform(0.1, 3.0)
            end = at + round(turn * radius / STEP)
            bend[at:end, k] = rng.choice([-1.0, 1.0]) / radius
            at = end
    way = STEP * np.arange(steps)[:, None]
    off = 0.3 * np.sin(way * rng.uniform(0.1, 0.6, cars) + rng.uniform(0.0, 6.0, cars))
    along = np.arctan(np.gradient(off, STEP, axis=0))
    turned = np.diff(np.cumsum(bend * STEP, axis=0) + along, axis=0, prepend=along[:1])
    odometer, memory = LegOdometer(BODY), np.zeros((cars, len(Way._fields)))
    for k in range(steps):
        seen = along[k] + (rng.normal(0.0, 0.03, cars) if known else np.nan)
        sides = 0.5 * CORRIDOR + off[k], 0.5 * CORRIDOR - off[k]
        found, _ = odometer.update(memory, k == 0, np.full(cars, STEP), turned[k], seen, *sides)
        memory = np.stack(found, axis=1)
        assert np.abs(found.heading).max() < 0.5 * CORNER
