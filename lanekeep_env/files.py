"""Files: whole or not at all when written, ordinary and bounded when read."""

from __future__ import annotations

import os
import stat
from pathlib import Path


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
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        _ordinary(status)
        content = b"" if status.st_size > largest else file.read(largest + 1)
    if max(status.st_size, len(content)) > largest:
        raise ValueError(f"it has {max(status.st_size, len(content))} bytes, allowed are {largest}")
    return content


def _ordinary(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is not an ordinary file")


def write_atomic(path: Path, content: bytes | str) -> None:
    """Write a file so that a reader sees all of it or nothing; what a killed writer left is written over."""
    data = content.encode() if isinstance(content, str) else content
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
