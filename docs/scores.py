"""Write what the shipped policies score on each environment: python docs/scores.py docs/scores.json

Each environment's first scenario of the frozen suite, on the episodes that `lanekeep bench` drives; `reference` shows
the scores on the environments' pages.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tables import measured_at

import lanekeep_agents
import lanekeep_baselines
from lanekeep_benchmarks.evaluate import evaluate
from lanekeep_benchmarks.made import make_definitions
from lanekeep_benchmarks.policies import entry_of
from lanekeep_benchmarks.suites import SUITES, Suite
from lanekeep_benchmarks.summary import RATE, RETURN, summarise
from lanekeep_env.files import write_atomic

FROZEN = SUITES["lanekeep-2026.1"]
SEED = 0


def nominal() -> Iterator[Suite]:
    """The frozen suite with one scenario, for each environment."""
    for scenarios in FROZEN.parts.values():
        yield replace(FROZEN, scenarios=scenarios[:1], per_environment=False)


def able(suite: Suite) -> list[str]:
    """The frozen suite's policies that can drive that scenario."""
    (made,) = make_definitions(suite, suite.name).values()
    fitting = {*lanekeep_baselines.names(made.definition), *lanekeep_agents.names(made.definition)}
    return [name for name in suite.policies if name in fitting]


def scores(suite: Suite, policies: Sequence[str]) -> dict[str, dict[str, list[float]]]:
    """Value and 95 % interval of failure rate, first metric and return by policy, the largest return first."""
    driven = evaluate(suite, policies, lambda name, told: entry_of(name).make(told), episodes=suite.episodes, seed=SEED)
    summary = summarise(suite, [line for lines in driven for line in lines], policies)
    found = {}
    for row in summary["scenarios"][0]["policies"]:
        first = next(iter(row["metrics"]))
        shown = {RATE: row[RATE], first: row["metrics"][first], RETURN: row["metrics"][RETURN]}
        found[row["policy"]] = {key: [one[end] for end in ("value", "low", "high")] for key, one in shown.items()}
    return dict(sorted(found.items(), key=lambda item: -item[1][RETURN][0]))


def measured() -> dict[str, Any]:
    """What the file holds."""
    found = {}
    for suite in nominal():
        (scenario,) = suite.scenarios
        rows = scores(suite, able(suite))
        found[scenario.env_id] = {"scenario": scenario.name, "title": scenario.title, "policies": rows}
    source = {"suite": FROZEN.name, "episodes": FROZEN.episodes, "seed": SEED}
    return {**source, "measured": measured_at(), "environments": found}


if __name__ == "__main__":
    write_atomic(Path(sys.argv[1]), json.dumps(measured(), indent=1) + "\n")
