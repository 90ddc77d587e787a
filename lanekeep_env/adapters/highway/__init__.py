"""highway-env (Leurent 2018): our cars and controllers in its worlds.

Importing this makes its configuration know two more types, and changes nothing else of it:

    >>> import gymnasium as gym
    >>> config = {
    ...     "action": {"type": "LanekeepAction", "vehicle": "yin", "longitudinal": False},
    ...     "observation": {"type": "LanekeepObservation", "preview": 12},
    ... }
    >>> env = gym.make("lanekeep_env.adapters.highway:racetrack-v1", config=config)
    >>> scenario = HighwayScenario.of(env.unwrapped)  # for lanekeep_baselines.make

`RoadLane` puts our roads into its networks. `lanekeep bench highway` drives its own tasks as they are.
"""

from gymnasium.envs.registration import register, registry

try:
    import highway_env  # noqa: F401  # which registers its ids
    from highway_env.envs.common import abstract as their_env
    from highway_env.envs.common import action as their_actions
    from highway_env.envs.common import observation as their_observations
except ModuleNotFoundError as error:
    if error.name != "highway_env":
        raise
    raise ModuleNotFoundError('highway_env is missing: pip install "lanekeep[highway]"', name=error.name) from None

from lanekeep_env.adapters.highway.action import ACTION, EgoAction, extended
from lanekeep_env.adapters.highway.lane import RoadLane
from lanekeep_env.adapters.highway.observation import OBSERVATION, EgoObservation, look
from lanekeep_env.adapters.highway.scenario import THEIR_CAR, HighwayScenario
from lanekeep_env.adapters.highway.vehicle import EgoVehicle

__all__ = [
    "ACTION",
    "OBSERVATION",
    "TASK",
    "THEIR_CAR",
    "EgoAction",
    "EgoObservation",
    "EgoVehicle",
    "HighwayScenario",
    "RoadLane",
    "look",
]

#: `gym.make_vec("lanekeep_env.adapters.highway:lanekeep/Highway-v0")`.
TASK = "lanekeep/Highway-v0"

# Their factories know their own types only: where they look them up, ours stand beside.
for _module in (their_actions, their_env):
    _module.action_factory = extended(_module.action_factory, ACTION, EgoAction)
for _module in (their_observations, their_env):
    _module.observation_factory = extended(_module.observation_factory, OBSERVATION, EgoObservation)
# Their tasks as the benchmark drives them.
if TASK not in registry:
    register(
        TASK,
        entry_point="lanekeep_env.adapters.highway.task:HighwayTask",
        vector_entry_point="lanekeep_env.adapters.highway.task:HighwayVectorEnv",
        order_enforce=False,
        disable_env_checker=True,
    )
