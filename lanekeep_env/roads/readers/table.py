"""Tables of numbers in text: delimiter and decimal sign as the whole file has them, names, rows."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass

import numpy as np

from lanekeep_env.checks import shown
from lanekeep_env.roads.readers.drawing import MOST_POINTS
from lanekeep_env.roads.road import Floats

#: Most lines, with comments, and characters of a line.
MOST_LINES = 1_000_000
LONGEST_LINE = 10_000

EXPECTED = "lines 'x, y[, width right, width left]' in m, or named columns"

_LINE_ENDS = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"
_COMMENT = re.compile(r"^\s*(?:#|//|%)+\s*")
#: Delimiter (None: blanks) and decimal sign, the likelier first where lines can be read in several ways.
_MANNERS: tuple[tuple[str | None, str], ...] = (
    (";", "."),
    (";", ","),
    ("\t", "."),
    ("\t", ","),
    (",", "."),
    (",", ","),  # in quotes
    (None, "."),
    (None, ","),
)
_TOLD = {";": "semicolons", "\t": "tabs", ",": "commas", None: "blanks"}
# Lines by which the manner is judged.
_SAMPLE = 200


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of numbers.

    Attributes:
        names: of the columns, or None.
        units: of a second header line ("m", "rad"), or None.
        values: (rows, columns).
        lines: number of each row's line.
        assumed: how the text was read.
    """

    names: tuple[str, ...] | None
    units: tuple[str, ...] | None
    values: Floats
    lines: list[int]
    assumed: tuple[str, ...]


def read_table(content: bytes, name: str) -> Table:
    """Read a table; ``name`` is what errors call the file.

    Raises:
        ValueError: one line that names the line, the fault and what is allowed.
    """
    text = _text(content, name)
    count = sum(map(text.count, _LINE_ENDS))
    if count > MOST_LINES:
        raise ValueError(f"{name} has {count} lines; allowed are {MOST_LINES}")
    lines = text.splitlines()
    delimiter, decimal = _manner(lines)
    headers: list[str] = []
    rows: list[list[float]] = []
    numbers: list[int] = []
    for number, line in enumerate(lines, start=1):
        if len(line) > LONGEST_LINE:
            raise ValueError(f"{name}, line {number}: {len(line)} characters; allowed are {LONGEST_LINE}")
        line = line.strip()
        comment = _COMMENT.match(line)
        if comment is not None or not line:
            if not rows and line:
                headers.append(line[comment.end() :] if comment else line)
            continue
        cells = _cells(line, delimiter)
        try:
            row = [_number(cell, decimal) for cell in cells]
        except ValueError:
            if not rows and len(headers) < 20 and not any(_is_number(cell, decimal) for cell in cells):
                headers.append(line)
                continue
            raise ValueError(f"{name}, line {number}: {_wrong(cells, decimal)}") from None
        if rows and len(row) != len(rows[0]):
            raise ValueError(f"{name}, line {number}: {len(row)} columns; the lines before it have {len(rows[0])}")
        if not np.isfinite(row).all():
            raise ValueError(f"{name}, line {number}: {shown(line)} holds a value that is not finite")
        if len(rows) == MOST_POINTS:
            raise ValueError(f"{name}, line {number}: more than {MOST_POINTS} points; leave out some of them")
        rows.append(row)
        numbers.append(number)
    if not rows:
        begin = f"holds no line of numbers, first {shown(headers[0][:80])}" if headers else "is empty"
        raise ValueError(f"{name} {begin}; expected {EXPECTED}")
    names, units = _names(headers, len(rows[0]), delimiter)
    told = f"columns between {_TOLD[delimiter]}" + (", decimal comma" if decimal == "," else "")
    return Table(names, units, np.array(rows, dtype=np.float64), numbers, (told,))


def _text(content: bytes, name: str) -> str:
    """UTF-8, or UTF-16 that says so."""
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        raise ValueError(f"{name} is not a text file; expected {EXPECTED}, in UTF-8") from None


def _manner(lines: list[str]) -> tuple[str | None, str]:
    """Delimiter and decimal sign that make most of the first lines rows of at least two numbers."""
    sample = [line.strip()[:LONGEST_LINE] for line in lines[: 4 * _SAMPLE]]
    sample = [line for line in sample if line and not _COMMENT.match(line)][:_SAMPLE]

    def rows(manner: tuple[str | None, str]) -> int:
        delimiter, decimal = manner
        found = 0
        for line in sample:
            cells = _cells(line, delimiter)
            found += len(cells) > 1 and all(_is_number(cell, decimal) for cell in cells)
        return found

    return max(_MANNERS, key=rows) if sample else (",", ".")


def _cells(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line; empty ones at its end belong to a trailing delimiter."""
    if delimiter is None:
        cells = line.split()
    elif '"' in line:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        cells = line.split(delimiter)
    cells = [cell.strip().strip('"').strip() for cell in cells]
    while len(cells) > 1 and not cells[-1]:
        cells.pop()
    return cells


def _number(cell: str, decimal: str) -> float:
    """A number in ASCII digits: `float` takes those of all scripts, and 1_000."""
    if not cell.isascii() or "_" in cell:
        raise ValueError
    if decimal == ",":
        if "." in cell:
            raise ValueError
        cell = cell.replace(",", ".")
    return float(cell)


def _is_number(cell: str, decimal: str) -> bool:
    try:
        _number(cell, decimal)
    except ValueError:
        return False
    return True


def _wrong(cells: list[str], decimal: str) -> str:
    bad = next(cell for cell in cells if not _is_number(cell, decimal))
    if re.fullmatch(r"[-+]?\d+,\d+", bad):
        return f"{shown(bad)} is not a number here: decimal commas take semicolons, tabs or blanks between the columns"
    return f"{shown(bad)} is not a number"


def _names(
    headers: list[str], columns: int, delimiter: str | None
) -> tuple[tuple[str, ...] | None, tuple[str, ...] | None]:
    """Names and units of the columns: the last header lines with as many words as there are columns."""
    found: list[tuple[str, ...]] = []
    for line in headers:
        for words in (_split(line, delimiter), _split(line, None), _split(line, ",")):
            if len(words) == columns and all(words):
                found.append(words)
                break
    if not found:
        return None, None
    if len(found) > 1 and all(re.fullmatch(r"[\[(]?[a-z/°²]{1,5}[\])]?", word, re.I) for word in found[-1]):
        return found[-2], tuple(word.strip("[]()") for word in found[-1])
    return found[-1], None


def _split(line: str, delimiter: str | None) -> tuple[str, ...]:
    return tuple(_cells(line, delimiter)) if len(line) <= LONGEST_LINE else ()
