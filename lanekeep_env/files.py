"""Files: whole or not at all when written, ordinary and bounded when read."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

if sys.platform != "win32":
    import fcntl

_NO_WAIT = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def read_bounded(path: str | Path, largest: int) -> bytes:
    """Return the content of an ordinary file of at most ``largest`` bytes.

    Pipes, devices and folders are told before they are opened, and no more is read than is allowed, whatever size the
    file says that it has.

    Raises:
        ValueError: what is there is no ordinary file, or too large a one; one line without the path, for the caller to
            put it in front.
        OSError: it is missing or may not be read.
    """
    _ordinary(os.stat(path))
    # Whatever took the file's place in between: opened so, not even a pipe waits.
    descriptor = os.open(path, os.O_RDONLY | _NO_WAIT)
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        _ordinary(status)
        content = b"" if status.st_size > largest else file.read(largest + 1)
    if max(status.st_size, len(content)) > largest:
        raise ValueError(f"it has {max(status.st_size, len(content))} bytes, allowed are {largest}")
    return content


def require_ordinary(*paths: Path) -> None:
    """Raise ValueError, one line, for the first of the paths at which there is something else than an ordinary file."""
    for path in paths:
        if os.path.lexists(path) and not stat.S_ISREG(os.lstat(path).st_mode):
            raise ValueError(f"{path} is not an ordinary file; name another folder")


def _ordinary(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is not an ordinary file")


def open_to_append(path: Path) -> BinaryIO:
    """Open an ordinary file for more at its end, a new one where there is none; a link is not followed.

    Raises:
        ValueError: what is there is no ordinary file; one line without the path, for the caller to put it in front.
        OSError: it may not be written.
    """
    if os.path.lexists(path):
        _ordinary(os.lstat(path))
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | _NO_WAIT
    file = os.fdopen(os.open(path, flags, 0o666), "ab")
    try:
        _ordinary(os.fstat(file.fileno()))
    except ValueError:
        file.close()
        raise
    return file


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes that lock ``folder`` out until this context or this process ends, in whatever way it ends.

    Nothing is written for it. Where the system or its disk has no locks there is none.

    Raises:
        ValueError: another process has locked it.
    """
    if sys.platform == "win32":
        yield
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(
                f"{folder}: another process is writing there; wait for it, or name another folder"
            ) from None
        except OSError:
            pass  # a file system without locks
        yield
    finally:
        os.close(descriptor)


def write_atomic(path: Path, content: bytes | str) -> None:
    """Write a file so that a reader sees all of it or nothing; what a killed writer left is written over.

    Raises:
        OSError: it cannot be written; the error names ``path``, not the file beside it.
    """
    data = content.encode() if isinstance(content, str) else content
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        temporary.unlink(missing_ok=True)
        with temporary.open("xb") as file:  # never through a link that somebody has put there
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
