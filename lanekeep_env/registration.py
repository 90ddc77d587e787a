"""One row an environment id; its vector form, length and options follow from what the row names."""

from __future__ import annotations

from typing import NamedTuple

from gymnasium.envs.registration import register, registry

from lanekeep_env.scenario import (
    CameraLaneScenario,
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
from lanekeep_env.scenario.car import CarScenario


class Row(NamedTuple):
    """What an id stands for.

    Attributes:
        scenario: whose fields are the keywords of ``gym.make``, and whose `episode_steps` is the length.
        page: "module:class" of the single environment, which is not imported before the first ``gym.make``.
    """

    scenario: type[CarScenario]
    page: str

    @property
    def vector(self) -> str:
        """Where its vector form is, "module:class"."""
        return f"lanekeep_env.envs.vector_twins:{self.page.partition(':')[2].removesuffix('Env')}VectorEnv"


ENVIRONMENTS: dict[str, Row] = {
    "lanekeep/LaneKeep-v0": Row(LaneKeepScenario, "lanekeep_env.envs.lane_keep:LaneKeepEnv"),
    "lanekeep/RoadWorks-v0": Row(RoadWorksScenario, "lanekeep_env.envs.road_works:RoadWorksEnv"),
    "lanekeep/LaneSupport-v0": Row(LaneSupportScenario, "lanekeep_env.envs.lane_support:LaneSupportEnv"),
    "lanekeep/CameraLane-v0": Row(CameraLaneScenario, "lanekeep_env.envs.camera_lane:CameraLaneEnv"),
    "lanekeep/TurnOff-v0": Row(TurnOffScenario, "lanekeep_env.envs.camera_lane:TurnOffEnv"),
    "lanekeep/Evasive-v0": Row(EvasiveScenario, "lanekeep_env.envs.evasive:EvasiveEnv"),
    "lanekeep/ReversePath-v0": Row(ReversePathScenario, "lanekeep_env.envs.evasive:ReversePathEnv"),
    "lanekeep/Drive-v0": Row(DriveScenario, "lanekeep_env.envs.drive:DriveEnv"),
    "lanekeep/Traffic-v0": Row(TrafficScenario, "lanekeep_env.envs.traffic:TrafficEnv"),
    "lanekeep/WallFollow-v0": Row(WallFollowScenario, "lanekeep_env.envs.wall_follow:WallFollowEnv"),
    "lanekeep/Circuit-v0": Row(CircuitScenario, "lanekeep_env.envs.wall_follow:CircuitEnv"),
    "lanekeep/ObstacleCircuit-v0": Row(ObstacleCircuitScenario, "lanekeep_env.envs.course:ObstacleCircuitEnv"),
    "lanekeep/ParallelPark-v0": Row(ParallelParkScenario, "lanekeep_env.envs.course:ParallelParkEnv"),
}


def register_all() -> None:
    """Register every environment with Gymnasium; a second call changes nothing."""
    for name, row in ENVIRONMENTS.items():
        if name not in registry:
            # Kernels truncate after `episode_steps`; a limit of Gymnasium's beside that would cut longer ones short.
            # The environments themselves refuse a step before reset and a wrong action, at each step; the
            # wrappers that Gymnasium would add for that cost more than a tenth of a step.
            register(
                name,
                entry_point=row.page,
                vector_entry_point=row.vector,
                order_enforce=False,
                disable_env_checker=True,
            )
