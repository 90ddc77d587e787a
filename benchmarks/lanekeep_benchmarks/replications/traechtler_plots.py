"""Figures 5 and 7 of Trächtler, Lohmann, Struck 1992."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from lanekeep_benchmarks.plots import GRID, colour_of, png
from lanekeep_benchmarks.replications.van import Drive, Floats, LinearDrive


def figure_5(wanted: Floats, curves: Mapping[str, Floats]) -> bytes:
    """Steering angle over its set-point, one panel a curve, with the bisector."""
    figure = Figure(figsize=(9, 4.6), layout="constrained")
    panels = figure.subplots(1, len(curves), sharex=True, sharey=True)
    span = np.degrees(np.abs(wanted).max()) * np.array([-1.05, 1.05])
    for place, (axes, (name, angle)) in enumerate(zip(panels, curves.items(), strict=True)):
        axes.plot(span, span, color="#909090", linewidth=0.8, label="bisector")
        axes.plot(np.degrees(wanted), np.degrees(angle), color=colour_of(place), linewidth=1.2)
        axes.set_title(f"{name} over the measured angle", fontsize=10)
        axes.set_xlabel("set-point of δ [°]")
        axes.set_aspect("equal")
        axes.grid(**GRID)
    panels[0].set_ylabel("road-wheel angle δ [°]")
    panels[0].legend(frameon=False, fontsize=8)
    figure.suptitle("Figure 5: steering with 2° of backlash", fontsize=11)
    return png(figure)


def figure_7(driven: Drive, linear: LinearDrive, marks: Mapping[str, int]) -> bytes:
    """Steering angle and edge distance over time, the van and the linear simulation, t1 to t5 marked."""
    figure = Figure(figsize=(9, 6.4), layout="constrained")
    above, below, errors = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [2, 2, 1.2]})
    above.plot(driven.time, np.degrees(driven.steer), color=colour_of(0), label="van, nonlinear, with backlash")
    above.plot(driven.time, np.degrees(linear.steer), "--", color=colour_of(1), label="linear simulation, edge visible")
    above.set_ylabel("steering angle δ [°]")
    seen = np.where(driven.valid, driven.edge, np.nan)
    below.plot(driven.time, seen, color=colour_of(0))
    below.plot(driven.time, linear.edge, "--", color=colour_of(1))
    below.set_ylabel("edge distance d [m]")
    errors.plot(driven.time, driven.lateral, color=colour_of(0))
    errors.set_ylabel("rear axle's\nerror [m]")
    errors.set_xlabel("time [s]")
    end = driven.time[min(marks["t5"] + 400, len(driven.time) - 1)]
    for axes in (above, below, errors):
        axes.grid(**GRID)
        axes.set_xlim(0.0, end)
        axes.axvspan(driven.time[marks["t4"]], driven.time[marks["t5"]], color="#f0e4d8", zorder=0)
        for step in marks.values():
            axes.axvline(driven.time[step], color="#808080", linewidth=0.8, linestyle=":")
    for name, step in marks.items():
        above.annotate(
            f"t{'₁₂₃₄₅'[int(name[1]) - 1]}", (driven.time[step], 1.02), xycoords=("data", "axes fraction"), ha="center"
        )
    above.legend(frameon=False, fontsize=8, loc="lower left")
    figure.suptitle("Figure 7: left curve, straight, blind turn to the right (shaded: no edge, S2), 4 m/s", fontsize=11)
    return png(figure)
