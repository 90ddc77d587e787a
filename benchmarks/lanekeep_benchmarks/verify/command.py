"""`lanekeep verify`: whether the results in a folder are what its policies drive."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.console import console, progress
from lanekeep_benchmarks.endings import input_errors, interruptible, one_line, short
from lanekeep_benchmarks.machine import this_machine

if TYPE_CHECKING:
    from lanekeep_benchmarks.verify.again import Again
    from lanekeep_benchmarks.verify.claims import Claims
    from lanekeep_benchmarks.verify.fresh import Fresh

#: Lines of the table of scores, above which only those that are worse are shown, and of what does not hold.
MOST_ROWS, MOST_FAULTS = 60, 20


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
    lines give. Then a tenth of the episodes, drawn now, is driven again: flags must be equal, metrics up to 1e-6. Then
    32 fresh episodes of each scenario, whose seed is drawn now: a policy that drives episodes it has seen, and no
    others, is worse there than it claims; the level is 1 % for all comparisons together.

    Shipped policies and learned ones (.json) are driven as they are. Own code is run only where you name it, in a
    process of its own that sees observations and gives actions: what it changes in the simulator or the metrics there
    changes nothing here. It is run as you, though: read it first, or verify in a container.

    Example: lanekeep verify results/their_run --policies their_controller.py:Controller

    docs/frozen-suite.md says what this does not find.
    """
    from lanekeep_benchmarks.verify.again import drawn, drive_again
    from lanekeep_benchmarks.verify.claims import read_claims
    from lanekeep_benchmarks.verify.fresh import EPISODES, drive_fresh

    named = [name.strip() for name in (policies or "").split(",") if name.strip()]
    with interruptible(""), input_errors():
        claims = read_claims(folder, named)
        again: list[Again] = []
        fresh: list[Fresh] = []
        try:
            episodes = drawn(claims)
            pairs = sum(map(len, claims.plan.drivers.values()))
            with progress() as bar:
                total = sum(map(len, episodes.values())) + EPISODES * pairs
                task = bar.add_task("again", total=total)
                for one in drive_again(claims, episodes):
                    again.append(one)
                    bar.update(task, advance=one.episodes, description=f"again, {one.scenario}: {one.policy}")
                seed, scores = drive_fresh(claims)
                for score in scores:
                    fresh.append(score)
                    bar.update(task, advance=EPISODES, description=f"fresh, {score.scenario}: {score.policy}")
        finally:
            claims.close()
    faults = _faults(claims, again, fresh)
    if as_json:
        print(json.dumps(_plain(folder, claims, again, fresh, seed, faults)))
    else:
        _print(folder, claims, again, fresh, seed, faults)
    raise typer.Exit(1 if faults else 0)


def _faults(claims: Claims, again: Sequence[Again], fresh: Sequence[Fresh]) -> list[str]:
    """What does not hold, a line each."""
    found = list(claims.faults)
    for one in again:
        found += [f"{one.policy} on {one.scenario}: {one.error}"] if one.error else []
        for scenario, policy, episode, *_ in (differs.place for differs in one.differs[:1]):
            first = one.differs[0]
            bad = len({differs.place for differs in one.differs})
            found.append(
                f"{policy} on {scenario}: {bad} of {one.episodes} episodes driven again differ, e.g. {episode}: "
                f"{first.field} is {_short(first.claimed)} in the folder, {_short(first.driven)} driven"
            )
    for score in fresh:
        if score.error and not any(one.error and one.policy == score.policy for one in again):
            found.append(f"{score.policy} on {score.scenario}, fresh episodes: {score.error}")
        if score.worse(len(fresh)):
            found.append(
                f"{score.policy} on {score.scenario}: {score.key} is {score.claimed:.4g} in the folder, "
                f"{score.fresh:.4g} on fresh episodes (by chance: {score.probability:.1g})"
            )
    return [short(one_line(fault)) for fault in found]


def _short(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _plain(
    folder: Path, claims: Claims, again: Sequence[Again], fresh: Sequence[Fresh], seed: int, faults: Sequence[str]
) -> dict[str, Any]:
    scores = [
        {**one._asdict(), "difference": None if one.difference is None else vars(one.difference), "worse": worse}
        for one in fresh
        if (worse := one.worse(len(fresh))) is not None
    ]
    return {
        "folder": str(folder),
        "suite": claims.record.suite,
        "holds": not faults,
        "faults": list(faults),
        "left_out": claims.left_out,
        "machines": list(claims.record.machines),
        "verified_on": this_machine(),
        "driven_again": sum(one.episodes for one in again),
        "lines": len(claims.lines),
        "fresh_seed": seed,
        "scores": scores,
    }


def _print(
    folder: Path, claims: Claims, again: Sequence[Again], fresh: Sequence[Fresh], seed: int, faults: Sequence[str]
) -> None:
    there = console()
    shown = fresh if len(fresh) <= MOST_ROWS else [one for one in fresh if one.worse(len(fresh))]
    title = f"Fresh episodes, seed {seed}" + (f": worse in {len(shown)} of {len(fresh)}" if shown is not fresh else "")
    table = Table(title=Text(title), title_justify="left")
    for place, heading in enumerate(
        ("policy", "scenario", "score", "claimed", "fresh", "difference, 95 %", "failed, claimed", "fresh", "")
    ):
        table.add_column(heading, justify="left" if place < 3 else "right")
    for one in shown:
        table.add_row(*map(Text, _row(one, len(fresh))))
    if shown:
        there.print(table)
    elif fresh:
        there.print(f"{title}; --json prints all scores", highlight=False)
    driven = sum(one.episodes for one in again)
    differ = len({differs.place for one in again for differs in one.differs})
    drawn = f"Driven again: {driven} of {len(claims.lines)} episodes, drawn by chance; {differ} differ"
    there.print(Text(drawn), soft_wrap=True)
    for machine in claims.record.machines:
        there.print(Text(f"Claimed on {', '.join(f'{key} {value}' for key, value in machine.items())}"), soft_wrap=True)
    for name, why in claims.left_out.items():
        there.print(Text(f"Not driven: {name}: {why}"), soft_wrap=True)
    for fault in faults[:MOST_FAULTS]:
        there.print(Text(f"Does not hold: {fault}"), soft_wrap=True)
    if len(faults) > MOST_FAULTS:
        there.print(Text(f"Does not hold: {len(faults) - MOST_FAULTS} more; --json prints all"))
    what = "does not hold" if faults else "holds for every policy that was driven"
    there.print(Text(f"{folder}: {what}"), soft_wrap=True)


def _row(one: Fresh, comparisons: int) -> tuple[str, ...]:
    if one.difference is None:
        return one.policy, one.scenario, "", "", "", "", "", "", "fails"
    difference = one.difference
    return (
        one.policy,
        one.scenario,
        one.key,
        f"{one.claimed:.4g}",
        f"{one.fresh:.4g}",
        f"{difference.value:+.3g} ({difference.low:+.3g}…{difference.high:+.3g})",
        *(f"{100 * rate:.1f} %" for rate in one.failed),
        "worse" if one.worse(comparisons) else "",
    )
