"""What of a controller can be tuned, and the controller with other values: `lanekeep tune` goes by it.

A tuned controller is a subclass whose constants are others. It is designed as the shipped one is: weights of the LQ
family go through the same reserve (`lq_reserve`), so that what was tuned keeps its margins, too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lanekeep_env.checks import known, require, shown, shown_path
from lanekeep_env.files import read_bounded
from lanekeep_env.plain import parse_json

if TYPE_CHECKING:
    from lanekeep_baselines.declared import Declared

#: What stands first in a file of tuned values, and bytes beyond which none is read.
FORMAT, LARGEST = "lanekeep-tuned-1", 1 << 20


class Tunable(NamedTuple):
    """A number that a search may change.

    Attributes:
        name: of the class's attribute, or of the field of its record ``of``.
        low, high: between which it is searched, and allowed.
        log: whether it is a scale, searched by its logarithm.
        of: the attribute that holds it as a field, "" for none.
    """

    name: str
    low: float
    high: float
    log: bool = True
    of: str = ""


def shipped(policy: type[Declared]) -> dict[str, float]:
    """Return the values of all that can be tuned, as the controller comes."""
    return {one.name: float(getattr(getattr(policy, one.of) if one.of else policy, one.name)) for one in policy.tunable}


def tuned(policy: type[Declared], values: Mapping[str, Any]) -> type[Declared]:
    """Return the controller with other values of what it declares as tunable.

    Raises:
        ValueError: it has no such number, or not within its range.
    """
    declared = {one.name: one for one in policy.tunable}
    known(f"policy {policy.name!r}", values, list(declared), "tunable number")
    constants: dict[str, Any] = {}
    for name, value in values.items():
        one = declared[name]
        require(name, value, f"(policy {policy.name!r})", at_least=one.low, at_most=one.high)
        if one.of:
            record = constants.get(one.of, getattr(policy, one.of))
            constants[one.of] = replace(record, **{name: float(value)})
        else:
            constants[name] = float(value)
    constants["__reduce__"] = lambda self: (_restored, (policy, dict(values), self.__dict__))
    return type(policy.__name__, (policy,), constants)


def _restored(policy: type[Declared], values: Mapping[str, Any], state: dict[str, Any]) -> Declared:
    """Return a tuned controller from a pickle: its class is in no module."""
    made = object.__new__(tuned(policy, values))
    made.__dict__.update(state)
    return made


class Tuned(NamedTuple):
    """A controller's name and the values that it was tuned to."""

    policy: str
    values: dict[str, float]


def is_tuned(path: str | Path) -> bool:
    """Tell whether a file says of itself that it holds tuned values."""
    try:
        values = parse_json(read_bounded(path, LARGEST))
    except (OSError, ValueError):
        return False
    return isinstance(values, dict) and str(values.get("format", "")).startswith("lanekeep-tuned-")


def read_tuned(path: str | Path) -> Tuned:
    """Read what `lanekeep tune` found for a classical controller; nothing in the file is executed.

    Raises:
        ValueError: it is no such file; one line with the file and the field.
        OSError: it is missing or may not be read.
    """
    try:
        found = parse_json(read_bounded(path, LARGEST))
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            told = found.get("format") if isinstance(found, dict) else None
            raise ValueError(f"format={shown(told)} is not allowed: it must be {FORMAT}")
        if isinstance(trained := found.get("policy_file"), str):
            raise ValueError(f"it is the record of trainings; the policy is {shown_path(trained)} beside it")
        policy, values = found.get("policy"), found.get("values")
        if not isinstance(policy, str) or not isinstance(values, dict) or not values:
            raise ValueError(
                f"policy={shown(policy)}, values={shown(values)} are not allowed: they must be a name and numbers"
            )
        for name, value in values.items():
            require(f"values.{shown(name)}", value, "")
        return Tuned(policy, values)
    except ValueError as error:
        raise ValueError(f"{shown_path(path)}: {' '.join(str(error).split())}") from None


def tuned_text(values: Mapping[str, float], **further: Any) -> str:
    """Return the text of such a file, ``policy`` and what its record says ``further``."""
    return json.dumps({"format": FORMAT, "values": dict(values), **further}, indent=1) + "\n"
