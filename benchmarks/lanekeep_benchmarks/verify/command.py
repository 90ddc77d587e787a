"""`lanekeep verify`: whether the results in a folder are what its policies drive."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.console import console, progress
from lanekeep_benchmarks.endings import input_errors, interruptible

if TYPE_CHECKING:
    from lanekeep_benchmarks.verify.fresh import Fresh
    from lanekeep_benchmarks.verify.verdict import Verdict

#: Rows of the table of scores, above which only those that are worse are shown, and lines of what does not hold.
MOST_ROWS, MOST_FAULTS = 60, 20
_HEADINGS = ("policy", "scenario", "score", "claimed\nfresh", "difference\n95 %", "failed\nfresh", "")


def verify(
    folder: Annotated[Path, typer.Argument(help="Of a lanekeep bench run.")],
    policies: Annotated[
        str | None,
        typer.Option(help="Own code of the run that may be run here, as the run names it, comma-separated."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, with every score.")] = False,
) -> None:
    """Say whether the results in a folder are what its policies drive; exit code 1 where something does not hold.

    First the files: run.json fits the suite here, every episode has its line, summary.json and summary.md are what the
    lines give. Then a tenth of the episodes, at least 64, drawn now, is driven again: flags must be equal, metrics up
    to 1e-6. Then 32 fresh episodes of each scenario, whose seed is drawn now: a policy that drives episodes it has
    seen, and no others, is worse there than it claims; the level is 1 % for all comparisons together.

    Shipped policies and learned ones (.json) are driven as they are. Own code is run only where you name it, in a
    process of its own that sees observations and gives actions: what it changes in the simulator or the metrics there
    changes nothing here. It is run as you, though: read it first, or verify in a container.

    Example: lanekeep verify results/their_run --policies their_controller.py:Controller

    docs/frozen-suite.md says what this does not find.
    """
    from lanekeep_benchmarks.verify.claims import read_claims
    from lanekeep_benchmarks.verify.verdict import Verdict

    named = [name.strip() for name in (policies or "").split(",") if name.strip()]
    with interruptible(""), input_errors():
        verdict = Verdict(folder, read_claims(folder, named))
        try:
            _drive(verdict)
        finally:
            verdict.claims.close()
    if as_json:
        print(json.dumps(verdict.to_dict(), allow_nan=False))
    else:
        _print(verdict)
    raise typer.Exit(1 if verdict.faults else 0)


def _drive(verdict: Verdict) -> None:
    """Drive what is drawn, and show how far it is."""
    from lanekeep_benchmarks.verify import again, fresh

    claims = verdict.claims
    episodes = again.drawn(claims)
    with progress() as bar:
        total = sum(map(len, episodes.values())) + fresh.EPISODES * sum(map(len, claims.plan.drivers.values()))
        task = bar.add_task("again", total=total)
        for one in again.drive_again(claims, episodes):
            verdict.again.append(one)
            bar.update(task, advance=one.episodes, description=f"again, {one.scenario}: {one.policy}")
        verdict.seed, scores = fresh.drive_fresh(claims)
        for score in scores:
            verdict.fresh.append(score)
            bar.update(task, advance=fresh.EPISODES, description=f"fresh, {score.scenario}: {score.policy}")


def _print(verdict: Verdict) -> None:
    there, record, faults = console(), verdict.claims.record, verdict.faults
    many = len(verdict.fresh) > MOST_ROWS
    shown = verdict.worse if many else verdict.fresh
    title = f"Fresh episodes, seed {verdict.seed}"
    if many:
        title += f": worse in {len(shown)} of {len(verdict.fresh)} comparisons; --json prints all"
    table = Table(title=Text(title), title_justify="left", show_lines=True)
    for place, heading in enumerate(_HEADINGS):  # numbers are whole on any terminal, words are folded
        table.add_column(heading, justify="left" if place < 3 else "right", no_wrap=place > 2, overflow="fold")
    for one in shown:
        table.add_row(*map(Text, _row(one, one in verdict.worse)))
    there.print(table if shown else Text(title))
    lines = [f"Claimed of {record.suite}: {record.episodes} episodes of each scenario, seed {record.seed}"]
    lines += [f"Claimed on {', '.join(f'{key} {value}' for key, value in one.items())}" for one in record.machines]
    lines += [f"Driven again: {verdict.driven} of {len(verdict.claims.lines)} episodes; {verdict.differ} differ"]
    lines += [f"Not driven: {name}: {why}" for name, why in verdict.claims.left_out.items()]
    lines += [f"Does not hold: {fault}" for fault in faults[:MOST_FAULTS]]
    if len(faults) > MOST_FAULTS:
        lines.append(f"Does not hold: {len(faults) - MOST_FAULTS} more; --json prints all")
    lines.append(f"{verdict.folder}: {'does not hold' if faults else 'holds for every policy that was driven'}")
    for line in lines:
        there.print(Text(line), soft_wrap=True)


def _row(one: Fresh, worse: bool) -> tuple[str, ...]:
    if one.difference is None:
        return one.policy, one.scenario, "", "", "", "", "fails"
    difference = one.difference
    return (
        one.policy,
        one.scenario,
        one.key,
        f"{one.claimed:.4g}\n{one.fresh:.4g}",
        f"{difference.value:+.3g}\n{difference.low:+.3g}…{difference.high:+.3g}",
        "\n".join(f"{100 * rate:.1f} %" for rate in one.failed),
        "worse" if worse else "",
    )
