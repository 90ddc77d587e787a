"""`lanekeep/CameraLane-v0` and `lanekeep/TurnOff-v0`: guidance by a camera that sees the road's edge."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import GuidedEnv
from lanekeep_env.scenario import CameraLaneScenario, TurnOffScenario


class CameraLaneEnv(GuidedEnv, gym.Env):
    """
    ## Description

    Guide a van along the roads of a works yard at 0 to 6 m/s by what one camera sees: the distance of the van's
    axis from the right road edge, 3.5 m ahead of the front axle (Trächtler, Lohmann, Struck 1992). The van rolls
    without slip; `speed` is that of its front wheels. A motor of limited speed turns the steering column through a gear
    with backlash. Bends go down to the van's turning circle; there, and where markings are missing, the edge leaves the
    picture, and what remains is the planned curvature of a map. The van stops now and then and slows down for bends.

    ## Action Space

    `Box(-1, 1, (1,), float32)`: the road-wheel angle asked for, 1 = `max_steering_angle` (0.6 rad), left positive, or
    with `action="steering_rate"` its speed, 1 = `max_steering_rate` (20 deg/s).

    ## Observation Space

    A flat float32 box; `env.unwrapped.channels` names each entry with unit and bounds.

    | entry | unit | meaning |
    |---|---|---|
    | edge_distance | m | of the body's axis from the edge at the look-ahead point, along the body's lateral axis |
    | edge_valid | | 1 where the last picture showed the edge; otherwise the last valid distance is held |
    | speed | m/s | of the front wheels |
    | steering_angle | rad | of the road wheel, behind the gear |
    | steering_command | rad | the command that last entered the actuator |
    | planned_curvature_0 ... 19 | 1/m | of the road's centre line at the rear axle and every 0.5 m ahead of it |

    The distance is exact on any road. It is 1.5 m (half of `lane_width`) on the centre of a straight, and until
    an edge was seen. It is not valid where the edge has no marking, has left the field of view (110 deg) or turns away
    before the look-ahead point. `sensors` adds noise, a frame rate, latency, lost pictures. `observation="full"` adds
    lateral_error (m), heading_error (rad) and motor_angle (rad). `info` as in `LaneKeepEnv`; the errors are
    those of the REAR AXLE, the point that the published controller keeps on the lane's centre.

    ## Rewards

    As `lanekeep/LaneKeep-v0`, with reference 0.4 m and 0.2 rad/s.

    ## Starting State

    Anywhere on the road, steered along it, within 0.3 m and 3 deg to either side, at a set speed.

    ## Episode End

    Terminates when the rear axle is more than half a `lane_width` (3 m) from the lane's centre. Truncated after
    `episode_steps` (1000) control steps of 0.04 s (a PAL camera's 25 pictures a second).

    ## Arguments

    Every field of `lanekeep_env.CameraLaneScenario`; and dtype. For instance

    ```python
    gym.make("lanekeep/CameraLane-v0", speed=4.0, road={"kind": "circle", "radius": -30.0}, sensors="production")
    gym.make("lanekeep/CameraLane-v0", camera={"edge": "left"}, vehicle={"base": "van", "steering": {"backlash": 0.0}})
    ```

    (the second van has no backlash).

    ## Vectorized environment

    `gym.make_vec("lanekeep/CameraLane-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = CameraLaneScenario


class TurnOffEnv(GuidedEnv, gym.Env):
    """
    ## Description

    Turn off the road at a junction that shows no edge (Trächtler, Lohmann, Struck 1992, Figure 7): a left curve, a
    straight, a turn by 90 degrees to either side on a centre line of 9.5 to 21.5 m radius, and a straight whose
    edge the camera sees again half-way through the turn. Set speed 2 to 6 m/s, constant. In the turn the van
    drives blind, by the planned curvature. `road={"kind": "turn-off", "lost": 2.0}` loses the edge for twice as long,
    `"smallest_angle"` and `"largest_angle"` (rad) turn by other angles, and `road="bypass"` is a way round an obstacle,
    all of it blind.

    `plan_errors={"offset": 1.0, "radius": (-0.1, 0.1), "angle": 0.05, "recognised": 3.0}` gives the plan the errors of
    a map and of a late look: m, shares of radius and angle, and the way ahead at which a bend comes into the plan.

    `set_points=1.2`, or `{"minimum": 1.2, "maximum": 1.8, "hold": 8.0}` for distances (m) that change every 8 s, sets
    what the edge is to be kept at; the channel set_distance tells it, and the running cost counts from it.

    ## Action Space, Observation Space, Rewards

    As `lanekeep/CameraLane-v0`.

    ## Starting State

    At the start of the road, within 0.1 m and 1 degree to either side.

    ## Episode End

    Terminates when the rear axle is more than half a `lane_width` (3 m) from the lane's centre. Truncated after
    `episode_steps` (1500) control steps of 0.04 s.

    ## Arguments

    Every field of `lanekeep_env.TurnOffScenario`, which are those of `CameraLaneScenario` with other defaults.

    ## Vectorized environment

    `gym.make_vec("lanekeep/TurnOff-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = TurnOffScenario
