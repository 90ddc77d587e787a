"""A results folder as DataFrames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lanekeep_benchmarks.results import EPISODES, LARGEST_LINES, read_lines
from lanekeep_benchmarks.traces import FOLDER, KEYS
from lanekeep_env.checks import shown_path
from lanekeep_env.files import read_bounded

if TYPE_CHECKING:
    import pandas as pd


class Results(NamedTuple):
    """What a run left: a row each episode, and a row each step that was kept."""

    results: pd.DataFrame
    steps: pd.DataFrame


def read(folder: str | Path) -> Results:
    """Read a results folder.

    Returns:
        ``results``: scenario, policy, episode, seeds, failed, steps and a column each metric (NaN where a scenario has
        it not). ``steps``: scenario, policy, episode, step, what the policy observed (observed.CHANNEL), the actions
        that it gave for that, and the truth (lateral_error in m, ...) and the reward after the step; of all episodes
        with ``--trace``, else of those that failed. ``to_csv`` of both writes a table for everything else.

    Raises:
        ValueError, OSError: there are no results, or a file is damaged; one line that names it.
    """
    import pandas as pd

    folder = Path(folder)
    file = folder / EPISODES
    if not file.is_file():
        raise ValueError(f"{shown_path(folder)} holds no results: {EPISODES} is missing")
    try:
        lines = [line for _, line in read_lines(read_bounded(file, LARGEST_LINES))]
    except ValueError as error:
        raise ValueError(f"{file} {error}") from None
    rows = [{**vars(line), **line.metrics} for line in lines]
    results = pd.DataFrame(rows).drop(columns="metrics", errors="ignore")
    return Results(results, _steps(sorted((folder / FOLDER).glob("*.parquet"))))


def _steps(files: list[Path]) -> pd.DataFrame:
    """The steps of all files; numbers go straight into the frame's own memory, which for a suite is a gigabyte."""
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet

    if not files:
        return pd.DataFrame()
    heads = {}
    for file in files:
        try:
            heads[file] = parquet.read_metadata(file)
        except (pa.ArrowException, OSError) as error:
            raise ValueError(f"{file} is not a trace: {error}") from None
    names = list(dict.fromkeys(name for head in heads.values() for name in head.schema.names))
    numbers = {name: row for row, name in enumerate(name for name in names if name not in KEYS)}
    rows = sum(head.num_rows for head in heads.values())
    whole = np.zeros((2, rows), dtype=np.int32)
    values = np.empty((len(numbers), rows), dtype=np.float32)
    texts: dict[str, list[Any]] = {name: [] for name in KEYS[:2]}
    first = 0
    for file, head in heads.items():
        rest = slice(first, first + head.num_rows)
        try:
            opened = parquet.ParquetFile(file)
            for name, column in texts.items():
                column += opened.read(columns=[name]).column(name).chunks
            for name, row in zip(KEYS[2:], whole, strict=True):
                row[rest] = opened.read(columns=[name]).column(name).to_numpy()
            for name, place in numbers.items():
                there = name in head.schema.names
                values[place, rest] = opened.read(columns=[name]).column(name).to_numpy() if there else np.nan
        except (pa.ArrowException, OSError, KeyError, ValueError) as error:
            raise ValueError(f"{file} is not a trace: {error}") from None
        first = rest.stop
    keys = {name: pa.chunked_array(column).unify_dictionaries().to_pandas() for name, column in texts.items()}
    frames = pd.DataFrame(keys), pd.DataFrame(whole.T, columns=list(KEYS[2:]), copy=False)
    return pd.concat([*frames, pd.DataFrame(values.T, columns=list(numbers), copy=False)], axis=1)
