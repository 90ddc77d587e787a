"""Parking: whole episodes, the shortest gap, the servo's map from driven half circles."""

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_baselines.path_planning import shortest_gap
from lanekeep_baselines.servo_map import ServoMap
from lanekeep_env.scenario import Servo

PARK = "lanekeep/ParallelPark-v0"
NOISY = {"sensors": "production", "encoder_ticks": 40}


def drive(name, rows, world, options=None, **keywords):
    """Return termination, success and smallest share of each row's first episode; a scan is not needed."""
    env = gym.make_vec(PARK, rows, "vector_entry_point", world=world, scan="none", **keywords)
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario, **(options or {}))
    worlds = len(env.unwrapped.world_set())
    observation, info = env.reset(seed=2000, options={"world_index": np.arange(rows) % worlds})
    state, over = None, np.zeros(rows, dtype=bool)
    termination, success = np.zeros(rows, dtype=int), np.zeros(rows, dtype=bool)
    while not over.all():
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        now = (terminated | truncated) & ~over
        termination[now], success[now] = info["termination"][now], info["is_success"][now]
        over |= now
    return termination, success


@pytest.mark.parametrize("keywords", [{}, NOISY, {**NOISY, "servo": {"left": 0.36, "right": 0.4, "ticks": 50}}])
def test_every_random_row_is_parked_in(keywords):
    world = {"kind": "random-parking-rows", "count": 64, "seed": 2000}
    _, success = drive("knightriders-park", 64, world, **keywords)
    assert success.mean() >= 0.98


@pytest.mark.slow
def test_two_hundred_rows_beside_the_published_form():
    """The gap that is long enough is 0.1 to 0.5 m longer than the shortest of one sweep."""
    shortest = shortest_gap(0.091, 0.532, 0.265, 0.35 / np.tan(np.deg2rad(22.0)))
    world = {"kind": "random-parking-rows", "count": 200, "seed": 813970, "longer": (shortest + 0.1, shortest + 0.5)}
    failed = {
        name: 200 - drive(name, 200, world, **NOISY)[1].sum()
        for name in ("knightriders-park", "knightriders-shunt", "knightriders-park-published")
    }
    assert failed["knightriders-park"] <= 4 and failed["knightriders-shunt"] <= 4
    assert 2 * failed["knightriders-park"] < failed["knightriders-park-published"]


@pytest.mark.parametrize(
    ("vehicle", "overhang", "length", "radius"),
    [
        ("knightriders", 0.091, 0.532, 0.35 / np.tan(np.deg2rad(22.0))),
        ("pses", 0.091, 0.44, 0.93),
    ],
)
def test_the_shortest_gap_is_that_of_the_swept_body(vehicle, overhang, length, radius):
    """Boxes as wide as the car, no noise: always 5 cm beyond the shortest gap, never below it; no contact ever."""
    shortest = shortest_gap(overhang, length, 0.265, radius)
    for spare, parks in ((-0.01, False), (0.05, True), (0.3, True)):
        world = {"kind": "parking-row", "gaps": (0.4, shortest + spare), "width": 0.265}
        termination, success = drive("knightriders-park", 6, world, vehicle=vehicle, steering_offset=0.0)
        assert success.all() == success.any() == parks, spare
        assert (termination != 2).all()


def test_the_report_s_own_rule_finds_no_gap_that_is_only_as_long_as_needed():
    """Its gap length is the rear axle's travel, 1.33 m and more: the issue of (36)."""
    world = {"kind": "random-parking-rows", "count": 32, "seed": 2000}
    _, success = drive("knightriders-park-published", 32, world)
    assert not success.any()


@pytest.mark.parametrize("keywords", [{}, NOISY])
def test_gaps_too_short_for_one_sweep_are_entered_in_several_moves(keywords):
    """0.66 to 0.88 m, where one sweep needs 0.8995 m: `knightriders-park` enters none of them."""
    world = {"kind": "random-parking-rows", "count": 48, "seed": 2001, "longer": (0.66, 0.88), "shorter": (0.1, 0.6)}
    _, success = drive("knightriders-shunt", 48, world, **keywords)
    assert success.mean() >= 0.93
    _, swept = drive("knightriders-park", 12, world, episode_steps=700, **keywords)
    assert not swept.any()


def test_a_gap_hardly_longer_than_the_car_is_left_alone():
    world = {"kind": "parking-row", "gaps": (0.4, 0.55, 0.58)}
    termination, success = drive("knightriders-shunt", 4, world, episode_steps=600, **NOISY)
    assert not success.any() and (termination == 0).all()


@pytest.mark.parametrize(("name", "longer"), [("knightriders-park", (1.0, 1.4)), ("knightriders-shunt", (0.66, 0.88))])
def test_asked_for_another_mode_the_car_leaves_the_gap_again(name, longer):
    """Parked, then away: it is in the street along the row without a contact, and was in a gap before."""
    rows, leaves = 16, 42.0
    world = {"kind": "random-parking-rows", "count": rows, "seed": 2002, "longer": longer, "shorter": (0.1, 0.6)}
    modes = [(0.0, "park"), (leaves, "roundtrip")]
    env = gym.make_vec(PARK, rows, "vector_entry_point", world=world, scan="none", modes=modes, **NOISY)
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
    observation, info = env.reset(seed=2002, options={"world_index": np.arange(rows)})
    state, touched, inside = None, np.zeros(rows, dtype=bool), np.zeros(rows, dtype=bool)
    left = np.zeros(rows, dtype=bool)
    for k in range(int((leaves + 20.0) / 0.045)):
        action, state = policy.predict(observation, state)
        if k * 0.045 > leaves + 1.0:
            out = inside & ~policy.inside(state) & ~touched & ~left
            for row in np.flatnonzero(out):
                pose, space = env.unwrapped._core.pose(row), env.unwrapped.world_set()[row].spaces[0]
                assert abs(pose.heading) < np.deg2rad(4.0) and pose.y > space[4] + 0.3
            left |= out
        observation, *_, info = env.step(action)
        touched |= (info["cost"] > 0.0) & ~left
        if k * 0.045 < leaves:
            inside = info["space_share"] > 0.99
    assert inside.mean() >= 0.9
    assert left[inside].mean() >= 0.93


def test_each_improvement_that_is_switched_off_costs_something():
    """The published car has none of them: less often parked, or later."""
    world = {"kind": "random-parking-rows", "count": 48, "seed": 2003}
    settings = {**NOISY, "servo": {"left": 0.36, "right": 0.4, "ticks": 50}}
    whole = drive("knightriders-park", 48, world, **settings)[1].sum()
    for option, least in (("start_parallel", 1), ("estimate_offset", 5), ("invert_servo", 20)):
        without = drive("knightriders-park", 48, world, {option: False}, **settings)[1].sum()
        assert without <= whole - least, option
    assert drive("knightriders-park", 48, world, {"vary_path": False}, **settings)[1].sum() > 0


def test_options_are_named():
    scenario = gym.make(PARK, scan="none").unwrapped.scenario
    with pytest.raises(ValueError, match=r"no option 'vary'; allowed: start_parallel, estimate_offset, invert_servo"):
        lanekeep_baselines.make("knightriders-park", scenario, vary=False)
    with pytest.raises(ValueError, match=r"vary_path=0 is not allowed: it must be True or False"):
        lanekeep_baselines.make("knightriders-park", scenario, vary_path=0)
    with pytest.raises(ValueError, match=r"'knightriders-park-published' has no option 'vary_path'; allowed: none"):
        lanekeep_baselines.make("knightriders-park-published", scenario, vary_path=False)


def test_half_circles_give_the_servo_s_map_and_its_inverse():
    """A servo's half circles are driven; what they show is the map, to the arc's share of a step."""
    limit, angles = 0.38, (-0.42, -0.3, -0.17, -0.06, 0.02, 0.08, 0.19, 0.27, 0.33)
    commands = np.linspace(-limit, limit, len(angles))
    env = gym.make_vec(
        "lanekeep/Circuit-v0",
        len(angles),
        "vector_entry_point",
        dtype="float64",
        scan="none",
        steering_offset=0.0,
        world={"kind": "corridor", "length": 200.0, "width": 100.0},
        servo={"angles": angles},
        contact="off",
        max_steering_angle=limit,
        vehicle={"base": "knightriders", "steering": {"angle_limit": None}},
        max_acceleration=1000.0,
        start_heading_error=0.0,
        start_lateral_error=0.0,
        episode_steps=100_000,
    )
    _, info = env.reset(seed=0)
    actions = np.column_stack([commands / limit, np.full(len(angles), 0.5)]).astype(np.float32)
    turned, way = np.zeros(len(angles)), np.zeros(len(angles))
    for _ in range(300):
        before = info["heading_error"]
        *_, info = env.step(actions)
        turned += np.remainder(info["heading_error"] - before + np.pi, 2 * np.pi) - np.pi
        way += info["speed"] * 0.045
    # The speed is the centre of gravity's only where the car does not turn; the rear axle's is what the encoder tells.
    half = np.pi * way / turned
    shown = ServoMap.from_half_circles(commands, half, 0.35)
    np.testing.assert_allclose(shown.angle(commands), angles, atol=2e-3)
    wanted = np.linspace(angles[0], angles[-1], 50)
    known = ServoMap.of(Servo(angles=angles), limit)
    np.testing.assert_allclose(known.angle(known.command(wanted)), wanted, atol=1e-12)
    assert (known.left, known.right) == (0.33, 0.42)
    plain = ServoMap.of(Servo(), 0.3)
    np.testing.assert_array_equal(plain.command(wanted), np.clip(wanted, -0.3, 0.3))


def test_a_map_that_does_not_rise_is_refused():
    with pytest.raises(ValueError, match="must rise"):
        ServoMap([-1.0, 0.0, 1.0], [-0.1, 0.2, 0.1])
