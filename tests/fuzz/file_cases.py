"""What damaged files of all kinds share: a case, which writes a file and reads it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

Case = tuple[str, Callable[[], object]]


def with_file(path: Path, content: bytes, read: Callable[[Path], None]) -> Callable[[], None]:
    def case() -> None:
        path.write_bytes(content)
        read(path)

    return case
