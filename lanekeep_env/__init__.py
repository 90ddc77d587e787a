"""Lane keeping, path following and wall following environments for Gymnasium.

``import lanekeep_env`` registers the ids ``lanekeep/<Task>-v0``.
"""

from lanekeep_env.physics.parameters import SteeringActuator, VehicleParameters
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.randomisation import RANDOMISATIONS, Randomisation
from lanekeep_env.registration import ENVIRONMENTS, register_all
from lanekeep_env.scenario import (
    CameraLaneScenario,
    Channel,
    CircuitScenario,
    DriveScenario,
    EvasiveScenario,
    LaneKeepScenario,
    LaneSupportScenario,
    ObstacleCircuitScenario,
    ParallelParkScenario,
    ReversePathScenario,
    RoadWorksScenario,
    TrafficScenario,
    TurnOffScenario,
    WallFollowScenario,
)
from lanekeep_env.sensing import SENSOR_SETS, Sensor
from lanekeep_env.tasks.termination import Termination

__version__ = "0.1.0"
__all__ = [
    "ENVIRONMENTS",
    "RANDOMISATIONS",
    "SENSOR_SETS",
    "VEHICLES",
    "CameraLaneScenario",
    "Channel",
    "CircuitScenario",
    "DriveScenario",
    "EvasiveScenario",
    "LaneKeepScenario",
    "LaneSupportScenario",
    "ObstacleCircuitScenario",
    "ParallelParkScenario",
    "Randomisation",
    "ReversePathScenario",
    "RoadWorksScenario",
    "Sensor",
    "SteeringActuator",
    "Termination",
    "TrafficScenario",
    "TurnOffScenario",
    "VehicleParameters",
    "WallFollowScenario",
    "__version__",
]

register_all()
