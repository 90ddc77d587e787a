"""The wall-following policies in `WallFollow-v0`: what the report claims, and what it did not see."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.knightriders import wall_car
from lanekeep_benchmarks.replications.knightriders_rules import contacts
from lanekeep_benchmarks.replications.wall_simulation import simulate
from lanekeep_env import CircuitScenario, WallFollowScenario

CORRIDOR = {"kind": "corridor", "length": 120.0, "width": 4.0}
OFFSET = math.radians(3.0)


def follow(name, steps, cars=1, seed=0, start=None, **keywords):
    """Return lateral errors (m), steering angles (rad) and whether a wall was touched: (steps, cars) each."""
    settings = {
        "world": CORRIDOR,
        "observation": "full",
        "episode_steps": steps + 1,
        "steering_offset": 0.0,
        **keywords,
    }
    env = gym.make_vec("lanekeep/WallFollow-v0", cars, "vector_entry_point", **settings)
    scenario = env.unwrapped.scenario
    steer = [channel.name for channel in scenario.channels].index("steering_angle")
    policy = lanekeep_baselines.make(name, scenario)
    observation, info = env.reset(seed=seed, options=start)
    errors, angles, touched, state = [info["lateral_error"]], [observation[:, steer]], [], None
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, _, _, _, info = env.step(action)
        errors.append(info["lateral_error"])
        angles.append(observation[:, steer])
        touched.append(info["cost"] > 0.0)
    env.close()
    return np.array(errors), np.array(angles), np.array(touched)


@pytest.mark.parametrize(
    ("policy", "name", "variant"),
    [
        ("knightriders-pi", "pi", "si"),
        ("knightriders-pi-state-as-driven", "pi-state", "as-driven"),
        ("knightriders-cascade", "cascade-redesigned", "si"),
        ("knightriders-pd-as-driven", "pd", "as-driven"),
    ],
)
@pytest.mark.parametrize("speed", [0.4, 0.6])
def test_policies_are_the_controllers_of_the_car_without_a_world(policy, name, variant, speed) -> None:
    """A simulation that knows neither walls nor sensors; headings stay inside the ultrasonic's cone."""
    run = simulate(name, variant, (0.95, 2.0, speed), duration=5.0)
    start = {"lateral_error": -0.05, "heading_error": math.radians(2.0)}
    errors, _, touched = follow(policy, len(run.time) - 1, start=start, speed=speed)
    assert not touched.any()
    assert errors[:, 0] == pytest.approx(run.distance - 1.0, abs=2e-3)


@pytest.mark.parametrize("speed", [0.4, 0.7, 1.0, 1.5, 2.0])
def test_the_cascade_on_the_kalman_filter_holds_the_wall_within_2_cm(speed: float) -> None:
    """Noise, yaw-rate bias and 3 degrees of steering offset to either side; the competition's PD does not."""
    for offset in (-OFFSET, OFFSET):
        settings = {"sensors": "production", "steering_offset": offset, "speed": speed, "cars": 32}
        errors, _, touched = follow("knightriders-cascade-kalman", 600, **settings)
        assert not touched.any()
        assert np.abs(errors[-200:]).max() < 0.02
        errors, _, _ = follow("knightriders-pd-as-driven", 600, **settings)
        assert np.abs(errors[-200:].mean(axis=0)).min() > 0.1


@pytest.mark.parametrize("sensors", [None, "production"])
@pytest.mark.parametrize("speed", [0.1, 0.3, 0.5])
def test_no_slow_cascade_on_the_kalman_filter_touches_the_wall(speed: float, sensors: str | None) -> None:
    """400 cars from the environment's own starts, of which 11 did at 0.1 m/s."""
    assert contacts(speed, sensors) == (0, 0)


@pytest.mark.parametrize("place", [0.0, 0.14, 0.3])
def test_the_side_sensor_is_where_it_is_said_to_be_and_the_policies_know(place: float) -> None:
    """A car turned by 10 degrees at 0.9 m of its rear axle hears the wall from the sensor's place."""
    keywords = {"world": CORRIDOR, "side_sensor": place, "observation": "full", "steering_offset": 0.0, "speed": 0.5}
    env = gym.make("lanekeep/WallFollow-v0", **keywords)
    heading = math.radians(10.0)
    # The lateral error that is asked for is the sensor's.
    observation, info = env.reset(seed=0, options={"lateral_error": -0.1, "heading_error": heading})
    assert info["distance"] == pytest.approx(0.9, abs=1e-9) and observation[0] == pytest.approx(0.9, abs=1e-6)
    # The centre of gravity is half-way between the axles; the wall is 2 m to the right of the corridor's centre line.
    assert info["y"] == pytest.approx(-2.0 + 0.9 + (0.175 - place) * math.sin(heading), abs=1e-9)
    assert wall_car(env.unwrapped.scenario).sensor == place
    env.close()
    errors, _, touched = follow("knightriders-cascade-kalman", 600, cars=8, side_sensor=place, sensors="production")
    assert not touched.any() and np.abs(errors[-200:]).max() < 0.03


@pytest.mark.parametrize("speed", [0.4, 1.0, 2.0])
@pytest.mark.parametrize("start", [(0.2, 20.0), (-0.5, -20.0), (0.3, -10.0)])
def test_the_redesigned_cascade_neither_overshoots_nor_winds_up_nor_chatters(speed: float, start) -> None:
    """From the report's starts: no more than 1 cm beyond the set distance once it was met, and calm steering."""
    place = {"lateral_error": start[0], "heading_error": math.radians(start[1])}
    errors, angles, touched = follow("knightriders-cascade", 500, start=place, speed=speed)
    errors = errors[:, 0]
    assert not touched.any()
    # The heading at the start carries the car on at first; from the farthest place on it only comes nearer.
    turned = int(np.argmax(np.abs(errors)))
    side = np.sign(errors[turned])
    assert (side * errors[turned:]).min() > -0.01
    assert abs(errors[-1]) < 0.005
    reversals = np.sum(np.diff(np.sign(np.diff(angles[20:, 0][np.abs(np.diff(angles[19:, 0])) > 1e-3]))) != 0)
    assert reversals <= 4


def test_the_published_cascade_chatters_between_the_steering_limits() -> None:
    """A loop gain of 17 with one sample of delay: at its limit most of the time."""
    _, angles, _ = follow("knightriders-cascade-published", 400, speed=0.4)
    limit = WallFollowScenario().max_steering_angle
    assert np.mean(np.abs(angles[20:]) > 0.99 * limit) > 0.85


def test_the_state_feedback_in_radians_winds_up() -> None:
    """MODELS: started 0.2 m off and 20 degrees at 0.4 m/s it diverges, into a wall; as driven it does not."""
    start = {"lateral_error": -0.2, "heading_error": math.radians(20.0)}
    errors, _, touched = follow("knightriders-pi-state", 600, start=start, speed=0.4, contact="cost")
    assert touched.any()
    errors, _, touched = follow("knightriders-pi-state-as-driven", 600, start=start, speed=0.4)
    assert np.abs(errors).max() < 0.5 and not touched.any()


def test_steps_without_an_echo_hold_the_last_distance() -> None:
    scenario = WallFollowScenario(observation="full")
    policy = lanekeep_baselines.make("knightriders-pi", scenario)
    seen = np.zeros((1, len(scenario.channels)), dtype=np.float32)
    seen[0, 0], seen[0, 4] = 1.2, 1.0
    _, state = policy.predict(seen)
    expected, _ = policy.predict(seen, state)
    seen[0, 0] = 0.0
    action, _ = policy.predict(seen, state)
    assert action == expected


def test_the_heading_has_to_be_measured() -> None:
    with pytest.raises(ValueError, match="heading_error"):
        lanekeep_baselines.make("knightriders-cascade", WallFollowScenario())
    assert "knightriders-cascade-kalman" in lanekeep_baselines.names(WallFollowScenario())


WALL = WallFollowScenario(observation="full")
POLICIES = {n: lanekeep_baselines.make(n, WALL) for n in lanekeep_baselines.names(WALL) if n.startswith("knightriders")}


@pytest.mark.parametrize("name", POLICIES)
def test_rows_are_independent_and_nothing_is_remembered_but_in_the_state(name: str) -> None:
    """Ten steps of random readings, some without an echo: 50 rows at once and one by one, to the last bit."""
    random = np.random.default_rng(3)
    steps, rows = 10, 50
    seen = random.normal(size=(steps, rows, len(WALL.channels))) * 0.2
    seen[..., :3] = random.uniform(0.3, 3.0, size=(steps, rows, 3)) * (random.random((steps, rows, 3)) < 0.9)
    seen[..., 4] = random.uniform(0.0, 2.0, size=(steps, rows))
    policy = POLICIES[name]
    seen = seen.astype(np.float32)
    state = None
    alone: list = [None] * rows
    for step in range(steps):
        before = None if state is None else state.copy()
        action, following = policy.predict(seen[step], state)
        assert action.shape == (rows, 1) and np.isfinite(action).all()
        if state is not None:
            np.testing.assert_array_equal(state, before)
        for row in range(0, rows, 7):
            one, alone[row] = policy.predict(seen[step, row], alone[row])
            assert one.tobytes() == action[row].tobytes() and alone[row].tobytes() == following[row].tobytes()
        state = following


def test_a_policy_is_for_as_many_actions_as_it_gives() -> None:
    assert lanekeep_baselines.names(CircuitScenario()) == ("knightriders-circuit",)
    assert "knightriders-circuit" not in lanekeep_baselines.names(WALL)
    with pytest.raises(ValueError, match="the scenario asks for 2"):
        lanekeep_baselines.make("knightriders-pi", CircuitScenario())
