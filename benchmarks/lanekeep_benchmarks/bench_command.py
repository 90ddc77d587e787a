"""`lanekeep bench`: policies on identical episodes."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from lanekeep_benchmarks.console import console, progress
from lanekeep_benchmarks.endings import disk_errors, input_errors, interruptible, own_errors
from lanekeep_benchmarks.play_command import POLICY
from lanekeep_benchmarks.suites import ENDING, SUITES


def bench(
    suite: Annotated[
        str | None, typer.Argument(help=f"{', '.join(SUITES)}, or a {ENDING} file of your own; default: classical.")
    ] = None,
    policies: Annotated[
        str | None, typer.Option(help=f"{POLICY}, comma-separated; the first is the reference.")
    ] = None,
    road: Annotated[Path | None, typer.Option(help="CSV centre line (x, y in m) to drive instead of a suite.")] = None,
    smoothing: Annotated[float | None, typer.Option(help="How far its points scatter, m; default: estimated.")] = None,
    episodes: Annotated[int | None, typer.Option(help="Episodes for each scenario; default: the suite's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Another seed, other episodes; default: 0.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results; default: results/SUITE-TIME.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace results in --out.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Complete the run in --out; options left out are those of that run.")
    ] = False,
    trace: Annotated[
        bool, typer.Option("--trace", help="Keep every step of every episode; those of failed ones are kept always.")
    ] = False,
    engine: Annotated[str, typer.Option(help="What drives: serial, processes or ray.")] = "serial",
    workers: Annotated[int | None, typer.Option(help="Processes; default: one a processor.")] = None,
    address: Annotated[str | None, typer.Option(help="Of a Ray cluster; default: one for this run.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """Compare policies on identical episodes: table, result lines, plots.

    Example: lanekeep bench --policies pd,yin-lqr-observer --road my_track.csv --out results/my_track

    A killed run goes on where it stopped: lanekeep bench --resume --out results/my_track

    On several processors: lanekeep bench --engine processes --workers 4
    """
    from lanekeep_benchmarks import runs
    from lanekeep_benchmarks.engines import Engine
    from lanekeep_benchmarks.report import replay_command
    from lanekeep_benchmarks.reporting import write_report

    with input_errors():
        how = Engine(engine, workers, address)
        named = _listed(policies)
        options = runs.Options(suite, named, road, smoothing, episodes, seed, out, overwrite, resume, trace, how)
        plan, folder = runs.open_run(options)
    advice = f"; to complete the run: lanekeep bench --resume --out {shlex.quote(str(folder.path))}"
    if resume:
        torn = ", a torn last line was dropped" if folder.torn else ""
        print(f"lanekeep: {len(plan.results)} of {plan.total} episodes are in {folder.path}{torn}", file=sys.stderr)
    with interruptible(advice), own_errors(advice), disk_errors(advice), folder, progress() as bar:
        task = bar.add_task("driving", total=plan.total, completed=len(plan.results))
        for name, count in runs.drive(plan, folder):
            bar.update(task, advance=count, description=name)
        bar.update(task, description="tables and plots")
        summary = write_report(plan, folder)
    _print_report({"folder": str(folder.path), **summary}, as_json)
    failed = next((line for line in plan.results if line.failed), None)
    if failed is not None and not as_json:
        command = replay_command(folder.path, failed.scenario, failed.policy, failed.episode)
        console().print(f"A failed episode to look at: {command}", highlight=False, soft_wrap=True)


def _print_report(summary: dict[str, Any], as_json: bool) -> None:
    from lanekeep_benchmarks.report import caption, terminal_table
    from lanekeep_benchmarks.results import PAGE

    if as_json:
        print(json.dumps(summary))
        return
    there = console()
    for entry in summary["scenarios"]:
        there.print(terminal_table(entry, entry["policies"][0]["policy"], there.width))
    there.print(caption(summary), highlight=False)
    there.print(f"Results, tables and plots: {summary['folder']}", highlight=False, soft_wrap=True)
    there.print(f"To explore in a browser: {Path(summary['folder']) / PAGE}", highlight=False, soft_wrap=True)


def _listed(policies: str | None) -> tuple[str, ...] | None:
    """Split a comma-separated list."""
    return None if policies is None else tuple(name.strip() for name in policies.split(",") if name.strip())
