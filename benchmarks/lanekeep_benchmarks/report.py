"""From a summary to tables, for the terminal and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.summary import COLUMNS, RATE, Column, columns_of

#: Key of the metric that weighs error, steering and departures as the environment does.
RETURN = "return"
#: How a cell shows that the interval of the paired difference to the reference excludes zero.
MARKS = {"better": " ▲", "worse": " ▼", "tie": ""}


def headings(columns: Sequence[Column], reference: str) -> list[str]:
    """Column headings of a scenario's table."""
    names = [f"{column.label} [{column.unit}]" if column.unit else column.label for column in columns]
    return ["policy", "failure rate [%]", *names, f"{columns[0].label} − {reference}'s [{columns[0].unit}]"]


def cells(row: dict[str, Any], columns: Sequence[Column]) -> list[tuple[str, str]]:
    """One policy's cells as (value, interval) in the order of the headings, without the policy's name."""
    numbers = [(RATE, {key: 100 * bound for key, bound in row["failure_rate"].items()}, 1)]
    numbers += [(column.key, row["metrics"][column.key], column.digits) for column in columns]
    found = []
    for key, number, digits in numbers:
        value, interval = _cell(number, digits)
        found.append((value + MARKS[row["verdict"][key]] if row["verdict"] else value, interval))
    difference = row["difference_to_reference"]
    first = columns[0]
    found.append(_cell(difference[first.key], first.digits, sign="+") if difference else ("reference", ""))
    return found


def _cell(interval: dict[str, float | None], digits: int, sign: str = "") -> tuple[str, str]:
    form = f"{{:{sign}.{digits}f}}"
    if interval["low"] is None:
        return form.format(interval["value"]), ""
    return form.format(interval["value"]), f"{form.format(interval['low'])}…{form.format(interval['high'])}"


def caption(summary: dict[str, Any]) -> str:
    """What a reader must know about the numbers, in one line."""
    episodes = summary["episodes"]
    what = (
        f"{episodes} episode{'s' if episodes > 1 else ''} a policy, the same for all (seed {summary['seed']}),"
        f" lanekeep {summary['version']}"
    )
    interval = f"{100 * summary['confidence']:.0f} % interval"
    if episodes == 1:
        return f"{what}; below the rate Wilson's {interval}; for means, one episode allows none"
    rows = [row for scenario in summary["scenarios"] for row in scenario["policies"]]
    seeds = (
        ", Student's over training seeds and episodes where there are several"
        if any(row["seeds"] > 1 for row in rows)
        else ""
    )
    marks = "" if len(rows) == len(summary["scenarios"]) else f"; ▲ better, ▼ worse than {summary['reference']}"
    return f"{what}; below each mean its {interval}: bootstrap over episodes{seeds}, Wilson for the rate{marks}"


def terminal_table(scenario: dict[str, Any], reference: str) -> Table:
    """Table of one scenario for the terminal, the interval below each value."""
    # Text, because plain strings are markup, which eats the units' brackets.
    table = Table(title=Text(scenario["title"], style="bold"), title_justify="left", row_styles=("", "dim"))
    columns = columns_of(scenario["policies"])
    for index, heading in enumerate(headings(columns, reference)):
        table.add_column(Text(heading), justify="right" if index else "left", no_wrap=not index)
    for row in scenario["policies"]:
        table.add_row(row["policy"], *("\n".join(cell).rstrip() for cell in cells(row, columns)))
    return table


def overview(summary: dict[str, Any]) -> list[str]:
    """Who wins where, as lines of Markdown: the return of every policy on every scenario, and what share failed."""
    scenarios = summary["scenarios"]
    lines = ["", "## Return", "", f"| policy | {' | '.join(scenario['scenario'] for scenario in scenarios)} |"]
    lines.append(f"|---{'|---:' * len(scenarios)}|")
    digits = next(column.digits for column in COLUMNS if column.key == RETURN) + 1
    for rows in zip(*(scenario["policies"] for scenario in scenarios), strict=True):
        texts = []
        for row in rows:
            value, interval = _cell(row["metrics"][RETURN], digits)
            failed = row["failure_rate"]["value"]
            parts = [value + (MARKS[row["verdict"][RETURN]] if row["verdict"] else ""), interval]
            parts += [f"{failed:.1%} failed"] if failed else []
            texts.append("<br>".join(part for part in parts if part))
        lines.append(f"| {rows[0]['policy']} | {' | '.join(texts)} |")
    return lines


def markdown(summary: dict[str, Any]) -> str:
    """All tables of a run as Markdown."""
    lines = [f"# {summary['suite']}: {summary['description']}", "", caption(summary) + "."]
    if len(summary["scenarios"]) > 1:
        lines += overview(summary)
    for scenario in summary["scenarios"]:
        columns = columns_of(scenario["policies"])
        names = headings(columns, summary["reference"])
        lines += ["", f"## {scenario['title']}", "", f"| {' | '.join(names)} |", f"|---{'|---:' * (len(names) - 1)}|"]
        for row in scenario["policies"]:
            texts = [f"{value}<br>{interval}" if interval else value for value, interval in cells(row, columns)]
            lines.append(f"| {row['policy']} | {' | '.join(texts)} |")
    return "\n".join(lines) + "\n"
