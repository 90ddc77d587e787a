"""Figures 2, 3, 5 and 7 of Trächtler, Lohmann, Struck 1992, set points, and what errors of the plan cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
        axes.set_title(name, fontsize=10)
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


def figure_2(time: Floats, curves: Mapping[str, Mapping[str, tuple[Floats, ...]]]) -> bytes:
    """How d grows in both situations: exact, linear (dashed) and measured by the van's camera (dots)."""
    figure = Figure(figsize=(10, 4.6), layout="constrained")
    panels = figure.subplots(1, 2)
    titles = ("a: into a right curve with straight wheels", "b: on a straight with the wheels turned")
    for axes, title, named in zip(panels, titles, curves.values(), strict=True):
        for place, (name, (exact, linear, since, seen)) in enumerate(named.items()):
            axes.plot(time, exact, color=colour_of(place), linewidth=1.4, label=name)
            axes.plot(time, linear, "--", color=colour_of(place), linewidth=1.0)
            axes.plot(since, seen, "o", color=colour_of(place), markersize=3)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("time [s]")
        axes.grid(**GRID)
        axes.legend(frameon=False, fontsize=8)
    panels[0].set_ylabel("change of the edge distance Δd [m]")
    figure.suptitle("Figure 2: exact (solid), linear (dashed) and the van's camera (dots), 4 m/s", fontsize=11)
    return png(figure)


def figure_3(time: Floats, curves: Mapping[str, Floats]) -> bytes:
    """Responses of the model's blocks to steps."""
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    axes = figure.subplots()
    for place, (name, way) in enumerate(curves.items()):
        axes.plot(time, way, color=colour_of(place), label=name)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("change of the edge distance Δd [m]")
    axes.grid(**GRID)
    axes.legend(frameon=False, fontsize=8)
    figure.suptitle("Figure 3: steps through the blocks of the linear model, 4 m/s", fontsize=11)
    return png(figure)


def set_points(driven: Drive) -> bytes:
    """Edge distance beside the one that is asked for, and the steering."""
    figure = Figure(figsize=(9, 5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    above.step(driven.time, driven.wanted, where="post", color="#606060", linewidth=1.0, label="set point d_soll")
    above.plot(driven.time, driven.edge, color=colour_of(0), label="edge distance d")
    above.legend(frameon=False, fontsize=8)
    above.set_ylabel("[m]")
    below.plot(driven.time, np.degrees(driven.steer), color=colour_of(0))
    below.set_ylabel("steering angle δ [°]")
    below.set_xlabel("time [s]")
    for axes in (above, below):
        axes.grid(**GRID)
        axes.margins(x=0.01)
    figure.suptitle("The distance from the edge as a command, 4 m/s", fontsize=11)
    return png(figure)


def turns(errors: Mapping[tuple[str, float], Sequence[float]], speeds: Sequence[float], names: Sequence[str]) -> bytes:
    """Largest errors of turns by angle and of the bypass, a panel a speed; the lane's edge dashed."""
    drives = list(dict.fromkeys(drive for drive, _ in errors))
    figure = Figure(figsize=(11, 3.8), layout="constrained")
    for axes, speed in zip(figure.subplots(1, len(speeds), sharey=True), speeds, strict=True):
        for place, name in enumerate(names):
            largest = [errors[drive, speed][place] for drive in drives]
            across = np.arange(len(drives)) + 0.25 * (place - 1)
            axes.bar(across, largest, width=0.22, color=colour_of(place), label=name)
        axes.axhline(1.5, color="#b00000", linewidth=1.0, linestyle="--")
        labels = [drive.removeprefix("turn by ").replace(" ", "\n") for drive in drives]
        axes.set_xticks(np.arange(len(drives)), labels, fontsize=8)
        axes.set_xlabel(f"turn, {speed:g} m/s")
        axes.grid(**GRID, axis="y")
        axes.set_axisbelow(True)
        if axes.get_subplotspec().is_first_col():
            axes.set_ylabel("mean of the largest error [m]")
            figure.legend(loc="outside lower center", ncols=len(names), frameon=False, fontsize=8)
    figure.suptitle("Drives without the edge, by angle, and round an obstacle (red: lane's edge)", fontsize=11)
    return png(figure)


def plan_errors(curves: Mapping[str, Mapping[str, Sequence[float]]]) -> bytes:
    """Largest errors over the size of the plan's, a panel a kind; the lane's edge dashed."""
    labels = {
        "offset": "bends later or earlier by [m]",
        "radius": "radii wrong by [%]",
        "angle": "angles wrong by [%]",
        "recognised": "bend recognised ahead [m]",
    }
    figure = Figure(figsize=(12, 3.8), layout="constrained")
    panels = figure.subplots(1, len(curves), sharey=True)
    for axes, (kind, lines) in zip(panels, curves.items(), strict=True):
        size = np.array(lines["size"]) * (100.0 if kind in ("radius", "angle") else 1.0)
        for place, name in enumerate(name for name in lines if name != "size"):
            axes.plot(size, lines[name], "o-", color=colour_of(place), markersize=4, label=name)
        axes.axhline(1.5, color="#b00000", linewidth=1.0, linestyle="--")
        axes.set_xlabel(labels[kind])
        axes.set_ylim(0.0, 1.6)
        axes.grid(**GRID)
        if kind == "recognised":
            axes.axvline(6.5, color="#808080", linewidth=1.0, linestyle=":")
            axes.invert_xaxis()
    panels[0].set_ylabel("mean of the largest error [m]")
    panels[0].legend(frameon=False, fontsize=8)
    figure.suptitle(
        "Turns by 90° at 4 m/s by a plan with errors (red: lane's edge; dotted: look-ahead point)", fontsize=11
    )
    return png(figure)
