"""What a named set of randomised cars changes in each environment, as a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from lanekeep_env.randomisation import RANDOMISATIONS, Randomisation
from lanekeep_env.registration import ENVIRONMENTS
from lanekeep_env.scenario.lane_keep import TYRES

#: Choices that decide what a scenario's car knows of, beside its vehicle.
_CHOICES: dict[str, tuple[str, ...]] = {"dynamics": ("dynamic", "kinematic"), "tyre": TYRES}


#: The randomised numbers that a named set draws.
DRAWN_BY_SETS = tuple(
    field.name
    for field in fields(Randomisation)
    if any(getattr(drawn, field.name) != field.default for drawn in RANDOMISATIONS.values())
)


def applying(scenario: Any) -> tuple[str, ...]:
    """Return the names of the randomised numbers that a named set draws and that have an effect in a scenario."""
    without = scenario.without_effect
    return tuple(name for name in DRAWN_BY_SETS if f"randomisation.{name}" not in without)


def sets_table() -> str:
    """Return what applies of a named set, a Markdown table with a row for all scenarios with the same entries."""
    rows: dict[tuple[str, ...], list[str]] = {}
    for label, scenario in _scenarios():
        rows.setdefault(applying(scenario), []).append(label)
    lines = [["", *(f"`{name}`" for name in DRAWN_BY_SETS)], ["---"] + ["---"] * len(DRAWN_BY_SETS)]
    lines += [
        [", ".join(labels), *("yes" if name in entries else "-" for name in DRAWN_BY_SETS)]
        for entries, labels in rows.items()
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _scenarios() -> Iterator[tuple[str, Any]]:
    """Every environment as it is and with each choice that it has, by what to call it."""
    for env_id, row in ENVIRONMENTS.items():
        record, name = row.scenario, env_id.rpartition("/")[2]
        usual = record.from_keywords()
        yield name, usual
        for field, choices in _CHOICES.items():
            for choice in choices:
                if getattr(usual, field, choice) != choice:
                    try:
                        yield f'{name} with `{field}="{choice}"`', record.from_keywords(**{field: choice})
                    except ValueError:
                        continue  # no choice of this environment
