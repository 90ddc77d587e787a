"""What files and pickles of others hold, as plain values: JSON as its standard has it, and arrays; all bounded."""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from lanekeep_env.checks import shown
from lanekeep_env.files import read_bounded

#: Levels of lists and mappings in each other that JSON may have: records have less than ten.
DEEPEST = 64
#: What arrays may be made of, by NumPy's letters: truth values, whole numbers, numbers, texts.
_KINDS = "biufU"
_VERSIONS: dict[tuple[int, int], Any] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def parse_json(content: bytes | str) -> Any:
    """Read JSON in which numbers are finite, no mapping has a name twice and nothing is nested beyond `DEEPEST`.

    Raises:
        ValueError: it is anything else; one line without the file, for the caller to put it in front.
    """
    text = content.decode() if isinstance(content, bytes) else content
    try:
        value = json.loads(
            text, parse_constant=_no_number, parse_float=_finite, parse_int=_whole, object_pairs_hook=_no_twins
        )
    except RecursionError:
        raise ValueError(f"it is nested deeper than {DEEPEST} levels") from None
    level = [value]
    for _ in range(DEEPEST):
        level = [one for part in level if isinstance(part, dict | list) for one in _entries(part)]
        if not level:
            return value
    raise ValueError(f"it is nested deeper than {DEEPEST} levels")


def json_able(value: Any) -> Any:
    """Return a keyword as JSON has it: paths as text, arrays and tuples as lists, records as mappings, an
    enumeration's member as its name in small letters, as ours are written."""
    if hasattr(value, "to_dict"):
        return json_able(value.to_dict())
    if is_dataclass(value) and not isinstance(value, type):
        return json_able(asdict(value))
    if isinstance(value, Mapping):
        return {str(key): json_able(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [json_able(one) for one in value]
    if isinstance(value, np.ndarray | np.generic):
        return json_able(value.tolist())
    if isinstance(value, Enum):
        return value.name.lower()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def _entries(part: dict[str, Any] | list[Any]) -> Any:
    return part.values() if isinstance(part, dict) else part


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is not allowed: numbers must be finite")


def _finite(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _no_number(shown(text))


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:  # Python reads some thousands of digits at the most
        raise ValueError(f"an integer of {len(text)} digits is not allowed") from None


def _no_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        seen: set[str] = set()
        twin = next(name for name, _ in pairs if name in seen or seen.add(name))  # type: ignore[func-returns-value]
        raise ValueError(f"{shown(twin)} appears twice")
    return values


def read_arrays(path: str | Path, largest: int) -> dict[str, np.ndarray]:
    """Read the arrays of an .npz file by name: truth values, numbers and texts; nothing is unpickled.

    Args:
        path: of an ordinary file.
        largest: bytes that the file may have, and all of its arrays together.

    Raises:
        ValueError: it is no such file; one line without the path, for the caller to put it in front.
        OSError: it is missing or may not be read.
    """
    content = read_bounded(path, largest)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            claimed = sum(member.file_size for member in members)
            if claimed > largest:
                raise ValueError(f"its arrays have {claimed} bytes, allowed are {largest}")
            names = [member.filename.removesuffix(".npy") for member in members]
            if len(set(names)) < len(names):
                raise ValueError("it has an array twice")
            return {name: _array(name, archive.read(member)) for name, member in zip(names, members, strict=True)}
    except ValueError as error:
        raise ValueError(_one_line(error)) from None
    except Exception as error:  # zipfile, zlib and what an array's header can bring NumPy to: errors of many kinds
        raise ValueError(f"it is not a whole .npz file ({_one_line(error) or type(error).__name__})") from None


def own(kept: dict[str, Any]) -> dict[str, Any]:
    """Return what a pickle kept, with arrays that kernels can write: from shared memory they come as they lie there."""
    return {
        k: np.require(v, requirements=("C", "A", "W", "E")) if isinstance(v, np.ndarray) else v for k, v in kept.items()
    }


def _array(name: str, data: bytes) -> np.ndarray:
    """Read one array; its header must not ask for more memory than there are bytes behind it."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version not in _VERSIONS:
        raise ValueError(f"{shown(name)} is of .npy version {version}, allowed are {list(_VERSIONS)}")
    shape, _, dtype = _VERSIONS[version](file)
    if dtype.kind not in _KINDS:
        raise ValueError(
            f"{shown(name)} has dtype {shown(str(dtype))}: allowed are numbers and texts, nothing is unpickled "
            "(allow_pickle=False)"
        )
    expected, found = math.prod(shape) * dtype.itemsize, len(data) - file.tell()
    if expected != found or min(shape, default=0) < 0:
        raise ValueError(f"{shown(name)} has {found} bytes where shape {shown(shape)} takes {expected}")
    file.seek(0)
    array: np.ndarray = np.lib.format.read_array(file, allow_pickle=False)
    return array


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]
