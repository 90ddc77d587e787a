"""Patches of friction along the road, and cars that change in mid-episode."""

import math

import gymnasium as gym
import numpy as np
import pytest
from disturbed_roads import CENTRED, IDEAL, LIMIT, STRAIGHT, driven, made

from lanekeep_env.physics.parameters import GRAVITY


def test_patches_take_the_share_of_the_road_that_they_are_given():
    """One of `length` in every `every` metres, the same ones however the car steers, the factors between bounds."""
    n, every, length = 200, 50.0, 10.0
    patches = {"friction": (0.5, 0.8), "every": every, "length": length}
    keywords = {**STRAIGHT, "speed": 20.0, "tyre": "magic_formula", "friction": 0.9, "patches": patches}
    env = gym.make_vec("lanekeep/LaneKeep-v0", n, "vector_entry_point", control_step=0.01, **keywords)
    column = [c.name for c in env.unwrapped.channels].index("friction")
    drives = []
    for action in (0.0, 0.02):
        env.reset(seed=2)
        acted = np.full((n, 1), action, np.float32)
        drives.append(np.array([env.step(acted)[0][:, column] for _ in range(2000)], dtype=np.float64))
    factor = drives[0] / 0.9
    on = factor < 0.999
    for i in range(n):  # who steers gets less far along the road, and meets the same patches
        met = [drive[1:, i][(drive[1:, i] < 0.899) & (drive[:-1, i] >= 0.899)] for drive in drives]
        np.testing.assert_array_equal(met[0][:6], met[1][:6])
    assert ((factor[on] > 0.5 - 1e-6) & (factor[on] < 0.8 + 1e-6)).all()
    # A drive of 400 m has 8 stretches: the share of each car varies by the ends of its way alone.
    assert abs(on.mean() - length / every) < 0.02
    entered = (on[1:] & ~on[:-1]).sum(axis=0)
    assert (entered >= 7).mean() > 0.9 and (entered <= 9).all()
    assert abs(factor[on].mean() - 0.65) < 0.02


def test_on_a_patch_the_tyres_give_no_more_than_its_friction():
    patches = {"friction": 0.3, "every": 60.0, "length": 40.0}
    env = made(speed=25.0, tyre="magic_formula", patches=patches, vehicle=IDEAL, control_step=0.01)
    seen = driven(env, [LIMIT] * 600, **CENTRED)
    friction, lateral = seen["friction"][1:], np.abs(seen["lateral_acceleration"][1:])
    both = (friction[1:] == friction[:-1]) & (np.abs(friction[1:] - 0.3) < 1e-6)  # the rear axle follows by 0.1 s
    settled = np.convolve(both, np.ones(20), mode="full")[: len(both)] == 20
    assert settled.any() and lateral[1:][settled].max() <= 0.3 * GRAVITY * (1.0 + 1e-9)
    off = np.convolve(friction == 1.0, np.ones(20), mode="full")[: len(friction)] == 20
    assert lateral[off].max() > 0.6 * GRAVITY


def step_response(env, wait, steps=60):
    """Wait on a straight, steer by a step and let go; lateral error and yaw rate from the steering on."""
    seen = driven(
        env, [0.0] * wait + [0.02] * (steps // 2) + [0.0] * (steps // 2), lateral_error=0.0, heading_error=0.0
    )
    return np.array([seen["lateral_error"][wait:], seen["yaw_rate"][wait:], seen["steering_angle"][wait:]])


@pytest.mark.parametrize("tyre", ["linear", "magic_formula", "load_sensitive"])
def test_a_changed_car_drives_as_one_that_was_so_from_the_start(tyre):
    factors = {"mass": 1.25, "front_cornering_stiffness": 0.8, "rear_cornering_stiffness": 0.75, "steering_lag": 2.0}
    factors |= {"friction": 0.55} if tyre != "linear" else {}
    keywords = {"speed": 25.0, "tyre": tyre}
    born = step_response(made(randomisation=factors, **keywords), 20)
    became = step_response(made(changes={**factors, "time": 1.0}, **keywords), 20)
    np.testing.assert_allclose(became, born, rtol=1e-6, atol=1e-9)
    plain = step_response(made(**keywords), 20)
    assert np.abs(plain - born).max() > 0.01
    still_itself = step_response(made(changes={**factors, "time": 5.0}, **keywords), 20)
    again = step_response(made(changes={**factors, "time": 0.2, "duration": 0.5}, **keywords), 20)
    for found in (still_itself, again):
        np.testing.assert_allclose(found, plain, rtol=1e-6, atol=1e-9)


def test_a_change_multiplies_what_the_episode_drew_and_comes_at_its_time():
    n = 300
    changes = {"friction": (0.5, 0.7), "time": (1.0, 3.0), "duration": (0.5, 1.0)}
    keywords = {**STRAIGHT, "speed": 20.0, "tyre": "magic_formula", "randomisation": {"friction": (0.8, 1.0)}}
    env = gym.make_vec("lanekeep/LaneKeep-v0", n, "vector_entry_point", changes=changes, **keywords)
    column = [c.name for c in env.unwrapped.channels].index("friction")
    seen = [env.reset(seed=3)[0][:, column]]
    seen = np.array(seen + [env.step(np.zeros((n, 1), np.float32))[0][:, column] for _ in range(120)], np.float64)
    low = seen < 0.99 * seen[0]
    begins, lasts = low.argmax(axis=0) * 0.05, low.sum(axis=0) * 0.05
    assert low.any(axis=0).all() and (np.abs(np.diff(low.astype(int), axis=0)).sum(axis=0) == 2).all()
    for values, (least, most) in ((begins - 0.05, changes["time"]), (lasts, changes["duration"])):
        assert least - 0.026 <= values.min() and values.max() <= most + 0.026
        assert abs(values.mean() - (least + most) / 2) < 5.0 * (most - least) / math.sqrt(12.0 * n) + 0.03
    share = np.array([seen[low[:, i], i][0] / seen[0, i] for i in range(n)])
    assert share.min() > 0.5 - 1e-6 and share.max() < 0.7 + 1e-6 and share.std() > 0.04
    np.testing.assert_array_equal(seen[-1], seen[0])


def test_a_car_that_changes_stays_the_one_that_was_drawn():
    """What `narrow` says holds from the next episode on, and so does what another car is reset with."""
    keywords = {"randomisation": {"friction": (0.5, 1.0), "speed": (0.8, 1.0)}, "changes": {"mass": 1.1, "time": 1.0}}
    keywords |= {**STRAIGHT, "speed": 20.0, "tyre": "magic_formula"}
    envs = gym.make_vec("lanekeep/LaneKeep-v0", 2, "vector_entry_point", **keywords).unwrapped
    names = [c.name for c in envs.channels]
    columns = names.index("friction"), names.index("speed")
    envs.reset(seed=3)
    seen = []
    for step in range(40):
        if step == 10:
            envs.reset(options={"friction": 0.5, "speed": 0.8, "reset_mask": np.array([False, True])})
        seen.append(envs.step(np.zeros((2, 1), np.float32))[0][:, columns])
    seen = np.array(seen)
    assert (seen[:, 0] == seen[0, 0]).all() and (seen[11:, 1] == seen[11, 1]).all()
    np.testing.assert_allclose(seen[-1, 1], [0.5, 16.0], rtol=1e-6)
    assert seen[0, 0, 0] > 0.51 and seen[0, 0, 1] > 16.1
