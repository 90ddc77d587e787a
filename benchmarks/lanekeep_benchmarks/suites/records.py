"""What a suite is: scenarios with everything that fixes their episodes, in frozen records."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from lanekeep_env.scenario.base import ScenarioRecord

Scenario = TypeVar("Scenario", bound=ScenarioRecord)


@dataclass(frozen=True)
class SuiteScenario:
    """One environment with everything that fixes its episodes.

    Attributes:
        name: short, for files and tables.
        title: one line, for headings.
        keywords: of `gym.make_vec`, JSON-able.
        env_id: a registered environment.
        options: of `reset`, the same for every episode.
        max_episode_steps: length of an episode; None keeps the registered one.
        told: what policies are told instead of the truth: fields of the scenario that they are made for where it is
            not the one they drive. What ``randomisation`` changes needs no word here, they do not know of it anyway.
        metrics: keys of what is measured (`metrics.METRICS`), the first of which differences are told; empty for those
            of the environment's task.
    """

    name: str
    title: str
    keywords: Mapping[str, Any] = field(default_factory=dict)
    env_id: str = "lanekeep/LaneKeep-v0"
    options: Mapping[str, Any] = field(default_factory=dict)
    max_episode_steps: int | None = None
    told: Mapping[str, Any] = field(default_factory=dict)
    metrics: tuple[str, ...] = ()

    def policies_scenario(self, definition: Scenario) -> Scenario:
        """Return the scenario that policies are made for, where ``definition`` is driven."""
        return replace(definition, **self.told) if self.told else definition

    def hash(self, definition_hash: str) -> str:
        """16 hexadecimal digits that change with anything that changes the episodes, or what policies are told."""
        parts: list[Any] = [self.env_id, definition_hash, dict(self.options), self.max_episode_steps]
        parts += [dict(self.told)] if self.told else []
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Suite:
    """Scenarios that are evaluated and reported together.

    ``episodes`` is the default number for each scenario; ``policies`` drive it by default, where there are none all
    classical ones that can; ``learned`` adds the shipped learned ones whose channels fit; ``reference`` is the one of
    them that the others are compared with, empty for the first. Where ``per_environment``, each environment's scenarios
    are driven by those of the policies that can drive all of them, the first of which is the reference there.
    """

    name: str
    description: str
    scenarios: tuple[SuiteScenario, ...]
    episodes: int
    policies: tuple[str, ...] = ()
    learned: bool = False
    reference: str = ""
    per_environment: bool = False

    @property
    def parts(self) -> dict[str, tuple[SuiteScenario, ...]]:
        """Scenarios that the same policies drive, by their environment's name; all of them, without one, as a rule."""
        if not self.per_environment:
            return {"": self.scenarios}
        found: dict[str, tuple[SuiteScenario, ...]] = {}
        for one in self.scenarios:
            name = one.env_id.rpartition("/")[2]
            found[name] = (*found.get(name, ()), one)
        return found
