"""What was spent on the policies of a run that were trained or tuned, as a table beside their scores."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from lanekeep_agents.policy_file import LARGEST_RECORD, read_record
from lanekeep_baselines.declared import PREFIX
from lanekeep_baselines.tunable import is_tuned
from lanekeep_benchmarks.policies import FILE, ZOO
from lanekeep_benchmarks.summary import rows_of
from lanekeep_env.checks import require
from lanekeep_env.files import read_bounded
from lanekeep_env.plain import parse_json

#: Heading of the table.
BUDGETS = "## Budgets"
#: The record of a search, beside the folders of its trainings.
_SEARCH = "best.json"


class Budget(NamedTuple):
    """Trials of `lanekeep tune`, 0 for a training alone, and environment steps in all."""

    trials: int
    steps: int


def budget_of(policy: str) -> Budget | None:
    """Return what was spent on a policy as its file tells; None where it has none, or tells nothing."""
    name = policy.removeprefix(PREFIX)
    file = Path(name) if name.endswith(FILE) else ZOO / (name + FILE)
    try:
        if is_tuned(file):
            return _searched(file, None)
        steps = read_record(file).training.steps
    except (OSError, ValueError):
        return None
    try:
        return _searched(file.parent.parent / _SEARCH, f"{file.parent.name}/{file.name}")
    except (OSError, ValueError):  # trained by itself
        return Budget(0, steps)


def _searched(file: Path, trained: str | None) -> Budget:
    """The budget of a search; ValueError where it is none, or not the one that has ``trained`` a policy."""
    found: Any = parse_json(read_bounded(file, LARGEST_RECORD))
    if not isinstance(found, dict) or found.get("policy_file") != trained or not isinstance(found.get("budget"), dict):
        raise ValueError("it has no budget")
    numbers = [found["budget"].get(name) for name in ("trials", "environment_steps")]
    for one in numbers:
        require("budget", one, "", at_least=0, at_most=10**18, whole=True)
    return Budget(*map(int, numbers))


def budgets(policies: Sequence[str]) -> str:
    """Return the table in Markdown, "" where nothing was trained or tuned; training seeds share a row, in all."""
    lines = []
    for label, row in rows_of(policies).items():
        spent = [one for one in map(budget_of, row) if one is not None]
        if spent:
            trials, steps = map(sum, zip(*spent, strict=True))
            lines.append(f"| {label} | {steps:,} | {trials or ''} |")
    if not lines:
        return ""
    head = ["", BUDGETS, "", "| trained or tuned | environment steps | trials of a search |", "|---|---:|---:|"]
    return "\n".join([*head, *lines]) + "\n"
