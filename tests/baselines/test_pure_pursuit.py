"""Pure pursuit's geometry worked out elsewhere: the arc, the goal on the path, the look-ahead distance."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_env  # noqa: F401  (registers the environments)
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import LaneKeepScenario

TO_REAR, WHEELBASE = 1.5, 2.8
BOTH = ("pure-pursuit", "pure-pursuit-understeer")


def ask(policy, **channels) -> np.ndarray:
    """Return the road-wheel angles for channels given as numbers or arrays."""
    n = max(np.size(value) for value in channels.values())
    at = {name: np.broadcast_to(np.asarray(value, dtype=float), (n,)).copy() for name, value in channels.items()}
    return policy.wanted(at)


def arc(curvature: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the end of an arc from the origin along x."""
    return np.sin(curvature * length) / curvature, (1.0 - np.cos(curvature * length)) / curvature


@pytest.mark.parametrize("speed", [2.0, 12.0, 40.0])
def test_arc_on_a_straight_leads_to_the_point_the_look_ahead_distance_away(speed: float) -> None:
    """delta = atan(2 l sin(alpha) / L_d), and the arc of that curvature passes through the goal."""
    policy = lanekeep_baselines.make("pure-pursuit", LaneKeepScenario())
    random = np.random.default_rng(0)
    lateral, heading = random.uniform(-1.5, 1.5, 40), random.uniform(-0.4, 0.4, 40)
    distance = max(5.0, 0.8 * speed)
    rear = lateral - TO_REAR * np.sin(heading)
    alpha = -np.arcsin(rear / distance) - heading
    delta = ask(policy, lateral_error=lateral, heading_error=heading, speed=speed)
    np.testing.assert_allclose(delta, np.arctan(2.0 * WHEELBASE * np.sin(alpha) / distance), atol=1e-12)
    curvature = np.tan(delta) / WHEELBASE
    x, y = arc(curvature, 2.0 * alpha / curvature)
    np.testing.assert_allclose(np.hypot(x, y), distance, rtol=1e-9)
    np.testing.assert_allclose(rear + np.sin(heading) * x + np.cos(heading) * y, 0.0, atol=1e-9)


@pytest.mark.parametrize("radius", [40.0, -90.0, 1000.0])
@pytest.mark.parametrize("speed", [0.0, 4.0, 9.0, 15.0])
def test_goal_lies_on_the_previewed_path(radius: float, speed: float) -> None:
    """On a circle: the arc from the rear axle crosses the circle where the goal is, about L_d away."""
    policy = lanekeep_baselines.make("pure-pursuit", LaneKeepScenario(preview=9))
    random = np.random.default_rng(1)
    lateral, heading = random.uniform(-1.0, 1.0, 30), random.uniform(-0.2, 0.2, 30)
    previews = {f"curvature_preview_{k}": 1.0 / radius for k in range(9)}
    delta = ask(policy, lateral_error=lateral, heading_error=heading, speed=speed, **previews)
    curvature = np.tan(delta) / WHEELBASE
    rear = np.array([-TO_REAR * np.cos(heading), lateral - TO_REAR * np.sin(heading)])
    length = np.linspace(0.9, 1.1, 2001)[:, None] * max(5.0, 0.8 * speed)
    x, y = arc(curvature, length)
    place = rear[:, None] + np.array(
        [np.cos(heading) * x - np.sin(heading) * y, np.sin(heading) * x + np.cos(heading) * y]
    )
    off = np.hypot(place[0], place[1] - radius) - abs(radius)
    crossing = np.abs(off).argmin(axis=0)
    # The arc meets the circle at its goal (or runs along it), a few per cent of L_d from where a straight path has it.
    assert np.abs(off[crossing, np.arange(30)]).max() < 2e-3


@pytest.mark.parametrize("name", BOTH)
def test_rear_axle_stays_on_a_circle_without_slip(name: str) -> None:
    """On the circle, along it, the answer is the circle's own curvature, to a tenth of a per cent."""
    policy = lanekeep_baselines.make(name, LaneKeepScenario(dynamics="kinematic", preview=12))
    radius = np.array([50.0, -50.0, 300.0, -1000.0])
    previews = {f"curvature_preview_{k}": 1.0 / radius for k in range(12)}
    heading = -np.arcsin(TO_REAR / radius)  # of a car whose rear axle runs along a circle, at its centre of gravity
    # The centre of gravity of a car whose rear axle is on the circle runs outside of it.
    lateral = radius - np.sign(radius) * np.hypot(radius, TO_REAR)
    for speed in (1.0, 10.0, 18.0):
        delta = ask(policy, lateral_error=lateral, heading_error=heading, speed=speed, **previews)
        np.testing.assert_allclose(np.tan(delta) / WHEELBASE, 1.0 / radius, rtol=2e-3)


def test_changing_curvature_is_followed_to_the_goal() -> None:
    """On a clothoid the path's lateral offset at arc length s is c s³/6, and that is what the answer is for."""
    policy = lanekeep_baselines.make("pure-pursuit", LaneKeepScenario(preview=20))
    speed, slope = 10.0, 1e-4
    previews = {f"curvature_preview_{k}": slope * 0.1 * speed * k for k in range(20)}
    x = 8.0 - TO_REAR
    delta = ask(policy, lateral_error=0.0, heading_error=0.0, speed=speed, **previews)
    assert np.tan(delta[0]) / WHEELBASE == pytest.approx(2.0 * (slope * x**3 / 6.0) / 8.0**2, rel=1e-3)


def test_previews_count_only_if_they_reach_the_goal() -> None:
    channels = {"lateral_error": 0.2, "heading_error": 0.05, "speed": 20.0}
    straight = ask(lanekeep_baselines.make("pure-pursuit", LaneKeepScenario()), **channels)
    for samples, interval, used in ((1, 0.1, False), (8, 0.1, False), (9, 0.1, True), (3, 0.4, True)):
        scenario = LaneKeepScenario(preview=samples, preview_interval=interval)
        previews = {f"curvature_preview_{k}": 0.01 for k in range(samples)}
        answer = ask(lanekeep_baselines.make("pure-pursuit", scenario), **channels, **previews)
        assert (answer != straight).item() is used


@pytest.mark.parametrize("name", BOTH)
def test_far_off_and_backwards_it_turns_to_the_path(name: str) -> None:
    policy = lanekeep_baselines.make(name, LaneKeepScenario())
    delta = ask(policy, lateral_error=[15.0, -15.0, 1.0, 0.0], heading_error=[0.0, 0.0, 2.0, -1.5], speed=5.0)
    assert np.isfinite(delta).all()
    assert delta[0] < 0.0 < delta[1] and delta[2] < 0.0 < delta[3]


@pytest.mark.parametrize("name", BOTH)
@pytest.mark.parametrize("speed", [2.0, 5.0, 10.0, 20.0, 35.0, 50.0])
def test_no_steady_error_on_a_straight_with_actuator_lag(bench, name: str, speed: float) -> None:
    scenario = LaneKeepScenario()
    policy = lanekeep_baselines.make(name, scenario)
    car = bench.LinearCar(scenario.vehicle, speed, scenario.control_step)
    states = bench.drive(policy, scenario, car, lambda t: np.zeros(1), 100.0, start=1.0)
    assert np.abs(states[-1, :, 3:]).max() < 1e-5


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_understeer_is_the_cars_own(bench, vehicle: str) -> None:
    """The angle asked for an arc is the one with which the linear car, left alone, turns at that curvature."""
    scenario = LaneKeepScenario(vehicle=VEHICLES[vehicle])
    policy = lanekeep_baselines.make("pure-pursuit-understeer", scenario)
    for speed in (10.0, 25.0, 40.0):
        curvature = np.array([2.0 / speed**2])
        delta = policy.steering(curvature, np.array([speed]))
        car = bench.LinearCar(scenario.vehicle, speed, 0.05)
        states = np.zeros((1, 5))
        for _ in range(400):
            states = car.advance(states, delta, np.zeros(1))
        assert states[0, 2] / speed == pytest.approx(curvature[0], rel=2e-3)  # atan of a few hundredths


@pytest.mark.parametrize(("speed", "width"), [(20.0, 1.8), (50.0, 9.57)])
def test_how_far_an_understeering_car_runs_wide(bench, speed: float, width: float) -> None:
    scenario = LaneKeepScenario(preview=20)
    car = bench.LinearCar(scenario.vehicle, speed, scenario.control_step)
    errors = []
    for name in BOTH:
        policy = lanekeep_baselines.make(name, scenario)
        curvature = np.array([3.924 / speed**2])
        errors.append(-bench.drive(policy, scenario, car, lambda t, c=curvature: c, 60.0)[-1, 0, 4])
    assert errors[0] == pytest.approx(width, rel=0.01)
    assert 0.0 < errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize(("name", "figure"), [("pure-pursuit", 1.24), ("pure-pursuit-understeer", 0.39)])
def test_sine_road_of_the_readme(name: str, figure: float) -> None:
    road = {"kind": "sine", "wavelength": 800.0}
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        road=road,
        speed=18.97,
        preview=12,
        departure="off",
        episode_steps=800,
        max_episode_steps=800,
    )
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
    observation, _ = env.reset(seed=0, options={"lateral_error": 1.0, "heading_error": 0.0, "arc_length": 0.0})
    errors = []
    for _ in range(800):
        observation, _, _, _, info = env.step(policy.predict(observation)[0])
        errors.append(info["lateral_error"])
    assert np.sqrt(np.mean(np.square(errors[100:]))) == pytest.approx(figure, abs=0.01)


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("pure-pursuit", {"dynamics": "kinematic"}),
        ("pure-pursuit", {"vehicle": "commonroad-2"}),
        ("pure-pursuit", {"vehicle": "commonroad-2", "action": "steering_rate"}),
        ("pure-pursuit-understeer", {}),
        ("pure-pursuit-understeer", {"road": "yin"}),
        ("pure-pursuit-understeer", {"action": "steering_rate"}),
    ],
    ids=str,
)
def test_no_departure_in_an_episode(name: str, settings: dict) -> None:
    envs = gym.make_vec("lanekeep/LaneKeep-v0", num_envs=16, preview=12, **settings)
    policy = lanekeep_baselines.make(name, envs.unwrapped.scenario)
    observation, _ = envs.reset(seed=0)
    for _ in range(600):
        observation, _, terminated, _, _ = envs.step(policy.predict(observation)[0])
        assert not terminated.any()
    envs.close()
