"""Drawn damage to a file's content."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: What takes the place of a word, or is put between two.
NASTY = (
    *b"nan -nan NaN inf -inf +Infinity 1e999 -1e999 1e308 1e300 1e-320 -0 0 -1 0x10 1_000 1,5 1e 1/0 --1 +1".split(),
    *b"True false null None ~ {} [] () ; , : - ? | > % @ ` \" ' \\ # & * ! .. . / ~root %s%n{0} 2001-01-01".split(),
    *b"& &a *a <<: !!int !!python/name:os !!str !".split(),
    *(b"!!bool foo", b"!!int ''", b"!!timestamp foo", b"!!binary x", b"!!float ''", b"!!set {a}", b"!!omap [a: 1]"),
    *(word.encode() for word in ("\u0661\u0662", "\uff11", "\u00bd", "\u2028", "\u0085", "\u202e")),
    *(b"", b"/dev/zero", b"/dev/stdin", b"\0", b"\0" * 300, b"\r", b"\r\n", b"\n", b"\n---\n", b"\t", b"\x1b[2J"),
    *(b"\xff\xfe", b"\xef\xbb\xbf", b"\xc0\x80", b"\xed\xa0\x80"),
    *(b"9" * 400, b"-" + b"9" * 400, b"9" * 5000, b"0" * 400, b"1." + b"0" * 400, b"x" * 10_000),
    *(b"[" * 2000, b"{a: " * 500, b"[" * 50 + b"]" * 50, b"(" * 500, b"- " * 500),
)
_ENCODINGS = ("utf-16", "utf-16-le", "utf-32", "utf-8-sig", "utf-7", "cp037")


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Return ``content`` with one to four drawn changes."""
    for _ in range(rng.integers(1, 5)):
        content = _CHANGES[rng.integers(len(_CHANGES))](content, rng)
    return content


def _span(content: bytes, rng: np.random.Generator, longest: int = 1 << 30) -> tuple[int, int]:
    begin = int(rng.integers(len(content) + 1))
    return begin, begin + int(rng.integers(min(len(content) - begin, longest) + 1))


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(rng.integers(1, 9) if content else 0):
        changed[rng.integers(len(changed))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(len(content) + 1)]


def _insert(content: bytes, rng: np.random.Generator) -> bytes:
    place = int(rng.integers(len(content) + 1))
    added = rng.bytes(int(rng.integers(1, 40))) if rng.random() < 0.5 else NASTY[rng.integers(len(NASTY))]
    return content[:place] + added + content[place:]


def _remove(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _span(content, rng, 200)
    return content[:begin] + content[end:]


def _double(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _span(content, rng, 5000)
    return content[:end] + content[begin:end] * int(rng.integers(1, 20)) + content[end:]


def _splice(content: bytes, rng: np.random.Generator) -> bytes:
    begin, end = _span(content, rng)
    place = int(rng.integers(len(content) + 1))
    return content[:place] + content[begin:end]


def _swap_lines(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    a, b = rng.integers(len(lines), size=2)
    lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def _replace_word(content: bytes, rng: np.random.Generator) -> bytes:
    """Put something nasty in the place of what stands between two drawn separators."""
    marks = [0, *(k + 1 for k, byte in enumerate(content[:100_000]) if byte in b" \t\r\n,;:[]{}=\"'"), len(content) + 1]
    k = int(rng.integers(len(marks) - 1))
    return content[: marks[k]] + NASTY[rng.integers(len(NASTY))] + content[marks[k + 1] - 1 :]


def _recode(content: bytes, rng: np.random.Generator) -> bytes:
    text = content.decode("latin-1")
    return text.encode(_ENCODINGS[rng.integers(len(_ENCODINGS))], "replace")


_CHANGES: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    *(_flip, _cut, _insert, _insert, _remove, _double, _splice, _swap_lines),
    *(_replace_word, _replace_word, _replace_word, _recode),
)
