"""Vehicles from files, and what nested mappings change."""

import json
import math
from dataclasses import asdict

import pytest

from lanekeep_env import CameraLaneScenario, LaneKeepScenario, RoadWorksScenario
from lanekeep_env.physics.vehicles import VEHICLES, vehicle_from


@pytest.mark.parametrize("ending", ["yaml", "json"])
def test_vehicles_from_files_with_units(tmp_path, ending):
    fields = {"base": "passat", "mass": "1.8 t", "cg_to_front_axle": "1150 mm", "yaw_inertia": 3000}
    fields["front_cornering_stiffness"] = "95 kN/rad"
    fields["steering"] = {"angle_limit": "30 deg", "delay": "20 ms"}
    path = tmp_path / f"my_car.{ending}"
    path.write_text(json.dumps(fields))  # which is YAML, too
    car, base = vehicle_from(str(path)), VEHICLES["passat"]
    assert (car.name, car.mass, car.yaw_inertia) == ("my_car", 1800.0, 3000.0)
    assert car.cg_to_front_axle == pytest.approx(1.15)
    assert car.front_cornering_stiffness == 95e3 and car.rear_cornering_stiffness == base.rear_cornering_stiffness
    assert car.steering.angle_limit == pytest.approx(math.pi / 6) and car.steering.delay == 0.02
    assert car.steering.lag == base.steering.lag
    assert car.source == f"file {path.name}, changes to passat"
    scenario = LaneKeepScenario.from_keywords(vehicle=str(path))
    path.unlink()  # what it said stays
    assert LaneKeepScenario.from_keywords(**scenario.to_dict()).hash == scenario.hash


FAULTS = [
    ('{"mass": "1.7 stone"}', ["mass='1.7 stone'", "allowed units: kg, t, g, lb"]),
    ('{"mas": 3}', ["no field 'mas'", "did you mean 'mass'"]),
    ('{"mass": "heavy"}', ["mass='heavy'"]),
    ('{"wheelbase": 2.5}', ["no field 'wheelbase' (it is cg_to_front_axle + cg_to_rear_axle)"]),
    ('{"steering": {"lagg": 1}}', ["vehicle.steering has no field 'lagg'"]),
    ('{"steering": 3}', ["vehicle.steering=3 must be"]),
    ('{"base": "pasat"}', ["base='pasat' is unknown", "did you mean 'passat'"]),
    ('{"base": "other.yaml"}', ["base='other.yaml' is unknown"]),
    ("[1, 2]", ["holds no fields"]),
    ('{"m": 1, "I_z": 2, "a": "x", "b": 1, "l": 1, "w": 1}', ["a='x' is not allowed"]),
    ("{", ["my_car.yaml"]),
    ("mass: 1700\nlength: 4.5\nmass: 2", ["line 3", "mass", "twice"]),
    ("steering:\n  lag: 0.1\n  lag: 0.2", ["line 3", "lag", "twice"]),
    ("mass: 190:20:30", ["mass", "190:20:30"]),  # YAML 1.1 reads minutes and seconds
    ("mass: 2001-99-99", ["mass", "2001-99-99"]),  # ... and dates
]


@pytest.mark.parametrize(("text", "words"), FAULTS, ids=range(len(FAULTS)))
def test_bad_vehicle_files_are_told_in_one_line(tmp_path, text, words):
    path = tmp_path / "my_car.yaml"
    path.write_text(text)
    with pytest.raises(ValueError) as caught:
        vehicle_from(path)
    message = str(caught.value)
    assert "my_car.yaml" in message and "\n" not in message
    for word in words:
        assert word in message, message
    with pytest.raises(ValueError, match="No such file"):
        vehicle_from(str(tmp_path / "nowhere.yaml"))
    with pytest.raises(ValueError, match=r"or a file \(.yaml"):
        vehicle_from("my_car.toml")


@pytest.mark.parametrize("number", [1, 2, 3])
def test_commonroad_parameter_files_are_their_cars(number):
    """The files of the package, against the cars that were typed in from its tables."""
    models = pytest.importorskip("vehiclemodels")
    from pathlib import Path

    path = Path(models.__file__).parent / "parameters" / f"parameters_vehicle{number}.yaml"
    car, typed = asdict(vehicle_from(path)), asdict(VEHICLES[f"commonroad-{number}"])
    for name in ("mass", "yaw_inertia", "cg_to_front_axle", "front_cornering_stiffness", "length", "width"):
        assert car[name] == pytest.approx(typed[name], rel=1e-12)
    assert car["steering"] == typed["steering"]


@pytest.mark.parametrize("slope", [-(10**400), -1e300, 0, "steep"])
def test_a_commonroad_tyre_without_a_slope_is_refused_in_one_line(tmp_path, slope):
    numbers = {"l": 4.5, "w": 1.8, "m": 1225, "I_z": 1538, "a": 0.88, "b": 1.5, "R_w": 0.34}
    path = tmp_path / "car.yaml"
    path.write_text(json.dumps({**numbers, "tire": {"p_ky1": slope}}))
    with pytest.raises(ValueError, match=r"car\.yaml.*p_ky1=.*it must be a number < 0") as caught:
        vehicle_from(str(path))
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_without_base_says_which_car_it_changes(tmp_path):
    (tmp_path / "mine.yaml").write_text("mass: 2 t\n")
    assert "yin" in vehicle_from(tmp_path / "mine.yaml").source


def test_nested_mappings_are_changes():
    car = vehicle_from({"base": "commonroad-1", "steering": {"delay": 0.05}})
    assert (car.steering.delay, car.steering.rate_limit, car.steering.angle_limit) == (0.05, 0.4, 0.91)
    assert "yin" in repr(vehicle_from({"mass": 2000.0})) and "yin" in vehicle_from({"mass": 2e3, "name": "mine"}).source
    works = RoadWorksScenario.from_keywords(speed={"lateral_acceleration": 2.0})
    assert works.speed.maximum == pytest.approx(80 / 3.6)
    assert CameraLaneScenario.from_keywords(camera={"edge": "left"}).camera.look_ahead == 3.5
    noisy = LaneKeepScenario.from_keywords(sensors={"base": "production", "lateral_error": {"noise": 0.2}})
    usual = LaneKeepScenario.from_keywords(sensors="production")
    assert dict(noisy.sensors)["lateral_error"].period == 0.05 and dict(noisy.sensors)["lateral_error"].noise == 0.2
    assert dict(noisy.sensors)["yaw_rate"] == dict(usual.sensors)["yaw_rate"]
    with pytest.raises(ValueError, match=r"sensors\.base='good' is unknown"):
        LaneKeepScenario.from_keywords(sensors={"base": "good"})
