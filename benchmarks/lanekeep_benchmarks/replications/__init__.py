"""The published works, driven again: their figures as pictures, their numbers beside those that come out here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module

from lanekeep_benchmarks.replications.differences import DIFFERENCES
from lanekeep_benchmarks.replications.record import HEADINGS, NOTE, NUMBERS, Replication, Row, Table
from lanekeep_env.checks import choose

__all__ = ["ALL", "HEADINGS", "NOTE", "NUMBERS", "WORKS", "Replication", "Row", "Table", "replication_of", "steps_of"]

#: Name of a work, which is that of the module that drives it, and what it is.
WORKS = {
    "traechtler": "Trächtler, Lohmann, Struck 1992: the camera-guided van",
    "yin": "Yin 2010: a passenger car at 68 to 180 km/h",
    "knightriders": "Team KnightRiders 2017: the 1:10 car along a wall",
    "werling": "Werling, Gröll, Bretthauer 2008: one controller from parking to an evasive path",
}
#: Word for all of them.
ALL = "all"

Step = tuple[str, Callable[[Replication], None]]


def replication_of(work: str) -> Replication:
    """Return a work's replication, of which nothing is driven yet."""
    return Replication(WORKS[work], DIFFERENCES[work])


def steps_of(work: str) -> Iterator[Step]:
    """Yield (what is driven next, the function that drives it into a `Replication`) of a work.

    Raises:
        ValueError: unknown work; the nearest one is named.
    """
    choose("work", work, WORKS)
    module = import_module(f"lanekeep_benchmarks.replications.{work}")
    yield from module.STEPS
