"""A results folder as DataFrames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lanekeep_benchmarks.results import EPISODES, LARGEST_LINES, read_lines
from lanekeep_benchmarks.traces import FOLDER
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
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet

    tables = []
    for file in files:
        try:
            tables.append(parquet.read_table(file))
        except (pa.ArrowException, OSError) as error:
            raise ValueError(f"{file} is not a trace: {error}") from None
    if not tables:
        return pd.DataFrame()
    frame: pd.DataFrame = (
        pa.concat_tables(tables, promote_options="default").unify_dictionaries().to_pandas(split_blocks=True)
    )
    return frame
