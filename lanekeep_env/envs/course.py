"""`lanekeep/ObstacleCircuit-v0` and `lanekeep/ParallelPark-v0`: a 1:10 car among boxes and into a parking space."""

from __future__ import annotations

import gymnasium as gym

from lanekeep_env.envs.wall_env import CourseEnv
from lanekeep_env.scenario import ObstacleCircuitScenario, ParallelParkScenario


class ObstacleCircuitEnv(CourseEnv, gym.Env):
    """
    ## Description

    Drive a lap of a rectangular circuit between walls in whose corridors boxes stand (Team KnightRiders 2017, second
    task): two to six boxes of 0.15 to 0.5 m a lap, corridors 1.2 to 3 m wide, in either direction. Each box leaves a
    passage of at least 0.5 m, for a car 0.265 m wide, and stands 2.5 m from the next one and the start, 1 m from the
    corners.

    ## Action Space

    `Box(-1, 1, (2,), float32)`: the road-wheel angle asked for, 1 = `max_steering_angle` (22 deg, an assumption: the
    source tells none), left positive, and the set speed, 1 = `max_speed` (2 m/s), -1 as much backwards.

    ## Observation Space

    As `lanekeep/Circuit-v0`, with mode behind speed_command: 1 while the car is to drive among obstacles (0 a round
    trip, 2 to park: `modes` may change that in the episode). The scan has 512 beams, the columns of the source's
    depth image, over 70 degrees, an assumption: its median over 41 values erases 0.048 m at 1 m there, 0.176 m on 141
    beams and 0.41 m on 64. `scan="kinect-columns"` adds the camera's faults.

    `observation="full"` adds to the channels of `Circuit-v0` the place of the world's longest parking space
    (space_ahead, space_left, space_turned, space_length), space_share and kerb_distance. `info` holds the truth as
    there, and mode, space_share, kerb_distance.

    ## Rewards

    As `lanekeep/Circuit-v0`: time counts, and a contact costs more than any drive without one.

    ## Starting State

    At rest in the middle of the circuit's lower side, which is its longest, within 0.1 m and 5 degrees.

    ## Episode End

    Terminates with the lap (`laps`) or with a contact. Truncated after `episode_steps` (2700) of 0.045 s.

    ## Arguments

    Every field of `lanekeep_env.ObstacleCircuitScenario`, and dtype. Worlds: `random-obstacle-circuits` (its fields
    say how many boxes of which sizes and what they leave free), or `obstacle-circuit` with a list of boxes and, for
    all three tasks in one world, a parking row:

    ```python
    gym.make("lanekeep/ObstacleCircuit-v0", world={"kind": "random-obstacle-circuits", "count": 100, "seed": 3})
    gym.make(
        "lanekeep/ObstacleCircuit-v0",
        world={"kind": "obstacle-circuit", "boxes": [(4.5, 0.5, 0.3, 0.3, 0.2)], "gaps": (0.6, 1.2)},
        modes=[(0, "roundtrip"), (20, "obstacles"), (60, "park")],
    )
    ```

    ## Vectorized environment

    `gym.make_vec("lanekeep/ObstacleCircuit-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = ObstacleCircuitScenario


class ParallelParkEnv(CourseEnv, gym.Env):
    """
    ## Description

    Park a 1:10 car parallel to the kerb on its right, in reverse, between boxes (Team KnightRiders 2017, third task).
    The car starts before a row of parked boxes with gaps between them; at least one gap is too short, and behind such
    ones there is one that is long enough (1.0 to 1.4 m; in one sweep the car needs 0.90 m).

    ## Action Space

    As `lanekeep/ObstacleCircuit-v0`, with `max_speed` 1 m/s.

    ## Observation Space

    As `lanekeep/ObstacleCircuit-v0`; mode is 2. With `observation="full"` the longest space's place is known.

    ## Rewards

    A second costs 1 until the car is parked. A time-out costs up to half of the episode's length more, by the share
    of the car that is not inside a space; after a contact the return is minus twice the episode's length. So contact <
    time-out < partly in < parked, and sooner is better.

    ## Starting State

    At rest before the row, 0.3 to 0.5 m from the boxes' line, within 0.03 m and 3 degrees.

    ## Episode End

    Terminates when the car has stood for 2 s (`parking_time`, below 0.01 m/s) inside a gap, at most 0.15 m from the
    kerb (`kerb_distance`) and within 5 degrees of it (`parking_angle`): `info["lap_time"]` is then the time that took,
    s. Or with a contact. Truncated after
    `episode_steps` (1400) of 0.045 s.

    ## Arguments

    Every field of `lanekeep_env.ParallelParkScenario`, and dtype. Worlds: `random-parking-rows`, `parking-row`.

    ```python
    gym.make("lanekeep/ParallelPark-v0", world={"kind": "parking-row", "gaps": (0.5, 1.1, 0.4)})
    ```

    ## Vectorized environment

    `gym.make_vec("lanekeep/ParallelPark-v0", num_envs=1024, vectorization_mode="vector_entry_point")`.

    ## Version History

    * v0: first version.
    """

    scenario_class = ParallelParkScenario
