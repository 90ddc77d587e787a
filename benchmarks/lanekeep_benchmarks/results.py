"""The folder a run writes into: result lines as they come, everything else atomically, nothing overwritten unasked.

A chunk of lines is on disk when `append` returns, so that a killed run loses the chunk it was driving and no more.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from lanekeep_benchmarks.evaluate import EpisodeResult
from lanekeep_benchmarks.run_record import ANEW, RUN, RunRecord, another_run, told
from lanekeep_env.files import write_atomic

if sys.platform != "win32":
    import fcntl

EPISODES = "episodes.jsonl"
SUMMARY = "summary.json"
TABLE = "summary.md"


def default_folder(suite: str) -> Path:
    """A folder below results/ that names the suite and the time, so that runs do not meet."""
    return Path("results") / f"{suite}-{datetime.now(UTC):%Y%m%d-%H%M%S}"


def read_lines(file: Path) -> tuple[list[EpisodeResult], int]:
    """Read result lines; return them and the number of bytes they take, without a torn end.

    A line is torn when its line end is missing: a line is written before its end, and both before the next line.

    Raises:
        ValueError: a whole line is not a result line.
    """
    content = file.read_bytes()
    *lines, torn = content.split(b"\n")
    results = []
    for number, line in enumerate(lines, start=1):
        try:
            results.append(EpisodeResult.from_json(line))
        except (ValueError, TypeError) as error:
            raise ValueError(f"{file} line {number} is not a result line ({error}); {ANEW}") from None
    return results, len(content) - len(torn)


class ResultFolder:
    """An open results folder; a context manager that closes the file of result lines.

    Args:
        path: made if it is missing.
        record: of the run that writes here.
        overwrite: remove the results of an earlier run; other files in the folder stay.
        resume: keep the lines of that very run as ``earlier``; a torn last line is dropped (``torn``).

    Raises:
        ValueError: the folder holds results and neither is set, or it holds those of another run (``resume``), or
            another process writes there, or the path is a file.
    """

    def __init__(self, path: Path, record: RunRecord, overwrite: bool = False, resume: bool = False) -> None:
        if path.exists() and not path.is_dir():
            raise ValueError(f"--out {path} is a file; allowed: a folder, which is made if it is missing")
        mine = [file for name in (RUN, EPISODES, SUMMARY, TABLE) if (file := path / name).exists()]
        if mine and not overwrite and not resume:
            raise ValueError(
                f"--out {path} already holds results; name another folder, or pass --resume to complete them or"
                " --overwrite to replace them"
            )
        path.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.earlier: list[EpisodeResult] = []
        self.torn = False
        self._lines = (path / EPISODES).open("ab" if mine else "xb")
        try:
            _lock(self._lines, path)
            if resume:
                self._take_up(record)
            elif overwrite:
                self._clear()
            write_atomic(path / RUN, record.to_json())
        except BaseException:
            self._lines.close()
            raise

    def _take_up(self, record: RunRecord) -> None:
        """Read what a run left; change nothing before all of it is known to be of this run."""
        lines, whole = read_lines(self.path / EPISODES)
        found = RunRecord.read(self.path)
        if found is None and lines:
            raise ValueError(f"--out {self.path} holds result lines, but no {RUN} that says of which run; {ANEW}")
        if found is not None and (differences := record.differences(found)):
            raise another_run(self.path, differences)
        places = set()
        for number, line in enumerate(lines, start=1):
            where = f"{self.path / EPISODES} line {number}"
            if differences := record.line_differences(line):
                raise ValueError(f"{where} is of another run: {told(differences)}; {ANEW}")
            if line.place in places:
                raise ValueError(f"{where} repeats {line.scenario}, {line.policy}, episode {line.episode}; {ANEW}")
            places.add(line.place)
        self.earlier = lines
        self.torn = self._lines.tell() > whole
        self._lines.truncate(whole)

    def _clear(self) -> None:
        # The record goes first: lines without one are never taken up by mistake.
        (self.path / RUN).unlink(missing_ok=True)
        self._lines.truncate(0)
        for file in [self.path / SUMMARY, self.path / TABLE, *self.path.glob("plot_*.png")]:
            file.unlink(missing_ok=True)

    def append(self, results: Iterable[EpisodeResult]) -> None:
        """Add result lines; they are on disk when this returns."""
        self._lines.write(b"".join(result.to_json().encode() + b"\n" for result in results))
        self._lines.flush()
        os.fsync(self._lines.fileno())

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


def _lock(file: BinaryIO, path: Path) -> None:
    """Keep other processes out until this one ends, in whatever way it ends."""
    if sys.platform == "win32":
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(
            f"--out {path}: another process is writing there; wait for it, or name another folder"
        ) from None
    except OSError:
        pass  # a file system without locks
