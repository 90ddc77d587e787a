"""What the commands print with: tables that fit the terminal, progress bars where somebody watches."""

from __future__ import annotations

import os

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

#: Columns of text where the output is a file or a pipe.
PIPED = 260


def console(stderr: bool = False) -> Console:
    """A console; tables keep a readable width where the output is a file or a pipe, unless COLUMNS says one."""
    found = Console(stderr=stderr)
    if found.is_terminal or "COLUMNS" in os.environ:
        return found
    return Console(stderr=stderr, width=PIPED)


def watched() -> Console:
    """A console on stderr that is quiet where nobody watches."""
    there = console(stderr=True)
    # A progress bar would leave an empty line there; rich before 14.3 does so even where it is disabled.
    there.quiet = not there.is_terminal
    return there


def progress(unit: str = "episodes") -> Progress:
    """A progress bar on stderr."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit))
    there = watched()
    return Progress(*columns, TimeElapsedColumn(), console=there, transient=True, disable=there.quiet)
