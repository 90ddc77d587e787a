"""The published works, driven again: their figures as pictures, their numbers beside those that come out here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module

from lanekeep_benchmarks.replications.differences import DIFFERENCES
from lanekeep_benchmarks.replications.record import HEADINGS, NOTE, NUMBERS, Replication, Row, Table
from lanekeep_env.checks import choose

__all__ = [
    "ALL",
    "BESIDE",
    "HEADINGS",
    "NOTE",
    "NUMBERS",
    "WORKS",
    "Replication",
    "Row",
    "Table",
    "replication_of",
    "steps_of",
]

#: Name of a work, which is that of the module that drives it, and what it is.
WORKS = {
    "traechtler": "Trächtler, Lohmann, Struck 1992: the camera-guided van",
    "yin": "Yin 2010: a passenger car at 68 to 180 km/h",
    "knightriders": "Team KnightRiders 2017: the 1:10 car along a wall",
    "werling": "Werling, Gröll, Bretthauer 2008: one controller from parking to an evasive path",
}
#: The same of packages that have an adapter; not on the page of the works.
BESIDE = {"highway": "highway-env 1.12: its car with tyres beside the same car here"}
#: Word for all works.
ALL = "all"

Step = tuple[str, Callable[[Replication], None]]


def replication_of(work: str) -> Replication:
    """Return a work's replication, of which nothing is driven yet."""
    return Replication({**WORKS, **BESIDE}[work], DIFFERENCES.get(work, {}))


def steps_of(work: str) -> Iterator[Step]:
    """Yield (what is driven next, the function that drives it into a `Replication`) of a work.

    Raises:
        ValueError: unknown work; the nearest one is named.
        ModuleNotFoundError: the other package is not installed; names the extra that brings it.
    """
    choose("work", work, (*WORKS, *BESIDE))
    if work in BESIDE:
        import_module(f"lanekeep_env.adapters.{work}")  # which says what to install
    module = import_module(f"lanekeep_benchmarks.replications.{work}")
    yield from module.STEPS
