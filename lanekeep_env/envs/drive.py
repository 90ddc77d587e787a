"""`lanekeep/Drive-v0`: steering, throttle and brake."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import PoweredEnv
from lanekeep_env.scenario import DriveScenario


class DriveEnv(PoweredEnv, gym.Env):
    """
    ## Description

    Drive a full-size car with steering, throttle and brake along a road, at set speeds that change, behind other cars,
    to stop points (Werling, Gröll, Bretthauer 2008, section 3 and Figure 10): engine map, six-speed automatic that
    shifts by throttle and load with kick-down, reverse gear, brake, drag, rolling, creep at standstill; slope and wind
    differ from episode to episode. What engine and brake take of the tyres' friction is lost to cornering
    (`friction_circle`).

    ## Action Space

    `Box(-1, 1, (2,), float32)`: the road-wheel angle asked for, 1 = `max_steering_angle` (0.5 rad), left positive, and
    the pedal: throttle where positive, brake where negative, 1 = full. The lever follows the sign of the set speed, as
    soon as the car stands. A car that stands on a slope is held against rolling back.

    ## Observation Space

    As `lanekeep/LaneKeep-v0` with 1 s of curvature ahead, and then

    | entry | unit | meaning |
    |---|---|---|
    | acceleration | m/s² | longitudinal |
    | pedal | | what was asked for last |
    | gear | | 0 for the first, -1 for reverse |
    | set_speed | m/s | asked for, negative backwards |
    | lead_gap, lead_speed | m, m/s | of the car ahead, true up to 200 m; beyond, or without one, 200 m and 0 |
    | stop_gap | m | to the stop point, negative behind it; 200 m without one |
    | position_gap, position_speed, position_acceleration | m, m/s, m/s² | of the set position, where there are such |

    Speeds are negative backwards; cars and stop points are those in the way.

    `info` holds the truth as there, and gap and time_to_collision (1e6 without a car ahead, or where it does not come
    nearer), stop_error (way left of a car that stands at a stop point, negative beyond it, else 0), speed_error, jerk;
    contact and overrun (1 while the car is in one), and avoidable_contact and avoidable_overrun (1 in the step in which
    it comes to that, where full braking from the first observation that showed the car or the point had avoided it).

    ## Rewards

    As `lanekeep/LaneKeep-v0`, and the squared speed error over 2 m/s against the least of the set speed, a time gap of
    1.5 s behind 4 m to the car ahead, and what brakes with 1.7 m/s² to the stop point. Meeting the car ahead and
    passing a stop point, by more than 5 cm, cost the cap for the rest of `episode_steps`, as leaving the lane does.

    ## Starting State

    Anywhere on the road, at the first set speed.

    ## Episode End

    Terminates when the car leaves its lane, meets the car ahead or passes a stop point (`Termination.STOP_PASSED`).
    Truncated after `episode_steps` (3000) of 0.02 s.

    ## Arguments

    Every field of `lanekeep_env.DriveScenario`. Figure 10's time line, up to the stop, and a car that cuts in and
    brakes:

    ```python
    events = [(0, "speed", 0), (4, "speed", 10), (15, "lead", 35, 7.5), (30, "lead_gone"), (37, "stop", 30)]
    gym.make("lanekeep/Drive-v0", road="straight", traffic=events, slope=0.0, wind=0.0)
    hazard = [(0, "speed", 20), (5, "lead", 15, 18), (8, "lead_speed", 0, 8.0), (20, "lead_gone")]
    gym.make("lanekeep/Drive-v0", traffic=hazard)
    ```

    A set position (x(t), y(t)) that brakes while the path swerves:

    ```python
    plan = [(0, "speed", 15), (0, "position", 0, 15), (0.6, "position_speed", 5, 4)]
    gym.make("lanekeep/Drive-v0", road="evasive", traffic=plan, slope=0.0, wind=0.0)
    ```

    `traffic={"hazards": 1.0}` draws nothing but hard braking, cut-ins and late stop points.

    ## Vectorized environment

    `gym.make_vec("lanekeep/Drive-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = DriveScenario
