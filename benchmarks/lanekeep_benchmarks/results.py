"""The folder a run writes into: result lines as they come, everything else atomically, nothing overwritten unasked."""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType

from lanekeep_benchmarks.evaluate import EpisodeResult

EPISODES = "episodes.jsonl"
SUMMARY = "summary.json"
TABLE = "summary.md"


def default_folder(suite: str) -> Path:
    """A folder below results/ that names the suite and the time, so that runs do not meet."""
    return Path("results") / f"{suite}-{datetime.now(UTC):%Y%m%d-%H%M%S}"


def write_atomic(path: Path, content: bytes | str) -> None:
    """Write a file so that a reader sees all of it or nothing."""
    data = content.encode() if isinstance(content, str) else content
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


class ResultFolder:
    """An open results folder; a context manager that closes the file of result lines.

    Args:
        path: made if it is missing.
        overwrite: remove the results of an earlier run; other files in the folder stay.

    Raises:
        ValueError: the folder holds results and ``overwrite`` is not set, or the path is a file.
    """

    def __init__(self, path: Path, overwrite: bool = False) -> None:
        if path.exists() and not path.is_dir():
            raise ValueError(f"--out {path} is a file; allowed: a folder, which is made if it is missing")
        mine = [file for name in (EPISODES, SUMMARY, TABLE) if (file := path / name).exists()]
        if mine and not overwrite:
            raise ValueError(f"--out {path} already holds results; name another folder or pass --overwrite")
        path.mkdir(parents=True, exist_ok=True)
        for file in [*mine, *path.glob("plot_*.png")] if overwrite else []:
            file.unlink()
        self.path = path
        self._lines = (path / EPISODES).open("x", encoding="utf-8")

    def append(self, results: Iterable[EpisodeResult]) -> None:
        """Add result lines; they are on disk when this returns."""
        for result in results:
            self._lines.write(result.to_json() + "\n")
        self._lines.flush()

    def write(self, name: str, content: bytes | str) -> Path:
        """Write another file of the run atomically; return its path."""
        write_atomic(self.path / name, content)
        return self.path / name

    def __enter__(self) -> ResultFolder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lines.close()
