"""The vector forms of all registered environments, by their names (`LaneKeepVectorEnv`): derived, none is written."""

from __future__ import annotations

from pkgutil import resolve_name

import gymnasium as gym
from gymnasium.vector import VectorEnv

from lanekeep_env.envs.single import SingleEnv
from lanekeep_env.envs.skin import Skin
from lanekeep_env.envs.vector import ManyEnvs
from lanekeep_env.registration import ENVIRONMENTS


def vector_twin(name: str, single: type[SingleEnv]) -> type[ManyEnvs]:
    """Return the vector form of an environment: what its family shares, with its scenario."""
    family = next(base for base in single.__mro__ if issubclass(base, Skin) and not issubclass(base, gym.Env))
    scenario = single.scenario_class
    page = f"Vector form of `{single.__name__}`; arguments are those of `ManyEnvs` and `{scenario.__name__}`."
    body = {"scenario_class": scenario, "__doc__": page, "__module__": __name__}  # where a pickle finds it
    return type(name, (family, ManyEnvs, VectorEnv), body)  # skrl looks for VectorEnv among the direct bases


for _row in ENVIRONMENTS.values():
    _name = _row.vector.partition(":")[2]
    globals()[_name] = vector_twin(_name, resolve_name(_row.page))
