"""Contenders in turns, round after round, and the ratios within rounds."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

from lanekeep_benchmarks.speed.contenders import Contender


class Ratio(NamedTuple):
    """Times as fast: the median over rounds, the smallest and the largest."""

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class Measured:
    """A group's result.

    Attributes:
        rates: env-steps/s by name, medians.
        ratios: of each contender that is no rival, to each rival, by names.
    """

    rates: Mapping[str, float]
    ratios: Mapping[str, Mapping[str, Ratio]]


def measure(
    contenders: Sequence[Contender], rounds: int, seconds: float, report: Callable[[str], None] = lambda text: None
) -> Measured:
    """Let every contender run for about so many seconds in each round, after one that is not counted."""
    calls = {}
    for one in contenders:
        report(one.name)
        calls[one.name] = _calls(one, seconds)
    found: list[dict[str, float]] = []
    for number in range(rounds):
        report(f"round {number + 1} of {rounds}")
        order = contenders if number % 2 == 0 else contenders[::-1]
        found.append({one.name: _rate(one, calls[one.name]) for one in order})
    return compared(contenders, found)


def compared(contenders: Sequence[Contender], rounds: Sequence[Mapping[str, float]]) -> Measured:
    """Medians of the rates and of the ratios within rounds; ``rounds`` are rates by name."""

    def ratio(name: str, rival: str) -> Ratio:
        pairs = [found[name] / found[rival] for found in rounds]
        return Ratio(median(pairs), min(pairs), max(pairs))

    rivals = [one.name for one in contenders if one.rival]
    ours = [one.name for one in contenders if not one.rival]
    rates = {one.name: median(found[one.name] for found in rounds) for one in contenders}
    return Measured(rates, {name: {rival: ratio(name, rival) for rival in rivals} for name in ours})


def _calls(contender: Contender, seconds: float) -> int:
    """How many calls take so many seconds; the first one compiles."""
    contender.run(1)
    calls = 1
    while True:
        start = time.perf_counter()
        contender.run(calls)
        taken = time.perf_counter() - start
        if taken > seconds / 4:
            return max(1, round(calls * seconds / taken))
        calls *= 2


def _rate(contender: Contender, calls: int) -> float:
    start = time.perf_counter()
    steps = contender.run(calls)
    return steps / (time.perf_counter() - start)
