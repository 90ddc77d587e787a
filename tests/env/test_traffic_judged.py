"""What is judged in traffic: stop points that are passed, cars ahead as they drive, what could have been avoided."""

import math

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_env  # noqa: F401
from lanekeep_env import VEHICLES, Termination
from lanekeep_env import layout as at
from lanekeep_env.physics.powertrain_parameters import Powertrain

DRIVE, CAR, TRAIN, G = "lanekeep/Drive-v0", VEHICLES["passat"], Powertrain(), 9.81
START = {"lateral_error": 0.0, "heading_error": 0.0}
HAZARDS = {"count": 300, "hazards": 1.0, "largest_speed": 25.0, "duration": 25.0, "seed": 5}


def make(traffic, **keywords):
    return gym.make(DRIVE, **{"road": "straight", "slope": 0.0, "wind": 0.0, "traffic": traffic, **keywords})


def row(env, number):
    return float(env.unwrapped._core.cars[0, number, 0])


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_constant_throttle_past_a_stop_point_fails_in_reward_and_info(dtype):
    env = make([(0, "speed", 15), (1, "stop", 5)], dtype=dtype)
    env.reset(seed=0, options=START)
    steps, terminated = 0, False
    while not terminated:
        before = row(env, at.STOP_GAP)
        _, reward, terminated, truncated, info = env.step(np.array([0.0, 0.2], np.float32))
        steps += 1
    assert not truncated and not info["is_success"] and info["cost"] == 1.0
    assert info["termination"] == Termination.STOP_PASSED
    assert before >= -0.05 > info["stop_error"] > -0.4
    assert reward == pytest.approx(-16.0 * 0.02 * (3000 - steps + 1), rel=1e-6)
    assert info["overrun"] == 1.0 and info["avoidable_overrun"] == 0.0  # from 15 m/s in 5 m


@pytest.mark.parametrize(("departure", "ends"), [("terminate", True), ("cost", False), ("off", False)])
def test_a_stop_a_few_centimetres_beyond_is_no_failure_and_more_is(departure, ends):
    for beyond in (0.03, 0.08):
        env = make([(0, "speed", 3), (0, "stop", 4.0)], departure=departure)
        env.reset(seed=0, options=START)
        env.unwrapped._core.cars[0, at.STOP_GAP, 0] = 0.001
        env.unwrapped._core.cars[0, at.SPEED, 0] = 0.0
        flags, costs = [], []
        for _ in range(300):
            pedal = 0.0 if row(env, at.STOP_GAP) > -beyond else -1.0
            *_, terminated, _, info = env.step(np.array([0.0, pedal], np.float32))
            flags.append(terminated), costs.append(info["cost"])
            if terminated:
                break
        assert any(flags) == (ends and beyond > 0.05)
        assert (max(costs) == 1.0) == (beyond > 0.05) != info["is_success"]


def test_the_car_ahead_drives_its_own_way_and_is_seen_truly_to_two_hundred_metres():
    """Speeds are linear in time between events, of which the gap is the integral; beyond 200 m it is out of sight."""
    events = [
        (0, "speed", 10),
        (0, "lead", 150, 20),
        (1, "lead_speed", 26, 2),
        (8, "lead_speed", 5, 6),
        (30, "lead_gone"),
    ]
    env = make(events, departure="off")
    names = [c.name for c in env.unwrapped.channels]
    gap_of, lead_of = names.index("lead_gap"), names.index("lead_speed")
    observation, info = env.reset(seed=0, options=START)
    assert (observation[gap_of], info["gap"], info["time_to_collision"]) == (150.0, 150.0, at.NOWHERE)
    own, gap, lead, unseen = 10.0, 150.0, 20.0, 0
    for k in range(1400):
        observation, *_, info = env.step(np.array([0.0, 0.5], np.float32))
        t, dt = 0.02 * k + 1e-9, 0.02
        goal, rate = (20.0, 0.0) if t < 1.0 else (26.0, 2.0) if t < 8.0 else (5.0, 6.0)
        after = lead + np.clip(goal - lead, -rate * dt, rate * dt)
        gap += 0.5 * (lead + after - own - info["speed"]) * dt
        own, lead = info["speed"], after
        if gap <= 0.0:
            break
        assert info["gap"] == pytest.approx(gap, abs=2e-3)
        assert observation[gap_of] == pytest.approx(min(gap, 200.0), abs=2e-3)
        assert observation[lead_of] == pytest.approx(lead if gap < 200.0 else 0.0, abs=1e-4)
        unseen += gap > 200.0
        closing = own - lead
        assert info["time_to_collision"] == pytest.approx(gap / closing if closing > 1e-3 else at.NOWHERE, rel=0.05)
    assert unseen > 100 and gap < 150.0


def test_a_car_ahead_brakes_no_harder_than_the_road_lets_it():
    env = make([(0, "speed", 10), (0, "lead", 100, 20), (0.5, "lead_speed", 0, 9)], friction=0.3, departure="off")
    env.reset(seed=0, options=START)
    for _ in range(125):
        env.step(np.zeros(2, np.float32))
    assert row(env, at.LEAD_SPEED) == pytest.approx(20.0 - 2.0 * 0.3 * G, abs=1e-6)


def driven(brakes, seeds, steps=1250, **keywords):
    """Termination and what was avoidable of random episodes, (n,); ``brakes`` (n,): from which time on, s."""
    n = len(seeds)
    env = gym.make_vec(
        DRIVE, n, "vector_entry_point", autoreset_mode="disabled", traffic=HAZARDS, slope=(-0.0997, 0.0997),
        wind=(-15.0, 15.0), episode_steps=steps, **{"road": "straight", "lane_width": 1000.0, **keywords},
    )  # fmt: skip
    env.reset(seed=list(seeds), options=START)
    core, found, avoidable, event = env.unwrapped._core, np.zeros(n, int), np.zeros(n), np.zeros(n, int)
    alive = np.ones(n, bool)
    for k in range(steps):
        action = np.full((n, 2), keywords.get("lane_width", 0.0) and math.atan(CAR.wheelbase / 150.0) / 0.5, np.float32)
        action[:, 1] = np.where(0.02 * k >= brakes - 1e-6, -1.0, 0.15)
        *_, ended, over, info = env.step(action)
        new = alive & ended
        found[new], avoidable[new] = (
            info["termination"][new],
            (info["avoidable_contact"] + info["avoidable_overrun"])[new],
        )
        for code, first in ((Termination.CONTACT, at.LEAD_SIGHT), (Termination.STOP_PASSED, at.STOP_SIGHT)):
            rows = new & (info["termination"] == code)
            event[rows] = core.cars[:, first + at.SIGHT_EVENT].reshape(-1)[:n][rows]
        alive &= ~(ended | over)
    times = core.equipment[5][core.counters[at.TIMELINE], event, at.E_TIME]
    return found, avoidable, times


@pytest.mark.parametrize(
    "keywords",
    [
        {},
        {"friction": 0.3},
        {"friction_circle": False},
        {"road": {"kind": "circle", "radius": 150.0}, "friction": 0.7, "lane_width": 200.0},
    ],
)
def test_what_is_called_avoidable_is_what_braking_from_the_first_observation_avoids(keywords):
    """Everyone who failed drives once more, and brakes fully from the first observation on that shows what was met."""
    seeds = np.arange(300)
    found, avoidable, since = driven(np.full(300, np.inf), seeds, **keywords)
    failed = np.isin(found, (Termination.CONTACT, Termination.STOP_PASSED))
    again, _, _ = driven(since[failed] + np.where(since[failed] > 0.0, 0.02, 0.0), seeds[failed], **keywords)
    before = avoidable[failed] > 0.0
    assert failed.sum() > 60 and 5 < before.sum() < failed.sum() - 5
    differ = np.flatnonzero(before != (again != found[failed]))
    # Control steps and sub-steps round differently where it is a matter of centimetres.
    assert len(differ) <= 0.02 * len(before), differ


@pytest.mark.parametrize("slope", [-0.05, 0.05])
def test_backwards_and_forwards_again_in_one_episode(slope):
    """Standing, the lever follows the sign of the set speed; the car rolls where its wheels point, up or down."""
    env = make([(0, "speed", 0), (1, "speed", -2), (8, "speed", 2)], slope=slope, departure="off")
    names = [c.name for c in env.unwrapped.channels]
    columns = [names.index(name) for name in ("speed", "gear", "yaw_rate", "steering_angle", "acceleration")]
    env.reset(seed=0, options=START)
    table = []
    for k in range(800):
        v = table[-1][0] if table else 0.0
        pedal = -0.4 if k < 50 or 350 < k < 450 else float(np.clip(0.6 * (1.5 - abs(v)), -0.5, 0.6))
        table.append(env.step(np.array([0.4, pedal], np.float32))[0][columns].astype(float))
    v, gear, rate, steer, a = np.array(table).T
    assert set(gear[60:350]) == {-1.0} and set(gear[500:]) == {0.0}
    assert v[60:350].max() <= 0.0 and v[340] == pytest.approx(-1.5, abs=0.5) and v[450:].min() >= 0.0 and v[-1] > 1.0
    steady = np.abs(a) < 0.05
    steady &= np.abs(v) > 1.0
    assert steady.sum() > 50
    # Axle geometry, and the tyres' understeer: K v²/l of 0.7 % at 1.5 m/s.
    np.testing.assert_allclose(rate[steady], v[steady] * np.tan(steer[steady]) / CAR.wheelbase, rtol=0.02)


def test_engine_and_brake_leave_across_what_the_circle_leaves():
    """An axle's largest lateral force is sqrt(1 - u²) of its peak, u the share that is taken along."""
    for pedal, friction in ((-0.5, 1.0), (-1.0, 1.0), (-1.0, 0.4), (1.0, 0.3), (0.0, 1.0)):
        env = make([(0, "speed", 10)], friction=friction, powertrain={"pedal_lag": 0.0})
        env.reset(seed=0, options=START)
        env.step(np.array([0.0, pedal], np.float32))
        core = env.unwrapped._core
        slope_and_air = TRAIN.rolling * G + 0.6 * TRAIN.drag_area * row(env, at.SPEED) ** 2 / CAR.mass
        along = row(env, at.PULL) + slope_and_air
        used = along / (friction * G)
        for peak, grip in ((at.FRONT_PEAK, at.FRONT_GRIP), (at.REAR_PEAK, at.REAR_GRIP)):
            ratio = core.cars[0, peak, 0] / core.cars[0, grip, 0]
            assert ratio == pytest.approx(math.sqrt(1.0 - used**2), abs=2e-3)
        assert abs(used) <= 0.95 + 1e-3


def test_a_car_that_brakes_and_swerves_on_a_slippery_road_has_less_across_than_without_the_circle():
    offsets = []
    for circle in (True, False):
        env = make([(0, "speed", 15)], friction=0.3, friction_circle=circle, lane_width=100.0)
        env.reset(seed=0, options=START)
        for _ in range(100):
            *_, info = env.step(np.array([0.2, -1.0], np.float32))
        offsets.append(info["lateral_error"])
    assert 0.0 < offsets[0] < 0.8 * offsets[1]


def test_the_car_ahead_the_stop_line_and_the_failure_are_drawn(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    frames = {}
    for name, events in {"alone": [], "lead": [(0, "lead", 20, 10)], "stop": [(0, "stop", 20)]}.items():
        env = make([(0, "speed", 10), *events], render_mode="rgb_array")
        env.reset(seed=0, options={**START, "arc_length": 500.0, "road_index": 0})
        frames[name] = env.render().astype(int)
    shown = {name: np.abs(frame - frames["alone"]).sum(axis=2) > 60 for name, frame in frames.items()}
    assert shown["lead"].sum() > 200 and shown["stop"].sum() > 50
    env = make([(0, "speed", 10), (0, "stop", 1)], render_mode="rgb_array")
    env.reset(seed=0, options=START)
    terminated = False
    while not terminated:
        *_, terminated, _, _ = env.step(np.zeros(2, np.float32))
    assert env.unwrapped._core.pose(0).failure == "passed the stop point"
    assert env.render().shape == frames["alone"].shape
