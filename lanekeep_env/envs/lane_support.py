"""`lanekeep/LaneSupport-v0`: a driver steers, an assistant keeps the car from leaving its lane."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.road_env import DriverEnv
from lanekeep_env.scenario import LaneSupportScenario


class LaneSupportEnv(DriverEnv, gym.Env):
    """
    ## Description

    Lane keeping support (a use case that Yin 2010 names): a driver model steers, and the policy is the assistant, which
    overrides the driver where the car would leave its lane, as seldom and as little as it can, and hands back without a
    jump. Motorway-like roads (radii from 250 m), up to 130 km/h and 2 m/s² of lateral acceleration.

    The driver (after Donges 1978) steers for the curvature ahead and corrects lateral and course error, with a lag of
    the hands; where in the lane the driver wants to be wanders. `driver="drowsy"` (default) looks away every 25 seconds
    for one to four and holds the wheel meanwhile; `driver="attentive"` does not. Any field of
    `lanekeep_env.scenario.Driver` can be given, and changes the drowsy one: `driver={"lapse_rate": 0.1}`,
    or the attentive one, `driver={"base": "attentive", "wander": 0.2}`. Like the assistant, the driver asks the wheels
    for no more than `max_steering_angle` (0.15 rad).

    ## Action Space

    `Box(-1, 1, (2,), float32)`: the assistant's road-wheel angle, 1 = `max_steering_angle` (0.15 rad), left positive,
    and its authority a, from 0 (and below: the driver drives) to 1 (the assistant does). The actuator is told
    driver + a (assistant - driver). An intervention begins when the authority rises from 0.

    ## Observation Space

    As `lanekeep/LaneKeep-v0` with `preview=12` (the curvature up to 1.1 s ahead), and two channels behind the steering
    command, which is what driver and assistant together told the actuator: driver_steering (rad), the angle that the
    driver asks for now, and authority, that of the last control step. `info` has beside the usual truth: interventions
    (so far), authority, assistance (rad, what the assistant added to the driver's angle) and handover_jump (rad, the
    largest change of that in a control step in which the authority changed, so far).

    ## Rewards

    Minus the running cost min(cap, w (assistance / 0.02 rad)²) times the control step, with w = 1 and cap = 16 per
    second: where in the lane the driver drives is free. A departure charges the cap for the rest of `episode_steps`.

    ## Starting State

    Anywhere on the road, shifted by up to 0.2 m and 0.3 degrees to either side; the driver looks.

    ## Episode End

    Terminates when the car's body touches the lane's edge: |lateral_error| > (lane_width - car width) / 2, 0.975 m for
    a car of 1.8 m. Truncated after `episode_steps` (1200) of 0.05 s.

    ## Arguments

    Every field of `lanekeep_env.LaneSupportScenario`, which are those of `LaneKeepScenario` with other defaults, driver
    and reference_assistance; and dtype.

    ## Vectorized environment

    `gym.make_vec("lanekeep/LaneSupport-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = LaneSupportScenario
