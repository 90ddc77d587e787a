"""`lanekeep export`: a results folder as CSV, for everything that reads neither JSON lines nor Parquet."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from lanekeep_benchmarks.endings import input_errors, interruptible


def export(
    folder: Annotated[Path, typer.Argument(help="Of a run.")],
    out: Annotated[Path | None, typer.Option(help="Folder for both files; default: that of the run.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write over existing files.")] = False,
) -> None:
    """Write the results of a run as CSV: results.csv, a row an episode, and steps.csv, a row a kept step.

    Example: lanekeep export results/my_run --out tables
    """
    from lanekeep_benchmarks.reading import read

    with interruptible(""), input_errors():
        found = read(folder)
        there = folder if out is None else out
        if there.exists() and not there.is_dir():
            raise ValueError(f"--out {there} is a file; allowed: a folder, which is made if it is missing")
        tables = {there / "results.csv": found.results}
        if len(found.steps):
            tables[there / "steps.csv"] = found.steps
        for file in tables:
            if file.exists() and not overwrite:
                raise ValueError(f"{file} exists; name another --out, or pass --overwrite")
        there.mkdir(parents=True, exist_ok=True)
        for file, table in tables.items():
            # Line by line: the steps of a run may be gigabytes of text.
            part = file.with_name(f".{file.name}.tmp")
            table.to_csv(part, index=False)
            os.replace(part, file)
    print("\n".join(f"{file}: {len(table)} rows" for file, table in tables.items()))
