"""Policies by name, classical and learned alike: the one place that the benchmark and `lanekeep play` make them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.policy_file import LARGEST_RECORD
from lanekeep_env.checks import nearest, shown
from lanekeep_env.files import read_bounded

if TYPE_CHECKING:
    from lanekeep_benchmarks.evaluate import Policy

#: How the path of a learned policy's file ends.
FILE = ".json"
#: The folder of the learned policies that are shipped.
ZOO = Path(lanekeep_agents.__path__[0], "zoo")


def known_policies() -> tuple[str, ...]:
    """Return the names of all classical controllers, then of all shipped learned policies."""
    return *lanekeep_baselines.names(), *lanekeep_agents.names()


def check_policy(name: str) -> None:
    """Raise ValueError unless ``name`` is a known one or the path of a file; the nearest known one is named."""
    if name.endswith(FILE):
        try:
            found = Path(name).is_file()
        except OSError:  # what no file can be called
            found = False
        if not found:
            raise ValueError(f"policy {shown(name)}: no such file; allowed: the path of a learned policy's {FILE} file")
    elif name not in (known := known_policies()):
        raise ValueError(
            f"policy {shown(name)} is unknown{nearest(name, known)}; allowed: {', '.join(known)}, or a {FILE} file"
        )


def default_policies(definitions: Iterable[Any], listed: Sequence[str] = (), learned: bool = False) -> list[str]:
    """Return the policies ``listed``, or where there are none all classical ones that can drive all of ``definitions``.

    ``learned`` adds the shipped learned policies whose channels, actions and control step fit them all.
    """
    definitions = tuple(definitions)
    names = list(listed) or _able(lanekeep_baselines.names, definitions)
    names += _able(lanekeep_agents.names, definitions) if learned else []
    return list(dict.fromkeys(names))


def _able(names: Callable[..., tuple[str, ...]], definitions: Iterable[Any]) -> list[str]:
    those = [names(definition) for definition in definitions]
    return [name for name in names() if all(name in able for able in those)]


def make_policy(name: str, scenario: Any) -> Policy:
    """Make a classical controller for ``scenario``, or load a learned policy, by its name or its file's path, for it.

    Raises:
        ValueError, OSError, ImportError: unknown, not for this scenario, broken, or without a package that it needs.
    """
    check_policy(name)
    if name in lanekeep_baselines.names():
        return lanekeep_baselines.make(name, scenario)
    return lanekeep_agents.load(name, scenario)


def policy_digest(name: str) -> str | None:
    """SHA-256 of a learned policy's file, which holds that of its weights; None for a classical controller."""
    if name in lanekeep_baselines.names():
        return None
    file = Path(name) if name.endswith(FILE) else ZOO / (name + FILE)
    return hashlib.sha256(read_bounded(file, LARGEST_RECORD)).hexdigest()
