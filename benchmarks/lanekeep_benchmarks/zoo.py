"""`lanekeep zoo`: the learned policies that are shipped, beside the best classical controller on the same episodes."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import typer
from rich.table import Table

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.policy_file import read_record
from lanekeep_agents.policy_record import PolicyRecord
from lanekeep_agents.training.evaluation import HeldOut, Score
from lanekeep_benchmarks import remade
from lanekeep_benchmarks.console import console
from lanekeep_benchmarks.endings import disk_errors, input_errors, interruptible
from lanekeep_benchmarks.policies import FILE, ZOO
from lanekeep_benchmarks.summary import rows_of
from lanekeep_env.adapters import ADAPTED, full_ids, scenario_class
from lanekeep_env.checks import require

#: Episodes of a task of another simulator, at the most.
FEW = 4

HEADINGS = (
    "learned policy",
    "environment",
    "return",
    "failed",
    "RMS lateral error",
    "best classical",
    "return",
    "failed",
    "RMS lateral error",
)


@dataclass(frozen=True)
class Entry:
    """Training seeds of one policy, and what drives its scenario best without having learned anything.

    ``scores`` has one of each seed.
    """

    label: str
    records: tuple[PolicyRecord, ...]
    scores: tuple[Score, ...]
    classical: str
    classical_score: Score

    def cells(self) -> tuple[str, ...]:
        """As the table shows it: means over seeds, and the range of the returns."""
        record = self.records[0]
        keywords = _keywords(record)
        told = ("randomisation", "sensors", "tyre", "env", "observation")
        differs = [keywords[name] for name in told if keywords.get(name)]
        where = ", ".join([record.env_id.rpartition("/")[2], *differs])
        returns = [score.mean_return for score in self.scores]
        spread = f" ({min(returns):.2f} to {max(returns):.2f})" if len(returns) > 1 else ""
        mean = Score(
            *(float(np.mean([getattr(score, name) for score in self.scores])) for name in Score.__annotations__)
        )
        return (self.label, where, f"{mean.mean_return:.2f}{spread}", *_rest(mean), self.classical, *_all(self))

    def to_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "policies": [
                {"policy": record.name, "command": record.training.command, **vars(score)}
                for record, score in zip(self.records, self.scores, strict=True)
            ],
            "env_id": self.records[0].env_id,
            "keywords": _keywords(self.records[0]),
            "classical": {"policy": self.classical, **vars(self.classical_score)},
        }


def _all(entry: Entry) -> tuple[str, ...]:
    return (f"{entry.classical_score.mean_return:.2f}", *_rest(entry.classical_score))


def _rest(score: Score) -> tuple[str, str]:
    return f"{score.failure_rate:.1%}", f"{score.rms_lateral_error:.3f} m"


def _keywords(record: PolicyRecord) -> dict[str, Any]:
    """Of ``gym.make``, for the scenario trained on."""
    return dict(record.training.hyperparameters.get("env", record.scenario))


def _makes(record: PolicyRecord) -> bool:
    """Tell whether the simulator of a policy's task is installed."""
    try:
        return record.env_id not in ADAPTED or bool(scenario_class(record.env_id))
    except ModuleNotFoundError:
        return False


def held_out_of(record: PolicyRecord, episodes: int, seed: int) -> HeldOut:
    """Return episodes of what a policy was trained on; those of another simulator take long: `FEW` at the most."""
    if record.env_id in ADAPTED:
        return HeldOut(_full_id(record), _keywords(record), min(episodes, FEW), seed)
    return HeldOut(record.env_id, {"dtype": "float32", **_keywords(record)}, episodes, seed)


def _full_id(record: PolicyRecord) -> str:
    return next((one for one in full_ids() if one.endswith(f":{record.env_id}")), record.env_id)


def entries(episodes: int) -> Iterator[Entry]:
    """Drive every shipped policy, and the classical controllers of its scenario, through the same episodes.

    They are of the scenario that the policy was trained on, with starts that no training saw.
    """
    groups = rows_of([name for name in lanekeep_agents.names() if _makes(read_record(ZOO / (name + FILE)))])
    classical: dict[str, tuple[str, Score]] = {}
    for label, names in groups.items():
        records = tuple(read_record(ZOO / (name + FILE)) for name in names)
        first = records[0]
        digest = hashlib.sha256(f"zoo {first.env_id}".encode()).digest()
        held_out = held_out_of(first, episodes, int.from_bytes(digest[:8], "big") >> 33)
        scenario = gym.make(_full_id(first), **_keywords(first)).unwrapped.scenario  # type: ignore[attr-defined]
        if first.scenario_hash not in classical:
            found = {
                name: held_out.score(lanekeep_baselines.make(name, scenario))
                for name in lanekeep_baselines.names(scenario)
            }
            best = max(found, key=lambda name: found[name].mean_return)
            classical[first.scenario_hash] = best, found[best]
        scores = tuple(held_out.score(lanekeep_agents.load(name, scenario)) for name in names)
        yield Entry(label, records, scores, *classical[first.scenario_hash])


def _remake(text: str, out: Path) -> None:
    """Make policies anew and say whose weights are the shipped ones."""
    how = f"; to go on: lanekeep zoo --remake {shlex.quote(text)} --out {shlex.quote(str(out))}"
    with interruptible(how), input_errors(), disk_errors(how):
        for one in remade.remake(remade.names_of(text), out):
            weights = "the shipped weights to the last bit" if one.same else "other weights"
            print(f"{one.name}: {weights}, {out / one.name}")


def zoo(
    episodes: Annotated[int, typer.Option(min=1, help="That each policy drives.")] = 128,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print a Markdown table.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, with the command that trains each.")] = False,
    remake: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Make these anew instead, or all, each by its command.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for --remake.")] = Path("results/zoo"),
) -> None:
    """Drive the learned policies that are shipped beside the best classical controller, on the same episodes.

    Example: lanekeep zoo --episodes 64

    Each policy drives the environment that it was trained on, another simulator's where that is installed, in 4
    episodes at the most. lanekeep bench learned compares on cars that differ.

    Made anew: lanekeep zoo --remake distilled-lane-keep-seed0,ppo-circuit-seed0, or --remake all, in a folder each. It
    says whose weights are the shipped ones to the last bit; the same command again goes on where it was stopped.
    """
    if remake is not None:
        _remake(remake, out)
        return
    with interruptible(""), input_errors():
        require("--episodes", episodes, "", at_least=1, at_most=100_000, whole=True)
        with console(stderr=True).status("driving") as status:
            found = []
            for entry in entries(episodes):
                status.update(f"driving: {entry.label} done")
                found.append(entry)
    if as_json:
        print(json.dumps([entry.to_dict() for entry in found]))
    elif markdown:
        print(f"| {' | '.join(HEADINGS)} |\n|---|---|{'---:|' * 3}---|{'---:|' * 3}")
        for entry in found:
            print(f"| {' | '.join(entry.cells())} |")
    else:
        table = Table(title=f"{episodes} episodes each", title_justify="left")
        for place, heading in enumerate(HEADINGS):
            table.add_column(heading, justify="left" if place in (0, 1, 5) else "right")
        for entry in found:
            table.add_row(*entry.cells())
        console().print(table)
