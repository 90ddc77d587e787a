"""The report's obstacle avoidance, each of its phases in a small world, and the mode machine over the three tasks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.knightriders_modes import APPROACH, OBSTACLES, PARK, ROUNDTRIP, KnightRidersModes
from lanekeep_baselines.knightriders_obstacles_published import KnightRidersObstaclesPublished, Route
from lanekeep_env.scenario import CircuitScenario, ObstacleCircuitScenario, ParallelParkScenario

PUBLISHED, MODES = "knightriders-obstacles-published", "knightriders-modes"
ALL_MODES = ObstacleCircuitScenario(modes=((0.0, "roundtrip"), (1.0, "obstacles"), (2.0, "park")))
ID = "lanekeep/ObstacleCircuit-v0"
#: Radius of the smallest turn at 22 degrees, m.
RADIUS = 0.35 / np.tan(np.deg2rad(22.0))
CIRCUIT = {"kind": "obstacle-circuit", "length": 14.0, "width": 10.0, "corridor": 2.4}
ROW = {**CIRCUIT, "gaps": (0.6, 1.3, 0.5)}


def drive(
    name: str, steps: int, state: np.ndarray | None = None, cars: int = 1, start: Any = None, **keywords: Any
) -> SimpleNamespace:
    """Drive, and return over time (steps, cars, ...): places and headings (m, rad), states, what was seen, contacts."""
    env = gym.make_vec(ID, cars, "vector_entry_point", **{"steering_offset": 0.0, **keywords})
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
    observation, info = env.reset(seed=0, options=start)
    told: dict[str, list[Any]] = {"place": [], "states": [], "seen": [], "contact": [], "done": []}
    over = np.zeros(cars, dtype=bool)
    for _ in range(steps):
        told["seen"].append(observation)
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(np.clip(action, -1.0, 1.0))
        poses = [env.unwrapped._core.pose(car) for car in range(cars)]
        told["place"].append([(pose.x, pose.y, pose.heading) for pose in poses])
        told["states"].append(state)
        told["contact"].append(terminated & (info["cost"] > 0.0) & ~over)
        told["done"].append(terminated & ~over)
        over |= terminated | truncated
        if over.all():
            break
    env.close()
    return SimpleNamespace(policy=policy, **{name: np.array(values) for name, values in told.items()})


def plans(run: SimpleNamespace) -> list[tuple[np.ndarray, np.ndarray]]:
    """Ways and bends of the plans of the one car, as they were made."""
    made, last = [], np.zeros(3)
    for state in run.states[:, 0]:
        route = Route.split(state[None])
        ways, bends = route.ways[0], route.bends[0]
        if ways[0] != 0.0 and (last[0] == 0.0 or ways[0] * last[0] < 0.0):
            made.append((ways, bends))
        last = ways
    return made


#: Starts in the middle of the corridor, and as far from the right wall as the car is to go.
AHEAD = {"lateral_error": 0.0, "heading_error": 0.0}
BESIDE = {"lateral_error": 0.6 - 1.2, "heading_error": 0.0}


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_box_ahead_is_passed_by_an_s_curve(side: float) -> None:
    """On the side that it leaves free: arc, straight and opposite arc of the smallest radius, to 0.2 m beside it."""
    box = (2.5, -4.4 - side * 0.2, 0.0, 0.3, 0.5)
    run = drive(PUBLISHED, 120, start=BESIDE, world={**CIRCUIT, "boxes": [box]})
    ways, bends = plans(run)[0]
    np.testing.assert_array_equal(bends, [side, 0.0, -side])
    assert ways[0] == pytest.approx(ways[2]) and (ways > 0.0).all()
    assert not run.contact.any() and run.place[-1, 0, 0] > 3.0
    passes = np.abs(run.place[:, 0, 0] - box[0]).argmin()
    assert side * (run.place[passes, 0, 1] - box[1]) > 0.25 + 0.13


@pytest.mark.parametrize("turned", [-35.0, 25.0])
def test_a_wall_at_an_angle_is_followed_after_one_arc(turned: float) -> None:
    start = {"lateral_error": np.sign(turned) * 0.3, "heading_error": np.deg2rad(turned)}
    run = drive(PUBLISHED, 120, start=start, world={**CIRCUIT, "length": 20.0, "corridor": 1.8})
    ways, bends = plans(run)[0]
    np.testing.assert_array_equal(bends, [-np.sign(turned), 0.0, 0.0])
    assert ways[0] == pytest.approx(RADIUS * np.deg2rad(abs(turned)), rel=0.1)
    ended = np.flatnonzero(run.states[:, 0, 4] != 0.0)[-1] + 3
    assert abs(run.place[ended, 0, 2]) < np.deg2rad(10.0)
    assert not run.contact.any()


def test_a_corner_to_the_right_is_driven_as_a_straight_and_a_quarter_of_a_circle() -> None:
    run = drive(PUBLISHED, 210, start=BESIDE, world={**CIRCUIT, "clockwise": True})
    ways, bends = plans(run)[0]
    np.testing.assert_array_equal(bends, [0.0, -1.0, 0.0])
    assert ways[1] == pytest.approx(0.5 * np.pi * RADIUS)
    # The straight takes the rear axle to the corner's height: 4.6 m from the start in the middle.
    arc = np.flatnonzero((run.states[:, 0, 7] == -1.0) & (run.states[:, 0, 4] > 0.0))[0]
    assert abs(run.place[arc, 0, 0]) == pytest.approx(4.6 + 0.175, abs=0.15)
    turned = np.unwrap(run.place[:, 0, 2])
    assert turned[-1] - turned[0] == pytest.approx(-0.5 * np.pi, abs=np.deg2rad(10.0))
    assert not run.contact.any()


def test_a_wall_across_is_a_corner_to_the_left() -> None:
    run = drive(PUBLISHED, 260, start=AHEAD, world=CIRCUIT)
    ways, bends = plans(run)[0]
    np.testing.assert_array_equal(bends, [1.0, 0.0, 0.0])
    assert ways[0] == pytest.approx(0.5 * np.pi * RADIUS, rel=0.1)
    assert run.place[-1, 0, 2] == pytest.approx(0.5 * np.pi, abs=np.deg2rad(12.0))
    assert not run.contact.any()


def test_a_hit_while_a_plan_is_driven_discards_it_and_backs_up() -> None:
    """A plan straight into a box, given to the policy: it goes back as far as stated, and then evades the box."""
    state = np.zeros((1, KnightRidersObstaclesPublished.memory))
    state[0, 4:7], state[0, 9] = [3.0, 1.0, 0.0], 1.0
    run = drive(PUBLISHED, 250, state, start=AHEAD, world={**CIRCUIT, "boxes": [(2.5, -4.0, 0.0, 0.3, 0.5)]})
    backs = np.flatnonzero(run.states[:, 0, 4] < 0.0)
    first, last = backs[0], backs[backs < backs[0] + 100][-1]
    np.testing.assert_array_equal(run.states[first, 0, 4:10], [-KnightRidersObstaclesPublished.RETREAT, 0, 0, 0, 0, 0])
    nose = 0.5 * 0.532
    assert 2.35 - run.place[first, 0, 0] - nose < KnightRidersObstaclesPublished.WATCHED
    back = run.place[first, 0, 0] - run.place[last + 1, 0, 0]
    assert 0.0 < back - KnightRidersObstaclesPublished.RETREAT < 0.06  # the way to a standstill comes on top
    assert not run.contact.any() and run.place[-1, 0, 0] > 2.9


def step(ranges: Callable[[np.ndarray], np.ndarray], mode: float = OBSTACLES) -> tuple[np.ndarray, Route]:
    """Action and route after the first step of a car at a scan (m over the beams' angles, rad)."""
    scenario = ObstacleCircuitScenario()
    angles = np.arange(scenario.scan.beams) * scenario.scan.step - 0.5 * scenario.scan.field_of_view
    seen = np.zeros((1, len(scenario.channels)), dtype=np.float32)
    names = [channel.name for channel in scenario.channels]
    seen[0, names.index("scan_0") : names.index("scan_0") + len(angles)] = ranges(angles)
    seen[0, names.index("distance_right")], seen[0, names.index("mode")] = 0.6, mode
    action, state = lanekeep_baselines.make(PUBLISHED, scenario).predict(seen)
    return action, Route.split(state)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_without_a_jump_point_a_fixed_arc_leads_to_the_freer_side(side: float) -> None:
    """Something with a step of 0.2 m straight ahead, which no wall has; jumps are from 0.3 m on."""
    _, route = step(lambda angle: np.where(side * angle < 0.02, 0.8, 1.0))
    np.testing.assert_allclose(route.ways, [[np.deg2rad(25.0) * RADIUS, 0.0, 0.0]])
    np.testing.assert_array_equal(route.bends, [[side, 0.0, 0.0]])


def test_no_way_to_a_target_is_a_short_way_back() -> None:
    """Its free edge is 0.2 m before the nose, 0.11 m to the left: for 0.31 m an arc needs 0.663 m, not 0.641 m."""
    _, route = step(lambda angle: np.where(angle < 0.5, 0.2 / np.cos(angle), 4.0))
    np.testing.assert_array_equal(route.ways, [[-KnightRidersObstaclesPublished.REVERSE, 0.0, 0.0]])


def test_without_obstacles_it_is_faster_and_looks_for_none() -> None:
    def box(angle: np.ndarray) -> np.ndarray:
        return np.where(np.abs(angle) < 0.15, 0.8, 4.0)

    careful, evades = step(box)
    fast, drives = step(box, ROUNDTRIP)
    assert evades.ways[0, 0] > 0.0 and drives.ways[0, 0] == 0.0
    assert fast[0, 1] > careful[0, 1] > 0.0


def test_circuits_among_boxes_are_driven() -> None:
    """The phases together take it round most circuits."""
    world = {"kind": "random-obstacle-circuits", "seed": 2017, "count": 16}
    run = drive(PUBLISHED, 2700, cars=16, start={"world_index": np.arange(16)}, world=world)
    success = (run.done & ~run.contact).any(axis=0)
    assert success.sum() >= 8


@pytest.fixture(scope="module")
def tasks() -> dict[bool, SimpleNamespace]:
    """All three modes in one episode, in one world, both directions; noise, biases, the Kinect's faults."""
    settings: dict[str, Any] = {
        "sensors": "production",
        "encoder_ticks": 40,
        "scan": "kinect-columns",
        "world": {**ROW, "boxes": [(-6.8, 0.0, 0.1, 0.3, 0.3)]},
        "modes": [(0.0, "roundtrip"), (4.0, "obstacles"), (6.6, "park")],
        "cars": 4,
        "steering_offset": (-0.017, 0.017),
    }
    found = {}
    for clockwise in (False, True):
        settings["world"] = {**settings["world"], "clockwise": clockwise}
        found[clockwise] = drive(MODES, 1100, **settings)
    return found


@pytest.mark.parametrize("clockwise", [False, True])
def test_modes_change_in_one_episode_that_ends_parked(tasks: dict[bool, SimpleNamespace], clockwise: bool) -> None:
    run = tasks[clockwise]
    assert not run.contact.any() and run.done.any(axis=0).all()
    for car in range(4):
        driven = run.states[: np.flatnonzero(run.done[:, car])[0], car, 0]
        order = driven[np.flatnonzero(np.diff(driven, prepend=-1.0))]
        np.testing.assert_array_equal(order, [ROUNDTRIP, OBSTACLES, APPROACH, PARK])
        slow = driven == APPROACH
        speed = [channel.name for channel in ObstacleCircuitScenario().channels].index("speed")
        assert run.seen[: len(slow)][slow, car, speed].max() < KnightRidersModes.SLOW + 0.15  # a tick of the encoder


def test_asked_for_a_round_trip_a_parked_car_leaves_its_space_and_ends_the_lap() -> None:
    modes = [(0.0, "roundtrip"), (4.0, "obstacles"), (6.6, "park"), (45.0, "roundtrip")]
    run = drive(MODES, 1800, cars=2, world=ROW, modes=modes, sensors="production", encoder_ticks=40)
    assert run.done.any(axis=0).all() and not run.contact.any()
    for car in range(2):
        driven = run.states[: np.flatnonzero(run.done[:, car])[0], car, 0]
        order = driven[np.flatnonzero(np.diff(driven, prepend=-1.0))]
        np.testing.assert_array_equal(order, [ROUNDTRIP, OBSTACLES, APPROACH, PARK, ROUNDTRIP])
        last = np.flatnonzero(driven == PARK)[-1]
        assert 2.0 < last * 0.045 - 45.0 < 15.0  # the way out


def test_without_free_space_fewer_circuits_are_driven() -> None:
    """The report's way back and fixed arc where the plan would hit something."""
    laps = []
    for free_space in (True, False):
        env = gym.make_vec(ID, 8, "vector_entry_point", world={"kind": "random-obstacle-circuits", "seed": 2018})
        policy = lanekeep_baselines.make("knightriders-obstacles", env.unwrapped.scenario, free_space=free_space)
        observation, _ = env.reset(seed=0, options={"world_index": np.arange(8)})
        state, over, success = None, np.zeros(8, dtype=bool), np.zeros(8, dtype=bool)
        for _ in range(1200):
            action, state = policy.predict(observation, state)
            observation, _, terminated, truncated, info = env.step(np.clip(action, -1.0, 1.0))
            success |= terminated & info["is_success"] & ~over
            over |= terminated | truncated
            if over.all():
                break
        laps.append(success.sum())
    assert laps[0] >= 7 and 1 <= laps[1] < laps[0]


def test_each_mode_is_its_policy_to_the_last_bit() -> None:
    for scenario, mode, name in (
        (ALL_MODES, ROUNDTRIP, "knightriders-circuit"),
        (ALL_MODES, OBSTACLES, "knightriders-obstacles"),
        (ParallelParkScenario(), PARK, "knightriders-park"),
    ):
        policy, other = (lanekeep_baselines.make(one, scenario) for one in (MODES, name))
        low, high = scenario.channel_bounds().T
        seen = low + np.random.default_rng(4).random((20, 7, len(low))) * (high - low)
        seen[..., [channel.name == "mode" for channel in scenario.channels]] = mode
        state = alone = None
        for rows in seen.astype(np.float32):
            action, state = policy.predict(rows, state)
            expected, alone = other.predict(rows, alone)
            assert action.tobytes() == expected.tobytes()


def test_a_mode_that_begins_starts_its_policy_afresh() -> None:
    scenario = ALL_MODES
    policy = lanekeep_baselines.make(MODES, scenario)
    low, high = scenario.channel_bounds().T
    seen = (low + np.random.default_rng(5).random((30, 5, len(low))) * (high - low)).astype(np.float32)
    names = [channel.name for channel in scenario.channels]
    seen[..., names.index("mode")] = ROUNDTRIP
    seen[10:20, ::2, names.index("mode")] = OBSTACLES
    state = None
    for row, rows in enumerate(seen):
        action, state = policy.predict(rows, state)
        if row in (10, 20):
            new, new_state = policy.predict(rows)
            np.testing.assert_array_equal(action[::2], new[::2])
            np.testing.assert_array_equal(state[::2], new_state[::2])
            assert (action[1::2] != new[1::2]).any()


@pytest.mark.parametrize("name", [PUBLISHED, MODES])
def test_rows_do_not_know_of_each_other_and_nothing_is_remembered_but_in_the_state(
    name: str, tasks: dict[bool, SimpleNamespace]
) -> None:
    """Rows at different times, so in different modes and phases, together and alone."""
    steps = min(len(run.seen) for run in tasks.values())
    seen = np.concatenate([run.seen[k : steps - 100 + k : 3] for run in tasks.values() for k in (0, 37, 90)], axis=1)
    policy = lanekeep_baselines.make(name, ALL_MODES)
    together = alone = part = None
    for rows in seen:
        before = None if together is None else together.copy()
        action, following = policy.predict(rows, together)
        if before is not None:
            np.testing.assert_array_equal(together, before)
        one, alone = policy.predict(rows[17], alone)
        some, part = policy.predict(rows[3:9], part)
        assert action.shape == (len(rows), 2) and np.isfinite(action).all() and np.isfinite(following).all()
        assert one.tobytes() == action[17].tobytes() and some.tobytes() == action[3:9].tobytes()
        assert alone.tobytes() == following[17].tobytes() and part.tobytes() == following[3:9].tobytes()
        together = following
    starts = np.arange(len(rows)) % 3 == 0
    mixed, mixed_state = policy.predict(rows, together, starts)
    new, new_state = policy.predict(rows)
    plain, plain_state = policy.predict(rows, together)
    np.testing.assert_array_equal(mixed, np.where(starts[:, None], new, plain))
    np.testing.assert_array_equal(mixed_state, np.where(starts[:, None], new_state, plain_state))


def test_they_say_what_they_need() -> None:
    assert MODES not in lanekeep_baselines.names(ObstacleCircuitScenario())  # which never parks
    for name in (PUBLISHED, MODES):
        assert name in lanekeep_baselines.names(ALL_MODES)
        assert name not in lanekeep_baselines.names(CircuitScenario())
        with pytest.raises(ValueError, match=r"needs the channel 'scan_0'"):
            lanekeep_baselines.make(name, replace(ALL_MODES, scan="none"))
