"""`lanekeep replicate`: a published work driven again, or all of them on one page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.console import console, progress
from lanekeep_benchmarks.endings import input_errors, interruptible
from lanekeep_benchmarks.replications import (
    ALL,
    BESIDE,
    HEADINGS,
    NOTE,
    NUMBERS,
    WORKS,
    Replication,
    replication_of,
    steps_of,
)
from lanekeep_env.checks import choose
from lanekeep_env.files import write_atomic

TITLE = "The four works, driven again"
_WHICH = "; ".join(
    [
        *(f"{name}: {what}" for name, what in WORKS.items()),
        f"{ALL}: each of them, on one page",
        *(f"{name}: {what}" for name, what in BESIDE.items()),
    ]
)


def replicate(
    work: Annotated[str, typer.Argument(help=_WHICH)],
    out: Annotated[
        Path | None, typer.Option(help="Folder for tables and figures; default: results/replicate-WORK.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a replication in --out.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """Drive a published work again: its figures, and its numbers beside those that come out here.

    Example: lanekeep replicate traechtler --out results/van

    Example: lanekeep replicate all
    """
    with interruptible(""), input_errors():
        choose("work", work, (*WORKS, ALL, *BESIDE))
        works = list(WORKS) if work == ALL else [work]
        steps = [(one, *step) for one in works for step in steps_of(one)]
        folder = out or Path("results") / f"replicate-{work}"
        if folder.exists() and not folder.is_dir():
            raise ValueError(f"--out {folder} is a file; allowed: a folder, which is made if it is missing")
        if folder.exists() and any(folder.iterdir()) and not overwrite:
            raise ValueError(f"--out {folder} is not empty; name another folder, or pass --overwrite")
        folder.mkdir(parents=True, exist_ok=True)
        found = {one: replication_of(one) for one in works}
        with progress("steps") as bar:
            task = bar.add_task("driving", total=len(steps))
            for one, name, run_step in steps:
                bar.update(task, description=name if work != ALL else f"{one}: {name}")
                run_step(found[one])
                bar.update(task, advance=1)
        told = _write(folder, found, together=work == ALL)
    if as_json:
        print(json.dumps({"folder": str(folder), **told}))
        return
    for replication in found.values():
        _print(replication)
    console().print(f"Tables and figures: {folder}", highlight=False, soft_wrap=True)


def _write(folder: Path, found: dict[str, Replication], together: bool) -> dict[str, Any]:
    """Write pictures and pages, those of several works in a folder each; return the JSON."""
    for work, replication in found.items():
        place = folder / work if together else folder
        place.mkdir(exist_ok=True)
        for name, picture in replication.pictures.items():
            write_atomic(place / name, picture)
    if together:
        told: dict[str, Any] = {"title": TITLE, "works": {work: one.to_dict() for work, one in found.items()}}
        page = f"# {TITLE}\n\n" + "\n".join(one.markdown(2, f"{work}/") for work, one in found.items())
    else:
        (replication,) = found.values()
        told, page = replication.to_dict(), replication.markdown()
    write_atomic(folder / "replication.json", json.dumps(told, indent=1) + "\n")
    write_atomic(folder / "replication.md", page)
    return told


def _print(found: Replication) -> None:
    """Print rows and tables."""
    there = console()
    table = Table(title=found.title, title_justify="left")
    for heading in HEADINGS:
        table.add_column(heading, justify="right" if heading in NUMBERS else "left")
    for row in found.rows:
        table.add_row(*(Text(cell) for cell in found.cells(row)))
    there.print(table)
    there.print(NOTE, highlight=False)
    for further in found.tables:
        table = Table(title=Text(further.title), title_justify="left")
        for place, heading in enumerate(further.headings):
            table.add_column(Text(heading), justify="right" if place else "left")
        for cells in further.rows:
            table.add_row(*(Text(cell) for cell in cells))
        there.print(table)
