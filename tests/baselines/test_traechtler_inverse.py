"""The exact inverse's observer: what the camera should show, and how it finds the van's place."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from scipy.linalg import expm

import lanekeep_baselines
import lanekeep_env  # noqa: F401  (registers the environments)

NAME = "traechtler-inverse"


@pytest.mark.parametrize("edge", ["right", "left"])
@pytest.mark.parametrize(("spacing", "plan"), [(0.5, 20), (0.125, 80)])
def test_the_camera_shows_what_the_plan_says_on_the_path(spacing: float, plan: int, edge: str) -> None:
    """On yards of random bends, to the plan's sampling error.

    Where curvature jumps by k between two samples, half a spacing h of it is wrong at the most: a heading of k h/2, and
    that times as many metres as the look-ahead point is ahead, 6.5. Without jumps, 4 mm. (A wider camera looks along
    the edges of the tightest bends, where a small error of place is a large one of distance.)
    """
    camera = {"edge": edge, "field_of_view": np.radians(100.0)}
    settings = {"plan": plan, "plan_spacing": spacing, "camera": camera}
    env = gym.make("lanekeep/CameraLane-v0", road={"kind": "yard", "gap_spacing": None, "count": 32}, **settings)
    policy = lanekeep_baselines.make(NAME, env.unwrapped.scenario)
    random = np.random.default_rng(0)
    side = 1.0 if edge == "right" else -1.0
    differences, jumps = [], []
    for _ in range(1000):
        place = {"road_index": int(random.integers(32)), "arc_length": random.uniform(0.0, 380.0)}
        seen, _ = env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0, **place})
        ahead = seen[5 : 5 + plan].astype(np.float64)
        if seen[1] > 0.5:
            differences.append(policy.shown(ahead[None])[0] - side * (seen[0] - 1.5))
            jumps.append(np.abs(np.diff(ahead)).sum())
    env.close()
    differences, jumps = np.abs(differences), np.array(jumps)
    assert len(differences) > 900
    assert (differences < 4e-3 + 0.5 * spacing * 6.5 * jumps).all()
    assert np.quantile(differences, 0.9) < 0.01
    assert differences[jumps < 1e-3].max() < 4e-3 and (jumps < 1e-3).sum() > 200


def estimates(bench, **settings) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the observer's errors (m, rad) on a straight and the way per step, m, from a wrong start.

    What the camera shows first is taken for a lateral error; the van is also turned, by 0.03 rad.
    """
    drive = bench.drive_van(NAME, 60.0 / settings["speed"], road="straight", start=(0.2, 0.03), **settings)
    errors = drive.state[:, :2] - np.stack([drive.lateral, drive.heading], axis=1)
    return errors, drive.lateral, settings["speed"] * drive.scenario.control_step


@pytest.mark.parametrize("speed", [1.0, 3.0, 6.0])
def test_the_observer_forgets_a_wrong_start_over_its_way(bench, speed: float) -> None:
    """Both poles at -1/(4 m): corrections of 2/w - L/w² and 1/w² a metre on the surprise d + L theta, L = 6.5 m."""
    errors, _, way = estimates(bench, speed=speed)
    assert errors[0] == pytest.approx([6.5 * 0.03, -0.03], abs=2e-3)
    on_d, on_heading = 2.0 / 4.0 - 6.5 / 16.0, 1.0 / 16.0
    a = np.array([[-on_d, 1.0 - 6.5 * on_d], [-on_heading, -6.5 * on_heading]])
    assert np.linalg.eigvals(a) == pytest.approx([-0.25, -0.25], abs=1e-6)
    for metres in (2.0, 4.0, 8.0, 16.0):
        k = round(metres / way)
        truth = expm(a * k * way) @ errors[0]
        assert (np.abs(errors[k] - truth) < 0.06 * np.abs(errors[0])).all()
    assert np.abs(errors[round(40.0 / way) :]).max() < 2e-3


@pytest.mark.parametrize("speed", [2.0, 6.0])
@pytest.mark.parametrize(
    "camera", [{"delay": 0.4}, {"period": 0.4}, {"delay": 0.4, "period": 0.2, "dropout": 0.2}], ids=str
)
def test_late_and_slow_pictures_do_not_mislead_the_observer(bench, camera: dict, speed: float) -> None:
    """At 6 m/s 0.4 s are 2.4 m of the observer's 4 m; a wrong start is forgotten all the same, later."""
    errors, lateral, way = estimates(bench, speed=speed, sensors={"edge_distance": camera})
    assert np.abs(errors[:, 0]).max() < 0.25
    last = slice(round(50.0 / way), None)
    assert np.abs(errors[last]).max() < 5e-3
    assert np.abs(lateral[last]).max() < 0.05


@pytest.mark.parametrize(("sensors", "allowed"), [(None, 0.09), ("production", 0.10), ("poor", 0.16)])
def test_the_van_stays_near_the_path_on_yards_with_real_sensors(sensors: str | None, allowed: float) -> None:
    """RMS over 16 yards; "poor" has an offset of 5 cm in the camera and of 0.01 rad in the angle."""
    envs = gym.make_vec("lanekeep/CameraLane-v0", num_envs=16, sensors=sensors, departure="off")
    policy = lanekeep_baselines.make(NAME, envs.unwrapped.scenario)
    seen, info = envs.reset(seed=0)
    state, lateral = None, []
    for _ in range(750):
        action, state = policy.predict(seen, state)
        seen, _, _, _, info = envs.step(np.clip(action, -1.0, 1.0))
        lateral.append(info["lateral_error"])
    envs.close()
    assert np.sqrt(np.mean(np.square(lateral))) < allowed
    assert np.abs(lateral).max() < 1.0
