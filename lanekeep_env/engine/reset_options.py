"""What ``reset(options=...)`` says: how an episode starts, and between which bounds episodes draw their car."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import shown
from lanekeep_env.randomisation import Randomisation, randomisation_from

#: Numbers that differ from episode to episode, each an option by its own name beside ``randomisation``.
DRAWN = tuple(f.name for f in fields(Randomisation))

#: How an episode starts, and what that is, in the order of the kernel's start rows: on roads ...
ROAD_STARTS = {
    "lateral_error": "m, as `info` has it",
    "heading_error": "rad, as `info` has it",
    "arc_length": "m along the road",
    "road_index": "of a set of roads, or `road`",
}
#: ... and between walls.
WALL_STARTS = {
    "lateral_error": "m, as `info` has it",
    "heading_error": "rad, as `info` has it",
    "start_index": "of the world's starts, or `start`",
    "world_index": "of a set of worlds, or `world`",
}

#: How far from the lane's centre, or the middle, an episode may start.
_FARTHEST = {"lateral_error": (20.0, "20 m"), "heading_error": (np.pi, "pi rad")}


def page_section(starts: Mapping[str, str]) -> str:
    """Return what an environment's page says of the options of ``reset``."""
    fixed = "".join(f"* {name}: {what}\n" for name, what in starts.items())
    drawn = "".join(
        f"* {f.name}: {f.metadata['what']}{', ' + unit if (unit := f.metadata['unit'])[0] != '(' else ''}\n"
        for f in fields(Randomisation)
    )
    return (
        "## Reset Options\n\n"
        "`reset(options={...})` fixes how this episode starts, by numbers (in the vector form one or one a car):\n\n"
        f"{fixed}\n"
        "and bounds, by a number or (low, high), what this and later episodes draw, within the `randomisation` that\n"
        "the environment was made with (a car's numbers are factors of the nominal ones, not kg or N/rad):\n\n"
        f"{drawn}"
        "* randomisation: a mapping of these, a named set, or None for all that was declared\n\n"
        "`env.unwrapped.narrow({...})` does the latter without a reset. What has no effect is refused.\n\n"
    )


def split(options: Any, starts: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the options that fix an episode's start, by the names of ``starts``, and those that bound the draws.

    An index goes by its short name as well: ``road`` is ``road_index``.

    Raises:
        ValueError: they are no mapping, or one is unknown.
    """
    allowed = (*starts, "randomisation", *DRAWN)
    if not isinstance(options, dict):
        raise ValueError(f"reset options={shown(options)} must be a mapping; allowed: {', '.join(allowed)}")
    fixed: dict[str, Any] = {}
    drawn: dict[str, Any] = {}
    for key, value in options.items():
        name = f"{key}_index" if f"{key}_index" in starts else key
        if name not in allowed:
            raise ValueError(f"reset option {shown(key)} is unknown; allowed: {', '.join(allowed)}")
        if name in fixed:
            raise ValueError(
                f"reset options {shown(name)} and {shown(name.removesuffix('_index'))} are one: give either"
            )
        (fixed if name in starts else drawn)[name] = value
    return fixed, drawn


def start_rows(fixed: Mapping[str, Any], starts: tuple[str, ...], cars: int) -> np.ndarray:
    """Return the kernel's start rows, (`layout.START_ROWS`, cars), NaN where an episode draws.

    Raises:
        ValueError: a value is no number, nor one a car, or a place far off the road.
    """
    start = np.full((at.START_ROWS, cars), np.nan)
    for key, value in fixed.items():
        row = starts.index(key)
        try:
            numbers = np.asarray(value)
            if numbers.dtype.kind not in "iuf":  # no text that reads like a number, and no truth
                raise TypeError
            start[row] = numbers
        except (TypeError, ValueError):
            raise ValueError(
                f"reset option {key}={shown(value)} must be a number or one number a car ({cars})"
            ) from None
        if not np.isfinite(start[row]).all():
            raise ValueError(f"reset option {key}={shown(value)} must be finite; leave it out to have it drawn")
        largest, told = _FARTHEST.get(key, (np.inf, ""))
        if np.abs(start[row]).max() > largest:
            raise ValueError(
                f"reset option {key}={shown(value)} is not allowed: it must be within {told} to either side"
            )
    return start


def bounds(drawn: Mapping[str, Any], scenario: Any, present: np.ndarray) -> list[float]:
    """Return low and high of each randomised number for this episode and those after it.

    Args:
        drawn: ``randomisation``, a mapping of bounds or numbers, a named set, or None for the scenario's own, which
            leave what they do not name as the scenario says; and entries of it by their own names, which leave the
            others as they are.
        scenario: whose bounds hold everything: it was judged with them.
        present: low and high of each number as they are, in the precision of the simulation.

    Raises:
        ValueError: a bound is outside the scenario's, or has no effect in it.
    """
    declared: Randomisation = scenario.randomisation
    whole = drawn.get("randomisation")
    given = {name: drawn[name] for name in DRAWN if name in drawn}
    kept = asdict(declared)
    if "randomisation" not in drawn:
        low, high = np.reshape(declared.bounds(), (-1, 2)).T
        now = np.reshape(present.astype(np.float64), (-1, 2)).clip(low[:, None], high[:, None])  # of float32
        kept = {name: tuple(now[k].tolist()) for k, name in enumerate(DRAWN)}
    elif whole is None or (isinstance(whole, Mapping) and "base" not in whole):
        given = {**(whole or {}), **given}
    else:
        kept = asdict(randomisation_from(whole))
    wanted = randomisation_from({**kept, **given})
    idle = scenario.without_effect
    for f in fields(Randomisation):
        name, unit = f.name, f.metadata["unit"]
        (low, high), (least, most) = getattr(wanted, name), getattr(declared, name)
        need = idle.get(f"randomisation.{name}")
        if need is not None:
            if name in given and (low, high) != (least, most):
                raise ValueError(f"reset option {name}={shown(given[name])} has no effect in this scenario: {need.why}")
        elif not least <= low <= high <= most:
            raise ValueError(
                f"reset option {name}={shown(given.get(name, (low, high)))} is not allowed: it must be within "
                f"{least:g} to {most:g} {unit}; a wider range is declared when the environment is made, "
                f"randomisation={{'{name}': (low, high)}}"
            )
    return wanted.bounds()
