"""Walled worlds: wall segments, generators, map files, ray casting and contact."""

from lanekeep_env.walls.generators import Circuit, Corridor, Ell, RandomCircuits, Slalom, WorldRecord
from lanekeep_env.walls.map_file import read_map
from lanekeep_env.walls.obstacles import ObstacleCircuit, RandomObstacleCircuits
from lanekeep_env.walls.parking import ParkingRow, RandomParkingRows
from lanekeep_env.walls.specs import WORLDS, MapFile, world_from
from lanekeep_env.walls.world import World, pack

__all__ = [
    "WORLDS",
    "Circuit",
    "Corridor",
    "Ell",
    "MapFile",
    "ObstacleCircuit",
    "ParkingRow",
    "RandomCircuits",
    "RandomObstacleCircuits",
    "RandomParkingRows",
    "Slalom",
    "World",
    "WorldRecord",
    "pack",
    "read_map",
    "world_from",
]
