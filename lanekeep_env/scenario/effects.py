"""Keywords without effect in their scenario: what a field takes to matter is declared once, and refused by it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from lanekeep_env.checks import shown


@dataclass(frozen=True)
class Need:
    """What a field takes to have an effect; of several of one field, each must be met.

    Attributes:
        field: of a scenario, or of a record in it: "friction", "speed.hold".
        what: the field is, in a few words.
        why: it has no effect where this is not met.
        met: whether a scenario meets it.
        neutral: further values that are as good as not given.
    """

    field: str
    what: str
    why: str
    met: Callable[[Any], bool]
    neutral: tuple[Any, ...] = ()


def never(scenario: Any) -> bool:
    """What no scenario of a class meets."""
    return False


def unmet(scenario: Any, needs: tuple[Need, ...]) -> dict[str, Need]:
    """Return the fields without effect in a scenario, whatever their values, each with the first reason."""
    found: dict[str, Need] = {}
    for need in needs:
        if not need.met(scenario):
            found.setdefault(need.field, need)
    return found


def refuse_idle(scenario: Any, without_effect: Mapping[str, Need], given: Mapping[str, Any]) -> None:
    """Raise ValueError, in one line, for the ``given`` keywords that say what has no effect.

    What equals a default is as good as not given: that of the scenario's field or, of a record in it, the record's.
    """
    found: dict[str, tuple[Any, Any]] = {}
    for path, need in without_effect.items():
        top, _, inner = path.partition(".")
        value, usual = getattr(scenario, top), default_of(type(scenario), top)
        defaults = [usual]
        if inner:
            if not hasattr(value, inner):  # a constant speed has no lateral acceleration
                continue
            defaults = [default_of(type(value), inner), getattr(usual, inner, MISSING)]
            defaults = [default for default in defaults if default is not MISSING]
            value = getattr(value, inner)
        if top in given and value not in (*defaults, *need.neutral):
            found[path] = value, defaults[-1]
    if found:
        first, *others = (f"{path}={shown(value)}" for path, (value, _) in found.items())
        path, (_, allowed) = next(iter(found.items()))
        need = without_effect[path]
        further = f"; without effect as well: {', '.join(others)}" if others else ""
        raise ValueError(
            f"{first} ({need.what}) has no effect in this scenario: {need.why}; "
            f"allowed: {shown(allowed)}, or leave it out{further}"
        )


def default_of(record: type, name: str) -> Any:
    """Default of a dataclass's field, `MISSING` for none."""
    field = next(field for field in fields(record) if field.name == name)
    return field.default if field.default_factory is MISSING else field.default_factory()
