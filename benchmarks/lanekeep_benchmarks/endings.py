"""How a command ends when it cannot go on: one line on stderr and an exit code."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import gymnasium as gym
import typer

from lanekeep_benchmarks.own_code import OwnCodeError


def one_line(text: object) -> str:
    """Text without line ends; of an error of the system what failed and why, without its number."""
    if isinstance(text, OSError) and text.filename is not None and text.strerror is not None:
        text = f"{text.filename}: {text.strerror}"
    return " ".join(str(text).split())


def short(text: str, most: int = 1500) -> str:
    """Text cut in its middle where it is long: it may repeat a path or an option, however long that is."""
    return text if len(text) <= most else f"{text[: most // 2]}...{text[-most // 2 :]}"


def check_picture(out: Path | None, overwrite: bool, option: str = "--out", ending: str = ".png") -> None:
    """Raise ValueError where the file of an ``option`` cannot become a picture, before it is computed."""
    if out is None:
        return
    if out.suffix.lower() != ending:
        raise ValueError(f"{option} {out} must end in {ending}")
    if not out.parent.is_dir():
        raise ValueError(f"{option} {out}: there is no folder {out.parent}")
    if out.exists() and not overwrite:
        raise ValueError(f"{out} exists; give another {option} or --overwrite")


@contextmanager
def input_errors() -> Iterator[None]:
    """Turn what the packages say about bad input into one line on stderr and exit code 2."""
    try:
        yield
    except (ValueError, OSError, ImportError, gym.error.Error) as error:
        print(f"lanekeep: {short(one_line(error))}", file=sys.stderr)
        raise typer.Exit(2) from error


@contextmanager
def disk_errors(advice: str) -> Iterator[None]:
    """Turn a full disk and its like into one line on stderr and exit code 1."""
    try:
        yield
    except OSError as error:
        print(f"lanekeep: {short(one_line(error))}{advice}", file=sys.stderr)
        raise typer.Exit(1) from error


@contextmanager
def own_errors(advice: str = "") -> Iterator[None]:
    """Turn what fails in a user's own code into one line on stderr and exit code 1."""
    try:
        yield
    except OwnCodeError as error:
        print(f"lanekeep: {short(one_line(error))}{advice}", file=sys.stderr)
        raise typer.Exit(1) from error


@contextmanager
def plain_warnings() -> Iterator[None]:
    """Show what the packages warn of as one line on stderr."""

    def show(message: Warning | str, *_: object, **__: object) -> None:
        print(f"lanekeep: {short(one_line(message))}", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


class ClosedOutput(Exception):
    """What is printed reaches nobody; the text says why."""


@contextmanager
def open_output() -> Iterator[None]:
    """Raise `ClosedOutput` where stdout is a pipe whose reader has gone, or a file on a full disk, so that nothing
    fails when Python ends."""
    try:
        yield
        sys.stdout.flush()
    except (OSError, SystemExit) as error:
        # rich makes a SystemExit of a closed pipe.
        closed = isinstance(error, BrokenPipeError) or isinstance(error.__context__, BrokenPipeError)
        if not closed and (isinstance(error, SystemExit) or error.filename is not None):
            raise
        why = "what reads the output was closed before its end"
        if not closed and isinstance(error, OSError):
            why = f"the output cannot be written: {error.strerror or error}"
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise ClosedOutput(why) from error


class Interrupted(Exception):
    """Ctrl-C; the text is what the user can do now."""


@contextmanager
def interruptible(advice: str) -> Iterator[None]:
    """Let the command end with ``advice`` after Ctrl-C; without it, it says that it was interrupted, and no more."""
    try:
        yield
    except KeyboardInterrupt as error:
        raise Interrupted(advice) from error
