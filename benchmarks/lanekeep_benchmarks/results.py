"""The folder a run writes into: result lines as they come, everything else atomically, nothing overwritten unasked.

A chunk of lines is on disk when `append` returns, so that a killed run loses the chunk it was driving and no more.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType

from lanekeep_benchmarks.evaluate import Driven
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.machine import this_machine
from lanekeep_benchmarks.run_record import ANEW, RUN, AnotherRun, RunRecord, told
from lanekeep_benchmarks.traces import FOLDER
from lanekeep_env.files import locked, open_to_append, read_bounded, require_ordinary, write_atomic

EPISODES = "episodes.jsonl"
SUMMARY = "summary.json"
TABLE = "summary.md"
PAGE = "report.html"
#: Bytes beyond which result lines are not read: `MOST_EPISODES` with policies named by long paths, a line alone.
LARGEST_LINES = 1 << 29
LONGEST_LINE = 1 << 16
#: How differences of policies begin.
_HASH = "policy_sha256 of "
#: What every result line begins with.
_BEGINNING = b'{"suite": "'


def default_folder(suite: str) -> Path:
    """A folder below results/ that names the suite and the time, so that runs do not meet."""
    return Path("results") / f"{suite}-{datetime.now(UTC):%Y%m%d-%H%M%S}"


def read_lines(content: bytes) -> Iterator[tuple[int, EpisodeResult]]:
    """Yield result lines with their numbers, without a torn end.

    A line is torn when its line end is missing: a line is written before its end, and both before the next line. Where
    the power failed, NULs may stand for it.

    Raises:
        ValueError: a line is not a result line, or the end not the beginning of one; names its number.
    """
    for number, line in enumerate(io.BytesIO(content), start=1):
        if len(line) > LONGEST_LINE:
            raise ValueError(f"line {number} has {len(line)} bytes, allowed are {LONGEST_LINE}")
        if line.endswith(b"\n"):
            try:
                yield number, EpisodeResult.from_json(line)
            except (ValueError, TypeError) as error:
                raise ValueError(f"line {number} is not a result line ({error})") from None
        elif line.strip(b"\0") and not line.startswith(_BEGINNING[: len(line)]):
            raise ValueError(f"line {number} is not the beginning of a result line")


def written(folder: ResultFolder, batches: Iterable[Driven]) -> Iterator[list[EpisodeResult]]:
    """Write what is driven while the next is being driven; yield the lines that are on disk.

    The steps of a batch are on disk before its lines are.
    """

    failed = False

    def write(driven: Driven) -> list[EpisodeResult]:
        nonlocal failed
        if failed:  # a full disk: what comes after is driven again, too
            return []
        failed = True
        if driven.trace is not None:
            name, content = driven.trace
            folder.write(name, content())
        folder.append(driven.results)
        failed = False
        return driven.results

    with ThreadPoolExecutor(1, "writer") as writer:
        # Whatever ends the run, the writer ends what it has begun.
        before: Future[list[EpisodeResult]] | None = None
        for driven in batches:
            now = writer.submit(write, driven)
            if before is not None:
                yield before.result()
            before = now
        if before is not None:
            yield before.result()


class ResultFolder:
    """An open results folder; a context manager that closes the file of result lines.

    Args:
        path: made if it is missing.
        record: of the run that writes here.
        overwrite: remove the results of an earlier run; other files in the folder stay.
        resume: keep the lines of that very run as ``earlier``; a torn last line is dropped (``torn``).

    Raises:
        ValueError: the folder holds results and neither is set, or it holds those of another run (``resume``), or
            another process writes there, or the path is a file, or something else than a file has the name of one.
    """

    def __init__(self, path: Path, record: RunRecord, overwrite: bool = False, resume: bool = False) -> None:
        if path.exists() and not path.is_dir():
            raise ValueError(f"--out {path} is a file; allowed: a folder, which is made if it is missing")
        path.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.earlier: list[EpisodeResult] = []
        self.torn = False
        self._machines: list[Mapping[str, str]] = [this_machine()]
        self._open = ExitStack()
        try:
            self._open.enter_context(locked(path))
            files = self._files()
            # What ended before its first line has left nothing to lose.
            overwrite = overwrite or not (resume or self._holds_results())
            if files and not overwrite and not resume:
                raise ValueError(
                    f"--out {path} already holds results; name another folder, or pass --resume to complete them or"
                    " --overwrite to replace them"
                )
            whole = self._take_up(record) if resume else 0
            self._lines = self._open.enter_context(open_to_append(path / EPISODES))
            if overwrite:
                self._clear()
            write_atomic(path / RUN, replace(record, machines=self._machines).to_json())
            self._lines.truncate(whole)
        except BaseException:
            self._open.close()
            raise

    def _files(self) -> list[Path]:
        """What a run has left, all of it ordinary files."""
        found = [file for name in (RUN, EPISODES, SUMMARY, TABLE, PAGE) if os.path.lexists(file := self.path / name)]
        require_ordinary(*found, *self.path.glob("plot_*.png"), *self.path.glob(f"{FOLDER}/*.parquet"))
        return found

    def _holds_results(self) -> bool:
        lines = self.path / EPISODES
        whole = any(os.path.lexists(self.path / name) for name in (SUMMARY, TABLE))
        return whole or (os.path.lexists(lines) and lines.stat().st_size > 0)

    def _take_up(self, record: RunRecord) -> int:
        """Read what a run left, all of which must be of this run; return how many bytes of lines are whole."""
        file = self.path / EPISODES
        try:
            content = read_bounded(file, LARGEST_LINES) if file.exists() else b""
        except ValueError as error:
            raise ValueError(f"{file}: {error}; {ANEW}") from None
        whole = content.rfind(b"\n") + 1
        found = RunRecord.read(self.path)
        if found is None and whole:
            raise ValueError(f"--out {self.path} holds result lines, but no {RUN} that says of which run; {ANEW}")
        differences = [] if found is None else record.differences(found)
        # A controller that failed before its first line may have been mended since.
        mended = {name.removeprefix(_HASH) for name, _, _ in differences if name.startswith(_HASH)}
        if len(mended) < len(differences):
            raise AnotherRun(self.path, differences)
        places = set()
        try:
            for number, line in read_lines(content):
                if foreign := record.line_differences(line):
                    raise ValueError(f"line {number} is of another run: {told(foreign)}")
                if line.place in places:
                    raise ValueError(f"line {number} repeats {line.scenario}, {line.policy}, episode {line.episode}")
                places.add(line.place)
                self.earlier.append(line)
        except ValueError as error:
            raise ValueError(f"{file} {error}; {ANEW}") from None
        if mended & {line.policy for line in self.earlier}:
            raise AnotherRun(self.path, differences)
        self.torn = len(content) > whole
        before = [] if found is None else list(found.machines)
        self._machines = before + [one for one in self._machines if one not in before]
        return whole

    def _clear(self) -> None:
        # The record goes first: lines without one are never taken up by mistake.
        (self.path / RUN).unlink(missing_ok=True)
        self._lines.truncate(0)
        traces = self.path.glob(f"{FOLDER}/*.parquet")
        for file in [*(self.path / name for name in (SUMMARY, TABLE, PAGE)), *self.path.glob("plot_*.png"), *traces]:
            file.unlink(missing_ok=True)

    def append(self, results: Iterable[EpisodeResult]) -> None:
        """Add result lines; they are on disk when this returns."""
        self._lines.write(b"".join(result.to_json().encode() + b"\n" for result in results))
        self._lines.flush()
        os.fsync(self._lines.fileno())

    def write(self, name: str, content: bytes | str) -> Path:
        """Write another file of the run atomically; return its path."""
        (self.path / name).parent.mkdir(exist_ok=True)
        write_atomic(self.path / name, content)
        return self.path / name

    def __enter__(self) -> ResultFolder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()
