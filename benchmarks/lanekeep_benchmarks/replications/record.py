"""What a replication brings: rows of published against reproduced, further tables, pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

#: What a reader must know about the sources.
NOTE = "checked: not printed in the work, but recomputed from its equations, independently of this code."


@dataclass(frozen=True)
class Row:
    """One published quantity and what came out here; numbers in ``unit``.

    ``source``: where it is stated; "checked" marks a number that was recomputed from the work, not printed in it.
    """

    quantity: str
    source: str
    published: float
    reproduced: float
    unit: str = ""
    digits: int = 3


@dataclass(frozen=True)
class Table:
    """A table of its own; cells are text."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass
class Replication:
    """Filled step by step."""

    title: str
    rows: list[Row] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    pictures: dict[str, bytes] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """JSON-able form, without the pictures."""
        return {
            "title": self.title,
            "rows": [vars(row) for row in self.rows],
            "tables": [vars(table) for table in self.tables],
            "pictures": sorted(self.pictures),
        }

    def markdown(self) -> str:
        """All tables as Markdown."""
        lines = [
            f"# {self.title}",
            "",
            "| quantity | source | published | reproduced | unit |",
            "|---|---|---:|---:|---|",
        ]
        for row in self.rows:
            numbers = f"{row.published:.{row.digits}f} | {row.reproduced:.{row.digits}f}"
            lines.append(f"| {row.quantity} | {row.source} | {numbers} | {row.unit} |")
        lines += ["", NOTE[0].upper() + NOTE[1:]]
        for table in self.tables:
            lines += ["", f"## {table.title}", "", f"| {' | '.join(table.headings)} |"]
            lines.append(f"|---{'|---:' * (len(table.headings) - 1)}|")
            lines += [f"| {' | '.join(cells)} |" for cells in table.rows]
        for name in sorted(self.pictures):
            lines += ["", f"![{name}]({name})"]
        return "\n".join(lines) + "\n"
