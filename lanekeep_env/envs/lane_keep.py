"""`lanekeep/LaneKeep-v0`, one car."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import RoadEnv
from lanekeep_env.scenario import LaneKeepScenario


class LaneKeepEnv(RoadEnv, gym.Env):
    """
    ## Description

    Keep a car in the middle of its lane. The car follows a road of changing curvature at a given speed
    profile (0.4 g of lateral acceleration, up to 180 km/h); the policy steers. This is the scenario
    family of Yin 2010 (lane keeping at 68 to 180 km/h), on his car with his steering actuator.

    ## Action Space

    `Box(-1, 1, (1,), float32)`. With `action="steering_angle"` (default) the road-wheel angle asked for,
    1 = `max_steering_angle` (0.15 rad), left positive; with `action="steering_rate"` the speed of that
    angle, 1 = `max_steering_rate` (0.4 rad/s). Values outside are clipped and counted
    (`env.unwrapped.clipped_actions`); NaN is an error.

    ## Observation Space

    A flat float32 box; `env.unwrapped.channels` names each entry with unit and bounds.

    | entry | unit | meaning |
    |---|---|---|
    | lateral_error | m | centre of gravity left of the lane's centre |
    | heading_error | rad | heading minus the road's |
    | yaw_rate | rad/s | |
    | speed | m/s | |
    | steering_angle | rad | of the road wheel |
    | steering_command | rad | the command that last entered the actuator |
    | curvature_preview_0 ... n-1 | 1/m | with `preview=n`: curvature at the car and every `preview_interval` s ahead |

    `observation="full"` adds sideslip (rad), curvature (1/m) and lateral_acceleration (m/s²), and of what disturbs the
    car bank (rad), crosswind (m/s), friction, steering_offset (rad) and steering_gain.
    Values are clipped to the bounds. `info` holds the truth for metrics: lateral_error, heading_error,
    lateral_acceleration, steering_rate (mean of the step), speed, arc_length, cost (1 outside the
    lane), is_success (never departed so far), termination (`lanekeep_env.Termination`).

    ## Rewards

    Minus the running cost min(cap, (d / 0.5 m)² + w (steering rate / reference)²) times the control
    step, with w = 1, reference = 0.1 rad/s of the road wheel (at a steering ratio of 16 a brisk 92°/s of
    the steering wheel) and cap = 16 per second (a lane's edge costs 12.25). A departure charges the cap
    for the rest of `episode_steps`, so no drive inside the lane is worse than leaving it.

    ## Starting State

    Anywhere on the road (on open ones early enough for a whole episode), in curves as on straights, in the
    steady state of driving along the road there, moved by up to `start_lateral_error` (0.5 m) and turned by up
    to `start_course_error` (2°, heading plus sideslip against the road's) to either side; an option heading_error is
    the heading's alone.

    ## Episode End

    Terminates when the centre of gravity is more than half a `lane_width` (3.5 m) from the lane's centre
    (`departure="terminate"`; `"cost"` charges and goes on, `"off"` ignores it). Truncated after
    `episode_steps` (600) control steps of `control_step` (0.05 s); Gymnasium's `max_episode_steps` can
    shorten that. What an ended episode gives if stepped on means nothing; its rewards are 0.

    ## Arguments

    Every field of `lanekeep_env.LaneKeepScenario`: vehicle, dynamics, tyre, cornering_drag, friction, road, speed,
    action, max_steering_angle, max_steering_rate, start_lateral_error, start_course_error, lane_width,
    departure, bank, crosswind, gusts, gust_time, patches, changes, cost_weight, reference_steering_rate, cost_cap,
    effort, preview, preview_interval, observation, randomisation, sensors, control_step, episode_steps; and dtype
    ("float64" or "float32"), the precision of the simulation.

    ```python
    gym.make("lanekeep/LaneKeep-v0", vehicle="commonroad-2", tyre="magic_formula", road="yin", preview=20)
    ```

    `tyre="load_sensitive"` is honest at the limit: load transfer, friction and stiffness that fall with the load,
    combined slip, and a speed profile within the friction ellipse; `cornering_drag=True` lets bends cost speed
    (docs/single-track-error.md).

    ## Vectorized environment

    ```python
    gym.make_vec("lanekeep/LaneKeep-v0", num_envs=1024, vectorization_mode="vector_entry_point", dtype="float32")
    ```

    Car i after `reset(seed=s)` follows the single environment after `reset(seed=s + i)`.

    ## Version History

    * v0: first version.
    """

    scenario_class = LaneKeepScenario
