"""Checks of configuration: one-line errors that name the field, the value, the unit and what is allowed."""

from __future__ import annotations

import difflib
import math
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields
from numbers import Real
from typing import Any, TypeVar

T = TypeVar("T")

#: Characters of a value that an error repeats at the most.
LONGEST_ECHO = 80
#: Roads, worlds or timelines of a set at the most: all are made before the first episode, in less than a minute.
LARGEST_SET = 10_000


def shown(value: Any) -> str:
    """Return ``repr(value)`` on one line for an error, cut where it is long, whatever the value is."""
    text = " ".join(_SHORT.repr(value).split())
    return text if len(text) <= LONGEST_ECHO else f"{text[: LONGEST_ECHO - 3]}..."


def shown_path(path: Any) -> str:
    """Return a path as it is for an error, or as `shown` where it is not printable or longer than anybody's."""
    text = str(path)
    return text if text.isprintable() and len(text) < 1000 else shown(text)


class _Short(reprlib.Repr):
    """`repr` that looks at a few entries and levels only."""

    def repr_int(self, value: int, level: int) -> str:
        digits = int(value.bit_length() * math.log10(2.0))
        return repr(value) if digits < LONGEST_ECHO else f"<an integer of {digits} digits>"

    def repr_DataFrame(self, value: Any, level: int) -> str:  # reprlib's way to name a class: pandas', polars'
        return f"<DataFrame of shape {getattr(value, 'shape', None)}>"


_SHORT = _Short()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother, _SHORT.maxlong = 3, LONGEST_ECHO, LONGEST_ECHO, LONGEST_ECHO


def nearest(word: Any, allowed: Iterable[str]) -> str:
    """Return " (did you mean 'x'?)" for the closest allowed word, or an empty string."""
    if not isinstance(word, str):
        return ""
    match = difflib.get_close_matches(word[:LONGEST_ECHO], list(allowed), n=1, cutoff=0.5)
    return f" (did you mean {match[0]!r}?)" if match else ""


def require(
    name: str,
    value: Any,
    unit: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    whole: bool = False,
    optional: bool = False,
) -> None:
    """Raise ValueError unless ``value`` is a finite number inside the bounds (or None where ``optional``)."""
    if value is None and optional:
        return
    try:
        number = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number that no float can hold
        number = False
    good = (
        number
        and (above is None or value > above)
        and (at_least is None or value >= at_least)
        and (at_most is None or value <= at_most)
        and (not whole or value == int(value))
    )
    if not good:
        bounds = [
            text
            for text, bound in ((f"> {above}", above), (f">= {at_least}", at_least), (f"<= {at_most}", at_most))
            if bound is not None
        ]
        kind = "a whole number" if whole else "a finite number"
        limits = f" {' and '.join(bounds)}" if bounds else ""
        none = " or None" if optional else ""
        raise ValueError(
            f"{name}={shown(value)} is not allowed: it must be {kind}{limits}{f' {unit}' if unit else ''}{none}"
        )


def ordered(record: Any, of: str, lower: str, upper: str) -> None:
    """Raise ValueError where the field ``lower`` is above the field ``upper``; either may be the wrong one."""
    low, high = getattr(record, lower), getattr(record, upper)
    if low is not None and low > high:
        raise ValueError(
            f"{of}.{lower}={shown(low)} and {of}.{upper}={shown(high)} are not allowed together: the first must be <= "
            "the second"
        )


def require_line(name: str, value: Any) -> None:
    """Raise ValueError unless ``value`` is one line of text."""
    if not isinstance(value, str) or not value.isprintable() or not 1 <= len(value) <= 1000:
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be one line of text")


def choose(name: str, value: Any, allowed: Iterable[str]) -> None:
    """Raise ValueError unless ``value`` is one of the allowed words."""
    allowed = list(allowed)
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name}={shown(value)} is unknown{nearest(value, allowed)}; allowed: {', '.join(allowed)}")


def known(name: str, given: Iterable[Any], allowed: Sequence[str], kind: str = "field") -> None:
    """Raise ValueError for the first of the ``given`` keys that is not allowed, with the nearest that is."""
    for key in given:
        if key not in allowed:
            raise ValueError(f"{name} has no {kind} {shown(key)}{nearest(key, allowed)}; allowed: {', '.join(allowed)}")


def from_mapping(record: type[T], mapping: Mapping[str, Any], name: str) -> T:
    """Build the frozen dataclass ``record``; an unknown key (with the nearest field) or a missing one is an error."""
    wanted = [f for f in fields(record) if f.init]  # type: ignore[arg-type]
    allowed = [f.name for f in wanted]
    known(name, mapping, allowed)
    for f in wanted:
        if f.name not in mapping and f.default is MISSING and f.default_factory is MISSING:
            raise ValueError(f"{name} lacks the field {f.name!r}; it has {', '.join(allowed)}")
    return record(**mapping)


def record_from(record: type[T], value: Any, name: str, named: Mapping[str, T], of: str | None = None) -> T:
    """Read a frozen dataclass: a record, a name of ``named`` or a mapping of fields; ValueError names what is wrong.

    A mapping with ``base``, one of the names, has changes to that one. ``of`` says what a mapping holds, if not the
    record's fields.
    """
    if isinstance(value, record):
        return value
    if isinstance(value, str):
        choose(name, value, named)
        return named[value]
    if not isinstance(value, Mapping):
        holds = of or f"{record.__name__}'s fields"
        raise ValueError(f"{name}={shown(value)} must be {', '.join(named)} or a mapping of {holds}")
    if "base" not in value:
        return from_mapping(record, value, name)
    changes = {key: one for key, one in value.items() if key != "base"}
    choose(f"{name}.base", value["base"], named)
    usual = named[value["base"]]
    rest = {f.name: getattr(usual, f.name) for f in fields(record) if f.init}  # type: ignore[arg-type]
    return from_mapping(record, {**rest, **changes}, name)


def plain_numbers(record: Any) -> None:
    """Make the numbers of a frozen dataclass plain ints and floats, as its fields are declared.

    Equal records are then equal in JSON as well, whether somebody wrote 3, 3.0 or a NumPy number.
    """
    for f in fields(record):
        value = getattr(record, f.name)
        if isinstance(value, Real) and not isinstance(value, bool):
            with suppress(OverflowError):  # what no float can hold is left to the record's own check
                if str(f.type).startswith("float"):
                    object.__setattr__(record, f.name, float(value))
                elif str(f.type).startswith("int"):
                    object.__setattr__(record, f.name, int(float(value)))
