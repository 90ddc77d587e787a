"""Shipped learned policies made again, each by the command in its file, into a folder of its own."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import lanekeep_agents
from lanekeep_agents.policy_file import read_record
from lanekeep_benchmarks.policies import FILE, ZOO
from lanekeep_env.checks import choose, shown
from lanekeep_env.files import read_bounded, write_atomic
from lanekeep_env.plain import parse_json

#: What a folder's `remade.json` may have, bytes.
LARGEST = 1 << 20
DONE = "remade.json"


@dataclass(frozen=True)
class Remade:
    """A policy made again.

    Attributes:
        name: of the policy.
        command: that was run.
        sha256: of the new weights.
        same: whether these are the shipped ones to the last bit.
    """

    name: str
    command: str
    sha256: str
    same: bool


def names_of(text: str) -> list[str]:
    """Return the shipped policies that ``text`` names, "all" or names with commas between; ValueError for others."""
    shipped = lanekeep_agents.names()
    names = list(shipped) if text == "all" else [name.strip() for name in text.split(",")]
    for name in names:
        choose("--remake", name, ("all", *shipped))
    return names


def command_of(name: str, folder: Path) -> list[str]:
    """Return the command that makes a policy anew in ``folder``, or goes on where it was stopped.

    Raises:
        ValueError: an example makes it, which is a file of the repository, and there is none here.
    """
    words = shlex.split(read_record(ZOO / (name + FILE)).training.command)
    if words[0] == "lanekeep":
        begun = (folder / "settings.json").exists()
        return [sys.executable, "-m", "lanekeep_benchmarks", *words[1:], "--out", str(folder)] + ["--resume"] * begun
    script = Path(words[1])
    if not script.is_file():
        raise ValueError(f"policy {name!r} is made by {shown(words[1])}; allowed: run it in a checkout's root folder")
    return [sys.executable, *words[1:-1], str(folder / words[-1])]


def remake(names: Sequence[str], out: Path) -> Iterator[Remade]:
    """Make the policies that are not in ``out`` already, one after another.

    Raises:
        ValueError: a command that failed; what it said went to stderr.
    """
    for name in names:
        folder = out / name
        if (folder / DONE).exists():
            yield Remade(**parse_json(read_bounded(folder / DONE, LARGEST)))
            continue
        command = command_of(name, folder)
        folder.mkdir(parents=True, exist_ok=True)
        ended = subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode
        if ended:
            raise ValueError(f"{shlex.join(command[1:])} ended with {ended}; to go on: the same command again")
        shipped, made = (read_record(of / (name + FILE)).sha256 for of in (ZOO, folder))
        remade = Remade(name, shlex.join(command[1:]), made, made == shipped)
        write_atomic(folder / DONE, json.dumps(asdict(remade), indent=1) + "\n")
        yield remade
