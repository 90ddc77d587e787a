"""For controllers that drive one car, with what they remember in themselves: a batch of them is a policy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Controller(Protocol):
    """What drives one car for one episode."""

    def act(self, observation: NDArray[np.float32]) -> ArrayLike:
        """Return the action, a number or (actions,), for the car's observation (channels,)."""
        ...


class OneByOne:
    """A policy of controllers that each drive one car: a row gets one of its own, made as its episode starts.

    Slower than a policy of arrays, and the shortest way from a solver or an existing controller to the benchmark:

    >>> def make(scenario):
    ...     return OneByOne(lambda: MyController(scenario))

    Args:
        start: makes a controller. What is dear to make (a solver) is made once, outside of it.
    """

    def __init__(self, start: Callable[[], Controller]) -> None:
        self.__wrapped__ = start  # so that a hash of this is one of ``start`` too

    def predict(
        self,
        observation: ArrayLike,
        state: NDArray[Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], NDArray[Any]]:
        """Return the actions (n, actions) for observations (n, channels), or of one, and the controllers as state."""
        rows = np.asarray(observation)
        single = rows.ndim == 1
        rows = np.atleast_2d(rows)
        fresh = np.zeros(len(rows), dtype=bool) if episode_start is None else np.reshape(episode_start, -1)
        following = np.empty(len(rows), dtype=object)
        for row in range(len(rows)):
            following[row] = self.__wrapped__() if state is None or fresh[row] else state[row]
        actions = [np.atleast_1d(following[row].act(rows[row])) for row in range(len(rows))]
        action = np.array(actions, dtype=np.float32)
        return (action[0] if single else action), following
