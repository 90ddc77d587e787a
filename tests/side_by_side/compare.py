"""How two records of a case differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from side_by_side.drive import STEPS, Record

#: Units in the last place by which compilers may differ within a step.
LAST_BIT = 4


@dataclass(frozen=True)
class Difference:
    """How a case differs: at its first step in any column, and in that step's worst quantity.

    Attributes:
        quantity, others: the one that differs most where columns begin to differ, and how many more differ.
        step: the first one in any column, 0 for the reset.
        ulp, absolute: largest difference of the quantity in each column's first differing step.
        last_bit: each column begins to differ by no more than `LAST_BIT` ulp.
    """

    quantity: str
    others: int
    step: int
    ulp: float
    absolute: float
    last_bit: bool

    def __str__(self) -> str:
        more = f" and {self.others} more" if self.others else ""
        return f"{self.quantity}{more} from step {self.step}: {self.ulp:.0f} ulp, {self.absolute:.3g}"


def ulps(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Steps between neighbouring numbers from ``old`` to ``new``: 0 only for the same bits, inf where none lead."""
    if old.dtype.kind != "f":
        return np.where(old == new, 0.0, np.inf)
    whole = np.dtype(f"i{old.dtype.itemsize}")
    a, b = (np.ascontiguousarray(array).view(whole) for array in (old, new))
    same = a == b
    # Negative numbers count down from zero; the difference of two of these wraps into the unsigned type.
    a, b = (np.where(array < 0, np.iinfo(whole).min - array, array) for array in (a, b))
    unsigned = np.dtype(f"u{old.dtype.itemsize}")
    steps = np.where(a > b, a.astype(unsigned) - b.astype(unsigned), b.astype(unsigned) - a.astype(unsigned))
    apart = np.where(np.isnan(old) | np.isnan(new), np.inf, np.maximum(steps, 1))
    return np.where(same, 0.0, apart)


def _by_column(values: np.ndarray, columns: int) -> np.ndarray:
    """Largest entry by row and column; what no column owns belongs to all."""
    own = values.ndim > 1 and values.shape[1] == columns
    parts = columns if own else 1
    flat = values.reshape(len(values), parts, values[:1].size // parts if len(values) else 0)
    return np.broadcast_to(flat.max(axis=2, initial=0.0), (len(values), columns))


def compare(old: Record, new: Record, columns: int) -> Difference | None:
    """How quantities of both records differ, None where every bit agrees; ``columns`` is 0 for a single environment.

    Cars that differ in the last bit soon differ in everything, so each column is judged where it begins to differ.
    """
    columns = max(columns, 1)
    found = {name: _differences(old[name], new[name], columns) for name in old if name in new}
    found = {name: pair for name, pair in found.items() if pair[0].any()}
    if not found:
        return None
    worst = np.max([ulp for ulp, _ in found.values()], axis=0)
    # The last column holds rows that one side lacks: told by what differed before, or a difference of its own.
    lone = worst[:, -1] > 0
    if lone.any() and worst[: np.argmax(lone) + 1, :-1].any():
        worst[:, -1] = 0.0
    begins = np.flatnonzero(worst.any(axis=0))
    first = np.argmax(worst[:, begins] > 0, axis=0)
    quantity = max(found, key=lambda name: found[name][0][first, begins].max())
    ulp, absolute = found[quantity]
    return Difference(
        quantity=quantity,
        others=len(found) - 1,
        step=int(first.min()),
        ulp=float(ulp[first, begins].max()),
        absolute=float(absolute[first, begins].max()),
        last_bit=bool((worst[first, begins] <= LAST_BIT).all()),
    )


def _differences(
    old: tuple[np.ndarray, np.ndarray], new: tuple[np.ndarray, np.ndarray], columns: int
) -> tuple[np.ndarray, np.ndarray]:
    """Differences of a quantity in ulp and absolute, (STEPS + 1, columns + 1); rows that one side lacks in the last."""
    ulp, absolute = np.zeros((2, STEPS + 1, columns + 1))
    (steps, values), (new_steps, new_values) = old, new
    if values.dtype != new_values.dtype or values.shape[1:] != new_values.shape[1:]:
        ulp[:, :-1] = absolute[:, :-1] = np.inf
        return ulp, absolute
    shared, mine, yours = np.intersect1d(steps, new_steps, return_indices=True)
    values, new_values = values[mine], new_values[yours]
    apart = ulps(values, new_values)
    ulp[shared, :-1] = _by_column(apart, columns)
    with np.errstate(invalid="ignore"):
        size = np.abs(values.astype(np.float64) - new_values)
    absolute[shared, :-1] = _by_column(np.where(apart > 0, np.nan_to_num(size, nan=np.inf), 0.0), columns)
    ulp[np.setxor1d(steps, new_steps), -1] = absolute[np.setxor1d(steps, new_steps), -1] = np.inf
    return ulp, absolute
