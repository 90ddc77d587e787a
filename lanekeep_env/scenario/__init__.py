"""Scenarios: frozen records of everything that defines an environment, checked when they are built."""

from lanekeep_env.scenario.base import INTEGRATION_STEP, Channel
from lanekeep_env.scenario.camera import Camera, CameraLaneScenario, TurnOffScenario
from lanekeep_env.scenario.circuit import CircuitScenario
from lanekeep_env.scenario.course import CourseScenario, ObstacleCircuitScenario, ParallelParkScenario
from lanekeep_env.scenario.drive import DriveScenario
from lanekeep_env.scenario.driver import Driver
from lanekeep_env.scenario.evasive import EvasiveScenario, ReversePathScenario
from lanekeep_env.scenario.flow import Flow, TrafficScenario
from lanekeep_env.scenario.lane_keep import LaneKeepScenario, RoadWorksScenario
from lanekeep_env.scenario.road import RoadScenario
from lanekeep_env.scenario.scan import Scan
from lanekeep_env.scenario.servo import Servo
from lanekeep_env.scenario.support import LaneSupportScenario
from lanekeep_env.scenario.traffic import Traffic
from lanekeep_env.scenario.walls import WallFollowScenario

__all__ = [
    "INTEGRATION_STEP",
    "Camera",
    "CameraLaneScenario",
    "Channel",
    "CircuitScenario",
    "CourseScenario",
    "DriveScenario",
    "Driver",
    "EvasiveScenario",
    "Flow",
    "LaneKeepScenario",
    "LaneSupportScenario",
    "ObstacleCircuitScenario",
    "ParallelParkScenario",
    "ReversePathScenario",
    "RoadScenario",
    "RoadWorksScenario",
    "Scan",
    "Servo",
    "Traffic",
    "TrafficScenario",
    "TurnOffScenario",
    "WallFollowScenario",
]
