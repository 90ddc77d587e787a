"""`lanekeep speed`: how fast environments, controllers and the benchmark are, beside others."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

import lanekeep_env
from lanekeep_benchmarks.console import console, progress
from lanekeep_benchmarks.endings import input_errors, interruptible
from lanekeep_benchmarks.machine import this_machine
from lanekeep_benchmarks.speed.rounds import Measured
from lanekeep_env.checks import choose

#: Rounds, and about how many seconds everything is run in each; of a quick measurement and a full one.
QUICK, FULL = (3, 0.03), (9, 0.15)


def speed(
    ids: Annotated[list[str] | None, typer.Argument(metavar="[ID]...", help="Of these; default: of all.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer and shorter rounds, one first step.")] = False,
    history: Annotated[
        Path | None, typer.Option(help="A .jsonl file: the ratios are added to it and drawn beside, as a .png.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """Measure env-steps/s beside CartPole, Pendulum, highway-env and gymnax, and how long a first step takes.

    What is compared runs in turns, so that ratios hold on a noisy machine: the median over rounds is told, with the
    smallest and the largest. That spread is one run's: another run, a minute later, can lie beyond it, and --history
    shows by how much. All ids take minutes, most of them for first steps with nothing compiled.

    Example: lanekeep speed --quick LaneKeep-v0 WallFollow-v0

    Example: lanekeep speed --history results/speed.jsonl
    """
    from lanekeep_benchmarks.speed import contenders, rounds, start_up
    from lanekeep_benchmarks.speed.history import add, read

    with interruptible(""), input_errors():
        named = [one if "/" in one else f"lanekeep/{one}" for one in ids or lanekeep_env.ENVIRONMENTS]
        for one in named:
            choose("ID", one, lanekeep_env.ENVIRONMENTS)
        if history is not None and history.suffix != ".jsonl":
            raise ValueError(f"--history {history} is not allowed: it must be a .jsonl file")
        if history is not None:
            read(history)  # what is wrong with it is told before minutes of measuring
            history.parent.mkdir(parents=True, exist_ok=True)
        notes: list[str] = []
        with progress("groups") as bar:
            task = bar.add_task("compiling", total=None)
            groups = contenders.groups(named, notes)
            bar.update(task, total=len(groups) + 1)

            def tell(text: str) -> None:
                bar.update(task, description=text)

            measured = {}
            for title, group in groups.items():
                measured[title] = rounds.measure(group, *(QUICK if quick else FULL), tell)
                bar.advance(task)
            kinds = ("single",) if quick else tuple(start_up.MAKERS)
            seconds = start_up.start_up(named[:1] if quick else named, kinds, tell)
        picture = None if history is None else add(history, measured, quick)
    if as_json:
        print(json.dumps(_plain(measured, seconds, notes)))
        return
    _print(measured, seconds, notes)
    if picture is not None:
        console().print(f"History: {history}, {picture}", highlight=False, soft_wrap=True)


def _plain(measured: Mapping[str, Measured], seconds: Mapping[str, float], notes: list[str]) -> dict[str, Any]:
    groups = {
        title: {
            "env_steps_per_s": dict(one.rates),
            "times_as_fast": {
                name: {rival: ratio._asdict() for rival, ratio in rivals.items()} for name, rivals in one.ratios.items()
            },
        }
        for title, one in measured.items()
    }
    return {"groups": groups, "start_up_s": dict(seconds), "machine": this_machine(), "notes": notes}


def _print(measured: Mapping[str, Measured], seconds: Mapping[str, float], notes: list[str]) -> None:
    there = console()
    for title, one in measured.items():
        rivals = [name for name in one.rates if name not in one.ratios]
        table = Table(title=Text(title), title_justify="left")
        table.add_column("")
        for heading in ("env-steps/s", *(f"÷ {rival}" for rival in rivals)):
            table.add_column(heading, justify="right")
        for name, rate in one.rates.items():
            ratios = [one.ratios[name][rival] for rival in rivals] if name in one.ratios else []
            cells = [f"{ratio.median:.3g} ({ratio.low:.3g}…{ratio.high:.3g})" for ratio in ratios]
            table.add_row(name, f"{rate:,.0f}", *cells)
        there.print(table)
    table = Table(title="Start-up in a fresh process", title_justify="left")
    table.add_column("")
    table.add_column("s", justify="right")
    for name, value in seconds.items():
        table.add_row(name, f"{value:.2f}")
    there.print(table)
    for note in notes:
        there.print(note, highlight=False)
