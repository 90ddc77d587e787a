"""Learned policies run by numpy alone, as pure functions of their inputs like the classical ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_agents.activations import ACTIVATIONS
from lanekeep_agents.binding import Binding
from lanekeep_agents.frames import stacked
from lanekeep_agents.policy_file import check_tensors
from lanekeep_agents.policy_record import PolicyRecord
from lanekeep_env.scenario.car import CarScenario

#: Rows of a matrix product. BLAS lets the number of rows, and a row's place among them, choose the order of additions;
#: its kernels treat eight rows alike, so that rows are independent of each other to the last bit.
BLOCK = 8
#: In which networks are computed. Actions are float32, and what another processor adds in another order is lost where
#: they are rounded: in float32 its episodes drifted apart, and those with contacts ended otherwise.
Layer = NDArray[np.float64]


class LearnedPolicy:
    """A trained network with the interface of every policy.

    Args:
        record, tensors: what `read_policy` returns.
        scenario: to drive, by default the one trained on.
        allow_files: let the one trained on read the road or the world whose file it names.

    Attributes:
        name: of the policy.
        record: what it is and how it came about.

    Raises:
        ValueError: tensors that the record does not ask for, or a scenario that the policy cannot drive.
    """

    def __init__(
        self,
        record: PolicyRecord,
        tensors: Mapping[str, NDArray[np.float32]],
        scenario: CarScenario | None = None,
        *,
        allow_files: bool = False,
    ) -> None:
        check_tensors(record, tensors)
        self.record = record
        self.name = record.name
        self._bound = Binding(record, scenario, allow_files=allow_files)
        self._base = next(iter(self._bound.make_bases()), None)
        # What is added to or multiplied by blocks has their shape: numpy then runs through a block at once.
        exact = {key: tensor.astype(np.float64) for key, tensor in tensors.items()}
        self._mean = _block(exact["mean"])
        self._frames = record.frames
        if record.frames > 1:
            self._before = exact["before"]  # what stands for frames before the first, normalised
        self._activate = ACTIVATIONS[record.network.activation]
        self._inverse = _block(1.0 / np.sqrt(exact["variance"] + record.normalisation.epsilon))
        hidden = range(len(record.network.hidden))
        self._hidden = [(exact[f"layers.{i}.weight"].T.copy(), _block(exact[f"layers.{i}.bias"])) for i in hidden]
        last = len(record.network.hidden)
        self._last = exact[f"layers.{last}.weight"], exact[f"layers.{last}.bias"]

    def __repr__(self) -> str:
        record = self.record
        base = f", corrects {record.base}" if record.base else ""
        frames = f", {record.frames} frames" if record.frames > 1 else ""
        return f"<{type(self).__name__} {self.name}: {record.algorithm} trained on {record.env_id}{base}{frames}>"

    def predict(
        self,
        observation: ArrayLike,
        state: NDArray[Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], NDArray[Any] | None]:
        """Return actions in [-1, 1] and the next state.

        Args:
            observation: (channels,) or (n, channels) of the scenario.
            state: what the last call returned; the base of a residual policy may have one, and frames are one.
            episode_start: () or (n,); rows that are true forget their state.
            deterministic: there is nothing random here; accepted for Stable-Baselines3's sake.

        Returns:
            Actions, float32, (actions,) or (n, actions); the base's state, the frames before, or None.

        Raises:
            ValueError: an observation or a state of another shape.
        """
        given = self._bound.given(observation)
        rows = given[None] if given.ndim == 1 else given
        following = None
        seen = rows[:, self._bound.columns]
        if self._base is None:
            if self._frames > 1:
                seen, following = stacked(seen, self._frames, state, episode_start)
            action: NDArray[Any] = self._network(seen, None)
        else:
            base, following = self._base.predict(observation, state, episode_start)
            base = base.reshape(len(rows), self.record.actions).clip(-1.0, 1.0)
            action = (self._network(seen, base) * np.float64(self.record.bound or 0.0) + base).clip(-1.0, 1.0)
        action = self._bound.convert(action.astype(np.float32), rows)
        if given.ndim == 1:
            return action[0], following[0] if self._frames > 1 and following is not None else following
        return action, following

    def _network(self, seen: NDArray[np.float32], base: NDArray[np.float32] | None) -> Layer:
        """Return the network's outputs for what is seen, (n, inputs), clipped to [-1, 1], (n, actions)."""
        record = self.record
        n, read = seen.shape
        y = np.zeros((-(-n // BLOCK), BLOCK, record.inputs))
        x = y.reshape(-1, record.inputs)
        x[:n, :read] = seen
        if base is not None:
            x[:n, read:] = base
        y -= self._mean
        y *= self._inverse
        y.clip(-record.normalisation.clip, record.normalisation.clip, out=y)
        if self._frames > 1:
            earlier = y[:, :, : len(self._before)]
            np.copyto(earlier, self._before, where=np.isnan(earlier))
        for weight, bias in self._hidden:
            y = y @ weight
            y += bias
            self._activate(y)
        weight, bias = self._last
        action = np.vecdot(y[:, :, None, :], weight).reshape(-1, record.actions)[:n] + bias
        if record.network.squash:
            np.tanh(action, out=action)
        return action.clip(-1.0, 1.0, out=action)


def _block(row: Layer) -> Layer:
    """Repeat a row for each row of a block."""
    return np.tile(row, (BLOCK, 1))
