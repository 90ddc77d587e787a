"""The table of the README that says how often intervals hold the truth is what the study finds."""

import re
from pathlib import Path

import pytest

from lanekeep_benchmarks.coverage import table

README = Path(__file__).parents[2] / "benchmarks" / "README.md"


def rows(text):
    found = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) > 3 and re.fullmatch(r"\*?\d+\.\d\*?", cells[2]):
            found[tuple(cells[:2])] = [float(cell.strip("*")) for cell in cells[2:]]
    return found


def test_the_readme_has_every_row():
    assert set(rows(table(5))) <= set(rows(README.read_text(encoding="utf-8")))


@pytest.mark.slow
def test_the_readme_has_the_studys_numbers():
    """Drawn again with a fifth of the repeats, and other ones: within four standard errors of both."""
    printed, found = rows(README.read_text(encoding="utf-8")), rows(table(2000))
    for key, numbers in found.items():
        for there, here in zip(printed[key], numbers, strict=True):
            share = min(max(there, 1.0), 99.0) / 100.0
            assert here == pytest.approx(there, abs=400.0 * (share * (1.0 - share) * (1 / 2000 + 1 / 10_000)) ** 0.5)
