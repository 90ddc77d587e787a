"""What infos hold, of one car and of many."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
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


#: Of one car: what a step returns beside the info, as flags.
_FLAGS = {at.O_REWARD: "reward", at.O_TERMINATED: "terminated", at.O_TRUNCATED: "truncated", at.O_SUCCESS: "success"}


@functools.cache
def info_reader(further: Rows) -> Callable[..., dict[str, Any]]:
    """Return a function of the outcome's rows, success and termination that makes an info, with ``further`` truth."""
    return _written(
        further,
        {},
        "told, success, termination",
        ["info['is_success'] = success", "info['termination'] = termination", "return info"],
    )


@functools.cache
def step_reader(further: Rows) -> Callable[..., tuple[Any, float, bool, bool, dict[str, Any]]]:
    """Return a function of an observation and a car's outcome, floats, that makes of them what a step returns."""
    return _written(
        further,
        _FLAGS,
        "observation, told",
        [
            "info['is_success'] = success > 0.0",
            "info['termination'] = int(terminated) if terminated else 0",
            "return observation, reward, terminated > 0.0, truncated > 0.0, info",
        ],
    )


def _written(further: Rows, flags: Mapping[int, str], arguments: str, ending: Sequence[str]) -> Callable[..., Any]:
    """Return a function written out name by name, which fills in a template: a loop takes as long as a car's step."""
    places = {**{row: f"info[{name!r}]" for name, row in (*TRUTH, *further)}, **flags}
    rows = ", ".join(places.get(row, "_") for row in range(max(places) + 1))
    names = *dict(TRUTH), "is_success", "termination", *dict(further)
    written: dict[str, Any] = {"template": dict.fromkeys(names)}
    lines = f"def read({arguments}):", "info = template.copy()", f"{rows} = told", *ending
    exec("\n    ".join(lines), written)
    read: Callable[..., Any] = written["read"]
    return read
