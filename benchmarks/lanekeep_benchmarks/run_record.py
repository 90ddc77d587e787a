"""What a run is: `run.json` beside its result lines, by which ``--resume`` tells its own run from any other."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import lanekeep_agents
import lanekeep_baselines
import lanekeep_env
from lanekeep_benchmarks.evaluate import episode_seed
from lanekeep_benchmarks.lines import EpisodeResult, check_kinds, require_mapping
from lanekeep_env.checks import from_mapping, require, shown
from lanekeep_env.files import read_bounded
from lanekeep_env.plain import parse_json

RUN = "run.json"
#: Bytes beyond which it is not read: hundreds of scenarios and policies fit.
LARGEST_RECORD = 1 << 20
#: Episodes of a run in all, over scenarios and policies: their results are kept in memory.
MOST_EPISODES = 500_000
#: Differences that an error tells.
_TOLD = 6
ANEW = "name another folder, or start anew there with --overwrite instead of --resume"

#: What to do where a field differs. Options that are left out are those of the run in the folder.
_ADVICE = {
    "version": "install that version",
    "code": "restore lanekeep_env, lanekeep_baselines, lanekeep_agents, evaluate.py and metrics.py as the run had them",
    "suite": "leave the suite and --road out, and its file as it was when the run began",
    "policies": "leave --policies out",
    "episodes": "leave --episodes out",
    "seed": "leave --seed out",
    "trace": "leave --trace out",
    "scenario_hash": "restore the scenario, or the file of its suite or road, as it was when the run began",
    "policy_sha256": "restore the policy's file as it was when the run began",
}
_ADVICE["metrics"] = _ADVICE["scenario_hash"]

#: Name, found value, wanted value.
Difference = tuple[str, Any, Any]


@cache
def code_hash() -> str:
    """Hash of the sources that make result lines, 16 hexadecimal digits: an edit leaves the version as it is."""
    digest = hashlib.sha256()
    for own in ("evaluate.py", "metrics.py"):
        digest.update(Path(__file__).with_name(own).read_bytes())
    for package in (lanekeep_env, lanekeep_baselines, lanekeep_agents):
        folder = Path(package.__path__[0])
        for file in sorted(folder.rglob("*.py")):
            digest.update(file.relative_to(folder.parent).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@dataclass(frozen=True)
class RunRecord:
    """Everything that fixes the result lines of a run and their order in the report.

    ``road`` and ``suite_file`` are paths of files, None where the package's own is driven; ``policy_sha256`` tells
    learned policies and own code from others of their name; ``metrics`` has the names of those of each scenario;
    ``smoothing`` is that of the road, m. ``trace`` keeps the steps of all episodes, not only of those that failed.
    ``machines`` are those that the run was begun and resumed on, as `this_machine` tells; they may differ.
    """

    version: str
    code: str
    suite: str
    road: str | None
    policies: Sequence[str]
    episodes: int
    seed: int
    scenario_hash: Mapping[str, str]
    policy_sha256: Mapping[str, str] = field(default_factory=dict)
    metrics: Mapping[str, Sequence[str]] = field(default_factory=dict)
    suite_file: str | None = None
    trace: bool = False
    smoothing: float | None = None
    machines: Sequence[Mapping[str, str]] = ()

    def to_json(self) -> str:
        """The content of `run.json`."""
        return json.dumps(asdict(self), indent=1) + "\n"

    @classmethod
    def read(cls, folder: Path) -> RunRecord | None:
        """Read the record in a folder; None where there is none.

        Raises:
            ValueError: it is not readable, or it was written by another version or other sources.
        """
        file = folder / RUN
        if not os.path.lexists(file):
            return None
        try:
            values = parse_json(read_bounded(file, LARGEST_RECORD))
            require_mapping("the record", values)
            foreign = [
                (name, values[name], wanted)
                for name, wanted in (("version", lanekeep_env.__version__), ("code", code_hash()))
                if values[name] != wanted
            ]
            record = None if foreign else from_mapping(cls, values, "the record")
            if record is not None:
                record._check()
        except KeyError as error:
            raise ValueError(f"{file} is not the record of a run ({error} is missing); {ANEW}") from None
        except (TypeError, ValueError) as error:
            raise ValueError(f"{file} is not the record of a run ({error}); {ANEW}") from None
        if record is None:
            raise AnotherRun(folder, foreign[:1])
        return record

    def _check(self) -> None:
        """Raise ValueError for a field that no run writes so."""
        check_kinds(self)
        require("episodes", self.episodes, "", at_least=1, at_most=MOST_EPISODES, whole=True)
        require("seed", self.seed, "", at_least=0, whole=True)
        for name in ("road", "suite_file"):
            path = getattr(self, name)
            if not (path is None or isinstance(path, str)):
                raise ValueError(f"{name}={shown(path)} is not allowed: it must be a path or null")
        require("smoothing", self.smoothing, "m", at_least=0.0, at_most=100.0, optional=True)
        _texts("policies", self.policies)
        if not isinstance(self.machines, list | tuple):
            raise ValueError(f"machines={shown(self.machines)} is not allowed: it must be a list")
        for machine in self.machines:
            require_mapping("machines", machine)
            for key, value in machine.items():
                _text(f"machines {shown(key)}", value)
        for name, kind in (("scenario_hash", _text), ("policy_sha256", _text), ("metrics", _texts)):
            require_mapping(name, getattr(self, name))
            for key, value in getattr(self, name).items():
                kind(f"{name} of {shown(key)}", value)

    def differences(self, found: RunRecord) -> list[Difference]:
        """Return where the record in a folder is not this one; where road and suite files lie does not matter."""
        names = ("version", "code", "suite", "policies", "episodes", "seed", "trace")
        pairs: list[Difference] = [(name, getattr(found, name), getattr(self, name)) for name in names]
        hashes = ["scenario_hash", "metrics"] if found.suite == self.suite else []
        hashes += ["policy_sha256"] if found.policies == self.policies else []
        for kind in hashes:
            there, here = getattr(found, kind), getattr(self, kind)
            for name in {**there, **here}:
                plain = name if name in here else shown(name)
                pairs.append((f"{kind} of {plain}", there.get(name), here.get(name)))
        return [pair for pair in pairs if pair[1] != pair[2]]

    def line_differences(self, line: EpisodeResult) -> list[Difference]:
        """Return where a result line is not one of this run."""
        if line.policy not in self.policies:
            return [("policy", line.policy, " or ".join(self.policies))]
        if line.episode not in range(self.episodes):
            return [("episode", line.episode, f"0 to {self.episodes - 1}")]
        wanted = {
            "version": self.version,
            "suite": self.suite,
            "scenario_hash": self.scenario_hash.get(line.scenario, f"that of {' or '.join(self.scenario_hash)}"),
            "seed": self.seed,
            "episode_seed": episode_seed(self.suite, line.scenario, line.episode, self.seed),
        }
        pairs = [(name, getattr(line, name), value) for name, value in wanted.items() if getattr(line, name) != value]
        metrics = self.metrics.get(line.scenario, ())
        pairs += [(f"metrics.{name}", "a number", "none") for name in line.metrics if name not in metrics]
        return pairs + [(f"metrics.{name}", "missing", "a number") for name in metrics if name not in line.metrics]


def _text(name: str, value: Any) -> None:
    if not isinstance(value, str):
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be a text")


def _texts(name: str, values: Any) -> None:
    if not (isinstance(values, list) and values and all(isinstance(one, str) and one for one in values)):
        raise ValueError(f"{name}={shown(values)} is not allowed: it must be a list of texts")
    if len(set(values)) < len(values):
        raise ValueError(f"{name}={shown(values)} is not allowed: the texts must differ")


def told(differences: Sequence[Difference]) -> str:
    """Differences as one line."""
    first = "; ".join(
        f"{name} is {shown(found)} there, {shown(wanted)} wanted" for name, found, wanted in differences[:_TOLD]
    )
    return first + (f"; and {len(differences) - _TOLD} more" if len(differences) > _TOLD else "")


class AnotherRun(ValueError):
    """What refuses a folder: each field, found value and wanted value, and what to do."""

    def __init__(self, folder: Path, differences: Sequence[Difference]) -> None:
        self.differences = told(differences)
        self.advice = ", ".join(dict.fromkeys(_ADVICE[name.split()[0]] for name, _, _ in differences))
        super().__init__(
            f"--out {folder} holds another run: {self.differences}; to complete that one, {self.advice}; or {ANEW}"
        )
