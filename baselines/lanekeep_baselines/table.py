"""Tables over a uniform grid of speeds, looked up for many rows at once, and elementwise products."""

from __future__ import annotations

import numpy as np

from lanekeep_baselines.policy import Floats


class Table:
    """Values on a uniform grid, linearly interpolated between its points and clamped outside.

    Args:
        grid: uniform and increasing, shape (g,).
        values: shape (g, ...).
    """

    def __init__(self, grid: Floats, values: Floats) -> None:
        self._start, self._step = float(grid[0]), float(grid[1] - grid[0])
        self._last = float(len(grid) - 1)
        self._shape = values.shape[1:]
        self._values = np.ascontiguousarray(values.reshape(len(grid), -1))
        self._slopes = np.diff(self._values, axis=0, append=self._values[-1:])

    def __call__(self, at: Floats) -> Floats:
        """Return the interpolated values at ``at`` (n,), shape (n, ...)."""
        place = np.minimum(np.maximum((at - self._start) / self._step, 0.0), self._last)
        index = place.astype(np.intp)
        # Inside already, and clipping is quicker than looking whether it is. A place that is NaN gives NaN.
        part = self._slopes.take(index, axis=0, mode="clip")
        part *= (place - index)[:, None]
        part += self._values.take(index, axis=0, mode="clip")
        return part.reshape(len(at), *self._shape)


def weighted_sum(weights: Floats, values: Floats) -> Floats:
    """Return sum_j weights[:, j] values[:, j], added in the same order whatever the number of rows is.

    Args:
        weights: shape (n, m) or (n, m, k).
        values: shape (n, m).

    Returns:
        shape (n,) or (n, k).
    """
    n, m = values.shape
    k = 1 if weights.ndim == 2 else weights.shape[2]
    # One row a summand and n numbers long: whole rows are quicker to work on than short pieces of many.
    products = np.empty((m, k, n))
    np.multiply(weights.reshape(n, m, k).transpose(1, 2, 0), values.T[:, None], out=products)
    while m % 2 == 0:  # folding halves onto each other is quicker than adding row by row
        m //= 2
        products = products[:m] + products[m:]
    total = products[0]
    for row in products[1:]:
        total = total + row
    return total[0] if weights.ndim == 2 else total.T
