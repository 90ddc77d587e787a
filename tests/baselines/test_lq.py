"""The LQ controllers in closed loop: the least cost there is, no stationary error, filters that know the sensors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.lq import LinearQuadraticGaussian, LqPreview, LqPreviewOffsetFree
from lanekeep_baselines.lq_design import Weights
from lanekeep_baselines.lq_model import HEADING, LATERAL, STEER, YAW_RATE, StepModel
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.scenario import CameraLaneScenario, LaneKeepScenario, ReversePathScenario

STEP = 0.05
NOMINAL = Weights(rate=1.0, slip=1e-3, steer=1e-3, drift=1e-2, bend=0.1)
#: A preview of 2 s that shows every control step.
FINE = {"preview": 41, "preview_interval": STEP}


def with_delay(delay: float) -> LaneKeepScenario:
    """Return a scenario whose actuator also delays."""
    car = VEHICLES["yin"]
    return LaneKeepScenario(vehicle=replace(car, steering=replace(car.steering, delay=delay)), **FINE)


def drive(policy, scenario: LaneKeepScenario, speed: float, road: np.ndarray, start: float) -> np.ndarray:
    """Return the states (steps + 1, 5) of the linear nominal car along curvatures ``road``, held behind their end."""
    model = StepModel.of(scenario.vehicle, speed, STEP)
    x, memory = np.array([0.0, 0.0, 0.0, 0.0, start]), None
    sent, states = [0.0] * model.b.shape[1], []
    for k in range(500):
        states.append(x)
        seen = road[np.minimum(k + np.arange(scenario.preview), len(road) - 1)]
        observed = np.array([[x[LATERAL], x[3], x[2], speed, x[STEER], sent[0], *seen]])
        action, memory = policy.predict(observed, memory)
        sent = [float(action[0, 0]) * scenario.max_steering_angle, *sent[:-1]]
        x = model.a @ x + model.b @ sent + model.curvature @ seen[:2]
    return np.array(states)


def cost(scenario: LaneKeepScenario, states: np.ndarray) -> float:
    """Return the running cost of the scenario, without its cap, in control steps."""
    rate = np.diff(states[:, STEER]) / STEP / scenario.reference_steering_rate
    lateral = states[:-1, LATERAL] / scenario.reference_lateral_error
    return float(lateral @ lateral + scenario.cost_weight * rate @ rate)


def least_cost(scenario: LaneKeepScenario, speed: float, road: np.ndarray, start: float) -> float:
    """Return the least cost of any commands, by least squares over all of them at once."""
    model, n = StepModel.of(scenario.vehicle, speed, STEP), 499

    def residuals(u: np.ndarray, kappa: np.ndarray, lateral: float) -> np.ndarray:
        x, sent, states = np.array([0.0, 0.0, 0.0, 0.0, lateral]), [0.0] * model.b.shape[1], []
        for k in range(n):
            states.append(x)
            sent = [u[k], *sent[:-1]]
            x = model.a @ x + model.b @ sent + model.curvature @ kappa[k : k + 2]
        states = np.array([*states, x])
        rate = np.diff(states[:, STEER]) / STEP / scenario.reference_steering_rate
        return np.stack([states[:-1, LATERAL] / scenario.reference_lateral_error, np.sqrt(scenario.cost_weight) * rate])

    straight = np.zeros(n + 1)
    free = residuals(straight, road[np.minimum(np.arange(n + 1), len(road) - 1)], start)
    impulse = residuals(np.eye(n)[0], straight, 0.0)
    columns = [np.concatenate([np.zeros((2, k)), impulse[:, : n - k]], axis=1).ravel() for k in range(n)]
    response = np.stack(columns, axis=1)
    best = np.linalg.lstsq(response, -free.ravel(), rcond=None)[0]
    return float(np.sum((free.ravel() + response @ best) ** 2))


def paired(names: str, some: list[Any], others: list[Any]) -> pytest.MarkDecorator:
    """Each of some with one of the others; every pair in the slow tests."""
    pairs = [
        pytest.param(one, other, marks=() if row == column else pytest.mark.slow)
        for row, one in enumerate(some)
        for column, other in enumerate(others)
    ]
    return pytest.mark.parametrize(names, pairs)


@paired("speed, delay", [10.0, 20.0, 45.0], [0.05, 0.12, 0.0])
def test_no_drive_costs_less_than_lq_preview(speed: float, delay: float) -> None:
    """From beside the lane into a curve: what the policy costs is what the best of all commands cost."""
    scenario = with_delay(delay)
    # A road whose whole future fits in the first preview: a straight, a clothoid, an arc.
    road = 3.0 / speed**2 * np.interp(np.arange(41), [0, 12, 30, 40], [0.0, 0.0, 1.0, 1.0])
    least = least_cost(scenario, speed, road, start=0.4)
    found = cost(scenario, drive(LqPreview(scenario, NOMINAL), scenario, speed, road, start=0.4))
    assert found == pytest.approx(least, rel=1e-5)
    for rate in (0.5, 0.8, 1.25, 2.0):
        other = LqPreview(scenario, replace(NOMINAL, rate=rate))
        assert cost(scenario, drive(other, scenario, speed, road, start=0.4)) > found


class Scaled(LqPreview):
    """With one of the numbers that are fed back taken for a tenth more or less: a gain that is a tenth off."""

    channel: str
    factor: float

    def command(self, at, memory, fresh):
        right, following = super().command(at, memory, fresh)
        other = {**at, self.channel: at[self.channel] * (1.0 + 1e-3)}
        slope = (super().command(other, memory, fresh)[0] - right) / 1e-3
        return right + self.factor * slope, following


@pytest.mark.parametrize("factor", [-0.1, 0.1])
@pytest.mark.parametrize(
    "channel",
    ["lateral_error", "heading_error", "yaw_rate", "steering_angle", "curvature_preview_12", "curvature_preview_40"],
)
def test_any_other_gain_costs_more(channel: str, factor: float) -> None:
    scenario, speed = with_delay(0.0), 20.0
    road = 3.0 / speed**2 * np.interp(np.arange(41), [0, 12, 30, 40], [0.0, 0.0, 1.0, 1.0])
    best, other = LqPreview(scenario, NOMINAL), Scaled(scenario, NOMINAL)
    other.channel, other.factor = channel, factor
    costs = [cost(scenario, drive(policy, scenario, speed, road, start=0.4)) for policy in (best, other)]
    assert costs[1] > costs[0] * (1.0 + 1e-7)


@paired(
    "speed, wrong",
    [10.0, 20.0, 35.0],
    [{"mass": 1.2}, {"front_cornering_stiffness": 0.8}, {"rear_cornering_stiffness": 0.7}],
)
def test_offset_free_means_no_stationary_error_on_another_car(bench, speed: float, wrong: dict[str, float]) -> None:
    scenario = LaneKeepScenario(preview=20)
    nominal = scenario.vehicle
    car = replace(nominal, **{name: factor * getattr(nominal, name) for name, factor in wrong.items()})
    curvature = 3.0 / speed**2 * np.array([1.0, -0.5])
    stays = {}
    for name in ("lq-preview", "lq-preview-offset-free", "lqg"):
        policy = lanekeep_baselines.make(name, scenario)
        plant = bench.LinearCar(car, speed, scenario.control_step)
        states = bench.drive(policy, scenario, plant, lambda t: curvature, 60.0)
        stays[name] = np.abs(states[-1, :, LATERAL]).max()
    assert stays["lq-preview-offset-free"] < 1e-4 and stays["lqg"] < 1e-4
    assert stays["lq-preview"] > 0.01


@pytest.mark.parametrize("name", ["lq-preview", "lq-preview-offset-free", "lqg"])
@pytest.mark.parametrize("speed", [3.0, 18.97, 50.0])
def test_the_nominal_car_has_no_stationary_error(bench, name: str, speed: float) -> None:
    scenario = LaneKeepScenario(preview=20)
    policy = lanekeep_baselines.make(name, scenario)
    plant = bench.LinearCar(scenario.vehicle, speed, scenario.control_step)
    states = bench.drive(policy, scenario, plant, lambda t: 3.0 / speed**2 * np.array([1.0, -0.5]), 60.0, start=0.5)
    assert np.abs(states[-1, :, LATERAL]).max() < 1e-3


def test_lqg_does_not_look_ahead() -> None:
    """The road ahead, shown or not, whatever it looks like, changes no bit."""
    random = np.random.default_rng(0)
    blind, seeing = LaneKeepScenario(), LaneKeepScenario(preview=20)
    rows = random.normal(size=(5, 8, 26)) * 0.05
    rows[..., 3] = random.uniform(5.0, 40.0, size=(5, 8))
    states = [None, None]
    for row in rows:
        first, states[0] = lanekeep_baselines.make("lqg", blind).predict(row[:, :6], states[0])
        second, states[1] = lanekeep_baselines.make("lqg", seeing).predict(row, states[1])
        assert first.tobytes() == second.tobytes()


@pytest.mark.parametrize("kind", [LqPreview, LqPreviewOffsetFree, LinearQuadraticGaussian])
def test_a_filter_that_knows_the_noise_drives_better(bench, kind) -> None:
    """The same noisy episodes on a straight, with the gains for perfect sensors and for those that there are."""
    speed, cars = 25.0, 40
    noise = {"lateral_error": 0.1, "heading_error": 0.01, "yaw_rate": 0.02, "steering_angle": 1e-3}
    noisy = LaneKeepScenario.from_keywords(
        preview=20, sensors={name: {"noise": value} for name, value in noise.items()}
    )
    costs = []
    for scenario in (LaneKeepScenario(preview=20), noisy):
        policy, random = kind(scenario), np.random.default_rng(0)
        plant = bench.LinearCar(scenario.vehicle, speed, STEP)
        names = [channel.name for channel in scenario.channels]
        states, command, memory, history = np.zeros((cars, 5)), np.zeros(cars), None, []
        for _ in range(400):
            seen = plant.observe(scenario, states, command, np.zeros(cars))
            for name, deviation in noise.items():
                seen[:, names.index(name)] += deviation * random.normal(size=cars)
            action, memory = policy.predict(seen, memory)
            command = action[:, 0].astype(float) * scenario.max_steering_angle
            states = plant.advance(states, command, np.zeros(cars))
            history.append(states)
        drives = np.moveaxis(np.array(history), 1, 0)
        costs.append(np.mean([cost(scenario, one) for one in drives]))
    assert costs[1] < 0.7 * costs[0]


@pytest.mark.parametrize("kind", [LqPreview, LqPreviewOffsetFree, LinearQuadraticGaussian])
def test_late_sensors_change_nothing_on_the_nominal_car(kind) -> None:
    """The filter knows what late sensors are still to tell: from a steady start it drives to the same last digit."""
    late = {"lateral_error": {"delay": 0.1}, "heading_error": {"delay": 0.05}, "yaw_rate": {"delay": 0.05}}
    scenario, speed, drives = LaneKeepScenario(preview=20), 25.0, []
    for sensors in ({}, late):
        policy = kind(LaneKeepScenario.from_keywords(preview=20, sensors=sensors), replace(kind.weights, lag=0.0))
        model, memory = StepModel.of(scenario.vehicle, speed, STEP), None
        states, command = [np.array([0.0, 0.0, 0.0, 0.0, 0.5])] * 3, 0.0
        for _ in range(200):
            ago = (3, 2, 2) if sensors else (1, 1, 1)
            measured = [states[-steps][row] for steps, row in zip(ago, (LATERAL, HEADING, YAW_RATE), strict=True)]
            seen = np.array([*measured, speed, states[-1][STEER], command, *np.zeros(20)])
            action, memory = policy.predict(seen, memory)
            command = float(action[0]) * scenario.max_steering_angle
            states.append(model.a @ states[-1] + model.b[:, 0] * command)
        drives.append(np.array(states)[:, LATERAL])
    assert np.abs(drives[0][100:]).max() < 0.05
    np.testing.assert_allclose(drives[1], drives[0], atol=1e-5)


@pytest.mark.parametrize("name", ["lq-preview", "lq-preview-offset-free"])
def test_too_short_a_preview_says_how_much_is_needed(name: str) -> None:
    with pytest.raises(ValueError, match=rf"'{name}' needs 1 s of curvature preview, .* 0 s: .* preview=11 or more"):
        lanekeep_baselines.make(name, LaneKeepScenario())
    with pytest.raises(ValueError, match=r"shows 0\.9 s"):
        lanekeep_baselines.make(name, LaneKeepScenario(preview=10))
    with pytest.raises(ValueError, match=r"preview=6 or more"):
        lanekeep_baselines.make(name, LaneKeepScenario(preview=5, preview_interval=0.2))
    lanekeep_baselines.make(name, LaneKeepScenario(preview=11))
    assert name not in lanekeep_baselines.names(LaneKeepScenario(preview=10))


@pytest.mark.parametrize("name", ["lq-preview", "lq-preview-offset-free", "lqg"])
def test_scenarios_that_are_not_lanes_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="'lateral_error', which the scenario does not observe"):
        lanekeep_baselines.make(name, CameraLaneScenario())
    with pytest.raises(ValueError, match="is not for ReversePathScenario, which has no 'dynamics'"):
        lanekeep_baselines.make(name, ReversePathScenario())


def model_car(length: float) -> LaneKeepScenario:
    """A car and its times, ``length`` as large as one of 2 m; at equal lateral acceleration."""
    time = length**0.5
    actuator = {"lag": 0.1 * time, "delay": 0.04 * time}
    axles = {"cg_to_front_axle": 1.1 * length, "cg_to_rear_axle": 0.9 * length}
    return LaneKeepScenario(
        vehicle={"base": "yin", **axles, "yaw_inertia": 1300.0 * length**2, "steering": actuator},
        control_step=0.04 * time,
        preview=21,
        preview_interval=0.1 * time,
        max_steering_angle=0.4,
    )


@pytest.mark.parametrize("design", [LqPreview, LqPreviewOffsetFree])
def test_a_quarter_of_a_car_steers_as_the_whole(design: type[LqPreview]) -> None:
    """Dynamic similarity: a car a quarter as long, in half the time, has the same angles in similar places.

    By the same weights: what is kept for the margins depends on sensors, which are no smaller on a smaller car.
    """
    rng = np.random.default_rng(7)
    places = rng.uniform(-1.0, 1.0, (50, 6)) * [0.3, 0.1, 0.2, 0.0, 0.1, 0.1]
    places[:, 3] = rng.choice(np.arange(4.0, 50.0, 2.0), 50)
    bends = rng.uniform(-0.02, 0.02, (50, 21))
    actions = []
    for length in (1.0, 0.25):
        time = length**0.5
        seen = np.hstack([places * [length, 1.0, 1.0 / time, length / time, 1.0, 1.0], bends / length])
        actions.append(design(model_car(length), design.weights).predict(seen)[0])
    assert np.abs(actions[0]).max() > 0.1
    np.testing.assert_allclose(actions[1], actions[0], rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("name", ["lq-preview", "lq-preview-offset-free"])
def test_a_model_car_stays_within_its_narrow_lane(name: str) -> None:
    """Bends of 0.8 m radius in a lane of 0.9 m, as tracks for cars of scale 1:10 have them."""
    keywords = {"road": narrow_bends(1.25), "vehicle": "knightriders", "dynamics": "kinematic", "preview": 16}
    assert drives_all(name, **keywords)


@pytest.mark.parametrize("name", ["lq-preview-offset-free", "stanley"])
@pytest.mark.parametrize("tyre", ["linear", "magic_formula"])
def test_the_f1tenth_car_slips_through_narrow_bends(name: str, tyre: str) -> None:
    """At up to 5 m/s on a friction of 1.0489, in bends at 4 m/s²: it slips, and is steered at 3.2 rad/s at the most."""
    keywords = {"road": narrow_bends(0.8), "vehicle": "f1tenth", "tyre": tyre, "preview": 21, "preview_interval": 0.05}
    if tyre == "magic_formula":
        keywords["friction"] = 1.0489
    speed = {"lateral_acceleration": 4.0, "maximum": 5.0}
    assert drives_all(name, **keywords, speed=speed, control_step=0.02)


def narrow_bends(curvature: float) -> dict[str, Any]:
    bend = [(0.6, 0.0, curvature), (1.5, curvature, curvature), (0.6, curvature, 0.0), (4.0, 0.0, 0.0)]
    other = [(length, -start, -end) for length, start, end in bend]
    return {"kind": "clothoids", "segments": [(4.0, 0.0, 0.0), *4 * [*bend, *other]]}


def drives_all(name: str, **keywords: Any) -> bool:
    """Whether a policy drives to a road's end in a lane of 0.9 m."""
    keywords = {"lane_width": 0.9, "start_lateral_error": 0.1, "episode_steps": "lap", **keywords}
    env = gym.make("lanekeep/LaneKeep-v0", **keywords).unwrapped
    policy = lanekeep_baselines.make(name, env.scenario)
    observation, _ = env.reset(seed=0)
    state, terminated, truncated = None, False, False
    while not (terminated or truncated):
        action, state = policy.predict(observation[None], state)
        observation, _, terminated, truncated, _ = env.step(action[0])
    return truncated and not terminated
