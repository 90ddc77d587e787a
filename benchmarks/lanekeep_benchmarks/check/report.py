"""Quantities of a file with their units, and what there is to say about it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass
class Report:
    """What a check found.

    Attributes:
        title: what was checked.
        rows: name, value and unit of each quantity.
        notes: what was assumed, or is odd, a line each.
    """

    title: str
    rows: list[tuple[str, Any, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, value: Any, unit: str = "") -> None:
        """Add a quantity."""
        self.rows.append((name, value, unit))

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON-able values; names carry their units."""
        values = {f"{name} [{unit}]" if unit else name: value for name, value, unit in self.rows}
        return {"title": self.title, **values, "notes": self.notes}


def shown_number(value: Any) -> str:
    """A value for a table."""
    return f"{value:.5g}" if isinstance(value, float) else str(value)
