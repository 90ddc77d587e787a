"""Pictures: what they show, and that nothing is drawn unless asked for."""

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env

pytest.importorskip("pygame")
from lanekeep_env.rendering import road_picture, wall_picture
from lanekeep_env.rendering.scale import bar_length

IDS = sorted(lanekeep_env.ENVIRONMENTS)
CAR = np.array(road_picture._CAR)
STRAIGHT = {"road": "straight", "speed": 20.0}


def car_pixels(frame):
    """Rows and columns of the car's colour in the view from above."""
    view = frame[: road_picture.VIEW_HEIGHT].astype(int)
    return np.nonzero(np.abs(view - CAR).sum(axis=2) < 30)


@pytest.mark.parametrize("name", IDS)
def test_frames_of_single_and_vector_environments(name):
    env = gym.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape, np.float32))
    frame = env.render()
    assert frame.shape == (road_picture.HEIGHT, road_picture.WIDTH, 3) and frame.dtype == np.uint8
    vector = gym.make_vec(name, 3, "vector_entry_point", render_mode="rgb_array")
    vector.reset(seed=0)
    vector.step(np.zeros(vector.action_space.shape, np.float32))
    frames = vector.render()
    assert len(frames) == 3
    np.testing.assert_array_equal(frames[0], frame)
    assert not np.array_equal(frames[1], frame)


@pytest.mark.parametrize("lateral", [-1.2, 0.0, 1.2])
def test_a_car_left_of_the_centre_is_drawn_left_of_it(lateral):
    """Driving direction is to the right, so left is up; eight pixels are a metre."""
    env = gym.make("lanekeep/LaneKeep-v0", render_mode="rgb_array", **STRAIGHT)
    env.reset(seed=0, options={"lateral_error": lateral, "heading_error": 0.0})
    rows, columns = car_pixels(env.render())
    per_metre = road_picture.WIDTH / env.unwrapped.scenario.view
    assert road_picture.VIEW_HEIGHT / 2 - rows.mean() == pytest.approx(lateral * per_metre, abs=1.5)
    assert np.ptp(columns) == pytest.approx(4.5 * per_metre, abs=4)


@pytest.mark.parametrize("lanes", [1, 2, 3])
def test_lanes_have_marks_between_them(lanes):
    """As light as the edges, half a lane's width left of the middle of each lane but the left-most."""
    env = gym.make("lanekeep/Traffic-v0", render_mode="rgb_array", road="straight", lanes=lanes)
    env.reset(seed=0, options={"lateral_error": 0.0, "heading_error": 0.0})
    scenario, frame = env.unwrapped.scenario, env.render()[: road_picture.VIEW_HEIGHT]
    light = np.flatnonzero((frame > 235).all(axis=2).sum(axis=1) > road_picture.WIDTH / 4)
    per_metre = road_picture.WIDTH / scenario.view
    marks = (road_picture.VIEW_HEIGHT / 2 - light) / per_metre / scenario.lane_width
    lines = {round(float(mark) + 0.5) for mark in marks}
    assert lines == set(range(lanes + 1))


def test_the_bar_is_as_long_as_it_says():
    """20 m in a view of 100 m."""
    env = gym.make("lanekeep/LaneKeep-v0", render_mode="rgb_array", **STRAIGHT)
    env.reset(seed=0)
    row = env.render()[road_picture.VIEW_HEIGHT - 13].astype(int)
    dark = np.flatnonzero(row.sum(axis=1) < 250)
    assert env.unwrapped.scenario.view == 100.0 and bar_length(100.0) == 20.0
    assert np.ptp(dark) + 1 == pytest.approx(0.2 * road_picture.WIDTH, abs=1.0) == len(dark)


@given(st.floats(1e-3, 1e6))
def test_bars_have_round_lengths_of_about_a_fifth(extent):
    length = bar_length(extent)
    assert extent / 12.51 < length <= extent / 5.0
    assert f"{length:e}"[0] in "125" and float(f"{length:.0e}") == pytest.approx(length, rel=1e-12)


def test_a_car_that_left_its_lane_is_marked():
    env = gym.make("lanekeep/LaneKeep-v0", render_mode="rgb_array", **STRAIGHT)
    env.reset(seed=0)
    while not env.step(np.ones(1, np.float32))[2]:
        pass
    assert len(car_pixels(env.render())[0]) == 0


def test_recorders_of_gymnasium_get_a_frame_a_step():
    env = gym.wrappers.RenderCollection(gym.make("lanekeep/LaneKeep-v0", render_mode="rgb_array"))
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(1, np.float32))
    assert len(env.render()) == 6


def test_videos_are_written(tmp_path):
    env = gym.wrappers.RecordVideo(gym.make("lanekeep/LaneKeep-v0", render_mode="rgb_array"), str(tmp_path))
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(1, np.float32))
    env.close()
    assert list(tmp_path.glob("*.mp4"))


@pytest.mark.skipif(not hasattr(gym.wrappers.vector, "RecordVideo"), reason="gymnasium 1.1 has none for vectors")
def test_videos_of_vectors_are_written(tmp_path):
    env = gym.make_vec("lanekeep/LaneKeep-v0", 2, "vector_entry_point", render_mode="rgb_array")
    recorded = gym.wrappers.vector.RecordVideo(env, str(tmp_path), video_length=4)
    recorded.reset(seed=0)
    for _ in range(5):
        recorded.step(np.zeros((2, 1), np.float32))
    recorded.close()
    assert list(tmp_path.glob("*.mp4"))


def test_human_mode_runs_without_a_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gym.make("lanekeep/LaneKeep-v0", render_mode="human")
    env.reset(seed=0)
    for _ in range(3):
        assert env.render() is None
        env.step(np.zeros(1, np.float32))
    env.close()


def test_pygame_stays_out_unless_pictures_are_asked_for():
    code = (
        "import sys, gymnasium as gym, lanekeep_env; env = gym.make('lanekeep/LaneKeep-v0'); env.reset(seed=0); "
        "assert 'pygame' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ["lanekeep/LaneKeep-v0", "lanekeep/WallFollow-v0"])
def test_a_mode_alone_needs_no_pygame_as_trainers_ask_for_it_at_any_rate(name, monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = gym.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    with pytest.raises(ImportError, match=r"lanekeep\[render\]"):
        env.render()
    with pytest.raises(ImportError, match=r"lanekeep\[render\]"):
        gym.make(name, render_mode="human")


def test_render_without_a_mode_warns():
    env = gym.make("lanekeep/LaneKeep-v0")
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.unwrapped.render() is None


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 12))
@settings(max_examples=50, deadline=None)
def test_what_goes_round_a_point_is_shapely_s(seed, count):
    rng = np.random.default_rng(seed)
    corners, point = rng.normal(size=(count, 2)), rng.normal(size=2)
    turned = corners[np.argsort(np.arctan2(*(corners - corners.mean(axis=0)).T))]
    assert wall_picture._encloses(turned, point) == shapely.Polygon(turned).contains(shapely.Point(point))


@pytest.mark.parametrize(
    ("name", "world", "filled"),
    [
        ("Circuit", {"kind": "circuit", "length": 12.0, "width": 8.0, "corridor": 2.0}, True),
        ("Circuit", {"kind": "circuit", "length": 12.0, "width": 8.0, "corridor": 2.0, "glass_share": 0.3}, True),
        ("Circuit", {"kind": "corridor", "length": 12.0, "width": 2.0}, False),
        ("Circuit", {"kind": "ell", "first": 8.0, "second": 8.0, "width": 2.0}, False),
        ("ObstacleCircuit", {"kind": "obstacle-circuit", "boxes": [(3.0, -3.5, 0.0, 0.5, 0.4)]}, True),
    ],
)
def test_what_a_circuit_goes_round_is_shaded_and_no_way_is(name, world, filled):
    env = gym.make(f"lanekeep/{name}-v0", world=world, render_mode="rgb_array")
    env.reset(seed=0)
    assert (env.render() == wall_picture._BLOCK).all(axis=2).any() == filled
    env.close()


def test_a_picture_tells_a_lap_from_a_parked_car():
    for name, done in (("Circuit", "lap"), ("ObstacleCircuit", "lap"), ("ParallelPark", "parked")):
        env = gym.make(f"lanekeep/{name}-v0")
        env.reset(seed=0)
        assert env.unwrapped._core.pose(0).done == done
