"""What a replication brings: rows of printed against recomputed, further tables, pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

#: What a reader must know about the sources.
NOTE = (
    "printed: what the work itself prints. checked: not printed in it, but recomputed from its equations, independently"
    " of this code. here: what comes out of this code."
)
#: Headings of the rows, and which of them hold numbers.
HEADINGS = ("quantity", "source", "printed", "checked", "here", "difference", "unit", "why")
NUMBERS = HEADINGS[2:6]


@dataclass(frozen=True)
class Row:
    """One quantity, what it should be and what came out here; numbers in ``unit``.

    ``source``: where it is stated. "checked" marks a number that was recomputed from the work, not printed in it, as
    does an equation's number at its beginning, from which it follows. ``quantity`` ends in "at most" where the number
    is a bound.
    """

    quantity: str
    source: str
    expected: float
    reproduced: float
    unit: str = ""
    digits: int = 3

    @property
    def printed(self) -> bool:
        """Whether the work itself prints the expected number."""
        return "checked" not in self.source and not self.source.startswith("(")

    @property
    def difference(self) -> float:
        """Of what came out from what was expected."""
        return float(self.reproduced - self.expected)

    @property
    def equal(self) -> bool:
        """Whether it came out within half of the last digit that is given, or below its bound."""
        if "at most" in self.quantity:
            return bool(self.reproduced <= self.expected)
        return bool(abs(self.difference) <= 0.5001 * 10.0**-self.digits)


@dataclass(frozen=True)
class Table:
    """A table of its own; cells are text."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass
class Replication:
    """Filled step by step; ``why`` has a sentence for each quantity that comes out otherwise, by how that begins."""

    title: str
    why: dict[str, str] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    pictures: dict[str, bytes] = field(default_factory=dict)

    def reason(self, row: Row) -> str:
        """Return the sentence for a row that differs, "" for one that does not or has none."""
        if row.equal:
            return ""
        return next((why for begins, why in self.why.items() if row.quantity.startswith(begins)), "")

    def cells(self, row: Row) -> tuple[str, ...]:
        """Return a row as text, in the order of `HEADINGS`."""
        expected, here = (f"{number:.{row.digits}f}" for number in (row.expected, row.reproduced))
        both = (expected, "") if row.printed else ("", expected)
        difference = "" if "at most" in row.quantity else f"{row.difference:+.{row.digits + 1}f}"
        return row.quantity, row.source, *both, here, difference, row.unit, self.reason(row)

    def to_dict(self) -> dict[str, Any]:
        """JSON-able form, without the pictures."""
        rows = []
        for row in self.rows:
            derived = {"difference": row.difference, "equal": row.equal, "why": self.reason(row)}
            rows.append({**vars(row), "printed": row.printed, **derived})
        return {
            "title": self.title,
            "rows": rows,
            "tables": [vars(table) for table in self.tables],
            "pictures": sorted(self.pictures),
        }

    def markdown(self, level: int = 1, folder: str = "") -> str:
        """All tables as Markdown, under a heading of ``level``; ``folder`` is where the pictures are, with a slash."""
        lines = [f"{'#' * level} {self.title}", "", f"| {' | '.join(HEADINGS)} |"]
        lines.append(f"|{'|'.join('---:' if heading in NUMBERS else '---' for heading in HEADINGS)}|")
        lines += [f"| {' | '.join(self.cells(row))} |" for row in self.rows]
        lines += ["", NOTE[0].upper() + NOTE[1:]]
        for table in self.tables:
            lines += ["", f"{'#' * (level + 1)} {table.title}", "", f"| {' | '.join(table.headings)} |"]
            lines.append(f"|---{'|---:' * (len(table.headings) - 1)}|")
            lines += [f"| {' | '.join(cells)} |" for cells in table.rows]
        for name in sorted(self.pictures):
            lines += ["", f"![{name}]({folder}{name})"]
        return "\n".join(lines) + "\n"
