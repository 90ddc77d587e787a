"""Werling's multi-controller as policies in their environments: Figures 8, 9 and 10, and what every policy promises."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.werling_multi import WerlingDrive
from lanekeep_env import DriveScenario, EvasiveScenario, LaneKeepScenario, ReversePathScenario

FIGURE_10 = [(0, "speed", 0), (4, "speed", 10), (15, "lead", 35, 7.5), (30, "lead_gone"), (37, "stop", 30)]
LATE = {"base": "passat", "steering": {"lag": 0.05, "delay": 0.1, "angle_limit": 0.6}}
SCENARIOS = {
    "werling-lateral": EvasiveScenario(),
    "werling-lateral-ahead": EvasiveScenario(),
    "werling-lateral-predictor": EvasiveScenario(vehicle=LATE),
    "werling-reverse": ReversePathScenario(),
    "werling-reverse-ahead": ReversePathScenario(),
    "werling-drive": DriveScenario(),
}


def drive(task: str, name: str, steps: int, start: dict | None = None, **keywords):
    """Return each channel and truth over one episode, (steps,)."""
    env = gym.make(f"lanekeep/{task}-v0", departure="off", max_episode_steps=steps, episode_steps=steps, **keywords)
    policy = lanekeep_baselines.make(name, env.unwrapped.scenario)
    names = [channel.name for channel in env.unwrapped.channels]
    observation, _ = env.reset(seed=0, options=start)
    state, rows = None, []
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, _, _, _, info = env.step(action)
        rows.append({**dict(zip(names, observation.tolist(), strict=True)), **info})
    env.close()
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


@pytest.mark.parametrize("road_index", [0, 1])
def test_figure_8_at_50_hz_behind_a_real_actuator(road_index: int) -> None:
    """From 0.8 m beside the path on the side it comes from: the error falls steadily at 4.0 m/s²."""
    side = 0.8 if road_index == 0 else -0.8
    run = drive("Evasive", "werling-lateral", 260, {"lateral_error": side, "road_index": road_index})
    error = np.abs(run["lateral_error"])
    assert np.abs(run["lateral_acceleration"]).max() == pytest.approx(4.0, abs=0.1)
    assert (error - np.minimum.accumulate(error)).max() < 0.005
    assert error[149] == pytest.approx(0.215, abs=0.01)


@pytest.mark.parametrize("speed", [1.0, 1.4])
@pytest.mark.parametrize(("name", "bound"), [("werling-reverse", 0.01), ("werling-reverse-ahead", 0.004)])
def test_figure_9_stays_within_a_centimetre_near_the_turning_circle(name: str, bound: float, speed: float) -> None:
    path = {"kind": "parking", "smallest_radius": 5.0, "largest_radius": 5.01, "count": 1}
    steps = int(60.0 / speed / 0.02)
    run = drive(
        "ReversePath",
        name,
        steps,
        {"lateral_error": 0.0, "heading_error": 0.0},
        road=path,
        speed=speed,
        observation="full",
    )
    assert np.abs(run["curvature"]).max() == pytest.approx(0.2, abs=1e-3)
    assert np.abs(run["lateral_error"]).max() < bound


def test_figure_10_is_driven_with_pedals_and_gears() -> None:
    """Held, away at 1 m/s², three gear changes, speed control, a car ahead, away again, a stop."""
    run = drive(
        "Drive", "werling-drive", 2400, {"lateral_error": 0.0, "heading_error": 0.0, "arc_length": 0.0},
        road="straight", traffic=FIGURE_10, slope=0.0, wind=0.0,
    )  # fmt: skip
    time, v = 0.02 * np.arange(1, 2401), run["speed"]
    assert v[time < 4.0].max() < 0.02
    # From there on the speed law asks for less than the largest acceleration.
    takes_over = time[np.argmax(v > 10.0 - 1.0 / WerlingDrive.longitudinal.speed_rate)]
    assert takes_over == pytest.approx(12.5, abs=0.1)
    assert (np.diff(run["gear"][time < takes_over]) != 0).sum() == 3
    assert (np.diff(run["gear"][time < 15.0]) != 0).sum() == 3
    assert run["acceleration"][time < 15.0].max() <= 1.01
    at_30 = np.argmax(time > 29.9)
    assert run["lead_gap"][at_30] == pytest.approx(4.0 + 1.5 * v[at_30], rel=0.02)
    stands = time[np.argmax((time > 38.0) & (v < 1e-6))]
    assert stands == pytest.approx(45.0, abs=0.4)
    assert abs(run["stop_gap"][-1]) < 0.02 and v[-1] < 1e-6
    # The last seconds, with the change into the first gear.
    last = (time > 41.5) & (time < 46.0)
    assert run["gear"][time < 41.5][-1] == 1.0 and run["gear"][-1] == 0.0
    smooth = np.convolve(run["acceleration"], np.full(10, 0.1), "same")
    assert np.abs(np.gradient(smooth, 0.02)[last]).max() < 2.5


@pytest.mark.parametrize(("slope", "wind"), [(0.03, 5.0), (-0.03, -5.0)])
def test_slope_and_wind_are_made_good(slope: float, wind: float) -> None:
    """The integrator: the set speed is held within 0.1 m/s, the stop within 5 cm."""
    events = [(0, "speed", 8), (20, "stop", 40)]
    run = drive("Drive", "werling-drive", 2000, road="straight", traffic=events, slope=slope, wind=wind)
    assert run["speed"][900:990] == pytest.approx(8.0, abs=0.1)
    assert abs(run["stop_gap"][-1]) < 0.05 and run["speed"][-1] < 0.01


@pytest.mark.parametrize(("slope", "speed"), [(0.02, 2.5), (0.1, 5.5)])
def test_gears_come_to_rest_uphill(slope: float, speed: float) -> None:
    run = drive("Drive", "werling-drive", 1000, road="straight", traffic=[(0, "speed", speed)], slope=slope, wind=0.0)
    assert (np.diff(run["gear"][500:]) == 0.0).all()


def test_an_engine_without_drag_that_gives_nothing_at_high_speed_is_driven_as_well() -> None:
    engine = {"drag_torque": 0.0, "drag_slope": 0.0, "peak_speed": 200.0, "torque_width": 190.0}
    run = drive("Drive", "werling-drive", 500, road="straight", traffic=[(0, "speed", 8)], powertrain=engine)
    assert run["speed"][-50:] == pytest.approx(8.0, abs=0.1)


@pytest.mark.parametrize("name", SCENARIOS)
def test_rows_are_independent_and_nothing_is_remembered_but_in_the_state(name: str) -> None:
    scenario = SCENARIOS[name]
    random = np.random.default_rng(8)
    steps, rows = 8, 40
    low, high = np.clip(scenario.channel_bounds().T, -1.0, 1.0)
    seen = random.uniform(0.3 * low, 0.3 * high, size=(steps, rows, len(low)))
    order = [channel.name for channel in scenario.channels]
    fastest = -1.5 if "reverse" in name else 20.0
    seen[..., order.index("speed")] = random.uniform(0.0, 1.0, size=(steps, rows)) * fastest
    if "set_speed" in order:
        seen[..., order.index("lead_gap")] = random.choice([5.0, 30.0, 200.0], size=(steps, rows))
        seen[..., order.index("stop_gap")] = random.choice([2.0, 20.0, 200.0], size=(steps, rows))
        seen[..., order.index("gear")] = random.integers(0, 6, size=(steps, rows))
    seen = seen.astype(np.float32)
    policy = lanekeep_baselines.make(name, scenario)
    state, alone = None, [None] * rows
    for step in range(steps):
        before = None if state is None else state.copy()
        action, following = policy.predict(seen[step], state)
        assert action.shape == (rows, scenario.num_actions) and np.isfinite(action).all()
        if before is not None:
            np.testing.assert_array_equal(state, before)
        for row in range(0, rows, 9):
            one, alone[row] = policy.predict(seen[step, row], alone[row])
            assert one.tobytes() == action[row].tobytes()
        state = following


def test_the_reverse_law_wants_the_rear_axle() -> None:
    with pytest.raises(ValueError, match="rear axle"):
        lanekeep_baselines.make("werling-reverse", LaneKeepScenario(preview=1))
    assert lanekeep_baselines.names(DriveScenario()) == ("werling-drive",)
