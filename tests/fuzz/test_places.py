"""A small draw of what `places.py` drives, and the harness itself."""

import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import places
import pytest
from harness import Watch, drive


@pytest.mark.parametrize("kind", ["road", "map", "car"])
def test_damaged_places_are_read_or_refused_in_one_line(kind):
    assert places.run(150, 7, kind, bombs=False) == []


def _raise(message):
    raise ValueError(message)


CASES = {
    "good": (lambda: None, None),
    "refused": (lambda: _raise("x=1 is not allowed"), None),
    "hangs": (lambda: time.sleep(60.0), "no end within"),
    "long": (lambda: _raise("x" * 2000), "an error of 2000 characters"),
    "lines": (lambda: _raise("a\u2028b"), "an error of 2 lines"),
    "empty": (lambda: _raise(""), "an error of 0 lines"),
    "escape": (lambda: _raise("\x1b[2J"), "cannot be printed"),
    "index": (lambda: [][0], "IndexError"),
    "large": (lambda: np.ones(1 << 24).sum(), "took 12"),
    "huge": (lambda: np.zeros(1 << 40), "MemoryError"),
    "dies": (lambda: os._exit(3), "the process ended with 3"),
    "good again": (lambda: None, None),
}


def test_the_harness_sees_every_kind_of_violation(capfd):
    found = drive(lambda case: case(), [(k, v[0]) for k, v in CASES.items()], seconds=0.5, memory=64 << 20, name="it")
    expected = {label: words for label, (_, words) in CASES.items() if words}
    assert [line.split(":")[0] for line in found] == list(expected)
    for line, words in zip(found, expected.values(), strict=True):
        assert words in line, line
    assert "it: 12 cases, 5 refused, 2 read" in capfd.readouterr().out


def test_the_watch_sees_what_is_opened_written_and_run(tmp_path):
    given = tmp_path / "given"
    given.write_text("x")
    with Watch() as watch:
        given.read_text()
        import colorsys  # noqa: F401  (a module's file does not count)
    watch.require_only(given)
    for strange in (
        lambda: (tmp_path / "other").write_text("y"),
        lambda: Path("/etc/hostname").open().close(),
        lambda: os.rename(given, tmp_path / "moved"),
        lambda: subprocess.run(["true"]),
        lambda: tempfile.mkdtemp(dir=tmp_path),
    ):
        with Watch() as watch:
            strange()
        with pytest.raises(AssertionError):
            watch.require_only(given)
