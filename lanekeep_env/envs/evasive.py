"""`lanekeep/Evasive-v0` and `lanekeep/ReversePath-v0`: manoeuvres of a full-size car."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import RoadEnv
from lanekeep_env.scenario import EvasiveScenario, ReversePathScenario


class EvasiveEnv(RoadEnv, gym.Env):
    """
    ## Description

    Follow an evasive path at 55 km/h with a full-size car on saturating tyres, from up to 0.8 m beside it (Werling,
    Gröll, Bretthauer 2008, Figure 8): a lane change of 3.5 m over 36.7 m, to either side, whose lateral acceleration
    reaches 4.0 m/s². `friction` makes the road slippery: on 0.3 the path cannot be followed.

    ## Action Space, Observation Space

    As `lanekeep/LaneKeep-v0` with `observation="full"` and 1 s of curvature ahead, 50 times a second.

    ## Rewards

    As `lanekeep/LaneKeep-v0`, with a reference steering rate of 0.3 rad/s.

    ## Starting State

    10 m before the lane change, along the path, within 0.8 m of it.

    ## Episode End

    Terminates when the centre of gravity is more than half a `lane_width` (4 m) from the path. Truncated after
    `episode_steps` (300) of 0.02 s.

    ## Arguments

    Every field of `lanekeep_env.EvasiveScenario`, which are those of `LaneKeepScenario` with other defaults.

    ## Vectorized environment

    `gym.make_vec("lanekeep/Evasive-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = EvasiveScenario


class ReversePathEnv(RoadEnv, gym.Env):
    """
    ## Description

    Back up along a path with bends near the car's turning circle, at walking speed (Werling, Gröll, Bretthauer 2008,
    Figure 9). The car rolls without slip; errors are those of its rear axle. Path, curvature and errors keep the
    orientation of the path, which the car drives from its end to its start: the heading error is zero when the car
    points along the path, and a positive lateral error is left of it as seen from behind the car.

    ## Action Space

    As `lanekeep/LaneKeep-v0`, 1 = 0.6 rad.

    ## Observation Space

    As `lanekeep/LaneKeep-v0`, 50 times a second; speed is negative, and the curvature preview looks where the car goes.

    ## Rewards

    As `lanekeep/LaneKeep-v0`, with references 0.1 m and 0.3 rad/s.

    ## Starting State

    At the path's end, within 0.2 m and 3 degrees, backing up at 0.5 to 1.5 m/s.

    ## Episode End

    Terminates when the rear axle is more than half a `lane_width` (3 m) from the path. Truncated after
    `episode_steps` (1500) of 0.02 s.

    ## Arguments

    Every field of `lanekeep_env.ReversePathScenario`.

    ## Vectorized environment

    `gym.make_vec("lanekeep/ReversePath-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = ReversePathScenario
