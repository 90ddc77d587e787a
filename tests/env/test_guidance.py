"""What camera-guided cars are told: roads by other angles and round obstacles, plans with errors, set points."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env import CameraLaneScenario, TurnOffScenario
from lanekeep_env.roads import BypassRoads, TurnOffRoads


def make(name="TurnOff", cars=32, **keywords):
    settings = {"departure": "off", "autoreset_mode": "disabled", **keywords}
    return gym.make_vec(f"lanekeep/{name}-v0", cars, "vector_entry_point", **settings).unwrapped


def plans(env, observation):
    """Planned curvatures, (cars, samples)."""
    return observation[:, [k for k, c in enumerate(env.channels) if c.name.startswith("planned_curvature_")]]


# --- roads


def test_turns_have_the_angle_that_is_asked_for() -> None:
    """Curvature of the fourth segment times its length; everything else is as without an angle."""
    usual, wide = TurnOffRoads(count=8).build(), TurnOffRoads(count=8, smallest_angle=0.5, largest_angle=2.6).build()
    for ours, theirs in zip(wide, usual, strict=True):
        turn = abs(ours.curvature_start[3]) * ours.lengths[3]
        assert 0.5 <= turn <= 2.6 and abs(theirs.curvature_start[3]) * theirs.lengths[3] == pytest.approx(math.pi / 2)
        np.testing.assert_array_equal(ours.curvature_start, theirs.curvature_start)
        np.testing.assert_array_equal(ours.lengths[:3], theirs.lengths[:3])
        assert not ours.is_marked(ours.stations[3] + 0.5 * ours.lengths[3])


def test_a_bypass_swings_out_by_its_shift_and_back() -> None:
    for road in BypassRoads(count=16, smallest_shift=2.0, largest_shift=2.5).build():
        before, beside = road.stations[1], 0.5 * (road.stations[3] + road.stations[4])
        aside = road.position(np.array([before, beside, road.length]))[:, 1]
        assert aside[0] == pytest.approx(0.0, abs=1e-9) and aside[2] == pytest.approx(0.0, abs=1e-6)
        assert 2.0 <= aside[1] <= 2.5 and road.heading(beside) == pytest.approx(0.0, abs=1e-9)
        assert not road.is_marked(np.linspace(before + 0.1, road.stations[6] - 0.1, 20)).any()
        assert road.is_marked(before - 0.1) and road.is_marked(road.stations[6] + 0.1)


# --- plans


def drive_past(env, steps):
    """Stations of the rear axles and plans while cars roll straight on, (steps, cars) and (steps, cars, samples)."""
    which = np.arange(env.num_envs) % len(env.road_set())
    observation, info = env.reset(seed=0, options={"road_index": which, "lateral_error": 0.0})
    stations, seen = [np.array(info["arc_length"])], [plans(env, observation)]
    for _ in range(steps):
        observation, _, _, _, info = env.step(np.zeros((env.num_envs, 1), dtype=np.float32))
        stations.append(np.array(info["arc_length"])), seen.append(plans(env, observation))
    return np.array(stations), np.array(seen)


@pytest.mark.parametrize(
    ("offset", "radius", "angle"), [(1.5, 0.0, 0.0), (-2.0, 0.0, 0.0), (0.0, 0.2, 0.0), (0.7, -0.1, 0.15)]
)
def test_the_plan_has_bends_elsewhere_wider_and_longer(offset, radius, angle) -> None:
    """Against the geometry: an arc of (1 + radius) R over (1 + radius)(1 + angle) its length, offset metres later."""
    errors = {"offset": offset, "radius": radius, "angle": angle}
    env = make(cars=8, road={"kind": "turn-off", "count": 8}, speed=4.0, plan_errors=errors)
    stations, seen = drive_past(env, 350)
    roads = [road for road, _ in env.road_set()]
    for car, road in enumerate(roads):
        ahead = stations[:, car, None] + 0.5 * np.arange(seen.shape[2])
        expected = np.zeros_like(ahead)
        for arc in (1, 3):
            start, length = road.stations[arc] + offset, road.lengths[arc] * (1.0 + radius) * (1.0 + angle)
            inside = (ahead >= start) & (ahead < start + length)
            expected[inside] = road.curvature_start[arc] / (1.0 + radius)
        close = np.isclose(seen[:, car], expected, atol=1e-6)
        assert close.mean() > 0.999  # a sample on a border may fall to either side


def test_a_late_plan_knows_a_bend_only_from_where_it_is_recognised() -> None:
    env = make(cars=8, road={"kind": "turn-off", "count": 8}, speed=4.0, plan_errors={"recognised": 3.0})
    stations, seen = drive_past(env, 250)
    for car, (road, _) in enumerate(env.road_set()):
        left = road.stations[1] - stations[:, car]
        known = np.abs(seen[:, car]).max(axis=1) > 0.0
        assert not known[left > 3.05].any() and known[(left < 2.95) & (left > 0.0)].all()


def test_errors_are_drawn_between_their_bounds_and_right_plans_are_those_without_the_option() -> None:
    env = make(cars=64, speed=4.0, plan_errors={"offset": (-1.0, 1.0)}, road={"kind": "turn-off", "count": 1})
    stations, seen = drive_past(env, 200)
    (road, _) = env.road_set()[0]
    first = np.array([stations[np.argmax(np.abs(seen[:, car, 0]) > 0.0), car] for car in range(64)]) - road.stations[1]
    assert first.min() < -0.7 and first.max() > 0.7 and np.all(np.abs(first) < 1.2)
    exact, usual = make(cars=4, plan_errors={"offset": 0.0, "angle": 1e-12}), make(cars=4)
    a, b = exact.reset(seed=5)[0], usual.reset(seed=5)[0]
    np.testing.assert_allclose(a, b, atol=1e-7)
    assert not TurnOffScenario().told_more and exact.scenario.told_more


# --- set points


@pytest.mark.parametrize("edge", ["right", "left"])
def test_set_points_are_a_channel_a_command_and_what_the_cost_counts_from(edge: str) -> None:
    points = {"minimum": 1.0, "maximum": 2.0, "hold": 0.4}
    env = make("CameraLane", cars=64, road="straight", speed=4.0, set_points=points, camera={"edge": edge})
    s = env.scenario
    place, side = s.column("set_distance"), 1.0 if edge == "right" else -1.0
    observation, _ = env.reset(seed=1)
    told = [observation[:, place]]
    for step in range(60):
        observation, reward, _, _, info = env.step(np.zeros((64, 1), dtype=np.float32))
        # The set point of this step is the one that was in force while it was driven, drawn at its begin.
        off = info["lateral_error"] - side * (observation[:, place] - 1.5)
        cost = np.minimum(16.0, (off / s.reference_lateral_error) ** 2 + (info["steering_rate"] / 0.2) ** 2)
        np.testing.assert_allclose(reward, -0.04 * cost, atol=1e-6)
        changed = observation[:, place] != told[-1]
        assert changed.all() if step > 0 and step % 10 == 0 else not changed.any()
        told.append(observation[:, place])
    drawn = np.unique(np.array(told))
    assert drawn.min() > 1.0 and drawn.max() < 2.0 and np.mean(drawn) == pytest.approx(1.5, abs=0.06)


def test_a_number_is_a_set_point_for_ever_and_none_no_channel() -> None:
    env = make("CameraLane", cars=2, set_points=1.2)
    observation, _ = env.reset(seed=0)
    assert observation[:, env.scenario.column("set_distance")] == pytest.approx(1.2)
    assert CameraLaneScenario().column("set_distance") == -1


def test_wrong_plans_and_set_points_are_named_in_one_line() -> None:
    for keywords, words in (
        ({"plan_errors": {"offsets": 1.0}}, ["offset"]),
        ({"plan_errors": {"radius": -1.0}}, ["plan_errors.radius=-1.0", ">= -0.9"]),
        ({"plan_errors": 3.0}, ["plan_errors=3.0", "mapping"]),
        ({"set_points": {}}, ["set_points lacks the field 'minimum'"]),
        ({"set_points": 4.0}, ["set_points.maximum", "<= 3.0 m"]),
        ({"set_points": {"minimum": 1.0, "maximum": 2.0, "hold": 0.05}}, ["set_points.hold=0.05", "multiple"]),
        ({"plan": 0, "plan_errors": {"offset": 1.0}}, ["plan_errors", "no plan"]),
        ({"road": {"kind": "bypass", "smallest_radius": 0.5}}, ["road.smallest_radius=0.5"]),
        ({"road": {"kind": "turn-off", "largest_angle": 4.0}}, ["road.largest_angle=4.0", "<= 3.14"]),
        ({"road": {"kind": "turn-off", "smallest_angle": 2.0}}, ["road.smallest_angle=2.0", "road.largest_angle=1.57"]),
        ({"set_points": (1.2, 1.8)}, ["set_points=(1.2, 1.8)", "a number in m", "'minimum'", "'maximum'"]),
        ({"set_points": {"minimum": 1.2}}, ["set_points lacks the field 'maximum'", "minimum, maximum, hold"]),
        ({"set_points": {"minimum": 1.9, "maximum": 1.2}}, ["set_points.minimum=1.9", "set_points.maximum=1.2"]),
    ):
        with pytest.raises((ValueError, TypeError)) as caught:
            CameraLaneScenario.from_keywords(**keywords)
        text = str(caught.value)
        assert "\n" not in text and all(word in text for word in words), text
