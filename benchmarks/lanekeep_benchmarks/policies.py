"""Policies by name, classical, learned and a user's own alike: the one place where every command finds them."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.policy_file import LARGEST_RECORD
from lanekeep_baselines.declared import PREFIX
from lanekeep_baselines.slip_limit import SlipLimited
from lanekeep_baselines.tunable import is_tuned
from lanekeep_benchmarks.own_code import FORMS, SOURCE, Checked, is_code, load_factory, sha256_of
from lanekeep_env.checks import nearest, shown, shown_path
from lanekeep_env.files import read_bounded

if TYPE_CHECKING:
    from lanekeep_benchmarks.evaluate import Policy

#: How the path of a learned policy's file ends.
FILE = ".json"
#: How the hash of what was handed over in Python ends: its name may be that of another policy.
_HANDED_OVER = ", handed over"
#: The folder of the learned policies that are shipped.
ZOO = Path(lanekeep_agents.__path__[0], "zoo")


@dataclass(frozen=True)
class Entry:
    """A policy as a run knows it.

    Attributes:
        name: in result lines and tables.
        make: takes a scenario, gives the policy designed for it.
        sha256: of its file, or of the one with its code; None where the hash of the packages' sources tells it.
        given: what it was made from, a text or somebody's object, by which another process has it too (`rebuilt`).
    """

    name: str
    make: Callable[[Any], Policy]
    sha256: str | None = None
    given: Any = None


class Limited(NamedTuple):
    """What an entry with limited slips was made from, where that is an object: it travels wherever ``given`` does."""

    given: Any


def known_policies() -> tuple[str, ...]:
    """Return the names of all classical controllers, then of all shipped learned policies."""
    return *lanekeep_baselines.names(), *lanekeep_agents.names()


def is_known(name: str) -> bool:
    """Tell whether a policy of that name is part of the packages, its slips limited or not."""
    return name.removeprefix(PREFIX) in known_policies()


def check_policy(name: str) -> None:
    """Raise ValueError unless ``name`` is a known one or the path of a file; the nearest known one is named.

    Code is not looked for: this is for names that stand in a file.
    """
    name = _behind_prefix(name)
    if name.endswith(FILE):
        try:
            found = Path(name).is_file()
        except OSError:  # what no file can be called
            found = False
        if not found:
            raise ValueError(f"policy {shown(name)}: no such file; allowed: the path of a learned policy's {FILE} file")
    elif is_code(name):
        raise ValueError(
            f"policy {shown(name)} is code, which only a person may name: on the command line (--policies) or in Python"
        )
    elif name not in known_policies():
        raise ValueError(_unknown(name))


def _behind_prefix(name: str) -> str:
    inner = name.removeprefix(PREFIX)
    if inner.startswith(PREFIX):
        raise ValueError(f"policy {shown(name)} is limited twice; allowed: {PREFIX} once")
    return inner


def _unknown(name: str, fitting: Callable[[], Sequence[str]] = lanekeep_baselines.names) -> str:
    """What to say of a name that no policy has; ``fitting`` gives those that there are, or that fit."""
    all_ = fitting is lanekeep_baselines.names
    learned = ", a learned one (lanekeep zoo lists them)" if all_ else " (lanekeep zoo describes the learned ones)"
    return (
        f"policy {shown(name)} is unknown{nearest(name, known_policies())}; allowed: {', '.join(fitting())}{learned}, "
        f"or a {FILE} file"
    )


def entry_of(given: Any, code: bool = True, fitting: Callable[[], Sequence[str]] = lanekeep_baselines.names) -> Entry:
    """Return the entry of what a person names or hands over.

    Args:
        given: a name, the path of a learned policy's file, ``module:factory``, ``path/to/file.py:factory``, each of
            them behind ``slip-limited+`` too (`lanekeep_baselines.slip_limit`); in Python also a factory (takes a
            scenario, gives a policy) or a policy, an object with ``predict``.
        code: whether a text may name code: never where it comes from a file.
        fitting: gives the names that the error about an unknown one lists.

    Raises:
        ValueError: there is no such policy, or its code fails.
    """
    if isinstance(given, Entry):
        return given
    if not isinstance(given, str):
        return _handed_over(given)
    if given.startswith(PREFIX):
        return limited(entry_of(_behind_prefix(given), code, fitting))
    if code and is_code(given) and not given.endswith(FILE):
        return _own(given, load_factory(given), given)
    if code and given.endswith(SOURCE):
        raise ValueError(
            f"policy {shown(given)} lacks the factory's name; allowed: {shown_path(given)}:NAME, a function or a class"
        )
    if code and given not in known_policies() and not given.endswith(FILE):
        raise ValueError(f"{_unknown(given, fitting)}, or code of your own, {FORMS}")
    check_policy(given)
    registered = lanekeep_baselines.registered(given)
    if registered is not None:
        return _own(given, registered, registered)
    return Entry(given, lambda scenario: make_policy(given, scenario), policy_digest(given), given)


def limited(entry: Entry) -> Entry:
    """Return the entry of the same policy with its slips limited."""
    given = PREFIX + entry.given if isinstance(entry.given, str) else Limited(entry.given)
    name = PREFIX + entry.name
    return Entry(name, lambda scenario: SlipLimited(entry.make(scenario), scenario), entry.sha256, given)


def _handed_over(given: Any) -> Entry:
    """The entry of a factory or of a policy; its name is its own attribute's, or that of its function or class."""
    drives = callable(getattr(given, "predict", None)) and not isinstance(given, type)
    if not (drives or callable(given)):
        raise ValueError(
            f"policy {shown(given)} is not allowed: it must be a name, a file, a factory that takes a scenario, or an "
            "object with predict"
        )
    name = getattr(given, "name", None) or getattr(given, "__name__", None) or type(given).__name__
    factory = (lambda scenario: given) if drives else given
    return replace(_own(str(name), factory, given), sha256=_code_of(given) + _HANDED_OVER)


def rebuilt(name: str, given: Any) -> Entry:
    """Return an entry again, in another process, from its ``name`` and what it was ``given``."""
    if isinstance(given, Limited):
        return limited(rebuilt(name.removeprefix(PREFIX), given.given))
    return entry_of(given) if isinstance(given, str) else replace(_handed_over(given), name=name)


def handed_over(name: str, sha256: str | None) -> bool:
    """Tell whether no command can make a run's policy again: it came from Python, or was registered there."""
    ours = is_known(name) or is_code(name) or name.endswith(FILE)
    return not ours or (sha256 is not None and sha256.endswith(_HANDED_OVER))


def _own(name: str, factory: Callable[[Any], Any], given: Any) -> Entry:
    return Entry(name, lambda scenario: Checked(name, factory, scenario), _code_of(factory), given)


def _code_of(thing: Any) -> str:
    """The hash of its source; what has none is another thing in every run."""
    return sha256_of(thing) or f"no source, {uuid.uuid4().hex}"


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
    """Make a classical controller for ``scenario``, or load a learned or tuned policy, by name or its file's path.

    Raises:
        ValueError, OSError, ImportError: unknown, not for this scenario, broken, or without a package that it needs.
    """
    check_policy(name)
    if name in lanekeep_baselines.names():
        return lanekeep_baselines.make(name, scenario)
    if name.endswith(FILE) and is_tuned(name):
        return lanekeep_baselines.load(name, scenario)
    return lanekeep_agents.load(name, scenario)


def policy_digest(name: str) -> str | None:
    """SHA-256 of a learned policy's file, which holds that of its weights; None for a classical controller."""
    if name in lanekeep_baselines.names():
        return None
    file = Path(name) if name.endswith(FILE) else ZOO / (name + FILE)
    return hashlib.sha256(read_bounded(file, LARGEST_RECORD)).hexdigest()
