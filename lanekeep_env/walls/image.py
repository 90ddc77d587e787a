"""Grey pictures of maps: PGM (P2, P5) read here, PNG by Pillow."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from lanekeep_env.walls.world import Floats

#: Most cells that a map may have.
MOST_CELLS = 36_000_000

_HEADER = re.compile(rb"(P[25])" + rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})" * 3 + rb"\s")


def read_grey(path: Path, name: str) -> Floats:
    """Return the brightness of a PGM or PNG picture, 0 (black) to 1 (white), rows from the top, (rows, columns).

    Args:
        path: of the picture.
        name: what errors call it.

    Raises:
        ValueError: a file that cannot be read, is no such picture, too large or incomplete.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ValueError(f"{name} cannot be read: {error.strerror}") from None
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return _read_png(path, name)
    if data[:2] not in (b"P2", b"P5"):
        raise ValueError(f"{name} is neither PGM (P2, P5) nor PNG")
    return _read_pgm(data, name)


def _check_size(width: int, height: int, name: str) -> None:
    if width < 1 or height < 1 or width * height > MOST_CELLS:
        raise ValueError(f"{name} is {width} x {height} cells; allowed are 1 to {MOST_CELLS} cells")


def _read_pgm(data: bytes, name: str) -> Floats:
    header = _HEADER.match(data)
    if header is None:
        raise ValueError(f"{name}: the PGM header is not 'P2' or 'P5', width, height, largest value")
    width, height, largest = (int(group) for group in header.groups()[1:])
    _check_size(width, height, name)
    if not 1 <= largest <= 65535:
        raise ValueError(f"{name}: the largest value {largest} is not allowed: it must be 1 to 65535")
    rest, count = data[header.end() :], width * height
    if header[1] == b"P5":
        size = 1 if largest < 256 else 2
        if len(rest) < count * size:
            need = f"{width} x {height} cells need {count * size} bytes"
            raise ValueError(f"{name} is cut off: {len(rest)} bytes of data, {need}")
        values = np.frombuffer(rest, dtype=">u2" if size == 2 else np.uint8, count=count)
    else:
        words = re.sub(rb"#[^\r\n]*", b"", rest).split()
        if len(words) < count:
            raise ValueError(f"{name} is cut off: {len(words)} values, {width} x {height} cells need {count}")
        bad = next((word for word in words[:count] if not (word.isdigit() and len(word) <= 5)), None)
        if bad is not None:
            text = bad[:20].decode("ascii", "replace")
            raise ValueError(f"{name}: {text!r} is not a whole number from 0 to {largest}")
        values = np.array(words[:count], dtype=np.int64)
    if values.max() > largest:
        raise ValueError(f"{name}: a value of {values.max()} is above the largest value {largest} of its header")
    return values.reshape(height, width) / largest


def _read_png(path: Path, name: str) -> Floats:
    try:
        from PIL import Image
    except ImportError:
        raise ValueError(f"{name}: PNG needs Pillow: pip install 'lanekeep[maps]' (or convert it to PGM)") from None
    try:
        with warnings.catch_warnings():
            # The size is checked below, before anything is unpacked.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path, formats=["PNG"]) as picture:
                _check_size(picture.width, picture.height, name)
                picture.load()
                if picture.mode.startswith("I"):
                    return np.asarray(picture, dtype=np.float64) / 65535.0
                return np.asarray(picture.convert("RGB"), dtype=np.float64).mean(axis=2) / 255.0
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"{name} is not a whole PNG picture: {error}") from None
