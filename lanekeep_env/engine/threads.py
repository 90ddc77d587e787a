"""Several threads where they are faster than one, and one where they are not: it may change from minute to minute.

Threads wait for each other at the end of a step. Where other programs take the processors that wait is many steps long,
and no library can know it beforehand. So both are timed while they run; results are the same.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import numba

#: Share of all time that may go into trying what was slower.
TRIED = 0.03
#: Weight of the newest time in the mean.
_NEWEST = 0.2
#: How long GNU OpenMP's threads wait awake, rounds of a loop, before they sleep: some 50 µs, a step's uneven ends. Its
#: own choice is many times that, which keeps other programs from their processors.
_WAITING = {"GOMP_SPINCOUNT": "20000"}


class Faster:
    """Calls one of two functions that do the same: the one that took less time lately.

    The first call of each is not timed: it compiles.
    """

    def __init__(
        self, one: Callable[..., None], several: Callable[..., None], clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self._functions = one, several
        self._clock = clock
        self._means: list[float | None] = [None, None]
        self._new = [True, True]
        self._spent = self._tried = 0.0

    def __call__(self, *arguments: Any) -> None:
        which, tries = self._choose()
        if self._new[which]:
            self._new[which] = False
            self._functions[which](*arguments)
            return
        begin = self._clock()
        self._functions[which](*arguments)
        took = self._clock() - begin
        mean = self._means[which]
        self._means[which] = took if mean is None else mean + _NEWEST * (took - mean)
        self._spent += took
        self._tried += took if tries else 0.0

    def _choose(self) -> tuple[int, bool]:
        """Return which function to call, and whether only to see how long it takes now."""
        one, several = self._means
        if several is None:
            return 1, False
        if one is None:
            return 0, False
        better = int(several < one)
        tries = self._tried < TRIED * self._spent
        return (1 - better if tries else better), tries


def start_threads(number: int) -> None:
    """Start numba's threads, so that these, and those of no other library, read how long to wait awake."""
    said = os.environ.keys() & {"OMP_WAIT_POLICY", *_WAITING}
    os.environ.update({} if said else _WAITING)
    try:
        numba.set_num_threads(number)
    finally:
        for name in () if said else _WAITING:
            del os.environ[name]
