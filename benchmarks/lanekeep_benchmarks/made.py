"""What a suite asks for, made once before anything is driven: its scenarios, and the policies that drive by default."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator

from lanekeep_benchmarks.evaluate import make_cars
from lanekeep_benchmarks.metrics import metrics_of
from lanekeep_benchmarks.policies import check_policy, default_policies
from lanekeep_benchmarks.suites import Suite, SuiteScenario
from lanekeep_env.adapters import scenario_class
from lanekeep_env.checks import shown


class Made(NamedTuple):
    """What is driven in a scenario, and the keys of its metrics."""

    definition: Any
    metrics: tuple[str, ...]


def make_definitions(suite: Suite, where: str) -> dict[str, Made]:
    """Return what is driven in each scenario, by its name; errors begin with ``where`` the suite is from.

    Raises:
        ValueError: a keyword, an option of `reset` or a field that policies are told is unknown or not allowed.
    """
    definitions = {}
    for scenario in suite.scenarios:
        try:
            definitions[scenario.name] = _made(scenario)
        except (TypeError, ValueError, OSError, ImportError, gym.error.Error) as error:
            raise ValueError(f"{where}: scenario {scenario.name}: {error}") from error
    return definitions


def _made(scenario: SuiteScenario) -> Made:
    if ":" in scenario.env_id:
        scenario_class(scenario.env_id)
    spec: Any = gym.spec(scenario.env_id.rpartition(":")[2])
    environment: Any = load_env_creator(spec.vector_entry_point)
    record = environment.scenario_class
    definition = record.from_keywords(**scenario.keywords)  # which knows no keywords but the scenario's
    record.check_names(scenario.told)
    # What has no effect on the car that policies believe in has one on the true one.
    told = scenario.policies_scenario(definition)
    driven, believed = ([channel.name for channel in one.channels] for one in (definition, told))
    if driven != believed:
        odd = next(name for name in (*driven, *believed) if (name in driven) != (name in believed))
        where = "driven" if odd in driven else "told"
        raise ValueError(f"told={shown(dict(scenario.told))} is not allowed: only what is {where} has a channel {odd}")
    env = make_cars(scenario, 1)
    metrics = metrics_of(scenario.env_id, env.unwrapped.truth, scenario.metrics)
    if scenario.options:
        env.reset(seed=0, options=dict(scenario.options))
    env.close()
    return Made(definition, metrics)


def policies_of(suite: Suite, definitions: Mapping[str, Any], where: str) -> list[str]:
    """Return the names of the policies that drive a suite by default, its reference first; definitions by scenario.

    Raises:
        ValueError: it lists an unknown one, or its reference is none of them.
    """
    try:
        for name in suite.policies:
            check_policy(name)
        able = [
            default_policies([definitions[one.name] for one in part], suite.policies, suite.learned)
            for part in suite.parts.values()
        ]
        names = list(dict.fromkeys(name for part in able for name in part))
        if suite.reference and suite.reference not in names:
            check_policy(suite.reference)
            raise ValueError(f"reference={suite.reference!r} is none of its policies: {', '.join(names)}")
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    return sorted(names, key=lambda name: name != suite.reference)  # which leaves the others as they are
