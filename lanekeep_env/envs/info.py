"""What infos hold, of one car and of many."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from lanekeep_env import layout as at

#: Names of numbers, and their rows in the outcome.
Rows = tuple[tuple[str, int], ...]

#: Truth in the infos of every family.
TRUTH: Rows = (
    ("lateral_error", at.O_LATERAL_ERROR),
    ("heading_error", at.O_HEADING_ERROR),
    ("lateral_acceleration", at.O_LATERAL_ACCELERATION),
    ("steering_rate", at.O_STEERING_RATE),
    ("speed", at.O_SPEED),
    ("arc_length", at.O_ARC_LENGTH),
    ("cost", at.O_COST),
)


@functools.cache
def info_reader(further: Rows) -> Callable[..., dict[str, Any]]:
    """Return a function of the outcome's rows, success and termination that makes an info, with ``further`` truth.

    Its code is written out, name by name, and fills in a template: a loop takes as long as a car's step.
    """
    places = {row: f"info[{name!r}]" for name, row in (*TRUTH, *further)}
    code = f"""
def read(told, success, termination):
    info = template.copy()
    {", ".join(places.get(row, "_") for row in range(max(places) + 1))} = told
    info["is_success"] = success
    info["termination"] = termination
    return info
"""
    names = *dict(TRUTH), "is_success", "termination", *dict(further)
    written: dict[str, Any] = {"template": dict.fromkeys(names)}
    exec(code, written)
    read: Callable[..., dict[str, Any]] = written["read"]
    return read
