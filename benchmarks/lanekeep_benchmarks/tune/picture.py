"""Picture of a search: the score over the trials, and over each value that was tried."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, NullLocator

from lanekeep_benchmarks.looks import GRID, colour_of, png
from lanekeep_benchmarks.tune.run import Trial
from lanekeep_benchmarks.tune.space import Space

#: Panels in a row.
_ROW = 4
#: Of the trials' scores, those below this share of the spread of the better half are drawn at the lower edge.
_FAR = 3.0


def plot_trials(title: str, space: Space, trials: Sequence[Trial]) -> bytes:
    """Draw a search; trials far below the others, and those that failed, are triangles at the lower edge."""
    scores = 100.0 * np.array([math.nan if one.score is None else one.score for one in trials])
    best = int(np.nanargmax(scores))
    low, high = _limits(scores)
    outside = ~(scores >= low)
    shown = np.where(outside, low, scores)
    columns = min(_ROW, len(space.ranges))
    rows = 1 + math.ceil(len(space.ranges) / columns)
    figure = Figure(figsize=(13, 0.8 + 2.9 * rows), layout="constrained")
    grid = figure.add_gridspec(rows, columns)
    first = figure.add_subplot(grid[0, :])
    panels = [(first, np.arange(len(trials)))]
    for i, (name, one) in enumerate(space.ranges.items()):
        axes = figure.add_subplot(grid[1 + i // columns, i % columns])
        panels.append((axes, np.array([trial.values[name] for trial in trials])))
        edges = (min(one.choices), max(one.choices)) if one.choices else (one.low, one.high)
        if one.choices:
            axes.set_xscale("log")
            axes.set_xlim(edges[0] / 1.1, edges[1] * 1.1)
            axes.set_xticks(one.choices, [f"{choice:g}" for choice in one.choices], minor=False)
            axes.xaxis.set_minor_locator(NullLocator())
        elif one.log:
            axes.set_xscale("log", subs=[2, 5])
            axes.set_xlim(edges[0] / 1.1, edges[1] * 1.1)
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter(NullFormatter())
        else:
            axes.set_xlim(*edges)
        axes.set_xlabel(name)
    for axes, across in panels:
        axes.axhline(0.0, color="#909090", linewidth=0.8, linestyle="--")
        axes.plot(across[~outside], shown[~outside], "o", color=colour_of(5), markersize=4)
        if outside.any():
            axes.plot(across[outside], shown[outside], "v", color="#909090", markersize=4)
        axes.plot(across[0], shown[0], "s", color=colour_of(6), markersize=6, label="shipped")
        axes.plot(across[best], shown[best], "D", color=colour_of(1), markersize=6, label="best")
        axes.set_ylim(low, high)
        axes.grid(**GRID)
    so_far = np.fmax.accumulate(scores)
    first.plot(so_far, drawstyle="steps-post", color=colour_of(0), linewidth=1.3, label="best so far")
    first.xaxis.set_major_locator(MaxNLocator(integer=True))
    first.set_xlabel("trial")
    first.set_ylabel("gain over the shipped values [%]")
    figure.legend(*first.get_legend_handles_labels(), loc="outside lower center", fontsize=9, frameon=False, ncols=3)
    figure.suptitle(title, fontsize=11)
    return png(figure)


def _limits(scores: np.ndarray) -> tuple[float, float]:
    """Return the lower and the upper edge, in percent."""
    known = scores[np.isfinite(scores)]
    top, middle = float(known.max()), float(np.median(known))
    spread = max(top - middle, 1.0)
    low = max(float(known.min()), top - _FAR * spread)
    margin = 0.08 * max(top - low, 1.0)
    return min(low, 0.0) - margin, max(top, 0.0) + margin
