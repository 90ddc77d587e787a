"""Set positions (x(t), y(t)) along a path, braking while swerving: closed forms, kinematics, and friction."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.werling_longitudinal import (
    Grip,
    LongitudinalTuning,
    SetPosition,
    emergency_law,
    gap_law,
    position_law,
)

SPEED, STEP, GRAVITY = 55.0 / 3.6, 0.02, 9.81


def swerved(ahead: float, braking: float, seconds: float, **keywords) -> dict[str, np.ndarray]:
    """Drive the evasive path behind a set position that brakes from 0.6 s on, down to 5 m/s."""
    events = [(0, "speed", SPEED), (0, "position", ahead, SPEED), (0.6, "position_speed", 5.0, braking)]
    start = {"lateral_error": keywords.pop("lateral", 0.0), "heading_error": 0.0, "arc_length": 0.0, "road_index": 0}
    env = gym.make(
        "lanekeep/Drive-v0", road={"kind": "evasive", "side": "left"}, traffic=events, slope=0.0, wind=0.0,
        observation="full", departure="off", **keywords,
    )  # fmt: skip
    scenario = env.unwrapped.scenario
    policy = lanekeep_baselines.make("werling-drive", scenario)
    observation, info = env.reset(seed=0, options=start)
    state, rows, places = None, [observation], [info["arc_length"]]
    for k in range(round(seconds / STEP)):
        action, state = policy.predict(observation, state, np.array(k == 0))
        observation, *_, info = env.step(action)
        rows.append(observation), places.append(info["arc_length"])
    table = np.array(rows, dtype=float)
    return {c.name: table[:, k] for k, c in enumerate(scenario.channels)} | {"place": np.array(places)}


def test_the_law_alone_decays_as_the_lateral_one() -> None:
    """s_p - s of a double integrator under the law, in small steps, beside (1 + omega t) exp(-omega t)."""
    tuning, h, gap, closing = LongitudinalTuning(tracking=1.3), 1e-4, 2.0, 0.0
    for k in range(30_000):
        at = SetPosition(*(np.array([x]) for x in (gap, 12.0, -3.0, 1.0)))
        a = float(position_law(tuning, np.array([12.0 - closing]), at)[0])
        gap, closing = gap + h * closing, closing + h * (-3.0 - a)
        if k % 5000 == 0:
            time = 1.3 * h * (k + 1)
            assert gap == pytest.approx(2.0 * (1.0 + time) * np.exp(-time), abs=1e-3)
    none = SetPosition(*(np.array([x]) for x in (np.inf, 0.0, 0.0, 1.0)))
    assert position_law(tuning, np.array([9.0]), none) == 0.0


def test_the_set_position_moves_as_it_is_told() -> None:
    """Way to it = its own place, integrated here, minus the car's on the road."""
    seen = swerved(3.0, 4.0, 6.0)
    time = STEP * np.arange(len(seen["place"]))
    braked = np.clip(time - 0.6, 0.0, (SPEED - 5.0) / 4.0)
    place = 3.0 + SPEED * time - 2.0 * braked**2 - (SPEED - 5.0) * np.maximum(time - 0.6 - (SPEED - 5.0) / 4.0, 0.0)
    assert seen["position_gap"] == pytest.approx(place - seen["place"], abs=0.02)
    assert seen["position_speed"] == pytest.approx(SPEED - 4.0 * braked, abs=1e-3)
    assert set(np.round(seen["position_acceleration"], 2)) >= {0.0, -4.0}


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_backwards_the_way_to_the_set_position_grows_and_it_is_reached_forwards(dtype: str) -> None:
    """A standing one, 10 m ahead of a car that reverses: the way to it is 10 m less what the car goes on the road."""
    events, start = [(0, "speed", -5), (1, "position", 10, 0)], {"lateral_error": 0.0, "heading_error": 0.0}
    env = gym.make("lanekeep/Drive-v0", road="straight", traffic=events, slope=0.0, wind=0.0, dtype=dtype)
    policy = lanekeep_baselines.make("werling-drive", env.unwrapped.scenario)
    names = [c.name for c in env.unwrapped.scenario.channels]
    columns = [names.index(name) for name in ("position_gap", "gear")]
    observation, info = env.reset(seed=0, options=start)
    state, rows = None, []
    for k in range(1500):
        action, state = policy.predict(observation, state, np.array(k == 0))
        observation, *_, info = env.step(action)
        rows.append([*observation[columns], info["arc_length"]])
    gap, gear, place = np.array(rows, dtype=float)[50:].T
    before = rows[49][2]
    assert gap == pytest.approx(10.0 - (place - before), abs=0.02 if dtype == "float64" else 0.05)
    assert gap.max() > 12.0 and abs(gap[-1]) < 0.1
    assert gear[0] == -1.0 and gear[-1] >= 0.0 and (np.diff(gear < 0.0).sum() == 1)


def test_both_errors_follow_their_closed_forms_while_the_car_brakes_in_the_swerve() -> None:
    """(1 + t) exp(-t), with actuators at once; in steady curves the law lays the car l_r² kappa/2 outside."""
    quick = {"vehicle": {"base": "passat", "steering": {"lag": 0.0}}, "powertrain": {"pedal_lag": 0.0}}
    seen = swerved(-1.0, 3.0, 4.0, lateral=0.8, **quick)
    time = STEP * np.arange(len(seen["place"]))
    decay = (1.0 + time) * np.exp(-time)
    assert np.abs(seen["position_gap"] + decay).max() < 0.06
    assert np.abs(seen["lateral_error"] + 0.5 * 1.51**2 * seen["curvature"] - 0.8 * decay).max() < 0.04


@pytest.mark.parametrize(("friction", "braking"), [(1.0, 6.0), (0.5, 4.0), (0.5, 6.0), (0.3, 2.0), (0.3, 6.0)])
def test_the_circle_limits_both_and_the_car_stays_on_its_path(friction: float, braking: float) -> None:
    seen = swerved(0.0, braking, 6.0, friction=friction)
    used = np.hypot(seen["acceleration"], seen["lateral_acceleration"]) / (friction * GRAVITY)
    assert used.max() < 1.03  # the acceleration along is measured with what rolls and blows
    assert np.abs(seen["lateral_error"]).max() < 0.25 and np.degrees(np.abs(seen["sideslip"])).max() < 6.0
    feasible = friction == 1.0 or (friction, braking) == (0.5, 4.0)
    assert (np.abs(seen["position_gap"]).max() < 0.3) == feasible


def test_on_slippery_roads_gaps_are_as_long_as_a_car_ahead_that_brakes_fully_makes_necessary() -> None:
    """Where the gap law asks for nothing, full braking of both leaves the two cars apart."""
    tuning, random = LongitudinalTuning(), np.random.default_rng(0)
    v = random.uniform(3.0, 30.0, 500)
    ahead = v * random.uniform(0.3, 1.0, 500)
    grip = Grip(random.uniform(1.5, 2.8, 500), 2.9)
    low, high = np.zeros(500), np.full(500, 1e4)
    for _ in range(60):
        middle = 0.5 * (low + high)
        short = gap_law(tuning, v, middle, ahead - v, grip) < 0.0
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    left = high + ahead**2 / (2.0 * 2.9) - tuning.reaction * v - v**2 / (2.0 * grip.own)
    assert (left > 0.0).all()
    dry = gap_law(tuning, v, high, ahead - v)
    assert dry == pytest.approx(((ahead - v) + 0.5 * (high - 4.0 - 1.5 * v)) / 1.5)


def test_an_emergency_begins_where_a_part_of_the_grip_would_not_do() -> None:
    """A stop point for which 2 m/s² are needed: nothing on a dry road, braking where 2.8 m/s² are all there is."""
    tuning, v = LongitudinalTuning(), np.array([12.0])
    distance = v**2 / 4.0 + tuning.reaction * v
    nobody = np.array([np.inf]), np.array([0.0])
    assert np.isinf(emergency_law(tuning, v, *nobody, distance))
    assert emergency_law(tuning, v, *nobody, distance, Grip(2.8, 2.9)) == pytest.approx(-2.2)
    # A car 20 m ahead, as fast, that brakes with 6 m/s² stands after 12 m.
    lead = v, np.array([20.0]), np.array([0.0]), np.array([np.inf]), Grip(3.5, 6.0)
    assert np.isinf(emergency_law(tuning, *lead))
    assert emergency_law(tuning, *lead, -6.0) == pytest.approx(-1.1 * 72.0 / (19.0 + 12.0 - 12.0 * tuning.reaction))
