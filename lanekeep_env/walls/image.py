"""Grey pictures of maps: PGM (P2, P5) read here, PNG by Pillow."""

from __future__ import annotations

import io
import re
import warnings
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.checks import shown
from lanekeep_env.walls.world import Floats

#: Most cells that a map may have: 300 m x 300 m of 5 cm. Large maps of buildings have 4000 x 4000.
MOST_CELLS = 36_000_000
#: Most bytes that a picture's file may have: that many cells in P2 of five digits and a blank each, and comments.
LARGEST_PICTURE = 6 * MOST_CELLS + (1 << 20)

_HEADER = re.compile(rb"(P[25])" + rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})" * 3 + rb"\s")
# The header with its comments, bytes; and how much of P2 is read at a time.
_LONGEST_HEADER = 1 << 16
_BLOCK = 1 << 20
_BLANK = re.compile(rb"\s")

Levels = NDArray[np.uint8] | NDArray[np.uint16]
Numbers = TypeVar("Numbers", bound=NDArray[Any])


@dataclass(frozen=True)
class Grey:
    """A grey picture: the level of each cell, rows from the top, and the brightness of each level, 0 to 1 (white)."""

    levels: Levels
    brightness: Floats


def read_grey(data: bytes, name: str, with_alpha: bool = False) -> Grey:
    """Read the content of a PGM or PNG file.

    Args:
        data: of the file.
        name: what errors call it.
        with_alpha: whether the alpha channel counts as a fourth colour, as map_server has it in its mode trinary.

    Raises:
        ValueError: it is no such picture, too large or incomplete.
    """
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return _read_png(data, name, with_alpha)
    if data[:2] not in (b"P2", b"P5"):
        raise ValueError(f"{name} is neither PGM (P2, P5) nor PNG")
    return _read_pgm(data, name)


def _check_size(width: int, height: int, name: str) -> None:
    if width < 1 or height < 1 or width * height > MOST_CELLS:
        raise ValueError(f"{name} is {width} x {height} cells; allowed are 1 to {MOST_CELLS} cells")


def _read_pgm(data: bytes, name: str) -> Grey:
    header = _HEADER.match(data[:_LONGEST_HEADER])
    if header is None:
        raise ValueError(f"{name}: the PGM header is not 'P2' or 'P5', width, height, largest value")
    width, height, largest = (int(group) for group in header.groups()[1:])
    _check_size(width, height, name)
    if not 1 <= largest <= 65535:
        raise ValueError(f"{name}: the largest value {largest} is not allowed: it must be 1 to 65535")
    read = _binary if header[1] == b"P5" else _plain
    levels = read(data, header.end(), width, height, largest, name)
    return Grey(levels.reshape(height, width), np.arange(largest + 1) / largest)


def _binary(data: bytes, begin: int, width: int, height: int, largest: int, name: str) -> Levels:
    """Levels of P5: one byte each, or two, the higher first."""
    size, count = 1 if largest < 256 else 2, width * height
    if len(data) - begin < count * size:
        need = f"{width} x {height} cells need {count * size} bytes"
        raise ValueError(f"{name} is cut off: {len(data) - begin} bytes of data, {need}")
    return _within(
        np.frombuffer(data, dtype=">u2" if size == 2 else np.uint8, count=count, offset=begin), largest, name
    )


def _plain(data: bytes, begin: int, width: int, height: int, largest: int, name: str) -> Levels:
    """Levels of P2: whole numbers between blanks; block by block, as all the words at once take a lot of memory."""
    if data.find(b"#", begin) >= 0:
        data, begin = re.sub(rb"#[^\r\n]*", b"", data[begin:]), 0
    levels, done = np.empty(width * height, np.uint16), 0
    while done < len(levels):
        if begin >= len(data):
            raise ValueError(f"{name} is cut off: {done} values, {width} x {height} cells need {len(levels)}")
        blank = _BLANK.search(data, begin + _BLOCK)
        end = blank.start() if blank else len(data)
        values = _whole_numbers(data[begin:end].strip(), len(levels) - done, largest, name)
        levels[done : done + len(values)] = values
        done, begin = done + len(values), end + 1
    return levels


def _whole_numbers(block: bytes, most: int, largest: int, name: str) -> NDArray[np.int64]:
    """At most so many first numbers of a block; what follows them is nobody's."""
    if block.translate(None, b"0123456789 \t\n\r\v\f"):
        words = block.split()[:most]
        bad = next((word for word in words if not word.isdigit()), None)
        if bad is not None:
            raise ValueError(
                f"{name}: {shown(bad.decode('ascii', 'replace'))} is not a whole number from 0 to {largest}"
            )
        block = b" ".join(words)
    # One too large for the integers becomes the largest of them.
    values = np.fromstring(block, dtype=np.int64, sep=" ")[:most]
    return _within(values, largest, name)


def _within(levels: Numbers, largest: int, name: str) -> Numbers:
    if levels.max(initial=0) > largest:
        raise ValueError(f"{name}: a value of {levels.max()} is above the largest value {largest} of its header")
    return levels


def _read_png(data: bytes, name: str, with_alpha: bool) -> Grey:
    try:
        from PIL import Image
    except ImportError:
        raise ValueError(f"{name}: PNG needs Pillow: pip install 'lanekeep[maps]' (or convert it to PGM)") from None
    try:
        with warnings.catch_warnings():
            # The size is checked below, before anything is unpacked.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            picture = Image.open(io.BytesIO(data), formats=["PNG"])
    except Exception as error:
        raise ValueError(f"{name} is not a whole PNG picture: {shown(str(error))}") from None
    _check_size(picture.width, picture.height, name)
    try:
        picture.load()
        if picture.mode.startswith("I"):
            return Grey(np.asarray(picture, dtype=np.uint16), np.arange(65536) / 65535.0)
        alpha = with_alpha and (picture.mode in ("LA", "PA", "RGBA") or "transparency" in picture.info)
        colours = np.asarray(picture.convert("RGBA" if alpha else "RGB"))
    except Exception as error:
        raise ValueError(f"{name} is not a whole PNG picture: {shown(str(error))}") from None
    # The mean of the three colours, or of these and alpha.
    count = colours.shape[2]
    return Grey(colours.sum(axis=2, dtype=np.uint16), np.arange(count * 255 + 1) / float(count) / 255.0)
