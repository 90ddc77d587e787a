"""One row an environment id."""

from __future__ import annotations

from gymnasium.envs.registration import register, registry

#: id: (single environment, vector environment, control steps of an episode)
ENVIRONMENTS: dict[str, tuple[str, str, int]] = {
    "lanekeep/LaneKeep-v0": (
        "lanekeep_env.envs.lane_keep:LaneKeepEnv",
        "lanekeep_env.envs.lane_keep_vector:LaneKeepVectorEnv",
        600,
    ),
    "lanekeep/RoadWorks-v0": (
        "lanekeep_env.envs.road_works:RoadWorksEnv",
        "lanekeep_env.envs.road_works:RoadWorksVectorEnv",
        600,
    ),
    "lanekeep/CameraLane-v0": (
        "lanekeep_env.envs.camera_lane:CameraLaneEnv",
        "lanekeep_env.envs.camera_lane:CameraLaneVectorEnv",
        1000,
    ),
    "lanekeep/TurnOff-v0": (
        "lanekeep_env.envs.camera_lane:TurnOffEnv",
        "lanekeep_env.envs.camera_lane:TurnOffVectorEnv",
        1500,
    ),
    "lanekeep/Evasive-v0": (
        "lanekeep_env.envs.evasive:EvasiveEnv",
        "lanekeep_env.envs.evasive:EvasiveVectorEnv",
        300,
    ),
    "lanekeep/ReversePath-v0": (
        "lanekeep_env.envs.evasive:ReversePathEnv",
        "lanekeep_env.envs.evasive:ReversePathVectorEnv",
        1500,
    ),
    "lanekeep/Drive-v0": (
        "lanekeep_env.envs.drive:DriveEnv",
        "lanekeep_env.envs.drive:DriveVectorEnv",
        3000,
    ),
    "lanekeep/WallFollow-v0": (
        "lanekeep_env.envs.wall_follow:WallFollowEnv",
        "lanekeep_env.envs.wall_follow:WallFollowVectorEnv",
        600,
    ),
    "lanekeep/Circuit-v0": (
        "lanekeep_env.envs.wall_follow:CircuitEnv",
        "lanekeep_env.envs.wall_follow:CircuitVectorEnv",
        1800,
    ),
}


def register_all() -> None:
    """Register every environment with Gymnasium; a second call changes nothing."""
    for name, (single, vector, steps) in ENVIRONMENTS.items():
        if name not in registry:
            # The environments themselves refuse a step before reset and a wrong action, at each step; the
            # wrappers that Gymnasium would add for that cost more than a tenth of a step.
            register(
                name,
                entry_point=single,
                vector_entry_point=vector,
                max_episode_steps=steps,
                order_enforce=False,
                disable_env_checker=True,
            )
