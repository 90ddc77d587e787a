"""`lanekeep/WallFollow-v0` and `lanekeep/Circuit-v0`: a 1:10 car between walls."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.wall_env import WallEnv
from lanekeep_env.scenario import CircuitScenario, WallFollowScenario


class WallFollowEnv(WallEnv, gym.Env):
    """
    ## Description

    Follow the wall on the right at 1 m with a 1:10 car (after Team KnightRiders 2017; the steering limit of 22 deg and
    the depth camera's 70 deg and 141 beams are assumptions), at a speed of 0.3 to 2 m/s that is
    drawn once an episode, with a steering offset of up to 3 deg that the car does not know. The car sees what its
    sensors tell: ultrasonics to the right, left and front, the yaw rate, the wheels' encoder, and a depth camera if
    asked for.
    Its heading is not measured.

    ## Action Space

    `Box(-1, 1, (1,), float32)`: the road-wheel angle asked for, 1 = `max_steering_angle` (22 deg), left positive, or
    with `action="steering_rate"` its speed, 1 = `max_steering_rate` (3 rad/s). `servo` puts a servo between: ticks,
    different angles to the left and right, a measured map.

    ## Observation Space

    A flat float32 box; `env.unwrapped.channels` names each entry with unit and bounds.

    | entry | unit | meaning |
    |---|---|---|
    | distance_right, _left, _front | m | of the nearest wall in a cone of 45 deg, 0.03 to 6 m; 0 without an echo |
    | yaw_rate | rad/s | |
    | speed | m/s | of the wheels, by the encoder (`encoder_ticks` a turn, `encoder_direction`) |
    | steering_angle | rad | of the road wheel |
    | steering_command | rad | the command that last entered the servo |
    | scan_0 ... | m | with `scan=`: ranges of the depth camera from right to left, 0 where a beam shows nothing |

    The side sensors sit on the car's axis half-way between the axles, or `side_sensor` m ahead of the rear one, front
    sensor and camera at its nose. `sensors` adds noise, bias, rates, latency; `scan` range limits, gaps, wrong values
    at depth jumps; panels of glass are seen by the ultrasonics and not by the camera. `observation="full"` adds
    lateral_error, heading_error, clearance and steering_offset. `info` holds the truth: lateral_error (distance of the
    right wall from the side sensor minus the set one), heading_error, lateral_acceleration, steering_rate, speed,
    arc_length, cost (contact), is_success, termination, x, y, distance, clearance, lap_time.

    ## Rewards

    Minus the running cost min(cap, (lateral_error / 0.1 m)² + w (steering rate / reference)²) times the control step,
    with w = 1, reference = 2 rad/s and cap = 16 per second. A contact charges the cap for the rest of `episode_steps`.

    ## Starting State

    At the start of the world, `set_distance` from the right wall within 0.3 m, turned by up to 20 deg to either side.

    ## Episode End

    Terminates when the body touches a wall (`contact="terminate"`; with `"cost"` the wall holds the car and charges,
    with `"off"` it only holds it). Truncated after `episode_steps` (600) control steps of 0.045 s.

    ## Arguments

    Every field of `lanekeep_env.WallFollowScenario`, and dtype. For instance

    ```python
    gym.make("lanekeep/WallFollow-v0", speed=0.4, sensors="production", encoder_ticks=40, dynamics="dynamic")
    gym.make("lanekeep/WallFollow-v0", world="my_map.yaml", scan="kinect")
    ```

    ## Vectorized environment

    `gym.make_vec("lanekeep/WallFollow-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = WallFollowScenario


class CircuitEnv(WallEnv, gym.Env):
    """
    ## Description

    Drive a lap of a rectangular circuit between walls as fast as possible, without touching them (Team KnightRiders
    2017): four straights, four corners of 90 degrees, corridors 1.2 to 3 m wide, clockwise or not, by what the sensors
    of a 1:10 car tell.

    ## Action Space

    `Box(-1, 1, (2,), float32)`: the steering as in `WallFollow-v0`, and the set speed, 1 = `max_speed` (2 m/s), -1 as
    much backwards (a dynamic car stops instead).

    ## Observation Space

    As `lanekeep/WallFollow-v0`, with speed_command (m/s) behind the steering command and 64 beams over 70 degrees.
    lateral_error is that of the centre of gravity from the circuit's centre line.

    ## Rewards

    Time counts: a second costs 1 minus the progress along the centre line over that at `max_speed`, at most 2. A
    contact charges 2 a second for the rest of `episode_steps`; the lap done, nothing more is charged.
    `info["lap_time"]` is the last lap's in s (0 before).

    ## Starting State

    At rest in the middle of one of the four sides, within 0.1 m and 5 degrees.

    ## Episode End

    Terminates with the lap (`laps`) or with a contact. Truncated after `episode_steps` (1800) of 0.045 s.

    ## Arguments

    Every field of `lanekeep_env.CircuitScenario`, and dtype.

    ## Vectorized environment

    `gym.make_vec("lanekeep/Circuit-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = CircuitScenario
