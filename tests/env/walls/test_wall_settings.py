"""Settings of the environments between walls: what is wrong is named in one line; maps of one's own."""

import json

import gymnasium as gym
import numpy as np
import pytest
import shapely
from PIL import Image

import lanekeep_env
from lanekeep_env.sensing.ultrasonic import FARTHEST

WALL, CIRCUIT = "lanekeep/WallFollow-v0", "lanekeep/Circuit-v0"
SETTINGS = {
    "image": "map.png",
    "resolution": 0.1,
    "origin": [-2.0, -2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def refused(name=WALL, **keywords):
    """The one line with which settings are refused, by the single and the vector environment alike."""
    with pytest.raises(ValueError) as caught:
        gym.make(name, **keywords)
    with pytest.raises(ValueError) as again:
        gym.make_vec(name, 2, "vector_entry_point", **keywords)
    line = str(caught.value)
    assert line == str(again.value) and "\n" not in line
    return line


@pytest.mark.parametrize(
    "keywords",
    [
        {},
        {"speed": 3.0},
        {"speed": 8.0, "dynamics": "dynamic"},
        {"speed": 2.0, "episode_steps": 2000},
        {"speed": 3.0, "control_step": 0.1},
        {"randomisation": {"speed": (0.5, 1.9)}},
        {"speed": 3.0, "world": {"kind": "corridor", "width": 4.0}},
    ],
)
def test_the_default_corridor_is_longer_than_any_episode(keywords):
    """No car that rolls at its largest speed sees the end of it, and by default it has the 80 m that it always had."""
    scenario = gym.make(WALL, **keywords).unwrapped.scenario
    way = scenario.speed.largest * scenario.randomisation.speed[1] * scenario.control_step * scenario.episode_steps
    assert scenario.world.length >= way + 2.0 + FARTHEST  # from 1 m before the start, to 1 m behind the line's end
    assert scenario.world.length <= max(80.0, way + 12.0)
    assert scenario.world.length == 80.0 or keywords
    again = type(scenario).from_keywords(**scenario.to_dict())
    assert again == scenario and again.hash == scenario.hash


def test_a_given_length_stays_and_one_without_ends_after_a_kilometre():
    given = {"kind": "corridor", "length": 30.0, "width": 2.5}
    assert gym.make(WALL, speed=3.0, world=given).unwrapped.scenario.world.length == 30.0
    assert gym.make(WALL, episode_steps=100_000, dtype="float32").unwrapped.scenario.world.length == 1000.0


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"side_sensor": 6.0}, ["side_sensor=6.0", "<= 5.0 m"]),
        ({"set_distance": -1.0}, ["set_distance=-1.0", "> 0.0", "<= 6.0", " m"]),
        ({"set_distance": 7.0}, ["set_distance=7.0", "<= 6.0 m"]),
        ({"set_distance": float("nan")}, ["set_distance=nan", "finite"]),
        ({"speed": -0.5}, ["speed", "-0.5", ">= 0", "m/s"]),
        ({"speed": {"minimum": 3.0, "maximum": 2.0}}, ["speed.minimum=3.0", "speed.maximum=2.0", "<="]),
        ({"dynamics": "dynamik"}, ["dynamics='dynamik'", "did you mean 'dynamic'", "kinematic"]),
        ({"action": "speed"}, ["action='speed'", "steering_angle, steering_rate"]),
        ({"max_steering_angle": 2.0}, ["max_steering_angle=2.0", "<= 1.5 rad"]),
        ({"max_steering_rate": 0.0}, ["max_steering_rate=0.0", ">= 0.0001", "rad/s"]),
        ({"steering_offset": 0.7}, ["steering_offset=0.7", "<= 0.5 rad"]),
        ({"steering_offset": (0.1, -0.1)}, ["steering_offset=(0.1, -0.1)", "low <= high"]),
        ({"servo": {"left": -0.1}}, ["servo.left=-0.1", "> 0.0", "rad or None"]),
        ({"servo": {"lft": 0.1}}, ["servo", "'lft'", "did you mean 'left'"]),
        ({"servo": {"ticks": 2.5}}, ["servo.ticks=2.5", "whole number", ">= 0"]),
        ({"servo": {"angles": (-0.3, 0.3)}}, ["servo.angles=(-0.3, 0.3)", "odd number", "at least 3"]),
        ({"servo": {"angles": (0.3, 0.0, -0.3)}}, ["servo.angles", "rise from right to left"]),
        ({"servo": {"left": 1.4}, "steering_offset": 0.2}, ["steering_offset", "0.2", "1.4 rad", "<= 1.5 rad"]),
        ({"servo": 3}, ["servo=3", "mapping"]),
        ({"contact": "stop"}, ["contact='stop'", "terminate, cost, off"]),
        ({"scan": "kinekt"}, ["scan='kinekt'", "did you mean 'kinect'"]),
        ({"scan": {"beams": 1}}, ["scan.beams=1", "at least 2"]),
        ({"scan": {"beams": 5000}}, ["scan.beams=5000", "<= 4096 beams"]),
        ({"scan": {"beams": 9, "nearest": 3.0, "farthest": 2.0}}, ["scan.farthest=2.0", "> 3.0", " m"]),
        ({"scan": {"beams": 9, "field_of_view": 7.0}}, ["scan.field_of_view=7.0", "<= 6.2 rad"]),
        ({"scan": {"beams": 9, "jump_errors": 2.0}}, ["scan.jump_errors=2.0", "<= 1.0"]),
        ({"scan": {"beams": 9, "period": 0.1}}, ["scan.period=0.1", "multiple of 0.045 s", "0.09"]),
        ({"encoder_ticks": -8}, ["encoder_ticks=-8", ">= 0", "ticks a turn"]),
        ({"encoder_direction": "no"}, ["encoder_direction='no'", "True or False"]),
        ({"sensors": {"distance_rigth": {}}}, ["'distance_rigth'", "did you mean 'distance_right'"]),
        ({"sensors": {"yaw_rate": {"period": 0.1}}}, ["sensors.yaw_rate.period=0.1", "0.045 s"]),
        ({"control_step": 0.0005}, ["control_step=0.0005", ">= 0.001", "s"]),
        ({"observation": "ful"}, ["observation='ful'", "did you mean 'full'"]),
        ({"world": "coridor"}, ["'coridor'", "did you mean 'corridor'"]),
        ({"world": {"kind": "corridor", "width": 0.1}}, ["world.width=0.1", ">= 0.5", " m"]),
        ({"world": {"kind": "corridor", "wide": 2.0}}, ["'wide'", "width"]),
        ({"vehicle": "yin"}, ["corridor", "4.5 m long", "touches a wall at the start", "(1.000, 0.000) m"]),
        ({"start_heading_error": 4.0}, ["start_heading_error=4.0", "rad"]),
        ({"episode_steps": 0}, ["episode_steps=0", ">= 1", "steps"]),
    ],
)
def test_a_wrong_setting_is_named_with_value_unit_and_what_is_allowed(keywords, words):
    for name in (WALL, CIRCUIT):
        if "vehicle" in keywords:
            keywords = {**keywords, "world": {"kind": "corridor", "length": 30.0, "width": 6.0}}
        line = refused(name, **keywords)
        assert all(word in line for word in words), line


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"max_speed": 0.0}, ["max_speed=0.0", ">= 0.001", "<= 20.0 m/s"]),
        ({"max_acceleration": -1.0}, ["max_acceleration=-1.0", ">= 0.001", "m/s²"]),
        ({"laps": 1.5}, ["laps=1.5", "whole number"]),
    ],
)
def test_the_circuits_own_settings_are_checked(keywords, words):
    line = refused(CIRCUIT, **keywords)
    assert all(word in line for word in words), line
    with pytest.raises(TypeError, match="unexpected keyword"):
        gym.make(WALL, **keywords)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"lateral": 0.1}, ["'lateral'", "lateral_error, heading_error"]),
        ({"lateral_error": "left"}, ["lateral_error='left'", "number"]),
        ({"lateral_error": float("nan")}, ["lateral_error=nan", "finite"]),
        ({"lateral_error": 50.0}, ["20 m"]),
        ({"heading_error": 4.0}, ["pi rad"]),
        ({"start_index": 9}, ["start_index", "0 to 3"]),
        ({"world_index": 1.5}, ["world_index", "whole number"]),
        ({"lateral_error": 0.95}, ["lateral_error=0.95", "would stand in or beyond a wall"]),
        ({"lateral_error": 3.0}, ["lateral_error=3.0", "would stand in or beyond a wall"]),
    ],
)
def test_a_start_that_is_not_possible_is_refused(options, words):
    world = {"kind": "circuit", "corridor": 2.0}
    env, many = gym.make(CIRCUIT, world=world), gym.make_vec(CIRCUIT, 3, "vector_entry_point", world=world)
    for one in (env, many):
        with pytest.raises(ValueError) as caught:
            one.reset(seed=0, options=options)
        assert all(word in str(caught.value) for word in words) and "\n" not in str(caught.value)
        one.reset(seed=0, options={"lateral_error": 0.3, "heading_error": 0.1})
    with pytest.raises(ValueError, match="car 1 would stand in or beyond"):
        many.reset(seed=0, options={"lateral_error": np.array([0.0, 4.0, 0.0])})
    mask = np.array([True, False, True])
    masked = gym.make_vec(CIRCUIT, 3, "vector_entry_point", world=world, autoreset_mode="disabled")
    masked.reset(seed=0)
    masked.reset(options={"lateral_error": 0.0, "reset_mask": mask})


@pytest.mark.parametrize(
    "name, action", [(WALL, [0.0, 0.0]), (WALL, 0.0), (CIRCUIT, [0.0]), (CIRCUIT, [0.0, 0.0, 0.0])]
)
def test_an_action_of_another_shape_is_refused(name, action):
    env = gym.make(name)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="shape"):
        env.unwrapped.step(np.array(action, np.float32))


def test_nan_in_either_action_is_refused():
    env, many = gym.make(CIRCUIT), gym.make_vec(CIRCUIT, 3, "vector_entry_point")
    env.reset(seed=0), many.reset(seed=0)
    for place in range(2):
        action = np.zeros(2, np.float32)
        action[place] = np.nan
        with pytest.raises(ValueError, match="NaN"):
            env.step(action)
        with pytest.raises(ValueError, match="car 1 is NaN"):
            many.step(np.stack([np.zeros(2, np.float32), action, np.zeros(2, np.float32)]))


def hall(rows=60, columns=100):
    """Free cells inside walls of one cell, and a pillar: 0 to 255, rows from the top."""
    grey = np.full((rows, columns), 254, np.uint8)
    grey[[0, -1]] = grey[:, [0, -1]] = 0
    grey[10:14, 60:70] = 0
    return grey


def write(folder, grey=None, **changes):
    """Write a map; return the path of its YAML file."""
    Image.fromarray(hall() if grey is None else grey).save(folder / "map.png")
    path = folder / "my_map.yaml"
    path.write_text("\n".join(f"{key}: {json.dumps(value)}" for key, value in {**SETTINGS, **changes}.items()))
    return path


def test_a_map_that_is_no_circuit_has_no_laps(tmp_path, monkeypatch):
    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=r"the map is no circuit: .* give a centre_line"):
        gym.make(CIRCUIT, world="my_map.yaml")


def test_half_a_turn_in_a_control_step_is_refused():
    with pytest.raises(ValueError, match=r"control_step=1\.0 is not allowed: at 5\.443 m/s"):
        gym.make(WALL, control_step=1.0, speed=5.443, steering_offset=0.0)


def test_float32_is_refused_far_from_the_origin(tmp_path, monkeypatch):
    write(tmp_path, origin=[499990.0, 899990.0, 0.0])
    monkeypatch.chdir(tmp_path)
    world = {"kind": "map", "path": "my_map.yaml", "x": 499993.0, "y": 899993.0}
    gym.make(WALL, world=world)
    with pytest.raises(ValueError, match="float32"):
        gym.make(WALL, world=world, dtype="float32")


@pytest.mark.parametrize("name", [WALL])
def test_a_map_of_ones_own_is_driven_by_its_path_alone(tmp_path, monkeypatch, name):
    """From a cell map of 10 m x 6 m: distances to its walls, scan, contact with them; also relative and in JSON."""
    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    env = gym.make(name, world="my_map.yaml", scan="perfect", steering_offset=0.0, speed=1.0)
    (world,) = env.unwrapped.world_set()
    assert world.bounds == pytest.approx((-1.9, -1.9, 7.9, 3.9))
    options = {"lateral_error": 0.0, "heading_error": 0.0}
    observation, info = env.reset(seed=0, options=options)
    if name == WALL:
        assert (info["x"], info["y"]) == pytest.approx((0.0, -0.9)) and info["distance"] == pytest.approx(1.0)
    else:
        assert (info["x"], info["y"]) == pytest.approx((0.0, 0.0))
    ended, walls = False, shapely.union_all(shapely.linestrings(world.segments.reshape(-1, 2, 2)))
    action = np.array([0.0, 1.0], np.float32)[: env.action_space.shape[0]]
    while not ended:
        observation, _, ended, truncated, info = env.step(action)
        assert env.observation_space.contains(observation) and not truncated
        assert ended or shapely.Point(info["x"], info["y"]).distance(walls) > 0.13
    assert info["termination"] == lanekeep_env.Termination.CONTACT
    back = gym.make(name, **json.loads(json.dumps(env.unwrapped.scenario.to_dict())))
    assert back.unwrapped.scenario.hash == env.unwrapped.scenario.hash
    started = gym.make(name, world={"kind": "map", "path": "my_map.yaml", "x": 1.0, "y": 2.0, "heading": 1.5})
    assert started.unwrapped.world_set()[0].start.tolist() == [[1.0, 2.0, 1.5]]


def open_hall():
    grey = hall()
    grey[30:33, -1] = 254
    return grey


def walled_start():
    grey = hall()
    grey[35:45, 15:25] = 0
    return grey


@pytest.mark.parametrize(
    ("grey", "changes", "words"),
    [
        (open_hall(), {}, ["the walls are open", "cell 99"]),
        (walled_start(), {}, ["start lies inside a wall", "cell 20, 20"]),
        (None, {"resolution": 0}, ["resolution=0", ">= 0.0001", "m a cell"]),
        (None, {"resolution": -0.1}, ["resolution=-0.1", ">= 0.0001"]),
        (None, {"image": "gone.png"}, ["gone.png", "cannot be read"]),
        (None, {"origin": [50.0, 0.0, 0.0]}, ["start (0, 0) m is outside the map", "100 x 60 cells"]),
        (None, {"origin": [0.0]}, ["origin=[0.0]", "yaw in rad"]),
        (None, {"origin": [-0.35, -2.0, 0.0]}, ["my_map", "touches a wall at the start", "0.532 m long"]),
    ],
)
def test_a_faulty_map_is_refused_in_one_line_that_names_file_and_fault(tmp_path, grey, changes, words):
    path = write(tmp_path, grey, **changes)
    line = refused(world=str(path))
    assert "my_map" in line
    for word in words:
        assert word in line, line


def test_a_map_that_is_not_there_is_named(tmp_path):
    line = refused(world=str(tmp_path / "nowhere.yaml"))
    assert "nowhere.yaml" in line and "cannot be read" in line
