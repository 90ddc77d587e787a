"""Driving roads of one's own: steering enough, time enough, the file's speed."""

import math

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env import LaneKeepScenario
from lanekeep_env.roads import ConstantSpeed, LimitedSpeed, lap_time, road_set


def stadium(radius, straight, spacing):
    """Points of two straights and two half circles."""
    arc = np.arange(0.0, math.pi, spacing / radius)
    line = np.arange(0.0, straight, spacing)
    half = np.vstack(
        [
            np.column_stack([line, np.full(len(line), -radius)]),
            np.column_stack([straight + radius * np.sin(arc), -radius * np.cos(arc)]),
        ]
    )
    return np.vstack([half, [straight, 0.0] - half])


@pytest.fixture
def hairpins(tmp_path):
    path = tmp_path / "hairpins.csv"
    points = stadium(10.0, 80.0, 2.0)
    table = np.column_stack([points, np.full((len(points), 2), 2.0), 6.0 + np.arange(len(points)) % 2])
    np.savetxt(path, table, delimiter=",", fmt="%.9f", header="x_m,y_m,w_tr_right_m,w_tr_left_m,vx_mps")
    return str(path)


def test_steering_follows_the_sharpest_curve_but_never_below_the_usual(hairpins):
    scenario = LaneKeepScenario.from_keywords(road=hairpins)
    assert scenario.max_steering_angle == pytest.approx(1.5 * math.atan(2.8 / 10.0), abs=2e-3)
    assert LaneKeepScenario.from_keywords(road=hairpins, max_steering_angle=0.2).max_steering_angle == 0.2
    for road in ("straight", "random", "yin", "sine"):
        assert LaneKeepScenario.from_keywords(road=road).max_steering_angle == 0.15
    # The hash of today's default, with 0.15 rad given or not.
    assert LaneKeepScenario().hash == LaneKeepScenario(max_steering_angle=0.15).hash
    again = LaneKeepScenario.from_keywords(**scenario.to_dict())
    assert again == scenario and again.hash == scenario.hash


def test_a_lap_is_as_long_as_it_takes(hairpins):
    env = gym.make("lanekeep/LaneKeep-v0", road=hairpins, speed=8.0, episode_steps="lap", departure="off")
    steps, length = env.unwrapped.scenario.episode_steps, 2 * 80.0 + 2 * math.pi * 10.0
    assert steps == math.ceil(1.03 * length / 8.0 / 0.05) or abs(steps - 1.03 * length / 0.4) < 1.0
    env.reset(seed=0)
    count, over = 0, False
    while not over:
        *_, terminated, truncated, _ = env.step(np.zeros(1))
        count, over = count + 1, terminated or truncated
    assert count == steps
    slower = LaneKeepScenario.from_keywords(
        road=hairpins, speed=8.0, episode_steps="lap", randomisation={"speed": (0.5, 1.0)}
    )
    assert slower.episode_steps == pytest.approx(2 * steps, abs=2)
    longer = gym.make("lanekeep/LaneKeep-v0", episode_steps=700)  # more than the usual 600, and no other limit
    longer.reset(seed=0)
    assert longer.spec.max_episode_steps == longer.unwrapped.scenario.episode_steps == 700
    with pytest.raises(ValueError, match="episode_steps='lap' is not allowed: there is no lap"):
        gym.make("lanekeep/CameraLane-v0", episode_steps="lap")
    with pytest.raises(ValueError, match=r"episode_steps='laps' is unknown .did you mean 'lap'"):
        gym.make("lanekeep/LaneKeep-v0", episode_steps="laps")
    with pytest.raises(ValueError, match="a lap takes inf s"):
        gym.make("lanekeep/LaneKeep-v0", speed=0.0, dynamics="kinematic", episode_steps="lap")


def test_lap_time_of_constant_speed(hairpins):
    ((road, speed),) = road_set(LaneKeepScenario.from_keywords(road=hairpins).road, ConstantSpeed(5.0))
    assert lap_time(road, speed) == pytest.approx(road.length / 5.0)
    ((road, speed),) = road_set(LaneKeepScenario.from_keywords(road=hairpins).road, LimitedSpeed())
    assert speed.min() == pytest.approx(math.sqrt(0.4 * 9.81 * 10.0), rel=0.01)


def test_the_speed_of_the_file(hairpins, tmp_path):
    scenario = LaneKeepScenario.from_keywords(road=hairpins, speed="file")
    ((road, speed),) = road_set(scenario.road, scenario.speed)
    assert scenario.speed.largest == pytest.approx(7.0, abs=0.05) and speed.min() >= 5.99
    assert np.interp(road.beside[::2, 0], road.stations, speed) == pytest.approx(6.0, abs=0.05)
    assert LaneKeepScenario.from_keywords(**scenario.to_dict()) == scenario
    lower = LaneKeepScenario.from_keywords(road=hairpins, speed={"kind": "file", "maximum": 6.5})
    assert road_set(lower.road, lower.speed)[0][1].max() == 6.5
    with pytest.raises(ValueError, match="speed='file' is not allowed: road 'straight' comes without speeds"):
        LaneKeepScenario.from_keywords(road="straight", speed="file")


def test_small_cars_on_small_roads(tmp_path):
    """A rolling 1:10 car on bends of a metre: the step is that of speeds that the road allows."""
    path = tmp_path / "small.csv"
    np.savetxt(path, stadium(1.5, 8.0, 0.2), delimiter=",", fmt="%.9f")
    keywords = {"vehicle": "knightriders", "dynamics": "kinematic", "lane_width": 1.0}
    env = gym.make("lanekeep/LaneKeep-v0", road=str(path), episode_steps="lap", **keywords)
    assert env.unwrapped.scenario.max_steering_angle == pytest.approx(1.5 * math.atan(0.35 / 1.5), abs=2e-3)
    env.reset(seed=0)
    assert np.isfinite(env.step(np.zeros(1))[0]).all()


@pytest.mark.parametrize(("radius", "bound"), [(50.0, 1.0), (1.0, 1.0), (0.4, 3.0), (0.25, 4.0)])
def test_curvature_is_shown_whole_however_tight_the_road_is(radius, bound):
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        road={"kind": "circle", "radius": radius},
        vehicle="knightriders",
        dynamics="kinematic",
        speed=0.3,
        lane_width=0.3,
        start_lateral_error=0.0,
        preview=2,
        observation="full",
    )
    observation, _ = env.reset(seed=0)
    columns = [k for k, one in enumerate(env.unwrapped.channels) if one.name.startswith("curvature")]
    assert len(columns) == 3
    assert observation[columns] == pytest.approx(1.0 / radius, rel=1e-6)
    assert (env.observation_space.high[columns] == bound).all() and (env.observation_space.low[columns] == -bound).all()
