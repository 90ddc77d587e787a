"""Ratios of one measurement after another in a file, a line of JSON each, and a picture of them over versions."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from lanekeep_benchmarks.looks import GRID, png
from lanekeep_benchmarks.machine import this_machine
from lanekeep_benchmarks.run_record import code_hash
from lanekeep_benchmarks.speed.rounds import Measured
from lanekeep_env import __version__
from lanekeep_env.checks import shown_path
from lanekeep_env.files import read_bounded, write_atomic
from lanekeep_env.plain import parse_json

_LARGEST = 1 << 26
#: Of the picture: lines that one panel can tell apart.
_STYLES = ("-", "--", ":")


def read(file: Path) -> list[dict[str, Any]]:
    """Return the measurements of a file, oldest first; none where there is no file.

    Raises:
        ValueError: it holds something else.
    """
    content = read_bounded(file, _LARGEST) if file.exists() else b""
    return [_entry(file, number, line) for number, line in enumerate(content.splitlines(), 1) if line.strip()]


def add(file: Path, measured: Mapping[str, Measured], quick: bool) -> Path:
    """Add a measurement to those that the file has by now, and draw all beside, as a .png, whose path is returned.

    Rates stay out: they are the machine's.
    """
    ratios = {
        f"{title}: {name} ÷ {rival}": list(ratio)
        for title, group in measured.items()
        for name, rivals in group.ratios.items()
        for rival, ratio in rivals.items()
    }
    when = f"{datetime.now(UTC):%Y-%m-%d %H:%M}"
    entry = {"date": when, "version": __version__, "code": code_hash(), "quick": quick, "machine": this_machine()}
    entries = [*read(file), {**entry, "ratios": ratios}]
    write_atomic(file, "".join(json.dumps(entry, ensure_ascii=False) + "\n" for entry in entries))
    picture = file.with_suffix(".png")
    write_atomic(picture, plot(entries))
    return picture


def plot(entries: Sequence[Mapping[str, Any]]) -> bytes:
    """Every ratio over the measurements, with its spread; a panel for each group and rival."""
    panels: dict[str, list[str]] = {}
    for name in dict.fromkeys(name for entry in entries for name in entry["ratios"]):
        title, _, rest = name.partition(": ")
        panels.setdefault(f"{title}, ÷ {rest.partition(' ÷ ')[2]}", []).append(name)
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(8.5 * columns, 0.4 + 4.0 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (title, names) in zip(grid.flat, panels.items(), strict=False):
        for place, name in enumerate(names):
            given = [entry["ratios"].get(name, [math.nan] * 3) for entry in entries]
            middle, low, high = zip(*given, strict=True)
            colour, style = f"C{place % 10}", _STYLES[place // 10 % len(_STYLES)]
            label = name.partition(": ")[2].partition(" ÷ ")[0]
            last = next(one for one in reversed(middle) if math.isfinite(one))
            axes.plot(middle, style, marker=".", color=colour, label=f"{label}: {last:.3g}")
            axes.vlines(range(len(entries)), low, high, color=colour, alpha=0.4)
        axes.set_yscale("log")
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xticks(
            range(len(entries)), [f"{entry['date'][:10]}\n{entry['code'][:7]}" for entry in entries], fontsize=7
        )
        axes.grid(**GRID)
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axes in list(grid.flat)[len(panels) :]:
        axes.remove()
    return png(figure)


def _entry(file: Path, number: int, line: bytes) -> dict[str, Any]:
    """A line, checked."""
    try:
        entry = parse_json(line)
    except ValueError:
        entry = None
    texts = isinstance(entry, dict) and all(isinstance(entry.get(key), str) for key in ("date", "version", "code"))
    ratios = entry.get("ratios") if texts else None
    if not isinstance(ratios, dict) or not ratios or not all(map(_is_ratio, ratios.values())):
        raise ValueError(f"{shown_path(file)} line {number} is no measurement of `lanekeep speed --history`")
    return dict(entry)


def _is_ratio(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(type(one) in (int, float) and one > 0 for one in value)
