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
        flat = values.reshape(len(grid), -1)
        # Value and slope side by side: one look-up fetches both.
        self._rows = np.concatenate([flat, np.diff(flat, axis=0, append=flat[-1:])], axis=1)

    def __call__(self, at: Floats) -> Floats:
        """Return the interpolated values at ``at`` (n,), shape (n, ...)."""
        place = np.clip((at - self._start) / self._step, 0.0, self._last)
        index = place.astype(np.intp)
        rows = self._rows[index]
        half = rows.shape[1] // 2
        part = rows[:, half:] * (place - index)[:, None]
        part += rows[:, :half]
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
    products = np.repeat(values, k, axis=1)
    products *= weights.reshape(n, m * k)
    while m % 2 == 0:  # folding halves onto each other is quicker than adding columns one by one
        m //= 2
        products = products[:, : m * k] + products[:, m * k :]
    total = products[:, :k]
    for j in range(1, m):
        total = total + products[:, j * k : (j + 1) * k]
    return total[:, 0] if weights.ndim == 2 else total
