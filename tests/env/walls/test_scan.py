"""The depth camera's scan through the environment: shapely's rays from the nose, and each fault by itself."""

import math

import gymnasium as gym
import numpy as np
import pytest
import shapely
from scipy import stats

import lanekeep_env

CIRCUIT, WALL = "lanekeep/Circuit-v0", "lanekeep/WallFollow-v0"
NOSE = 0.532 / 2
BEHIND_EACH_OTHER = {"kind": "slalom", "count": 5, "width": 3.0, "gap": 1.2, "spacing": 2.0}


def columns(env, word="scan_"):
    names = [channel.name for channel in env.unwrapped.channels]
    return [names.index(name) for name in names if name.startswith(word) and name != "scan_new"]


def many(cars, name=CIRCUIT, **keywords):
    return gym.make_vec(name, cars, "vector_entry_point", contact="off", **keywords)


def headings(env):
    """Of the cars from the x axis, rad."""
    return np.array([env.unwrapped._core.pose(i).heading for i in range(env.num_envs)])


def rays(x, y, heading, angles, walls):
    """Ranges by shapely, inf where a ray meets no wall."""
    nose = np.array([x + NOSE * math.cos(heading), y + NOSE * math.sin(heading)])
    ends = nose + 100.0 * np.column_stack([np.cos(heading + angles), np.sin(heading + angles)])
    beams = shapely.linestrings(np.stack([np.broadcast_to(nose, ends.shape), ends], axis=1))
    geometry = (
        shapely.union_all(shapely.linestrings(walls.reshape(-1, 2, 2))) if len(walls) else shapely.MultiLineString()
    )
    found = shapely.distance(shapely.Point(nose), shapely.intersection(beams, geometry))
    return np.where(np.isnan(found), np.inf, found)


def differ(found, expected, tolerance):
    """Share of beams that differ: those that graze a corner may go either way."""
    return (np.abs(found - expected) > tolerance).mean()


@pytest.mark.parametrize("dtype, tolerance", [("float64", 2e-6), ("float32", 2e-3)])
@pytest.mark.parametrize("glass", [0.0, 0.4])
def test_a_perfect_scan_is_shapelys_at_random_poses_in_random_circuits(glass, dtype, tolerance):
    world = {"kind": "random-circuits", "count": 6, "glass_share": glass, "seed": 3}
    scan = {"beams": 33, "nearest": 0.0, "farthest": 30.0, "field_of_view": 2.5}
    env = many(24, world=world, scan=scan, dtype=dtype, start_heading_error=3.0)
    worlds, where = env.unwrapped.world_set(), columns(env)
    angles = np.linspace(-1.25, 1.25, 33)
    rng = np.random.default_rng(5)
    index = np.arange(24) % 6
    observation, infos = env.reset(seed=2, options={"world_index": index})
    wrong = []
    for _ in range(8):
        for i, heading in enumerate(headings(env)):
            world = worlds[index[i]]
            expected = rays(infos["x"][i], infos["y"][i], heading, angles, world.segments[~world.glass])
            expected[expected >= 30.0] = 0.0
            wrong.append(differ(observation[i, where], expected, tolerance * (1.0 + expected)))
        observation, _, _, _, infos = env.step(rng.uniform(-0.2, 1.0, (24, 2)).astype(np.float32))
    assert np.mean(wrong) < 2e-3
    assert np.mean([share > 0.0 for share in wrong]) < 0.05


def test_glass_is_seen_by_ultrasonics_and_felt_but_not_seen_by_the_camera():
    """A corridor all of glass: not one range, but distances and a contact."""
    world = {"kind": "corridor", "length": 10.0, "width": 2.0, "glass_share": 1.0}
    env = gym.make(WALL, world=world, scan="perfect", steering_offset=0.0, speed=2.0)
    observation, _ = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    assert not observation[columns(env)].any()
    assert observation[:2] == pytest.approx([1.0, 1.0])
    solid = gym.make(WALL, world={**world, "glass_share": 0.0}, scan="perfect", steering_offset=0.0, speed=2.0)
    assert (solid.reset(seed=0)[0][columns(solid)] > 0.0).sum() > 60
    ended = False
    while not ended:
        observation, _, ended, truncated, info = env.step(np.zeros(1, np.float32))
        assert not truncated
    assert info["termination"] == lanekeep_env.Termination.CONTACT and info["x"] == pytest.approx(10.0 - NOSE, abs=0.1)


def test_outside_its_range_and_at_missing_beams_a_scan_shows_zero():
    limits = {"nearest": 1.0, "farthest": 3.0}
    perfect = many(40, scan={"beams": 60, "nearest": 0.0, "farthest": 90.0})
    faulty = many(40, scan={"beams": 60, **limits, "missing_every": 7, "missing_rim": 3})
    rng = np.random.default_rng(0)
    truth, seen = (env.reset(seed=4)[0] for env in (perfect, faulty))
    gaps = np.zeros(60, dtype=bool)
    gaps[6::7] = gaps[:3] = gaps[-3:] = True
    near = far = 0
    for _ in range(30):
        ranges, shown = truth[:, columns(perfect)], seen[:, columns(faulty)]
        expected = np.where((ranges < 1.0) | (ranges >= 3.0) | gaps, 0.0, ranges)
        np.testing.assert_allclose(shown, expected, atol=1e-6)
        near, far = near + (ranges < 1.0).sum(), far + (ranges >= 3.0).sum()
        actions = rng.uniform(-1, 1, (40, 2)).astype(np.float32)
        truth, seen = perfect.step(actions)[0], faulty.step(actions)[0]
    assert near > 100 and far > 1000


def pairs(steps=25, cars=60, world=BEHIND_EACH_OTHER, **faults):
    """True and shown ranges of one drive, (steps * cars, beams) each."""
    common = {"beams": 80, "nearest": 0.0, "farthest": 40.0}
    perfect = many(cars, WALL, scan=common, world=world)
    faulty = many(cars, WALL, scan={**common, **faults}, world=world)
    rng = np.random.default_rng(6)
    truth, seen = [perfect.reset(seed=7)[0]], [faulty.reset(seed=7)[0]]
    for _ in range(steps):
        actions = rng.uniform(-1, 1, (cars, 1)).astype(np.float32)
        truth.append(perfect.step(actions)[0])
        seen.append(faulty.step(actions)[0])
    return np.concatenate(truth)[:, columns(perfect)], np.concatenate(seen)[:, columns(faulty)]


def test_errors_at_depth_jumps_lie_between_both_sides_and_nowhere_else():
    truth, shown = pairs(jump_errors=0.6)
    jump = np.abs(np.diff(truth, axis=1)) > 0.3
    beside = np.zeros(truth.shape, dtype=bool)
    beside[:, :-1] |= jump
    beside[:, 1:] |= jump
    wrong = np.abs(shown - truth) > 1e-5
    assert not (wrong & ~beside).any()
    ahead, behind = np.roll(truth, -1, axis=1), np.roll(truth, 1, axis=1)
    low = np.minimum(truth, np.minimum(ahead, behind))[wrong]
    high = np.maximum(truth, np.maximum(ahead, behind))[wrong]
    assert ((shown[wrong] >= low - 1e-5) & (shown[wrong] <= high + 1e-5)).all()
    # One beam of each jump errs in the stated share of scans, anywhere between both sides alike.
    assert wrong.sum() / jump.sum() == pytest.approx(0.6, abs=0.05)
    inner = jump & wrong[:, :-1]
    place = (shown - truth)[:, :-1][inner] / (ahead - truth)[:, :-1][inner]
    assert stats.kstest(place, stats.uniform.cdf).pvalue > 1e-3


def test_noise_is_white_gaussian_and_grows_with_the_square_of_the_range():
    truth, shown = pairs(noise=0.004)
    there = (shown > 0.0) & (truth > 0.3)
    standard = (shown - truth)[there] / (0.004 * truth[there] ** 2)
    assert stats.kstest(standard[:: max(1, len(standard) // 20_000)], stats.norm.cdf).pvalue > 1e-3
    for low, high in ((0.3, 1.0), (1.0, 2.0), (2.0, 5.0)):
        mine = there & (truth > low) & (truth < high)
        assert ((shown - truth)[mine] / truth[mine] ** 2).std() == pytest.approx(0.004, rel=0.05)
    error = np.where(there, (shown - truth) / (0.004 * np.maximum(truth, 0.1) ** 2), 0.0)
    assert abs(np.mean(error[:, :-1] * error[:, 1:])) < 0.02  # from beam to beam
    assert abs(np.mean(error[:-60] * error[60:])) < 0.02  # from scan to scan
    assert abs(np.mean(error[:-1] * error[1:])) < 0.02  # from car to car


def test_a_slow_scan_is_held_and_says_when_it_is_new():
    slow, fast = (many(20, scan={"beams": 20, "nearest": 0.0, "period": period}) for period in (0.135, 0.0))
    names = [channel.name for channel in slow.unwrapped.channels]
    assert names[-1] == "scan_new" and "scan_new" not in [channel.name for channel in fast.unwrapped.channels]
    rng = np.random.default_rng(8)
    observation, truth = slow.reset(seed=1)[0], fast.reset(seed=1)[0]
    held = truth[:, columns(fast)]
    for step in range(1, 40):
        np.testing.assert_array_equal(observation[:, columns(slow)], held)
        np.testing.assert_array_equal(observation[:, -1], float((step - 1) % 3 == 0))
        actions = rng.uniform(-1, 1, (20, 2)).astype(np.float32)
        observation, truth = slow.step(actions)[0], fast.step(actions)[0]
        held = truth[:, columns(fast)] if step % 3 == 0 else held


def test_every_beam_has_its_place_in_the_fan():
    """The first beam is the rightmost one: a car beside a wall on its right sees it there."""
    env = gym.make(WALL, world={"kind": "corridor", "length": 40.0, "width": 6.0}, scan="perfect", steering_offset=0.0)
    observation, _ = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    angles = np.linspace(-math.radians(35.0), math.radians(35.0), 64)
    shown = observation[columns(env)]
    right = np.flatnonzero(1.0 / np.maximum(-np.sin(angles), 1e-9) < 12.0)
    np.testing.assert_allclose(shown[right], -1.0 / np.sin(angles[right]), rtol=1e-6)
    assert shown[0] < shown[-1] and not shown[28:36].any()
    names = [channel.description for channel in env.unwrapped.channels if channel.name.startswith("scan_")]
    assert "-35.0 deg" in names[0] and "+35.0 deg" in names[-1]
