"""The steering gear with backlash against closed forms and a second simulation in steps of 10 microseconds."""

import math

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env  # noqa: F401
from lanekeep_env import layout as at

CAMERA, LANE = "lanekeep/CameraLane-v0", "lanekeep/LaneKeep-v0"
LAG, RATE = 0.25, math.radians(20.0)
LARGEST = 0.5  # rad at action 1


def run(commands, name=CAMERA, dt=0.01, **steering):
    """Motor and road-wheel angle (steps, cars), float64, for commands in rad, (steps,) or (steps, cars)."""
    commands = np.asarray(commands, dtype=float)
    commands = commands[:, None] if commands.ndim == 1 else commands
    env = gym.make_vec(
        name,
        commands.shape[1],
        "vector_entry_point",
        road="straight",
        departure="off",
        max_steering_angle=LARGEST,
        control_step=dt,
        episode_steps=1_000_000,
        speed=1.0,
        vehicle={
            "base": "van" if name == CAMERA else "yin",
            "steering": {"rate_limit": None, "angle_limit": None, "backlash": 0.0, "lag": LAG, **steering},
        },
    )
    env.reset(seed=0, options={"heading_error": 0.0, "lateral_error": 0.0})
    motor, wheel = [], []
    for row in commands:
        env.step(np.float32(row / LARGEST)[:, None])
        for row, kept in ((at.MOTOR, motor), (at.STEER, wheel)):
            cars = env.unwrapped._core.cars
            kept.append(np.concatenate([block[row] for block in cars])[: commands.shape[1]])
    return np.array(motor), np.array(wheel)


def slow(commands, dt, lag=LAG, rate=math.inf, gap=0.0, on_motor=False, h=1e-5):
    """Motor and road wheel by Euler steps: the wheel rests until the motor pushes it."""
    motor = wheel = 0.0
    shown = []
    for command in np.float32(np.asarray(commands) / LARGEST).astype(float) * LARGEST:
        for _ in range(round(dt / h)):
            measured = motor if on_motor else wheel
            motor += h * min(max((command - measured) / lag, -rate), rate)
            wheel = min(max(wheel, motor - gap / 2), motor + gap / 2)
        shown.append((motor, wheel))
    return np.array(shown).T


def varied(seed, steps):
    """Commands that jump, hold and creep."""
    rng = np.random.default_rng(seed)
    jumps = np.repeat(rng.uniform(-0.15, 0.15, steps // 10 + 1), 10)[:steps]
    return jumps + 0.02 * np.sin(0.3 * np.arange(steps))


@pytest.mark.parametrize("feedback", ["road_wheel", "motor"])
def test_a_closed_gap_is_the_first_order_lag(feedback):
    commands = varied(0, 200)
    _, plain = run(commands)
    _, tiny = run(commands, backlash=1e-9, feedback=feedback)
    np.testing.assert_allclose(tiny, plain, atol=2e-8)
    _, limited = run(commands, rate_limit=RATE)
    _, tiny = run(commands, backlash=1e-9, feedback=feedback, rate_limit=RATE)
    np.testing.assert_allclose(tiny, limited, atol=2e-8)


def time_constant(wheel, final, dt=0.01):
    """Identified from the rest of the way, which falls as exp(-t/T)."""
    rest = np.log(np.abs(final - wheel))
    return -1.0 / np.polyfit(dt * np.arange(len(rest)), rest, 1)[0]


@pytest.mark.parametrize("backlash", [0.0, math.radians(0.5), math.radians(2.0), math.radians(4.0)])
def test_a_small_step_behind_the_gear_has_the_stated_time_constant(backlash):
    """First a step that leaves the motor against the wheel, then one more in the same direction: no play is left."""
    first, second = np.full(400, 0.05), np.full(60, 0.08)
    _, wheel = run(np.concatenate([first, second]), backlash=backlash, rate_limit=RATE)
    assert wheel[399, 0] == pytest.approx(0.05, abs=1e-6)
    assert time_constant(wheel[400:, 0], 0.08) == pytest.approx(LAG, rel=0.01)
    # from the middle of the gap: the same once the motor has crossed it, which takes gap/2 over (step / T)
    _, wheel = run(np.full(120, 0.06), backlash=backlash, rate_limit=RATE)
    wait = 0.5 * backlash * LAG / 0.06
    moved = 0.01 * (1 + np.flatnonzero(wheel[:, 0] > 1e-12)[0])
    assert wait < moved <= wait + 0.011
    after = wheel[math.ceil(100 * wait) + 1 :, 0][:60]
    assert time_constant(after, 0.06) == pytest.approx(LAG, rel=0.05)
    time = 0.01 * np.arange(1, 121)
    expected = np.where(time < wait, 0.0, 0.06 * (1 - np.exp(-np.maximum(time - wait, 0.0) / LAG)))
    np.testing.assert_allclose(wheel[:, 0], expected, atol=5e-5)


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10**6), gap=st.floats(0.001, 0.2), limited=st.booleans())
def test_behind_the_gear_the_wheel_comes_to_rest_at_the_command_whatever_the_gap(seed, gap, limited):
    rng = np.random.default_rng(seed)  # crossing the gap takes gap T/step
    targets = np.cumsum(rng.choice([-1.0, 1.0], 6) * rng.uniform(0.04, 0.08, 6))
    limit = {"rate_limit": RATE} if limited else {}
    _, wheel = run(np.repeat(targets, 150), dt=0.05, backlash=gap, **limit)
    np.testing.assert_allclose(wheel[149::150, 0], np.float32(targets / LARGEST) * LARGEST, atol=1e-6)


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 10**6), gap=st.floats(0.001, 0.07))
def test_with_the_loop_on_the_motor_the_wheel_stays_half_the_gap_behind(seed, gap):
    targets = np.cumsum(np.random.default_rng(seed).choice([-1.0, 1.0], 5) * 0.08)  # all steps cross the gap
    motor, wheel = run(np.repeat(targets, 150), dt=0.05, backlash=gap, feedback="motor", rate_limit=RATE)
    came = np.sign(np.diff(np.concatenate([[0.0], targets])))
    np.testing.assert_allclose(motor[149::150, 0], targets, atol=1e-6)
    behind = (targets - wheel[149::150, 0]) * came
    np.testing.assert_allclose(behind, gap / 2, atol=1e-6)


@settings(max_examples=10, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    gap=st.floats(1e-4, 0.3),
    lag=st.floats(0.004, 1.0),
    rate=st.floats(0.02, 3.0),
    feedback=st.sampled_from(["road_wheel", "motor"]),
    name=st.sampled_from([CAMERA, LANE]),
)
def test_the_play_is_never_exceeded_nor_the_speed_limit(seed, gap, lag, rate, feedback, name):
    commands = np.random.default_rng(seed).uniform(-LARGEST, LARGEST, (60, 40)).repeat(3, axis=0)
    motor, wheel = run(commands, name, dt=0.02, backlash=gap, lag=lag, rate_limit=rate, feedback=feedback)
    assert np.abs(motor - wheel).max() <= gap / 2 + 1e-15
    for angle in (motor, wheel):
        assert np.abs(np.diff(angle, axis=0)).max() <= rate * 0.02 * (1 + 1e-9)
    # the wheel never leaves the range of what was asked for
    assert np.abs(wheel).max() <= LARGEST + 1e-12


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), gap=st.floats(1e-3, 0.1), feedback=st.sampled_from(["road_wheel", "motor"]))
def test_the_wheel_moves_only_when_it_is_pushed(seed, gap, feedback):
    commands = varied(seed, 300)
    motor, wheel = run(commands, backlash=gap, feedback=feedback, rate_limit=RATE)
    change, ahead = np.diff(wheel[:, 0]), (motor - wheel)[1:, 0]
    np.testing.assert_allclose(ahead[change > 1e-12], gap / 2, atol=1e-12)
    np.testing.assert_allclose(ahead[change < -1e-12], -gap / 2, atol=1e-12)


@pytest.mark.parametrize("feedback", ["road_wheel", "motor"])
@pytest.mark.parametrize(("gap", "rate"), [(math.radians(2.0), RATE), (0.02, math.inf), (0.1, 0.2)])
def test_it_is_the_second_simulation(gap, rate, feedback):
    """Within a twentieth of what the motor turns in one half-step of the integration."""
    commands = varied(7, 250)
    limit = {} if rate == math.inf else {"rate_limit": rate}
    motor, wheel = run(commands, backlash=gap, feedback=feedback, **limit)
    expected = slow(commands, 0.01, rate=rate, gap=gap, on_motor=feedback == "motor")
    fastest = min(rate, 0.3 / LAG)
    np.testing.assert_allclose(motor[:, 0], expected[0], atol=0.05 * fastest * 0.005)
    np.testing.assert_allclose(wheel[:, 0], expected[1], atol=0.05 * fastest * 0.005)


@pytest.mark.parametrize("keywords", [{}, {"tyre": "magic_formula"}])
def test_lane_keeping_has_the_same_gear(keywords):
    """The gear knows nothing of the car around it; the car follows the road wheel."""
    commands = np.stack([varied(seed, 150) / 2 for seed in range(5)], axis=1)
    for feedback in ("road_wheel", "motor"):
        ours = run(commands, backlash=0.03, rate_limit=RATE, feedback=feedback)
        theirs = run(commands, LANE, backlash=0.03, rate_limit=RATE, feedback=feedback)
        np.testing.assert_allclose(theirs, ours, atol=1e-12)
    env = gym.make(
        LANE,
        road="straight",
        speed=20.0,
        vehicle={"steering": {"lag": 0.1, "backlash": 0.04}},
        max_steering_angle=0.1,
        departure="off",
        **keywords,
    )
    env.reset(seed=0, options={"heading_error": 0.0, "lateral_error": 0.0})
    for _ in range(3):  # inside the gap nothing happens: 0.02 rad at 0.01 rad / 0.1 s take 0.2 s
        observation, _, _, _, info = env.step(np.array([0.1], np.float32))
        assert observation[4] == 0.0 and info["lateral_error"] == 0.0
    for _ in range(40):
        observation, _, _, _, info = env.step(np.array([0.1], np.float32))
    assert observation[4] == pytest.approx(0.01, abs=1e-5) and info["lateral_error"] > 1.0


def test_without_a_gap_there_is_no_gear():
    assert (
        gym.make(CAMERA, vehicle={"base": "van", "steering": {"lag": LAG, "backlash": 0.0}}).unwrapped._core._gear()
        is None
    )


@pytest.mark.parametrize(
    ("steering", "words"),
    [
        ({"backlash": 0.1, "lag": 0.0}, ["vehicle.steering.backlash=0.1", "lag"]),
        ({"lag": 5e-324}, ["vehicle.steering.lag=5e-324 s", "0, or at least 1e-06 s"]),
        ({"backlash": -0.1, "lag": 0.1}, ["vehicle.steering.backlash=-0.1", ">= 0", "rad"]),
        ({"backlash": 0.7, "lag": 0.1}, ["vehicle.steering.backlash=0.7", "<= 0.5"]),
        ({"feedback": "wheel"}, ["vehicle.steering.feedback='wheel'", "road_wheel", "motor"]),
    ],
)
def test_wrong_gears_are_named(steering, words):
    for name in (CAMERA, LANE):
        with pytest.raises(ValueError) as caught:
            gym.make(name, vehicle={"steering": steering})
        assert "\n" not in str(caught.value) and all(word in str(caught.value) for word in words)


def costs(name, effort, actions, **keywords):
    """Rewards, and everything else that environments tell, (steps, ...) each."""
    env = gym.make(name, effort=effort, departure="off", **keywords)
    env.reset(seed=2)
    rewards, seen = [], []
    for action in actions:
        observation, reward, _, _, info = env.step(np.full(env.action_space.shape, action, np.float32))
        rewards.append(reward)
        seen.append(np.concatenate([observation, [value for key, value in info.items() if np.isscalar(value)]]))
    return np.array(rewards), np.array(seen, dtype=float), env.unwrapped


@pytest.mark.parametrize("disturbance", [{}, {"changes": {"mass": 1.2, "time": 0.2}}])
def test_a_motor_that_turns_inside_the_gap_costs_its_speed(disturbance):
    """The road wheel stands; the motor goes c (1 - exp(-t/T)), whose mean speed of each step counts."""
    lag, dt, command, weight, reference = 0.3, 0.05, 0.01, 2.0, 0.05
    steering = {"lag": lag, "rate_limit": None, "delay": 0.0, "backlash": 0.04, "feedback": "motor"}
    keywords = {"vehicle": {"steering": steering}, "road": "straight", "speed": 20.0, "control_step": dt, **disturbance}
    keywords |= {"start_lateral_error": 0.0, "start_course_error": 0.0, "max_steering_angle": 0.1}
    keywords |= {"cost_weight": weight, "reference_steering_rate": reference}
    actions = [command / 0.1] * 30
    rewards, seen, _ = costs(LANE, "motor", actions, **keywords)
    motor = command * (1.0 - np.exp(-dt * np.arange(31) / lag))
    np.testing.assert_allclose(rewards, -weight * (np.diff(motor) / dt / reference) ** 2 * dt, rtol=1e-6)
    free, same, _ = costs(LANE, "road_wheel", actions, **keywords)
    assert (free == 0.0).all()
    np.testing.assert_array_equal(seen, same)


@pytest.mark.parametrize("feedback", ["road_wheel", "motor"])
def test_by_camera_the_motor_s_speed_costs_and_nothing_else_changes(feedback):
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, 60)
    steering = {"lag": 0.25, "rate_limit": RATE, "angle_limit": 0.6, "backlash": 0.035, "feedback": feedback}
    keywords = {"vehicle": {"base": "van", "steering": steering}, "observation": "full", "episode_steps": 100}
    rewards, seen, env = costs(CAMERA, "motor", actions, **keywords)
    scenario = env.scenario
    motor = np.append(0.0, seen[:, [c.name for c in env.channels].index("motor_angle")])
    usual, same, _ = costs(CAMERA, "road_wheel", actions, **keywords)
    np.testing.assert_array_equal(seen, same)
    info = dict(zip(env.step(np.zeros(1, np.float32))[4], range(100), strict=False))
    errors, rates = (seen[:, len(env.channels) + info[key]] for key in ("lateral_error", "steering_rate"))
    seconds = scenario.control_step
    for found, speeds in ((rewards[1:], np.diff(motor)[1:] / seconds), (usual[1:], rates[1:])):
        cost = (errors[1:] / scenario.reference_lateral_error) ** 2 + (speeds / scenario.reference_steering_rate) ** 2
        np.testing.assert_allclose(found, -np.minimum(cost, scenario.cost_cap) * seconds, rtol=1e-4, atol=1e-6)
    assert np.abs(rewards - usual).max() > 1e-3


def test_between_walls_as_well_and_many_cars_cost_what_one_does():
    steering = {"lag": 0.1, "backlash": 0.1, "feedback": "motor"}
    keywords = {"vehicle": {"base": "knightriders", "steering": steering}, "effort": "motor", "contact": "off"}
    many = gym.make_vec("lanekeep/WallFollow-v0", 3, "vector_entry_point", **keywords)
    one = gym.make("lanekeep/WallFollow-v0", **keywords)
    plain = gym.make("lanekeep/WallFollow-v0", **{**keywords, "effort": "road_wheel"})
    many.reset(seed=4), one.reset(seed=5), plain.reset(seed=5)
    less = 0.0
    for action in np.random.default_rng(0).uniform(-0.3, 0.3, 40).astype(np.float32):
        rewards = many.step(np.full((3, 1), action))[1]
        (_, reward, _, _, info), (_, other, _, _, same) = one.step(np.array([action])), plain.step(np.array([action]))
        assert reward == rewards[1] and info == same
        less = max(less, abs(other - reward))
    assert less > 1e-4


def test_without_a_gap_or_a_cost_it_is_refused():
    gap = {"vehicle": {"steering": {"lag": 0.1, "backlash": 0.02}}}
    for name, keywords, words in (
        (LANE, {}, "backlash=0"),
        (LANE, {**gap, "cost_weight": 0.0}, "cost_weight=0"),
        ("lanekeep/LaneSupport-v0", gap, "assistant"),
        ("lanekeep/Circuit-v0", {}, "time is what costs"),
    ):
        with pytest.raises(ValueError, match=f"effort='motor' .*has no effect.*{words}"):
            gym.make(name, effort="motor", **keywords)
    with pytest.raises(ValueError, match="effort='wheel' "):
        gym.make(LANE, effort="wheel")
