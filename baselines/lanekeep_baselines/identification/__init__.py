"""Identification of a car from a driven run (Yin 2010): drive, fit, and design on what was found.

run = excited_drive(seed=0)                      # or DrivenRun.load("my_drive.npz")
found = identify(run)
policy = redesign("yin-lqr-observer", scenario, found)
"""

from lanekeep_baselines.identification.fit import identify
from lanekeep_baselines.identification.noise import SensorNoise
from lanekeep_baselines.identification.record import excited_drive, multi_sine, record_run
from lanekeep_baselines.identification.result import PARAMETERS, Identification
from lanekeep_baselines.identification.run import DrivenRun, UnusableRun
from lanekeep_baselines.identification.vehicle import redesign, vehicle_from_identification

__all__ = [
    "PARAMETERS",
    "DrivenRun",
    "Identification",
    "SensorNoise",
    "UnusableRun",
    "excited_drive",
    "identify",
    "multi_sine",
    "record_run",
    "redesign",
    "vehicle_from_identification",
]
