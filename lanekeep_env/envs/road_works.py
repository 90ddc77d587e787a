"""`lanekeep/RoadWorks-v0`: lane keeping in narrow, shifting lanes."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import RoadEnv
from lanekeep_env.scenario import RoadWorksScenario


class RoadWorksEnv(RoadEnv, gym.Env):
    """
    ## Description

    Drive through road works (Yin 2010 names the assistant): a lane of 2.75 m whose centre shifts to the side by up
    to 3.25 m within 70 to 112 m, back and forth, at 80 km/h or what 0.4 g allows. Observation, action and `info` are
    those of `LaneKeepEnv`, with the lane's centre as the path: lateral_error counts from it wherever it shifts.

    ## Action Space, Observation Space

    As `lanekeep/LaneKeep-v0`.

    ## Rewards

    As `lanekeep/LaneKeep-v0`, with a reference lateral error of 0.15 m instead of 0.5 m.

    ## Starting State

    Anywhere on the road, shifted by up to 0.15 m and 1 degree to either side.

    ## Episode End

    Terminates when the car's body touches the lane's edge: |lateral_error| > (lane_width - car width) / 2, 0.475 m
    for a car of 1.8 m. Truncated after `episode_steps` (600) of 0.05 s.

    ## Arguments

    Every field of `lanekeep_env.RoadWorksScenario`, which are those of `LaneKeepScenario` with other defaults.

    ## Vectorized environment

    `gym.make_vec("lanekeep/RoadWorks-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = RoadWorksScenario
