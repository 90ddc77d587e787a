"""Broken and hostile files: making them, and watching what a reader does with them.

Scripts beside this file import it as ``harness``; so do tests (pytest's ``pythonpath`` names this folder).
"""

from __future__ import annotations

import io
import multiprocessing
import os
import resource
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from mutations import mutated

__all__ = ["GIB", "Watch", "drive", "mutated", "special_files"]

GIB = 1 << 30

#: Longest error, characters.
LONGEST_MESSAGE = 1500

#: How much longer than the processor's time a case may take by the clock.
PATIENCE = 10.0


def special_files(folder: Path) -> Iterator[tuple[str, Path]]:
    """Make files that are none, or are endless or empty, in ``folder``; yield what each is and its path.

    Who runs as root may read the unreadable one: it holds text that is no format of ours.
    """
    pipe = folder / "pipe"
    os.mkfifo(pipe)
    yield "a pipe", pipe
    for device in ("zero", "tty", "full", "null"):
        if Path("/dev", device).exists():
            link = folder / f"link_to_{device}"
            link.symlink_to(f"/dev/{device}")
            yield f"a link to /dev/{device}", link
    (folder / "folder").mkdir()
    yield "a folder", folder / "folder"
    with (folder / "sparse").open("wb") as file:
        file.truncate(200 << 20)
    yield "200 MiB that are not there", folder / "sparse"
    yield "a missing file", folder / "missing"
    unreadable = folder / "unreadable"
    unreadable.write_bytes(b"\x01 nobody's format")
    unreadable.chmod(0)
    yield "an unreadable file", unreadable
    loop = folder / "loop"
    loop.symlink_to(loop)
    yield "a link to itself", loop
    (folder / "nuls").write_bytes(bytes(10_000))
    yield "NULs", folder / "nuls"
    (folder / "empty").write_bytes(b"")
    yield "an empty file", folder / "empty"
    yield "a name of 300 characters", folder / ("n" * 300)


_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGING = {"os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod", "os.link", "os.symlink"}
_RUNNING = {
    *("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.fork", "socket.connect", "socket.bind"),
    "pickle.find_class",
}


@dataclass
class Watch:
    """What Python opens, changes and runs while a ``with`` block lasts (what C and Rust libraries open is not seen).

    Attributes:
        read, written: real paths of the files opened; ``written`` also holds those created, removed or renamed.
        run: audit events of processes, connections and unpickled names, each with its arguments.

    Modules and compiled code that are loaded on the way do not count: reads below Python's own folders, the packages'
    and ``/proc``; writes below the kernels' cache and ``__pycache__``.
    """

    read: list[str] = field(default_factory=list)
    written: list[str] = field(default_factory=list)
    run: list[str] = field(default_factory=list)

    def __enter__(self) -> Watch:
        global _watching
        if not _hooked:
            sys.addaudithook(_hook)
            _hooked.append(True)
        _watching = self
        return self

    def __exit__(self, *_: object) -> None:
        global _watching
        _watching = None

    def require_only(self, *paths: str | Path) -> None:
        """Raise AssertionError if anything but reading ``paths`` was done."""
        strange = set(self.read) - {os.path.realpath(path) for path in paths}
        assert not strange, f"opened {sorted(strange)}"
        assert not self.written, f"wrote {self.written}"
        assert not self.run, f"ran {self.run}"

    def note(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Note an audit event."""
        if event in _RUNNING:
            if not (event == "pickle.find_class" and _is_cached(*arguments)):
                self.run.append(f"{event} {arguments!r}"[:300])
        elif event == "open" or event in _CHANGING:
            for path in arguments[: 2 if event in ("os.rename", "os.link", "os.symlink") else 1]:
                if isinstance(path, str | bytes | os.PathLike):
                    self._note_file(os.path.realpath(os.fsdecode(path)), event, arguments)

    def _note_file(self, path: str, event: str, arguments: tuple[Any, ...]) -> None:
        mode, flags = (arguments[1] or "", arguments[2] or 0) if event == "open" else ("w", 0)
        if any(letter in mode for letter in "wax+") or flags & _WRITING:
            if not (_below(path, _CACHES) or "/__pycache__" in path):
                self.written.append(path)
        elif not _below(path, _OWN):
            self.read.append(path)


_hooked: list[bool] = []
_watching: Watch | None = None

_ROOT = Path(__file__).resolve().parents[2]
_CACHES = tuple(
    os.path.realpath(folder)
    for folder in (os.environ.get("LANEKEEP_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME"), Path.home() / ".cache")
    if folder
)
_OWN = (
    *(os.path.realpath(path) for path in (sys.prefix, sys.base_prefix, *filter(None, sys.path))),
    *(str(_ROOT / name) for name in ("lanekeep_env", "baselines", "agents", "benchmarks", "tests")),
    *("/proc", "/sys", "/dev/urandom", "/usr/lib", "/lib"),
    *_CACHES,
)


def _below(path: str, folders: Iterable[str]) -> bool:
    return any(path == folder or path.startswith(folder.rstrip("/") + "/") for folder in folders)


def _is_cached(module: str, name: str) -> bool:
    """Whether numba's cache of compiled code holds such objects."""
    packages = ("numba", "llvmlite", "numpy", "lanekeep_env", "lanekeep_baselines")
    return module.split(".")[0] in packages or (module, name) in (("copyreg", "_reconstructor"), ("builtins", "object"))


def _hook(event: str, arguments: tuple[Any, ...]) -> None:
    if _watching is not None:
        _watching.note(event, arguments)


def drive(
    check: Callable[[Any], object],
    cases: Iterable[tuple[str, Any]],
    seconds: float = 10.0,
    memory: int = GIB,
    name: str = "",
    refusals: tuple[type[Exception], ...] = (ValueError,),
) -> list[str]:
    """Run a check on each case (label, argument) in a forked process; print one line; return the violations.

    A check reads something of others. It may return, or raise one of ``refusals`` with one printable line of at most
    `LONGEST_MESSAGE` characters. Any other exception (an AssertionError of the check's own is one), more than
    ``seconds`` of the processor's time, `PATIENCE` times that by the clock (then the process is killed: it hangs,
    however busy the machine is), a growth of more than ``memory`` bytes, or the end of the process, is a violation
    that begins with the case's label.
    """
    cases = list(cases)
    reports: list[_Report] = []
    while len(reports) < len(cases):
        reports += _batch(check, cases, len(reports), seconds, memory, refusals)
    found = [f"{label}: {r.fault}" for (label, _), r in zip(cases, reports, strict=True) if r.fault]
    slowest = max(range(len(cases)), key=lambda k: reports[k].seconds, default=None)
    print(
        f"{name or check.__name__}: {len(cases)} cases, {sum(r.refused for r in reports)} refused, "
        f"{sum(not r.refused and not r.fault for r in reports)} read, "
        + (f"slowest {reports[slowest].seconds:.2f} s ({cases[slowest][0]}), " if slowest is not None else "")
        + f"peak {max((r.peak for r in reports), default=0) / 2**20:.0f} MiB, {len(found)} violations",
        flush=True,
    )
    for line in found:
        print(f"  violation: {line}"[:LONGEST_MESSAGE], flush=True)
    return found


class _Report(NamedTuple):
    refused: bool = False
    fault: str = ""
    seconds: float = 0.0
    peak: int = 0


def _batch(
    check: Callable[[Any], object],
    cases: Sequence[tuple[str, Any]],
    first: int,
    seconds: float,
    memory: int,
    refusals: tuple[type[Exception], ...],
) -> list[_Report]:
    """Run cases from ``first`` on in one process, until the end or the first that it does not survive."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(check, cases[first:], memory, refusals, sender))
    process.start()
    sender.close()
    reports: list[_Report] = []
    try:
        while first + len(reports) < len(cases):
            if not receiver.poll(PATIENCE * seconds):
                return [*reports, _Report(fault=f"no end within {PATIENCE * seconds:g} s", seconds=seconds)]
            report = receiver.recv()
            if report.seconds > seconds and not report.fault:
                report = report._replace(fault=f"took {report.seconds:.1f} s")
            reports.append(report)
        return reports
    except EOFError:
        process.join()
        return [*reports, _Report(fault=f"the process ended with {process.exitcode}")]
    finally:
        process.kill()
        process.join()
        receiver.close()


def _work(
    check: Callable[[Any], object],
    cases: Sequence[tuple[str, Any]],
    memory: int,
    refusals: tuple[type[Exception], ...],
    sender: Connection,
) -> None:
    sys.stdout = io.StringIO()
    # A bomb ends in a MemoryError and not in a machine that swaps.
    limit = _status("VmSize") + 4 * memory
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for _, argument in cases:
        before, begin = _status("VmRSS"), time.process_time()
        with suppress(OSError):  # forget the peak so far
            Path("/proc/self/clear_refs").write_text("5")
        refused, fault = False, ""
        try:
            check(argument)
        except refusals as error:
            refused, fault = True, _message_fault(str(error))
        except BaseException as error:
            fault = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
        taken, peak = time.process_time() - begin, max(0, _status("VmHWM") - before)
        if peak > memory and not fault:
            fault = f"took {peak / 2**20:.0f} MiB"
        sender.send(_Report(refused, fault, taken, peak))


def _message_fault(message: str) -> str:
    if not message.strip() or len(message.splitlines()) != 1:
        return f"an error of {len(message.splitlines())} lines: {message[:200]!r}"
    if len(message) > LONGEST_MESSAGE:
        return f"an error of {len(message)} characters: {message[:200]!r}"
    if not message.isprintable():
        return f"an error that cannot be printed: {message[:200]!r}"
    return ""


def _status(key: str) -> int:
    """A size of this process in bytes: VmRSS now, VmHWM at most, VmSize with what is only reserved."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key + ":"):
            return 1024 * int(line.split()[1])
    raise OSError(f"/proc/self/status has no {key}")
