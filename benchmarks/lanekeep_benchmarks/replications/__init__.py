"""The published works, driven again: their figures as pictures, their numbers beside those that come out here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module

from lanekeep_benchmarks.replications.record import NOTE, Replication, Row, Table
from lanekeep_env.checks import choose

__all__ = ["NOTE", "WORKS", "Replication", "Row", "Table", "steps_of"]

#: Name of a work, the module that drives it, and what it is.
WORKS = {
    "traechtler": ("traechtler", "Trächtler, Lohmann, Struck 1992: the camera-guided van"),
    "knightriders": ("knightriders", "Team KnightRiders 2017: the 1:10 car along a wall"),
    "werling": ("werling", "Werling, Gröll, Bretthauer 2008: one controller from parking to an evasive path"),
}

Step = tuple[str, Callable[[Replication], None]]


def steps_of(work: str) -> Iterator[Step]:
    """Yield (what is driven next, the function that drives it into a `Replication`) of a work.

    Raises:
        ValueError: unknown work; the nearest one is named.
    """
    choose("work", work, WORKS)
    module = import_module(f"lanekeep_benchmarks.replications.{WORKS[work][0]}")
    yield from module.STEPS
