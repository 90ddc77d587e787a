"""From a summary to tables, for the terminal and as Markdown."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.budgets import budgets
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.metrics import METRICS, Metric
from lanekeep_benchmarks.statistics import BOOTSTRAP_FROM, MARKS_FROM
from lanekeep_benchmarks.summary import RATE, RETURN, columns_of, parts_of

#: How a cell shows that the interval of the paired difference to the reference excludes zero.
MARKS = {"better": " ▲", "worse": " ▼", "tie": ""}
#: Of scenarios whose optimum nobody can compute here.
NONE_KNOWN = "no bound known"
#: So many failed episodes of a policy are listed.
MOST_FAILURES = 20


def headings(columns: Sequence[Metric], reference: str, bounded: bool = False) -> list[str]:
    """Column headings of a scenario's table; ``bounded`` where its policies have a share of the bound."""
    names = [f"{column.label} [{column.unit}]" if column.unit else column.label for column in columns]
    first, unit = columns[0].label, f" [{columns[0].unit}]" if columns[0].unit else ""
    middle = [f"interquartile mean of {first}{unit}", f"median of {first}{unit}", "episodes won [%]"]
    middle += ["share of the bound [%]"] if bounded else []
    return ["policy", "failure rate [%]", *names, f"{first} − {reference}'s{unit}", *middle]


def cells(row: dict[str, Any], columns: Sequence[Metric]) -> list[tuple[str, str]]:
    """One policy's cells as (value, interval) in the order of the headings, without the policy's name."""
    numbers = [(RATE, _percent(row["failure_rate"]), 1)]
    numbers += [(column.key, row["metrics"][column.key], column.digits) for column in columns]
    found = []
    for key, number, digits in numbers:
        value, interval = _cell(number, digits)
        found.append((value + MARKS[row["verdict"][key]] if row["verdict"] else value, interval))
    difference = row["difference_to_reference"]
    first = columns[0]
    found.append(_cell(difference[first.key], first.digits, sign="+") if difference else ("reference", ""))
    found.append(_cell(row["interquartile_mean"][first.key], first.digits))
    found.append((f"{row['median'][first.key]:.{first.digits}f}", ""))
    found.append(_cell(_percent(row["won"]), 1) if row["won"] else ("", ""))
    if "share_of_bound" in row:
        share = row["share_of_bound"]
        found.append(("" if share is None else f"{100 * share:.1f}", ""))
    return found


def rows_in(scenario: dict[str, Any]) -> list[dict[str, Any]]:
    """The rows of a scenario's table: its policies, then what nobody can beat where that is known."""
    return [*scenario["policies"], *scenario.get("bounds", ())]


def _percent(interval: dict[str, float | None]) -> dict[str, float | None]:
    return {key: None if bound is None else 100 * bound for key, bound in interval.items()}


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
    reference = summary["reference"] or "the first of each table"
    marks = f"; ▲ better, ▼ worse than {reference}"
    if episodes < MARKS_FROM:
        marks = f"; from {MARKS_FROM} episodes on, marks say what is better or worse than {reference}"
    if len(rows) == len(summary["scenarios"]):
        marks = ""
    means = "studentised bootstrap over episodes" if episodes >= BOOTSTRAP_FROM else "Student's"
    return f"{what}; below each mean its {interval}: {means}{seeds}, Wilson for rates{marks}"


def terminal_table(scenario: dict[str, Any], reference: str, width: int) -> Table:
    """Table of one scenario for a terminal of ``width`` columns, the interval below each value.

    Where not all columns fit, the less important ones are left out: a number is never cut. Rows of policies that
    failed in most episodes are faded.
    """
    columns = columns_of(scenario["policies"])
    bounded = bool(scenario.get("bounds"))
    count = len(headings(columns, reference, bounded))
    # The rate and the first metric stay; then the difference, the share of the bound, the last metric, the others, the
    # middles and the wins.
    difference = len(columns) + 2
    last = [difference - 1] if difference > 3 else []
    share = [count - 1] if bounded else []
    middles = range(difference + 1, count - len(share))
    order = [1, 2, difference, *share, *last, *range(3, difference - 1), *middles]
    for kept in range(len(order), 0, -1):
        for folded in (0,) if kept == len(order) else (0, 20, 12):
            table = _table(scenario, reference, order[:kept], folded, width)
            if table is not None:
                return table
    return _table(scenario, reference, order[:1], 12, 10 * width) or Table()


def _table(scenario: dict[str, Any], reference: str, places: Sequence[int], folded: int, width: int) -> Table | None:
    """The table with the headings at ``places``, None where it is too wide.

    Names of policies longer than ``folded`` are broken at a hyphen, headings at their words, numbers nowhere.
    """
    columns = columns_of(scenario["policies"])
    names = headings(columns, reference, bool(scenario.get("bounds")))
    places = sorted(places)
    shown = rows_in(scenario)
    labels = [_folded(row["policy"], folded) for row in shown]
    rows = [["\n".join(cell).rstrip() for cell in cells(row, columns)] for row in shown]
    least = [_longest(["policy", *labels])]
    least += [_longest([*names[place].split(), *(texts[place - 1] for texts in rows)]) for place in places]
    lengths = [0, *(len(names[place]) for place in places)]
    spare = width - sum(least) - 3 * len(least) - 1  # a border and a space on both sides
    if spare < 0:
        return None
    for _ in range(spare):  # to the heading that takes the most lines
        column = max(range(len(least)), key=lambda k: lengths[k] / least[k])
        least[column] += 1 if lengths[column] > least[column] else 0
    # Text, because plain strings are markup, which eats the units' brackets.
    left = f" ({len(names) - 1 - len(places)} more in a wider terminal)" if len(places) < len(names) - 1 else ""
    table = Table(title=Text(scenario["title"] + left, style="bold"), title_justify="left")
    table.add_column("policy", width=least[0])
    for place, wide in zip(places, least[1:], strict=True):
        table.add_column(Text(names[place]), justify="right", width=wide)
    for number, (row, label, texts) in enumerate(zip(shown, labels, rows, strict=True)):
        style = "dim" if row["failure_rate"]["value"] > 0.5 else ""
        if number == len(scenario["policies"]):
            table.add_section()
        table.add_row(Text(label), *(Text(texts[place - 1]) for place in places), style=style)
    return table


def _longest(texts: Sequence[str]) -> int:
    return max(len(line) for text in texts for line in text.split("\n"))


def _folded(name: str, width: int) -> str:
    """A name in lines of at most ``width`` where it has hyphens to break it at; 0 for one line."""
    lines = [""]
    for part in re.split(r"(?<=[-/:_])", name):
        if width and lines[-1] and len(lines[-1]) + len(part) > width:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def overview(summary: dict[str, Any], part: str = "") -> list[str]:
    """Who wins where, as lines of Markdown: the return of every policy on every scenario, and what share failed."""
    scenarios = summary["scenarios"]
    lines = [
        "",
        f"## Return: {part}" if part else "## Return",
        "",
        f"| policy | {' | '.join(scenario['scenario'] for scenario in scenarios)} |",
    ]
    lines.append(f"|---{'|---:' * len(scenarios)}|")
    for rows in zip(*(scenario["policies"] for scenario in scenarios), strict=True):
        lines.append(f"| {rows[0]['policy']} | {' | '.join(map(_overview_cell, rows))} |")
    bounds = [{row["policy"]: row for row in scenario.get("bounds", ())} for scenario in scenarios]
    for label in dict.fromkeys(label for rows in bounds for label in rows):
        texts = (_overview_cell(rows[label]) if label in rows else "" if rows else NONE_KNOWN for rows in bounds)
        lines.append(f"| {label} | {' | '.join(texts)} |")
    return lines


def _overview_cell(row: dict[str, Any]) -> str:
    value, interval = _cell(row["metrics"][RETURN], METRICS[RETURN].digits + 1)
    failed, share = row["failure_rate"]["value"], row.get("share_of_bound")
    parts = [value + (MARKS[row["verdict"][RETURN]] if row["verdict"] else ""), interval]
    parts += [f"{failed:.1%} failed"] if failed else []
    parts += [f"{share:.1%} of the bound"] if share is not None else []
    return "<br>".join(part for part in parts if part)


def improvement(summary: dict[str, Any]) -> list[str]:
    """How likely training runs beat the reference's, as lines of Markdown; none where nothing was trained."""
    if not summary["improvement"]:
        return []
    lines = ["", "## Probability of improvement", ""]
    lines += [f"That a run has more return than one of {summary['reference']} on a scenario drawn by chance.", ""]
    lines += ["| policy | probability [%] |", "|---|---:|"]
    for label, interval in summary["improvement"].items():
        value, bounds = _cell(_percent(interval), 1)
        lines.append(f"| {label} | {value}<br>{bounds} |")
    return lines


def failures(results: Sequence[EpisodeResult]) -> str:
    """Which episodes failed, as a table in Markdown, or "" where none did."""
    found: dict[tuple[str, str], list[int]] = {}
    for line in results:
        if line.failed:
            found.setdefault((line.scenario, line.policy), []).append(line.episode)
    if not found:
        return ""
    command = replay_command(Path("FOLDER"), "S", "P", "N")
    lines = ["", "## Failed episodes", "", f"`{command}` drives one again."]
    lines += ["", "| scenario | policy | episodes |", "|---|---|---|"]
    for (scenario, policy), episodes in found.items():
        shown = ", ".join(map(str, sorted(episodes)[:MOST_FAILURES])) + ", …" * (len(episodes) > MOST_FAILURES)
        lines.append(f"| {scenario} | {policy} | {shown} |")
    return "\n".join(lines) + "\n"


def replay_command(folder: Path, scenario: str, policy: str, episode: int | str) -> str:
    """The command that drives an episode of a run again."""
    words = ["lanekeep", "play", "--run", str(folder), "--scenario", scenario, "--policy", policy]
    return shlex.join([*words, "--episode", str(episode)])


def tables(summary: dict[str, Any], results: Sequence[EpisodeResult]) -> str:
    """What a run keeps as Markdown: scores, what was spent on the policies, and which episodes failed."""
    return markdown(summary) + budgets(list(dict.fromkeys(line.policy for line in results))) + failures(results)


def markdown(summary: dict[str, Any]) -> str:
    """All tables of scores as Markdown."""
    lines = [f"# {summary['suite']}: {summary['description']}", "", caption(summary) + "."]
    for name, part in parts_of(summary).items():
        if len(part["scenarios"]) > 1 and all(RETURN in s["policies"][0]["metrics"] for s in part["scenarios"]):
            lines += overview(part, name)
    lines += improvement(summary)
    for scenario in summary["scenarios"]:
        columns = columns_of(scenario["policies"])
        bounded = scenario.get("bounds")
        names = headings(columns, scenario["policies"][0]["policy"], bool(bounded))
        title = scenario["title"] if len(summary["parts"]) == 1 else f"{scenario['scenario']}: {scenario['title']}"
        lines += ["", f"## {title}", ""]
        lines += [f"{NONE_KNOWN.capitalize()}.", ""] if bounded == [] else []
        lines += [f"| {' | '.join(names)} |", f"|---{'|---:' * (len(names) - 1)}|"]
        for row in rows_in(scenario):
            texts = [f"{value}<br>{interval}" if interval else value for value, interval in cells(row, columns)]
            lines.append(f"| {row['policy']} | {' | '.join(texts)} |")
    return "\n".join(lines) + "\n"
