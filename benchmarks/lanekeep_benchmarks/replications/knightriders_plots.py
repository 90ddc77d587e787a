"""Pictures of Team KnightRiders 2017: root loci, responses above their steering, the controllers compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import control
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lanekeep_benchmarks.plots import GRID, colour_of, png
from lanekeep_benchmarks.replications.wall_simulation import LIMIT, Run

MARKERS = (("o", "#b00000"), ("s", "#5b2a86"), ("^", "#404040"))


@dataclass(frozen=True)
class Locus:
    """A root locus: open loop, gains to mark, by what to call them, and what is shown (x from, to, y from, to)."""

    title: str
    loop: control.TransferFunction
    gains: Mapping[str, float] = field(default_factory=dict)
    shown: tuple[float, float, float, float] = (-1.45, 1.25, -1.35, 1.35)


@dataclass(frozen=True)
class Column:
    """A response above its steering, runs by what to call them; the limit is marked, ``until`` in s is shown."""

    title: str
    runs: Mapping[str, Run]
    limited: bool = True
    below: str = ""
    until: float = np.inf


def root_loci(title: str, loci: Sequence[Locus]) -> bytes:
    """Root loci, four a row, in the unit circle; closed poles out of sight are written down."""
    rows = -(-len(loci) // 4)
    figure = Figure(figsize=(14, 4.0 * rows + 0.4), layout="constrained")
    around = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 400))
    for place, locus in enumerate(loci):
        axes = figure.add_subplot(rows, 4, place + 1)
        west, east, south, north = locus.shown
        axes.plot(around.real, around.imag, color="#909090", linewidth=0.8)
        axes.axhline(0.0, color="#c0c0c0", linewidth=0.6)
        axes.axvline(0.0, color="#c0c0c0", linewidth=0.6)
        branches = control.root_locus_map(locus.loop, gains_of(locus.loop))
        for branch in range(branches.loci.shape[1]):
            roots = branches.loci[:, branch]
            axes.plot(roots.real, roots.imag, color=colour_of(branch), linewidth=1.6)
        poles, zeros = np.asarray(branches.poles), np.asarray(branches.zeros)
        axes.plot(poles.real, poles.imag, "x", color="black", markersize=8, zorder=3)
        axes.plot(zeros.real, zeros.imag, "o", color="black", markersize=7, markerfacecolor="none", zorder=3)
        for (marker, colour), (name, gain) in zip(MARKERS, locus.gains.items(), strict=False):
            closed = np.asarray(control.root_locus_map(locus.loop, [gain]).loci[0])
            away = [pole.real for pole in closed if not (west < pole.real < east and south < pole.imag < north)]
            if locus.shown == Locus.shown and away:
                name += f", a pole at {away[0]:.1f}".replace("-", "−")
            axes.plot(
                closed.real, closed.imag, marker, color=colour, markersize=6, markeredgecolor="white",
                markeredgewidth=0.5, label=name, zorder=4,
            )  # fmt: skip
        axes.set(xlim=(west, east), ylim=(south, north), aspect="equal")
        axes.set_title(locus.title, fontsize=10)
        axes.set_xlabel("Re z", fontsize=9, labelpad=1.0)
        axes.set_ylabel("Im z", fontsize=9, labelpad=0.0)
        axes.grid(**GRID)
        if locus.gains:
            axes.legend(frameon=False, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12))
    figure.suptitle(title, fontsize=11)
    return png(figure)


def gains_of(loop: control.TransferFunction) -> NDArray[np.float64]:
    """Gains for a locus: close together where branches meet and part, where poles move as the root of the gain."""
    over, under = np.atleast_1d(loop.num[0][0]), np.atleast_1d(loop.den[0][0])
    points = np.roots(np.polysub(np.polymul(np.polyder(over), under), np.polymul(over, np.polyder(under))))
    points = points[np.abs(points.imag) < 1e-6].real
    with np.errstate(divide="ignore", invalid="ignore"):
        meet = -np.polyval(under, points) / np.polyval(over, points)
    beside = 0.1 * np.linspace(-1.0, 1.0, 101)
    close = [gain * (1.0 + beside * np.abs(beside)) for gain in meet if 1e-9 < gain < 1e6]
    return np.unique(np.concatenate([[0.0], np.geomspace(1e-5, 1e4, 1500), *close]))


def responses(title: str, columns: Sequence[Column], band: float | None = None) -> bytes:
    """Distance above, steering below; the wanted distance and the limit dashed, ``band`` metres beside it shaded."""
    figure = Figure(figsize=(4.4 * len(columns), 5.6), layout="constrained")
    panels = figure.subplots(2, len(columns), sharex="col", squeeze=False)
    for axes in panels[0, 1:]:
        axes.sharey(panels[0, 0])
    ignored = False
    for place, column in enumerate(columns):
        above, below = panels[:, place]
        above.axhline(1.0, color="#808080", linewidth=1.0, linestyle="--")
        if band is not None:
            above.axhspan(1.0 - band, 1.0 + band, color="#d8e8d8", zorder=0)
        for which, (name, run) in enumerate(column.runs.items()):
            shown = run.time < column.until
            # The first one, usually calmer, on top and thicker.
            style: dict[str, Any] = {"color": colour_of(which), "linewidth": 1.4 - 0.7 * which, "zorder": 3 - which}
            above.plot(run.time[shown], run.distance[shown], label=name, **{**style, "linewidth": 1.4})
            # The steering is held until the next sample.
            below.step(run.time[shown], run.steering[shown], where="post", **style)
        asked = max(np.abs(run.steering).max() for run in column.runs.values())
        ignored |= not column.limited and asked > LIMIT
        if column.limited or asked > LIMIT:  # not where it would dwarf what is shown
            for limit in (-LIMIT, LIMIT):
                below.axhline(limit, color="#b00000", linewidth=1.0, linestyle="--" if column.limited else ":")
        above.set_title(column.title, fontsize=9)
        if column.below:
            below.set_title(column.below, fontsize=9)
        below.set_xlabel("time [s]")
        above.margins(x=0.01)
        for axes in (above, below):
            axes.grid(**GRID)
    if any(name for name in columns[0].runs):
        panels[0, 0].legend(frameon=False, fontsize=8, loc="lower right")
    panels[0, 0].set_ylabel("distance from the wall [m]")
    panels[1, 0].set_ylabel("steering [°], limit dashed" + ("\n(dotted: ignored)" if ignored else ""))
    figure.suptitle(title, fontsize=11)
    return png(figure)


def comparison(panels: Sequence[tuple[str, Mapping[str, Mapping[str, Run]]]], called: Mapping[str, str]) -> bytes:
    """Distances over time: a column a variant, two rows a start, the report's three approaches and the rest."""
    groups = (("pi", "pi-state", "cascade", "cascade-redesigned"), ("pd", "pd-misprinted", "cascade-delayed"))
    titles = {
        "published": "published: their simulation, units mixed (no car)",
        "as-driven": "as-driven: degrees per metre, on the car",
        "si": "si: designed in radians, on the car",
    }
    figure = Figure(figsize=(13, 11), layout="constrained")
    grid = figure.subplots(2 * len(panels), len(titles), sharex="col", sharey=True)
    for row, (start, runs) in enumerate(panels):
        for part, names in enumerate(groups):
            for place, variant in enumerate(titles):
                axes = grid[2 * row + part, place]
                axes.axhline(1.0, color="#808080", linewidth=1.0, linestyle="--")
                axes.axhspan(-1.0, 0.0, color="#e8dcd0", zorder=0)
                for which, name in enumerate(names):
                    if name in runs[variant]:
                        run = runs[variant][name]
                        colour = colour_of(which + 4 * part)
                        axes.plot(run.time, run.distance, color=colour, linewidth=1.4, label=called[name])
                axes.grid(**GRID)
                axes.set_ylim(-0.3, 2.7)
                if row + part == 0:
                    axes.set_title(titles[variant], fontsize=10)
            grid[2 * row + part, 0].set_ylabel(f"from {start}\ndistance [m]", fontsize=9)
            grid[2 * row + part, 2].legend(frameon=False, fontsize=8, loc="upper right", ncols=2)
    grid[0, 0].set_xlim(-0.1, 5.0)  # it is over soon
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    figure.suptitle("Distance of the sensor from the wall (shaded: behind it), steering limited to 22°", fontsize=11)
    return png(figure)


def steps(responses: Mapping[str, tuple[NDArray[Any], NDArray[Any]]]) -> bytes:
    """Step responses side by side, held between samples."""
    figure = Figure(figsize=(4.2 * len(responses), 3.6), layout="constrained")
    panels = figure.subplots(1, len(responses), squeeze=False)[0]
    for place, (axes, (title, (time, out))) in enumerate(zip(panels, responses.items(), strict=True)):
        axes.axhline(1.0, color="#808080", linewidth=1.0, linestyle="--")
        axes.step(time, out, where="post", color=colour_of(place), linewidth=1.4)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("time [s]")
        axes.grid(**GRID)
    figure.suptitle("Step responses: why no pole is to lie left of zero", fontsize=11)
    return png(figure)
