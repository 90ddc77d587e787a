"""`lanekeep/Traffic-v0`: steering, throttle and brake among other cars."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import AmongTraffic, PoweredEnv
from lanekeep_env.scenario import TrafficScenario


class TrafficEnv(AmongTraffic, PoweredEnv, gym.Env):
    """
    ## Description

    Drive the car of `lanekeep/Drive-v0` at a set speed on a road of several lanes, among cars that keep their distance
    by the Intelligent Driver Model and change lanes by MOBIL, as those of highway-env 1.12 do, vehicle by vehicle. They
    see the car as one of them. `flow` says how many there are and what happens:

    | situation | |
    |---|---|
    | "flow" | they drive as they like |
    | "braking_lead" | the car ahead, at its set speed and 0.8 to 2 s away, brakes with 4 to 9 m/s² for 1 to 5 s |
    | "cut_in" | a slower car ahead in the next lane comes over when it is 0.3 to 1.3 s away |
    | "merging" | the car starts in the right-most lane, which ends 150 to 300 m ahead; the others keep out of it |

    The others drive in the road's coordinates, their speeds are those along its line; the tyres of none give more
    than the road's friction does.

    ## Action Space

    As `lanekeep/Drive-v0`: the road-wheel angle asked for and the pedal.

    ## Observation Space

    As `lanekeep/Drive-v0`, with lateral_error from the middle of the nearest lane, lead_gap and lead_speed of the car
    ahead in that lane (or coming into it) and stop_gap to the end of the lane, and then

    | entry | unit | meaning |
    |---|---|---|
    | lane | | number of the nearest lane, 0 for the right-most |
    | ahead_right_distance, behind_right_distance | m | of the nearest cars in the lane to the right, from middle to middle along the road, negative behind; 200 and -200 without one within 200 m |
    | ahead_right_speed, behind_right_speed | m/s | theirs along the road, 0 without one |
    | ahead_right_lane, behind_right_lane | | how many lanes left of the middle of the car's own lane they are |
    | ahead_own_distance ... behind_left_lane | | the same in the own and in the left lane |

    ## Rewards

    As `lanekeep/Drive-v0`, with the lateral error in the nearest lane and a speed error that is the larger of what the
    car is slower than its set speed and faster than the gap ahead, or the end of its lane, allows, over 4 m/s: behind a
    slow car a change of lanes pays. Touching another car costs the cap for the rest of `episode_steps`.

    `info` is that of `lanekeep/Drive-v0`. A contact counts as avoidable where full braking from the observation
    behind the first that showed the car ahead in the lane had avoided it (the function that judges `lanekeep/Drive-v0`,
    on what the car ahead did), where the car had gone to that lane itself, or met one outside its lane.

    ## Starting State

    In any lane, at the set speed, within 0.3 m of its middle; the others `spacing` apart in each lane, none beside it.
    The reset option `lateral_error` counts from the middle of the right-most lane.

    ## Episode End

    Terminates when the car touches another, leaves the road, or passes the end of its lane (`Termination.STOP_PASSED`).
    Truncated after `episode_steps` (2000) of 0.02 s.

    ## Arguments

    Every field of `lanekeep_env.TrafficScenario`.

    ```python
    gym.make("lanekeep/Traffic-v0", flow={"situation": "cut_in", "cars": 12}, lanes=2)
    ```

    ## Vectorized environment

    `gym.make_vec("lanekeep/Traffic-v0", num_envs=256, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """  # noqa: E501

    scenario_class = TrafficScenario
