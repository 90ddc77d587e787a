"""What a policy lets be tuned: the numbers, their ranges, and where each search begins."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import lanekeep_baselines
from lanekeep_baselines.tunable import shipped
from lanekeep_env import ENVIRONMENTS
from lanekeep_env.checks import nearest, shown

if TYPE_CHECKING:
    from lanekeep_agents.training.settings import TrainingSettings

#: Ranges of hyper-parameters, a table an algorithm.
RANGES = Path(__file__).with_name("ranges.toml")
#: A hyper-parameter that not every environment's cost has.
_COST = "env.cost_weight"


class Range(NamedTuple):
    """Of a number: between which values, whether by its logarithm; or one of ``choices``."""

    low: float = 0.0
    high: float = 0.0
    log: bool = True
    choices: tuple[float, ...] = ()

    def holds(self, value: float) -> bool:
        """Tell whether the search may ask for a value."""
        return value in self.choices if self.choices else self.low <= value <= self.high


class Space(NamedTuple):
    """Ranges by name, and the values that are shipped, which are tried first."""

    ranges: dict[str, Range]
    start: dict[str, float]


@cache
def _learned() -> dict[str, dict[str, Range]]:
    table = tomllib.loads(RANGES.read_text())
    return {
        algorithm: {
            name: Range(**{**entry, "choices": tuple(entry.get("choices", ()))}) for name, entry in ranges.items()
        }
        for algorithm, ranges in table.items()
    }


def is_learned(policy: str) -> bool:
    """Tell whether a name is that of a learning algorithm."""
    return policy in _learned()


def check_tunable(policy: str) -> None:
    """Raise ValueError, one line, unless something of ``policy`` can be tuned."""
    if is_learned(policy):
        return
    names = lanekeep_baselines.names()
    able = [name for name in names if lanekeep_baselines.policy_class(name).tunable]
    allowed = f"allowed: {', '.join([*able, *_learned()])}"
    if policy not in names:
        raise ValueError(f"policy {shown(policy)} is unknown{nearest(policy, [*names, *_learned()])}; {allowed}")
    if policy not in able:
        raise ValueError(f"policy {policy!r} has nothing to tune: its values are published or given; {allowed}")


def space_of(policy: str, env_id: str) -> Space:
    """Return what is searched of a policy that `check_tunable` lets pass."""
    if is_learned(policy):
        from lanekeep_agents.training.settings import settings_for

        settings = settings_for(policy, env_id)
        ranges = {
            name: one for name, one in _learned()[policy].items() if name != _COST or _charges(env_id, settings.env)
        }
        return Space(ranges, {name: _value(settings, name) for name in ranges})
    declared = lanekeep_baselines.policy_class(policy)
    return Space({one.name: Range(one.low, one.high, one.log) for one in declared.tunable}, shipped(declared))


def nested(values: Mapping[str, float]) -> dict[str, Any]:
    """Return values with names like ``parameters.gae_lambda`` as `settings_for` takes them."""
    changes: dict[str, Any] = {}
    for name, value in values.items():
        outer, _, inner = name.partition(".")
        if inner:
            changes.setdefault(outer, {})[inner] = value
        else:
            changes[outer] = value
    return changes


def _charges(env_id: str, keywords: Mapping[str, Any]) -> bool:
    try:
        ENVIRONMENTS[env_id].scenario.from_keywords(**{**keywords, "cost_weight": 2.0})
    except (TypeError, ValueError):  # it has no such term
        return False
    return True


def _value(settings: TrainingSettings, name: str) -> float:
    if name == _COST:
        scenario: Any = ENVIRONMENTS[settings.env_id].scenario.from_keywords(**settings.env)
        return float(scenario.cost_weight)
    outer, _, inner = name.partition(".")
    value: Any = getattr(settings, outer)
    return value[inner] if inner else value
