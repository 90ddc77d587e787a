"""Every step of episodes, as Parquet: a file for each batch that was driven, on disk before its result lines are."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from lanekeep_benchmarks.evaluate import Step

#: Folder of the traces in that of a run.
FOLDER = "traces"
#: Beams of a scan are not kept: 512 numbers a step.
_BEAM = re.compile(r"scan_\d+")


class Trace:
    """The steps of a batch of episodes: observed.CHANNEL, action_0, ... that followed from it, truth and reward after.

    Args:
        channels: names of the observation's entries.
    """

    def __init__(self, channels: Sequence[str]) -> None:
        self._observed = [(place, name) for place, name in enumerate(channels) if not _BEAM.fullmatch(name)]
        self._names: list[str] = []
        self._steps: list[NDArray[np.float32]] = []
        self._alive: list[NDArray[np.bool_]] = []

    def watch(self, steps: Iterator[Step]) -> Iterator[Step]:
        """Yield the steps of `evaluate.drive`, and keep them."""
        places = [place for place, _ in self._observed]
        for step in steps:
            truth = [key for key in step.info if not key.startswith("_")]
            action = np.asarray(step.action, dtype=np.float32)
            if not self._names:
                self._names = [*truth, *(f"observed.{name}" for _, name in self._observed)]
                self._names += [*(f"action_{place}" for place in range(action.shape[1])), "reward"]
            kept = np.empty((len(self._names), len(step.alive)), dtype=np.float32)
            for row, key in enumerate(truth):
                kept[row] = step.info[key]
            kept[len(truth) : len(truth) + len(places)] = step.seen.T[places]
            kept[-1 - action.shape[1] : -1] = action.T
            kept[-1] = step.reward
            self._steps.append(kept)
            self._alive.append(step.alive.copy())
            yield step

    def parquet(self, scenario: str, policy: str, episodes: NDArray[np.int64], kept: NDArray[np.bool_]) -> bytes:
        """Return the steps of the cars ``kept`` (n,), whose episodes have the numbers ``episodes`` (n,), in order."""
        import pyarrow as pa
        from pyarrow import parquet

        alive = np.array(self._alive)[:, kept].T  # (cars, steps)
        data = np.array(self._steps)[:, :, kept].transpose(1, 2, 0)  # (columns, cars, steps)
        lengths = alive.sum(axis=1)
        rows = int(lengths.sum())
        zeros = pa.array(np.zeros(rows, dtype=np.int32))
        columns: dict[str, Any] = {
            "scenario": pa.DictionaryArray.from_arrays(zeros, pa.array([scenario])),
            "policy": pa.DictionaryArray.from_arrays(zeros, pa.array([policy])),
            "episode": np.repeat(episodes[kept].astype(np.int32), lengths),
            "step": np.nonzero(alive)[1].astype(np.int32),
        }
        columns |= {name: data[place][alive] for place, name in enumerate(self._names)}
        buffer = io.BytesIO()
        # Numbers of a drive do not repeat: dictionaries and statistics would cost time and save nothing.
        keys = ["scenario", "policy"]
        parquet.write_table(pa.table(columns), buffer, compression="lz4", use_dictionary=keys, write_statistics=False)
        return buffer.getvalue()


def file_name(scenario: str, policy: str, first: int) -> str:
    """Name of the file of a batch that begins with episode ``first``; a policy's may be a path or code."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "-", policy)
    if plain != policy:
        plain = f"{plain[-40:]}-{sha256(policy.encode()).hexdigest()[:8]}"
    return f"{FOLDER}/{scenario}.{plain}.{first:06d}.parquet"
