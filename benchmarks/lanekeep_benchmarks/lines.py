"""Result lines: one an episode, as JSON, and checked when they are read."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from lanekeep_benchmarks.metrics import METRICS
from lanekeep_env.checks import choose, from_mapping, require, shown
from lanekeep_env.plain import parse_json

#: A metric that is read may be as large: sums of fourth powers are still finite.
LARGEST_METRIC = 1e50
_KINDS: dict[Any, tuple[type, str]] = {
    "str": (str, "a text"),
    "int": (int, "a whole number"),
    "bool": (bool, "true or false"),
}
#: Scenario, policy, episode.
Place = tuple[str, str, int]


@dataclass(frozen=True)
class EpisodeResult:
    """One line of episodes.jsonl.

    ``metrics``: those of its task, as `metrics.METRICS` has them. ``failed``: the car left the lane, touched a wall or
    did not finish its lap.
    """

    suite: str
    scenario: str
    scenario_hash: str
    policy: str
    episode: int
    seed: int
    episode_seed: int
    failed: bool
    steps: int
    metrics: Mapping[str, float]
    version: str

    def to_json(self) -> str:
        """One line of JSON, without the line end."""
        return json.dumps(asdict(self), allow_nan=False)

    @classmethod
    def from_json(cls, text: str | bytes) -> EpisodeResult:
        """Read a line; ValueError or TypeError, which name the field, where it is not one."""
        values = parse_json(text)
        require_mapping("result line", values)
        line = from_mapping(cls, values, "result line")
        check_kinds(line)
        require("steps", line.steps, "", at_least=1, at_most=1_000_000_000)
        require_mapping("metrics", line.metrics)
        for name, value in line.metrics.items():
            choose("metrics", name, METRICS)
            require(f"metrics.{name}", value, "", at_least=-LARGEST_METRIC, at_most=LARGEST_METRIC)
        return line

    @property
    def place(self) -> Place:
        """What tells the line from the others of its run."""
        return self.scenario, self.policy, self.episode


def check_kinds(record: Any) -> None:
    """Raise ValueError unless the fields of a record that are declared as texts, int or bool are just that."""
    for field in fields(record):
        kind, words = _KINDS.get(field.type, (object, ""))
        value = getattr(record, field.name)
        if kind is not object and type(value) is not kind:
            raise ValueError(f"{field.name}={shown(value)} is not allowed: it must be {words}")


def require_mapping(name: str, value: Any) -> None:
    """Raise ValueError unless ``value`` is a mapping."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be a mapping of names to values")
