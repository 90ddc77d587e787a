"""Drawn damage to JSON, lines of JSON and .npz files that keeps their form."""

from __future__ import annotations

import io
import json
import struct
import warnings
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
from mutations import mutated

Rng = np.random.Generator
Damage = Callable[[bytes, Rng], bytes]


def nasty() -> list[Any]:
    """What takes the place of a value; texts in <> are written without their quotes."""
    deep: Any = 1
    for _ in range(300):
        deep = [deep]
    texts = [
        "",
        " ",
        "a\nb",
        "\0",
        "\ud800",
        "\x1b[2J",
        "x" * 100_000,
        "../x",
        "pd",
        "pd,pd",
        "slalom",
        "NaN",
        "MT19937",
    ]
    numbers = [0, 1, -1, 2, 3, 3.0, 0.0, -0.0, 1e-320, 1e30, 1e300, -1e308, 2**31, 2**53, 2**63, 10**18, 10**400]
    others = [
        True,
        False,
        None,
        [],
        {},
        [[]],
        [None],
        ["a", "a"],
        {"": ""},
        {"return": 1.0},
        {"tensor": "numbers"},
        deep,
    ]
    large = [list(range(3000)), {str(k): k for k in range(3000)}]
    raw = ["<NaN>", "<-Infinity>", "<1e999>", f"<{'9' * 5000}>", f"<{'[' * 100_000}>", "<01>", "<>"]
    return [*texts, *numbers, *others, *large, *raw]


NASTY = nasty()


def places(values: Any) -> list[tuple[Any, Any]]:
    """Every container with every key of it."""
    keys = list(values) if isinstance(values, dict) else range(len(values)) if isinstance(values, list) else ()
    return [pair for key in keys for pair in [(values, key), *places(values[key])]]


def damaged_json(text: bytes, rng: Rng) -> bytes:
    """Replace, remove, add or double a drawn value at a drawn place."""
    values = json.loads(text)
    found = places(values)
    container, key = found[rng.integers(len(found))]
    value = NASTY[rng.integers(len(NASTY))]
    change = rng.choice(["replace", "replace", "replace", "remove", "add", "double"])
    if change == "replace":
        container[key] = value
    elif change == "remove":
        del container[key]
    elif change == "add" and isinstance(container, dict):
        container["metrics" if rng.random() < 0.2 else "x" * int(rng.integers(100))] = value
    elif change == "add":
        container.insert(key, value)
    written = json.dumps(values)
    for raw in (one for one in NASTY if isinstance(one, str) and one.startswith("<")):
        written = written.replace(json.dumps(raw), raw[1:-1])
    if change == "double":
        written = written.replace("{", f"{{{json.dumps(str(key))}: {json.dumps(container[key])}, ", 1)
    return written.encode()


def damaged_lines(content: bytes, rng: Rng) -> bytes:
    """Damage one line, or double, swap or join lines."""
    lines = content.split(b"\n")
    a, b = (int(k) for k in rng.integers(len(lines) - 1, size=2))
    change = rng.random()
    if change < 0.7:
        lines[a] = damaged_json(lines[a], rng)
    elif change < 0.8:
        lines.insert(b, lines[a])
    elif change < 0.9:
        lines[a] = lines[a] + lines[b] * int(rng.integers(1, 300))
    else:
        lines[-1] = b"x" * int(rng.integers(1, 100_000))
    return b"\n".join(lines)


def damaged_array(array: np.ndarray, rng: Rng) -> np.ndarray:
    """Change numbers, type or shape of an array."""
    if array.dtype.kind == "U":
        return np.array(damaged_json(str(array).encode(), rng).decode()) if str(array).startswith("{") else array
    change, changed = rng.integers(7), array.copy().reshape(-1)
    if change < 3 and changed.size:
        some = rng.integers(changed.size, size=int(rng.integers(1, 4)))
        if array.dtype.kind == "f":
            changed[some] = rng.choice([np.nan, np.inf, -np.inf, -1.0, 0.0, 1e30, -1e30, 1e9, 5e-324])
        elif array.dtype.kind in "iu":
            changed[some] = np.array(rng.choice([-1, 0, 2**31, 2**62, -(2**62), 10**6])).astype(array.dtype)
        return changed.reshape(array.shape)
    if change == 3:
        return array.astype(rng.choice(["f2", "f4", "f8", "c16", "i8", "u1", "?", "U3", ">f8", "O"]))
    if change == 4:
        return np.asarray(array[None])
    if change == 5:
        return np.repeat(changed, 2)
    return changed[: changed.size // 2]


def damaged_npz(content: bytes, rng: Rng) -> bytes:
    """Change, remove, double, rename or inflate one array."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    place = int(rng.integers(len(members)))
    if rng.random() < 0.3:
        place = [name for name, _ in members].index("numbers.npy") if ("numbers.npy" in dict(members)) else place
    name, data = members[place]
    change = rng.random()
    if change < 0.6:
        array = damaged_array(np.load(io.BytesIO(data)), rng)
        written = io.BytesIO()
        np.save(written, array, allow_pickle=True)
        members[place] = name, written.getvalue()
    elif change < 0.7:
        members[place] = name, mutated(data, rng)
    elif change < 0.75:
        del members[place]
    elif change < 0.8:
        members.append((name if rng.random() < 0.5 else "x" * 300 + "\n.npy", data))
    elif change < 0.97:
        shape = rng.choice(["9" * 12, "-1", "1" * 400])
        header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape},), }}"
        members[place] = name, b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header.encode()
    else:
        members[place] = name, bytes(int(rng.integers(1, 200)) << 20)  # zeros, which take no room when packed
    made = io.BytesIO()
    warnings.simplefilter("ignore")  # of doubled names
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED if change >= 0.97 else zipfile.ZIP_STORED) as archive:
        for name, data in members:
            archive.writestr(name, data)
    return made.getvalue()
