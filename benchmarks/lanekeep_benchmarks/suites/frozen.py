"""Frozen suites: the hashes of their scenarios lie beside their file, and what differs from them is not driven.

A lock is ``scenario_hash`` as the `run.json` of a run of its suite has it, and never changes once it is released.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lanekeep_benchmarks.suites.records import Suite
from lanekeep_env.checks import shown
from lanekeep_env.files import read_bounded
from lanekeep_env.plain import parse_json

#: How the name of a lock ends, which is otherwise that of its suite.
LOCK = ".lock"
_LARGEST = 1 << 16
#: Frozen suites, each with the hashes of its scenarios by their names.
LOCKED: dict[str, dict[str, str]] = {
    file.name.removesuffix(LOCK): parse_json(read_bounded(file, _LARGEST))
    for file in sorted(Path(__file__).parent.glob(f"*{LOCK}"))
}


def check_frozen(suite: Suite, scenario_hash: Mapping[str, str]) -> None:
    """Raise ValueError where the scenarios of a frozen suite are not those that were frozen."""
    locked = LOCKED.get(suite.name, scenario_hash)
    for name in {**locked, **scenario_hash}:
        there, here = locked.get(name), scenario_hash.get(name)
        if there != here:
            raise ValueError(
                f"suite {suite.name} is frozen: scenario {name} has the hash {shown(here)}, allowed is {shown(there)}; "
                "what differs is another suite and needs another name"
            )
