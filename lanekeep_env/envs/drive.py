"""`lanekeep/Drive-v0`: steering, throttle and brake."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import RoadEnv
from lanekeep_env.scenario import DriveScenario


class DriveEnv(RoadEnv, gym.Env):
    """
    ## Description

    Drive a full-size car with steering, throttle and brake along a road, at set speeds that change, behind slower cars,
    to stop points (Werling, Gröll, Bretthauer 2008, section 3 and Figure 10): engine map, six-speed automatic with
    torque interruption, brake, drag, rolling, creep at standstill; slope and wind differ from episode to episode.

    ## Action Space

    `Box(-1, 1, (2,), float32)`: the road-wheel angle asked for, 1 = `max_steering_angle` (0.5 rad), left positive, and
    the pedal: throttle where positive, brake where negative, 1 = full.

    ## Observation Space

    As `lanekeep/LaneKeep-v0` with 1 s of curvature ahead, and then

    | entry | unit | meaning |
    |---|---|---|
    | acceleration | m/s² | longitudinal |
    | pedal | | what was asked for last |
    | gear | | 0 for the first |
    | set_speed | m/s | asked for |
    | lead_gap, lead_speed | m, m/s | of the car ahead; 200 m without one |
    | stop_gap | m | to the stop point, negative behind it; 200 m without one |

    ## Rewards

    As `lanekeep/LaneKeep-v0`, and the squared speed error over 2 m/s against the least of the set speed, a time gap of
    1.5 s behind 4 m to the car ahead, and what brakes with 1.7 m/s² to the stop point. Meeting the car ahead costs the
    cap for the rest of `episode_steps`, as leaving the lane does.

    ## Starting State

    Anywhere on the road, at the first set speed.

    ## Episode End

    Terminates when the car leaves its lane or meets the car ahead. Truncated after `episode_steps` (3000) of 0.02 s.

    ## Arguments

    Every field of `lanekeep_env.DriveScenario`. Figure 10's time line, up to the stop:

    ```python
    events = [(0, "speed", 0), (4, "speed", 10), (15, "lead", 35, 7.5), (30, "lead_gone"), (37, "stop", 30)]
    gym.make("lanekeep/Drive-v0", road="straight", traffic=events, slope=0.0, wind=0.0)
    ```

    ## Vectorized environment

    `gym.make_vec("lanekeep/Drive-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = DriveScenario
