"""What disturbs cars: steering that errs, bounds to draw from, what is refused, and that what is off costs nothing."""

import math

import gymnasium as gym
import numpy as np
import pytest
from disturbed_roads import LIMIT, STRAIGHT, driven, made
from hypothesis import given, settings
from hypothesis import strategies as st

from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.scenario import LaneKeepScenario


@settings(max_examples=15, deadline=None)
@given(st.floats(-0.1, 0.1), st.floats(-15.0, 15.0), st.floats(-0.02, 0.02), st.integers(0, 2**31))
def test_the_mirrored_disturbance_drives_the_mirrored_way(bank, across, offset, seed):
    angles = np.random.default_rng(seed).uniform(-0.05, 0.05, 40)
    drives = []
    for sign in (1.0, -1.0):
        vehicle = {"base": "yin", "steering": {"offset": sign * offset}}
        env = made(vehicle=vehicle, bank=sign * bank, crosswind=sign * across, tyre="magic_formula", speed=20.0)
        options = {"lateral_error": sign * 0.3, "heading_error": sign * 0.01}
        drives.append(driven(env, sign * angles, **options))
    for name in ("lateral_error", "heading_error", "yaw_rate", "sideslip", "lateral_acceleration", "steering_angle"):
        np.testing.assert_array_equal(drives[0][name], -drives[1][name])


@pytest.mark.parametrize(
    "steering",
    [
        {},
        {"lag": 0.0},
        {"lag": 0.1, "rate_limit": 0.2, "delay": 0.07},
        {"lag": 0.2, "backlash": 0.02},
        {"lag": 0.2, "backlash": 0.02, "feedback": "motor"},
    ],
)
def test_offset_and_gain_are_another_command(steering):
    """Command c on a wheel with gain 2 and offset o is command 2 c + o on one without; all of them binary parts."""
    offset, rng = LIMIT / 8, np.random.default_rng(3)
    asked = rng.integers(-100, 100, 80) / 256 * LIMIT
    plain = made(vehicle={"base": "yin", "steering": steering}, speed=20.0)
    faulty = made(vehicle={"base": "yin", "steering": {**steering, "gain": 2.0, "offset": offset}}, speed=20.0)
    # Both stand still at first, with the wheel straight.
    start = {"lateral_error": 0.0, "heading_error": 0.0}
    expected, seen = driven(plain, 2.0 * asked + offset, **start), driven(faulty, asked, **start)
    for name in ("lateral_error", "heading_error", "yaw_rate", "sideslip", "steering_angle"):
        np.testing.assert_allclose(seen[name], expected[name], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(seen["steering_offset"], offset)
    np.testing.assert_allclose(seen["steering_gain"], 2.0)


def test_bounds_are_drawn_from_and_once_an_episode():
    n = 400
    keywords = {**STRAIGHT, "bank": (-0.02, 0.06), "crosswind": (-3.0, 9.0), "speed": 20.0}
    drawn = {"steering_offset": (-0.02, 0.01), "steering_gain": (0.9, 1.2)}
    env = gym.make_vec("lanekeep/LaneKeep-v0", n, "vector_entry_point", randomisation=drawn, **keywords)
    names = [c.name for c in env.unwrapped.channels]
    first, last = env.reset(seed=1)[0], env.step(np.zeros((n, 1), np.float32))[0]
    found = []
    for name, (low, high) in {"bank": (-0.02, 0.06), "crosswind": (-3.0, 9.0), **drawn}.items():
        values = first[:, names.index(name)].astype(np.float64)
        np.testing.assert_array_equal(values, last[:, names.index(name)])
        assert low - 1e-6 <= values.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < values.max() <= high + 1e-6
        assert abs(values.mean() - (low + high) / 2) < 5.0 * (high - low) / math.sqrt(12.0 * n)
        found.append(values)
    assert np.abs(np.corrcoef(found) - np.eye(len(found))).max() < 5.0 / math.sqrt(n)


@pytest.mark.parametrize("name", ["RoadWorks", "LaneSupport", "Evasive", "Drive", "Traffic"])
def test_every_road_with_tyres_feels_them_and_cars_are_those_of_single_environments(name):
    keywords = {
        "bank": (-0.03, 0.03),
        "crosswind": 5.0,
        "gusts": 1.0,
        "changes": {"mass": 1.2, "time": 0.3},
        "randomisation": {"steering_offset": (-0.01, 0.01)},
        "departure": "off",
    }
    many = gym.make_vec(f"lanekeep/{name}-v0", 2, "vector_entry_point", **keywords)
    many.reset(seed=4)
    plain = gym.make_vec(f"lanekeep/{name}-v0", 2, "vector_entry_point", departure="off")
    plain.reset(seed=4)
    actions = np.random.default_rng(0).uniform(-0.1, 0.1, (30, *many.action_space.shape)).astype(np.float32)
    drives = [many.step(action) for action in actions]
    unlike = [plain.step(action)[4]["lateral_error"] for action in actions]
    for i in range(2):
        one = gym.make(f"lanekeep/{name}-v0", **keywords)
        one.reset(seed=4 + i)
        for action, (seen, *_) in zip(actions, drives, strict=True):
            observation, *_, info = one.step(action[i])
            np.testing.assert_array_equal(observation, seen[i])
        assert info["lateral_error"] != unlike[-1][i]


@pytest.mark.parametrize("name", ["WallFollow", "Circuit"])
def test_between_walls_offset_and_gain_are_another_command(name):
    steering = {"angle_limit": None}
    keywords = {"max_steering_angle": LIMIT, "steering_offset": 0.0}
    plain = gym.make(f"lanekeep/{name}-v0", vehicle={"base": "knightriders", "steering": steering}, **keywords)
    faults = {**steering, "gain": 2.0, "offset": LIMIT / 4}
    faulty = gym.make(f"lanekeep/{name}-v0", vehicle={"base": "knightriders", "steering": faults}, **keywords)
    start = {"lateral_error": 0.0, "heading_error": 0.0}
    plain.reset(seed=0, options=start), faulty.reset(seed=0, options=start)
    for asked in np.random.default_rng(1).integers(-90, 90, 20) / 256:
        action = np.zeros(plain.action_space.shape, np.float32)
        action[0], second = 2.0 * asked + 0.25, action.copy()
        second[0] = asked
        expected, seen = plain.step(action)[4], faulty.step(second)[4]
        assert [seen[key] for key in ("x", "y", "heading_error")] == [
            expected[key] for key in ("x", "y", "heading_error")
        ]
    drawn = gym.make(f"lanekeep/{name}-v0", randomisation={"steering_gain": (0.5, 0.6)}).unwrapped
    drawn.reset(seed=0)
    with pytest.raises(ValueError, match=r"randomisation\.steering_offset=.* has no effect in this scenario"):
        gym.make(f"lanekeep/{name}-v0", randomisation={"steering_offset": (0.0, 0.1)})


def test_what_is_off_is_no_part_of_a_kernel():
    env = made(observation="measured")
    assert not env.scenario.disturbed
    assert {c.name for c in made().channels}.isdisjoint({"bank", "crosswind", "friction", "steering_offset"})
    measured = made(observation="measured", bank=0.03, crosswind=3.0, vehicle={"steering": {"offset": 0.01}})
    assert [c.name for c in measured.channels] == [c.name for c in env.channels]


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"bank": 0.3}, ["bank=0.3", "<= 0.2 rad"]),
        ({"bank": (0.1, 0.0)}, ["bank=", "low <= high"]),
        ({"crosswind": "strong"}, ["crosswind='strong'", "m/s"]),
        ({"gusts": -1.0}, ["gusts=-1.0", ">= 0.0"]),
        ({"dynamics": "kinematic", "bank": 0.03}, ["bank=", "has no effect", "rolls without slip"]),
        ({"gust_time": 1.0}, ["gust_time=1.0", "has no effect", "gusts=0"]),
        ({"patches": {"friction": 0.5}}, ["patches=", "has no effect", "saturating"]),
        (
            {"tyre": "magic_formula", "patches": {"friction": 0.5, "evry": 3.0}},
            ["patches has no field 'evry'", "every"],
        ),
        ({"tyre": "magic_formula", "patches": {"friction": 0.5, "every": 3.0}}, ["patches.every=3.0", ">= 20.0"]),
        ({"changes": {"friction": 0.5}}, ["changes.friction=", "has no effect", "saturating"]),
        ({"changes": {"time": 3.0}}, ["changes=", "has no effect", "factor"]),
        ({"changes": {"mass": 0.0}}, ["changes.mass=0.0", ">= 0.05"]),
        ({"changes": {"mass": 1.2, "time": 30.0}}, ["changes.time=(30.0, 30.0)", "has no effect", "last 30 s"]),
        ({"vehicle": {"steering": {"gain": 0.0}}}, ["steering.gain=0.0", ">= 0.05"]),
        ({"max_steering_angle": 1.0, "vehicle": {"steering": {"gain": 3.0}}}, ["max_steering_angle=1.0", "1.5 rad"]),
        (
            {"changes": {"mass": 0.05, "front_cornering_stiffness": 20.0}, "vehicle": "pses", "speed": 1.0},
            ["vehicle.", "is not allowed", "integrated"],
        ),
        ({"tyre": "magic_formula", "friction": 0.4, "bank": 0.15}, ["bank=", "least friction gives 3.92 m/s²"]),
    ],
)
def test_refusals_are_one_line(keywords, words):
    with pytest.raises(ValueError) as error:
        gym.make("lanekeep/LaneKeep-v0", **keywords)
    text = str(error.value)
    assert "\n" not in text and all(word in text for word in words), text


def test_all_cars_that_occur_are_judged():
    """A car that becomes lighter and stiffer is integrated as one that is drawn so."""
    factors = {"mass": (0.3, 1.0), "front_cornering_stiffness": (1.0, 3.0)}
    car = {"vehicle": "pses", "speed": 1.0, "max_steering_angle": 0.15}
    drawn, becomes = LaneKeepScenario(randomisation=factors, **car), LaneKeepScenario(changes=factors, **car)
    assert becomes.integration == drawn.integration != LaneKeepScenario(**car).integration


def test_patches_that_grip_more_are_judged_as_a_road_that_does():
    """A tall, light car's loads move the more the harder it may brake."""
    car = {"base": "f1tenth", "cg_height": 0.3, "mass": 1.2, "yaw_inertia": 0.012}
    keywords = {"vehicle": car, "tyre": "load_sensitive", "speed": 1.0}
    patched = LaneKeepScenario(patches={"friction": (0.9, 2.0)}, **keywords)
    rough, smooth = LaneKeepScenario(friction=2.0, **keywords), LaneKeepScenario(**keywords)
    assert patched.integration == rough.integration != smooth.integration


def test_the_profile_asks_no_more_than_the_most_slippery_place_gives():
    """80 % of the friction there at the most, as on a road that is so all along."""
    keywords = {"road": {"kind": "circle", "radius": 200.0}, "tyre": "magic_formula", "speed": {"maximum": 60.0}}
    keywords["speed"]["lateral_acceleration"] = 6.0
    speeds = []
    for further in (
        {"friction": 0.5},
        {"patches": {"friction": (0.5, 0.9)}},
        {"changes": {"friction": 0.5}},
    ):
        env = gym.make("lanekeep/LaneKeep-v0", departure="off", **keywords, **further)
        env.reset(seed=0)
        speeds.append(env.step(np.zeros(1, np.float32))[4]["speed"])
    np.testing.assert_allclose(speeds, math.sqrt(0.8 * 0.5 * GRAVITY * 200.0), rtol=1e-6)


def test_in_highway_env_s_worlds_nothing_disturbs_a_car():
    pytest.importorskip("highway_env")
    from lanekeep_env.adapters.highway.plant import FreeScenario

    with pytest.raises(ValueError, match="gain 1 and offset 0"):
        FreeScenario(road="straight", speed=20.0, vehicle={"base": "yin", "steering": {"offset": 0.01}})
