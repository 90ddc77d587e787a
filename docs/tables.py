"""Write the tables of results between their markers: python docs/tables.py README.md docs/benchmark.md

A marker names suite, scenario and columns: <!-- measured: classical random-roads failure_rate return -->; what stands
from there to <!-- end --> is replaced by what the suite's policies do now.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import lanekeep_benchmarks
from lanekeep_benchmarks.metrics import METRICS
from lanekeep_benchmarks.suites import SUITES
from lanekeep_env.files import write_atomic

MARKED = re.compile(r"<!-- measured: (\S+) (\S+) ([^>]+?) -->\n(.*?)<!-- end -->", re.DOTALL)
_RATE = "failure_rate"


@cache
def measured(suite: str, scenario: str) -> dict[str, Any]:
    """The summary of a suite's policies on one of its scenarios, on the episodes that `lanekeep bench` drives."""
    (one,) = (one for one in SUITES[suite].scenarios if one.name == scenario)
    with tempfile.TemporaryDirectory() as folder:
        return lanekeep_benchmarks.benchmark(replace(SUITES[suite], scenarios=(one,)), out=Path(folder) / "run")


def value(row: dict[str, Any], key: str) -> str:
    """A cell: the mean and its interval."""
    interval, factor, digits = (row[_RATE], 100, 1) if key == _RATE else (row["metrics"][key], 1, METRICS[key].digits)
    mean, low, high = (f"{factor * interval[end]:.{digits}f}" for end in ("value", "low", "high"))
    return f"{mean} ({low}…{high})"


def table(summary: dict[str, Any], keys: Sequence[str]) -> str:
    """The rows of a summary's first scenario as Markdown."""
    heads = [
        "failure rate [%]" if key == _RATE else f"{METRICS[key].label} [{METRICS[key].unit}]".removesuffix(" []")
        for key in keys
    ]
    lines = [f"| policy | {' | '.join(heads)} |", f"|---{'|---:' * len(keys)}|"]
    for row in summary["scenarios"][0]["policies"]:
        lines.append(f"| {row['policy']} | {' | '.join(value(row, key) for key in keys)} |")
    return "\n".join(lines)


def measured_at() -> str:
    """Which commit's numbers these are, and when they were measured."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    return f"measured at {commit.stdout.strip()} on {datetime.now(UTC):%Y-%m-%d} by `make tables`"


def _written(found: re.Match[str]) -> str:
    suite, scenario, keys = found[1], found[2], found[3].split()
    summary = measured(suite, scenario)
    source = (
        f"`lanekeep bench {suite}`, scenario {scenario}: {summary['episodes']} episodes a policy, seed "
        f"{summary['seed']}; {measured_at()}."
    )
    text = found[0]
    return f"{text[: text.index('-->') + 3]}\n{table(summary, keys)}\n\n{source}\n<!-- end -->"


def main(files: Sequence[str]) -> None:
    """Write the tables of these files."""
    for file in map(Path, files):
        write_atomic(file, MARKED.sub(_written, file.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main(sys.argv[1:])
