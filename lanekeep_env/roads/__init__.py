"""Roads: piecewise-linear curvature over arc length, generators, file reader, speed along them."""

from lanekeep_env.roads.file import read_road
from lanekeep_env.roads.generators import (
    CircleRoad,
    RandomRoads,
    RoadWorksRoads,
    SineRoad,
    SlalomRoad,
    StraightRoad,
    YinRoad,
)
from lanekeep_env.roads.given import RoadClothoids, RoadPoints
from lanekeep_env.roads.manoeuvres import EvasiveRoads, ParkingPaths
from lanekeep_env.roads.road import Road
from lanekeep_env.roads.sets import road_set
from lanekeep_env.roads.specs import ROADS, RoadFile, RoadSpec, build_roads, road_from
from lanekeep_env.roads.speed import (
    ConstantSpeed,
    FileSpeed,
    LimitedSpeed,
    SetSpeeds,
    SpeedSpec,
    lap_time,
    set_speeds_from,
    speed_from,
)
from lanekeep_env.roads.yards import BypassRoads, TurnOffRoads, YardRoads

__all__ = [
    "ROADS",
    "BypassRoads",
    "CircleRoad",
    "ConstantSpeed",
    "EvasiveRoads",
    "FileSpeed",
    "LimitedSpeed",
    "ParkingPaths",
    "RandomRoads",
    "Road",
    "RoadClothoids",
    "RoadFile",
    "RoadPoints",
    "RoadSpec",
    "RoadWorksRoads",
    "SetSpeeds",
    "SineRoad",
    "SlalomRoad",
    "SpeedSpec",
    "StraightRoad",
    "TurnOffRoads",
    "YardRoads",
    "YinRoad",
    "build_roads",
    "lap_time",
    "read_road",
    "road_from",
    "road_set",
    "set_speeds_from",
    "speed_from",
]
