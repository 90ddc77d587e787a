"""Picture of margins over the speed, a panel each, as PNG bytes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from lanekeep_baselines.margins import Margins
from lanekeep_benchmarks.looks import GRID, png, styles

if TYPE_CHECKING:
    from lanekeep_benchmarks.margins_command import Row

#: Title; value; a usual bound, or None; whether the axis is logarithmic.
_PANELS: tuple[tuple[str, Callable[[Margins], float], float | None, bool], ...] = (
    ("damping ratio", lambda found: found.damping, None, False),
    ("gain margin, factor", lambda found: found.gain, 2.0, True),
    ("phase margin [°]", lambda found: math.degrees(found.phase), 30.0, False),
    ("delay margin [ms]", lambda found: 1e3 * found.delay, None, True),
    ("camera latency margin [ms]", lambda found: 1e3 * found.camera_delay, None, True),
    ("largest sensitivity Ms", lambda found: found.sensitivity, 2.0, True),
)
#: Factors of gain beyond which nobody asks.
_ENOUGH = 100.0


def plot_margins(rows: Sequence[Row]) -> bytes:
    """Draw the margins of every loop over the speed; where a loop is unstable there is a red cross."""
    loops = list(dict.fromkeys(row.loop for row in rows))
    one_car = len({row.vehicle for row in rows}) == 1
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    grid = figure.subplots(2, 3)
    looks = styles(loops, loops[:8])
    for axes, (title, value, bound, logarithmic) in zip(grid.flat, _PANELS, strict=True):
        if bound is not None:
            axes.axhline(bound, color="#909090", linewidth=0.8, linestyle="--")
        for loop in loops:
            those = [row for row in rows if row.loop == loop and row.found is not None]
            name = those[0].policy if one_car and those else loop
            look = looks[loop] | {"label": name if looks[loop].get("label") == loop else looks[loop].get("label")}
            look.pop("markevery", None)
            shown = [(row.speed, _shown(value(row.found))) for row in those if row.found and row.found.stable]
            axes.plot([speed for speed, _ in shown], [found for _, found in shown], **look)
        for row in rows:
            if row.found is not None and not row.found.stable:
                axes.plot(row.speed, 0.02, "x", color="#b00000", transform=axes.get_xaxis_transform(), clip_on=False)
        if logarithmic:
            axes.set_yscale("log")
            for which in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
                which(LogFormatter(labelOnlyBase=False, minor_thresholds=(2, 0.5)))
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("speed [m/s]")
        axes.grid(**GRID)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    car = rows[0].vehicle if one_car else "several cars"
    figure.suptitle(f"Margins around straight driving: {car}; dashed: usual bounds", fontsize=11)
    return png(figure)


def _shown(value: float) -> float:
    return min(value, _ENOUGH) if math.isinf(value) else value
