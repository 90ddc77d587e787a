"""JSON and arrays of others: what is whole is read as the standard readers do, what is not is one line."""

from __future__ import annotations

import io
import json
import os
import struct
import threading
import zipfile

import numpy as np
import pytest

from lanekeep_env.files import locked, open_to_append, require_ordinary, write_atomic
from lanekeep_env.plain import DEEPEST, parse_json, read_arrays


def drawn(rng, depth=0):
    """A value as JSON has it."""
    kind = rng.integers(7 if depth < 4 else 5)
    if kind == 0:
        return [None, True, False][rng.integers(3)]
    if kind == 1:
        return int(rng.integers(-(2**62), 2**62))
    if kind in (2, 3):
        return float(rng.normal() * 10.0 ** rng.integers(-300, 300))
    if kind == 4:
        return "".join(chr(rng.integers(1, 0x2FFF)) for _ in range(rng.integers(5)))
    if kind == 5:
        return [drawn(rng, depth + 1) for _ in range(rng.integers(4))]
    return {f"{k}{rng.integers(100)}": drawn(rng, depth + 1) for k in range(rng.integers(4))}


def test_plain_json_is_read_as_pythons_reader_reads_it():
    rng = np.random.default_rng(0)
    for _ in range(500):
        text = json.dumps(drawn(rng), ensure_ascii=bool(rng.integers(2)))
        assert parse_json(text.encode()) == json.loads(text) == parse_json(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"NaN", "NaN is not allowed"),
        (b'{"a": [-Infinity]}', "-Infinity is not allowed"),
        (b"1e999", "1e999"),
        (b"9" * 5000, "an integer of 5000 digits"),
        (b'{"a": 1, "b": 2, "a": 1}', "'a' appears twice"),
        (b'{"' + b"x" * 10_000 + b'": 1, "' + b"x" * 10_000 + b'": 1}', "appears twice"),
        (b"[" * 100_000, "nested deeper"),
        (b"[" * 65 + b"]" * 65, "nested deeper"),
        (b'{"a":' * 65 + b"1" + b"}" * 65, "nested deeper"),
        (b'"\xff"', "utf-8"),
        ("[1]".encode("utf-16"), "utf-8"),
        (b"", "Expecting value"),
        (b"[1] [1]", "Extra data"),
    ],
)
def test_what_is_no_plain_json_is_one_short_line(text, words):
    with pytest.raises(ValueError) as error:
        parse_json(text)
    assert words in str(error.value) and "\n" not in str(error.value) and len(str(error.value)) < 200


def test_the_deepest_json_is_read():
    text = "[" * (DEEPEST - 1) + "1" + "]" * (DEEPEST - 1)
    assert parse_json(text) == json.loads(text)


def packed(path, compression=zipfile.ZIP_STORED, **members):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return path


def npy(array):
    content = io.BytesIO()
    np.save(content, array, allow_pickle=True)
    return content.getvalue()


def header(text):
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text.encode()


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_are_read_as_numpy_reads_them(save, tmp_path):
    rng = np.random.default_rng(0)
    arrays = {
        "a": rng.normal(size=(3, 4)),
        "b": np.asfortranarray(rng.normal(size=(5, 2)).astype("f4")),
        "c": rng.integers(0, 9, size=7),
        "d": np.array("text é"),
        "e": np.zeros((0, 3)),
        "f": np.array([True, False]),
        "g": np.array(3.5, dtype=">f8"),
    }
    save(tmp_path / "x.npz", **arrays)
    found = read_arrays(tmp_path / "x.npz", 10_000)
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype


HUGE = "{'descr': '<f8', 'fortran_order': False, 'shape': (999999999999,), }"


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"a": npy(np.array([object()]))}, "allow_pickle"),
        ({"a": npy(np.zeros(3, dtype="c16"))}, "dtype 'complex128'"),
        ({"a": npy(np.zeros(3, dtype=[("x", "f8")]))}, "dtype"),
        ({"a": header(HUGE)}, "takes 7999999999992"),
        ({"a": header(HUGE.replace("999999999999", "-1"))}, "takes -8"),
        ({"a": header(HUGE.replace("999999999999", "9" * 5000))}, ""),
        ({"a": header(HUGE.replace("<f8", "|V999999999"))}, "dtype"),
        ({"a": header("(" * 3000)}, ""),
        ({"a": npy(np.zeros(3))[:-1]}, "has 23 bytes"),
        ({"a": npy(np.zeros(3)) + b"x"}, "has 25 bytes"),
        ({"a": b"\x93NUMPY\3\0" + b" " * 100}, "version"),
        ({"a": b"no array"}, ""),
    ],
)
def test_arrays_that_lie_are_refused(members, words, tmp_path):
    with pytest.raises(ValueError) as error:
        read_arrays(packed(tmp_path / "x.npz", **members), 1 << 20)
    assert words in str(error.value) and "\n" not in str(error.value) and len(str(error.value)) < 300


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    bomb = packed(tmp_path / "bomb.npz", zipfile.ZIP_DEFLATED, a=bytes(100 << 20))
    assert bomb.stat().st_size < 200_000
    with pytest.raises(ValueError, match="its arrays have 104857600 bytes, allowed are 1000000"):
        read_arrays(bomb, 1_000_000)


def test_a_bomb_that_states_another_size_gives_no_more_than_that(tmp_path):
    content = packed(tmp_path / "bomb.npz", zipfile.ZIP_DEFLATED, a=bytes(64 << 20)).read_bytes()
    (tmp_path / "bomb.npz").write_bytes(content.replace(struct.pack("<I", 64 << 20), struct.pack("<I", 1000)))
    with pytest.raises(ValueError):
        read_arrays(tmp_path / "bomb.npz", 1_000_000)


def test_a_file_that_is_cut_off_anywhere_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "x.npz", a=np.arange(100.0), b=np.array("text"))
    content = (tmp_path / "x.npz").read_bytes()
    for length in range(len(content)):
        (tmp_path / "x.npz").write_bytes(content[:length])
        with pytest.raises(ValueError):
            read_arrays(tmp_path / "x.npz", 1 << 20)


def test_a_folder_is_locked_until_its_holder_ends(tmp_path):
    pytest.importorskip("fcntl")
    with locked(tmp_path):
        with pytest.raises(ValueError, match="another process is writing there"), locked(tmp_path):
            pass
        assert list(tmp_path.iterdir()) == []
    with locked(tmp_path):
        pass


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes")
def test_nothing_but_an_ordinary_file_is_appended_to(tmp_path):
    victim = tmp_path / "victim"
    victim.write_bytes(b"mine")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(victim)
    (tmp_path / "broken").symlink_to(tmp_path / "nowhere")
    (tmp_path / "device").symlink_to("/dev/null")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "link", "broken", "device", "folder"):
        with pytest.raises(ValueError, match="not an ordinary file"):
            open_to_append(tmp_path / name)
        with pytest.raises(ValueError, match="not an ordinary file"):
            require_ordinary(victim, tmp_path / name)
    # Nor where somebody reads the pipe.
    reader = threading.Thread(target=lambda: os.close(os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)))
    reader.start()
    with pytest.raises(ValueError, match="not an ordinary file"):
        open_to_append(tmp_path / "pipe")
    reader.join()
    with open_to_append(victim) as file:
        file.write(b" and more")
    with open_to_append(tmp_path / "new") as file:
        file.write(b"new")
    assert victim.read_bytes() == b"mine and more" and (tmp_path / "new").read_bytes() == b"new"
    require_ordinary(victim, tmp_path / "missing")


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="links")
def test_a_link_in_the_way_of_an_atomic_write_is_not_followed(tmp_path):
    victim = tmp_path / "victim"
    victim.write_bytes(b"mine")
    (tmp_path / ".run.json.tmp").symlink_to(victim)
    write_atomic(tmp_path / "run.json", "new")
    assert victim.read_bytes() == b"mine" and (tmp_path / "run.json").read_text() == "new"
