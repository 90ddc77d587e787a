"""Every step of episodes, as Parquet: a file for each batch that was driven, on disk before its result lines are."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from lanekeep_benchmarks.evaluate import Step

#: Folder of the traces in that of a run.
FOLDER = "traces"
#: What tells a row from the others: two texts, two whole numbers; every other column is a number.
KEYS = ("scenario", "policy", "episode", "step")
#: Beams of a scan are not kept: 512 numbers a step.
_BEAM = re.compile(r"scan_\d+")
#: Steps that are turned into columns together: they fit the processor's cache.
_TOGETHER = 40


def is_beam(channel: str) -> bool:
    """Whether a channel is a beam of a scan, which no trace keeps."""
    return _BEAM.fullmatch(channel) is not None


class Trace:
    """The steps of a batch of episodes: observed.CHANNEL, action_0, ... that followed from it, truth and reward after.

    Args:
        channels: names of the observation's entries.
    """

    def __init__(self, channels: Sequence[str]) -> None:
        self._observed = {name: place for place, name in enumerate(channels) if not is_beam(name)}
        self._places = None if len(self._observed) == len(channels) else list(self._observed.values())
        self._steps: list[Step] = []

    def watch(self, steps: Iterator[Step]) -> Iterator[Step]:
        """Yield the steps of `evaluate.drive`, and keep them."""
        for step in steps:
            # The environment's arrays are new in each step and need no copy; an action is the policy's own.
            seen = step.seen if self._places is None else step.seen[:, self._places]
            self._steps.append(replace(step, seen=seen, action=np.array(step.action, dtype=np.float32)))
            yield step

    def parquet(self, scenario: str, policy: str, episodes: NDArray[np.int64], kept: NDArray[np.bool_]) -> bytes:
        """Return the steps of the cars ``kept`` (n,), whose episodes have the numbers ``episodes`` (n,), in order."""
        import pyarrow as pa
        from pyarrow import parquet

        cars = slice(None) if kept.all() else np.flatnonzero(kept)
        alive = np.array([step.alive for step in self._steps]).T[cars]  # (cars, steps)
        lengths = alive.sum(axis=1)
        zeros = pa.array(np.zeros(int(lengths.sum()), dtype=np.int32))
        columns: dict[str, Any] = {
            "scenario": pa.DictionaryArray.from_arrays(zeros, pa.array([scenario])),
            "policy": pa.DictionaryArray.from_arrays(zeros, pa.array([policy])),
            "episode": np.repeat(episodes[kept].astype(np.int32), lengths),
            "step": np.nonzero(alive)[1].astype(np.int32),
        }
        whole = alive.all()  # most often, and much faster than a mask
        names, table = self._numbers(cars)
        numbers = {name: values.ravel() if whole else values[alive] for name, values in zip(names, table, strict=True)}
        arrays = {name: pa.array(values) for name, values in (columns | numbers).items()}
        # Nothing is missing; that said, a quarter of the writing is saved.
        schema = pa.schema([pa.field(name, array.type, nullable=False) for name, array in arrays.items()])
        buffer = io.BytesIO()
        # Numbers of a drive do not repeat: dictionaries and statistics would cost time and save nothing. Their bytes
        # do, place by place: split so, they take a third less.
        parquet.write_table(
            pa.table(list(arrays.values()), schema),
            buffer,
            compression="lz4",
            use_dictionary=["scenario", "policy"],
            use_byte_stream_split=list(numbers),
            write_statistics=False,
            write_batch_size=1 << 16,
        )
        return buffer.getvalue()

    def _numbers(self, cars: Any) -> tuple[list[str], NDArray[np.float32]]:
        """What is kept of the cars: its names, and (names, cars, steps)."""
        first = self._steps[0]
        truth = [key for key in first.info if not key.startswith("_")]
        seen, actions = len(self._observed), first.action.shape[1]
        names = [*truth, *(f"observed.{name}" for name in self._observed)]
        names += [*(f"action_{column}" for column in range(actions)), "reward"]
        count = len(first.alive[cars])
        table = np.empty((len(names), count, len(self._steps)), dtype=np.float32)
        for start in range(0, len(self._steps), _TOGETHER):
            steps = self._steps[start : start + _TOGETHER]
            there = table[:, :, start : start + len(steps)]
            for row, key in enumerate(truth):
                there[row] = np.array([step.info[key][cars] for step in steps], dtype=np.float32).T
            middle = len(truth)
            there[middle : middle + seen] = np.array([step.seen[cars] for step in steps]).transpose(2, 1, 0)
            there[middle + seen : -1] = np.array([step.action[cars] for step in steps]).transpose(2, 1, 0)
            there[-1] = np.array([step.reward[cars] for step in steps], dtype=np.float32).T
        return names, table


def file_name(scenario: str, policy: str, first: int) -> str:
    """Name of the file of a batch that begins with episode ``first``; a policy's may be a path or code."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "-", policy)
    if plain != policy:
        plain = f"{plain[-40:]}-{sha256(policy.encode()).hexdigest()[:8]}"
    return f"{FOLDER}/{scenario}.{plain}.{first:06d}.parquet"
