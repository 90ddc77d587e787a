"""What a run is: `run.json` beside its result lines, by which ``--resume`` tells its own run from any other."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import lanekeep_agents
import lanekeep_baselines
import lanekeep_env
from lanekeep_benchmarks.evaluate import EpisodeResult, episode_seed

RUN = "run.json"
ANEW = "name another folder, or start anew there with --overwrite instead of --resume"

#: What to do where a field differs. Options that are left out are those of the run in the folder.
_ADVICE = {
    "version": "install that version",
    "code": "restore lanekeep_env, lanekeep_baselines, lanekeep_agents and evaluate.py as they were when the run began",
    "suite": "leave the suite and --road out, and its file as it was when the run began",
    "policies": "leave --policies out",
    "episodes": "leave --episodes out",
    "seed": "leave --seed out",
    "scenario_hash": "restore the scenario, or the file of its suite or road, as it was when the run began",
    "policy_sha256": "restore the policy's file as it was when the run began",
}

#: Name, found value, wanted value.
Difference = tuple[str, Any, Any]


@cache
def code_hash() -> str:
    """Hash of the sources that make result lines, 16 hexadecimal digits: an edit leaves the version as it is."""
    digest = hashlib.sha256(Path(__file__).with_name("evaluate.py").read_bytes())
    for package in (lanekeep_env, lanekeep_baselines, lanekeep_agents):
        folder = Path(package.__path__[0])
        for file in sorted(folder.rglob("*.py")):
            digest.update(file.relative_to(folder.parent).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@dataclass(frozen=True)
class RunRecord:
    """Everything that fixes the result lines of a run and their order in the report.

    ``road`` and ``suite_file`` are paths of files, None where the package's own is driven; ``policy_sha256`` tells
    learned policies from others of their name.
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
    suite_file: str | None = None

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
        if not file.is_file():
            return None
        try:
            values = json.loads(file.read_bytes())
            for name, wanted in (("version", lanekeep_env.__version__), ("code", code_hash())):
                if values[name] != wanted:
                    raise another_run(folder, [(name, values[name], wanted)])
            return cls(**values)
        except (KeyError, TypeError, json.JSONDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"{file} is not the record of a run ({error}); {ANEW}") from None

    def differences(self, found: RunRecord) -> list[Difference]:
        """Return where the record in a folder is not this one; where road and suite files lie does not matter."""
        names = ("version", "code", "suite", "policies", "episodes", "seed")
        pairs: list[Difference] = [(name, getattr(found, name), getattr(self, name)) for name in names]
        hashes = ["scenario_hash"] if found.suite == self.suite else []
        hashes += ["policy_sha256"] if found.policies == self.policies else []
        for kind in hashes:
            there, here = getattr(found, kind), getattr(self, kind)
            pairs += [(f"{kind} of {name}", there.get(name), here.get(name)) for name in {**there, **here}]
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
        return [(name, getattr(line, name), value) for name, value in wanted.items() if getattr(line, name) != value]


def told(differences: Sequence[Difference]) -> str:
    """Differences as one line."""
    return "; ".join(f"{name} is {found!r} there, {wanted!r} wanted" for name, found, wanted in differences)


def another_run(folder: Path, differences: Sequence[Difference]) -> ValueError:
    """The error that refuses a folder: each field, found value and wanted value, and what to do."""
    advice = dict.fromkeys(_ADVICE[name.split()[0]] for name, _, _ in differences)
    return ValueError(
        f"--out {folder} holds another run: {told(differences)}; to complete that one, {', '.join(advice)}; or {ANEW}"
    )
