"""`lanekeep bound`: the best that anybody could have driven, beside what policies drive."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.console import console, progress
from lanekeep_benchmarks.endings import disk_errors, input_errors, interruptible
from lanekeep_benchmarks.suites import ENDING, SUITES


def bound(
    suite: Annotated[
        str | None,
        typer.Argument(help=f"{', '.join(SUITES)}, or a {ENDING} file; default: that of the run in --out."),
    ] = None,
    episodes: Annotated[int | None, typer.Option(help="Of each scenario; default: the run's, or the suite's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the episodes; default: the run's, or 0.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of a lanekeep bench run; default: a new one.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace bounds in --out.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Complete the bounds in --out.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """Say how good any policy could be: episodes driven by one who knows the road to its end and the true car.

    For each episode of lanekeep bench, iterative LQR on the environment's own kernel finds the actions of the highest
    return, from what classical controllers drive; on saturating tyres from two starts. Nothing that drives by its
    sensors can be expected to reach that, so the share that it reaches says how much there is left to learn, and where
    classical control is the optimum already. "lq-told-the-truth" is lq-preview made for the true car and sensors, where
    all episodes have the same: what lies between it and lq-preview is to be had by learning the car.

    Example: lanekeep bench learned --out results/learned && lanekeep bound --out results/learned

    The run's tables then have both rows, and the share of the bound of every policy. Without a run: lanekeep bound
    learned --episodes 64. What was killed goes on with --resume. Worlds with walls, gears or traffic, and roads that a
    camera shows, have no bound that is known.
    """
    from lanekeep_benchmarks.bound import drive_bounds, open_bound
    from lanekeep_benchmarks.bound_table import bound_summary, rewrite_tables

    with input_errors():
        plan, folder, above = open_bound(suite, episodes, seed, out, overwrite, resume)
    advice = f"; to go on: lanekeep bound --resume --out {shlex.quote(str(above))}"
    if resume:
        count = len({line.place for line in plan.results if line.policy == "bound"})
        print(f"lanekeep: {count} of {plan.total} episodes are in {folder.path}", file=sys.stderr)
    with interruptible(advice), disk_errors(advice), folder, progress() as bar:
        done = sum(line.policy == "bound" for line in plan.results)
        task = bar.add_task("bounds", total=plan.total, completed=done)
        for name, count in drive_bounds(plan, folder):
            bar.update(task, advance=count, description=name)
    with input_errors():
        in_run = rewrite_tables(above)
    summary = {"folder": str(above), "tables": in_run, **bound_summary(plan)}
    if as_json:
        print(json.dumps(summary))
        return
    _print(summary)


def _print(summary: dict[str, Any]) -> None:
    there = console()
    title = f"{summary['suite']}: the best return of {summary['episodes']} episodes (seed {summary['seed']})"
    table = Table(title=Text(title), title_justify="left")
    for heading in ("scenario", "bound", "failed", "lq-told-the-truth"):
        table.add_column(heading, justify="left" if heading == "scenario" else "right")
    for name, entry in summary["scenarios"].items():
        if "why" in entry:
            table.add_row(name, "no bound known", "", "")
        else:
            told = entry["told"]
            table.add_row(
                name,
                f"{entry['bound']:.3f}",
                f"{entry['failure_rate']:.1%}",
                "" if told is None else f"{told:.3f}",
            )
    there.print(table)
    for why in dict.fromkeys(entry["why"] for entry in summary["scenarios"].values() if "why" in entry):
        there.print(Text(f"No bound is known where {why}."), soft_wrap=True)
    where = "in the tables of" if summary["tables"] else "result lines below"
    there.print(Text(f"Bounds: {where} {summary['folder']}"), soft_wrap=True)
