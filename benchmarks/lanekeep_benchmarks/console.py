"""What the commands print with: tables that fit the terminal, progress bars where somebody watches."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

#: Columns of text where the output is a file or a pipe.
PIPED = 160


def console(stderr: bool = False) -> Console:
    """A console; tables keep a readable width where the output is a file or a pipe, unless COLUMNS says one."""
    found = Console(stderr=stderr)
    if found.is_terminal or "COLUMNS" in (found._environ or {}):
        return found
    return Console(stderr=stderr, width=PIPED)


def progress(unit: str = "episodes") -> Progress:
    """A progress bar on stderr."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit))
    there = console(stderr=True)
    # Where nobody watches, it would leave an empty line; rich before 14.3 does so even where it is disabled.
    there.quiet = not there.is_terminal
    return Progress(*columns, TimeElapsedColumn(), console=there, transient=True, disable=there.quiet)
