"""The last observations of each car as one input, as Stable-Baselines3's ``VecFrameStack`` gives it to a policy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def stacked(
    latest: NDArray[np.float32], frames: int, state: NDArray[Any] | None, episode_start: ArrayLike | None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return what the policy sees, oldest first, NaN for frames before the first, and the state for the next call.

    Args:
        latest: the present observations, (n, channels).
        frames: observations that the policy sees at once.
        state: the frames before, (n, channels (frames - 1)), as the last call returned them; None for none.
        episode_start: rows whose frames before are forgotten, () or (n,).

    Raises:
        ValueError: a state of another shape.
    """
    n, channels = latest.shape
    earlier = np.full((n, channels * (frames - 1)), np.nan, dtype=np.float32)
    if state is not None:
        given = np.atleast_2d(np.asarray(state, dtype=np.float32))
        if given.shape != earlier.shape:
            raise ValueError(f"state has shape {given.shape}, allowed: {earlier.shape}, as predict returned it")
        fresh = False if episode_start is None else np.asarray(episode_start, dtype=bool).reshape(-1, 1)
        earlier = np.where(fresh, earlier, given)
    whole = np.concatenate([earlier, latest], axis=1)
    return whole, whole[:, channels:].copy()
