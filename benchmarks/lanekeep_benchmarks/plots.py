"""Pictures of a run, as PNG bytes: errors with intervals, one episode over time, the course on a map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.collections import LineCollection
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lanekeep_benchmarks.looks import GRID, colour_of, interesting, png, scale_bar, styles
from lanekeep_benchmarks.statistics import performance_profile
from lanekeep_benchmarks.summary import columns_of
from lanekeep_env import layout as at

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from lanekeep_env.roads import Road

#: The first three for pictures elsewhere.
__all__ = ["GRID", "colour_of", "plot_episode", "plot_errors", "plot_map", "plot_profiles", "png"]

Trace = Mapping[str, NDArray[np.float64]]


def plot_errors(summary: Mapping[str, Any]) -> bytes:
    """RMS lateral error (or lap time) of every policy with its interval, a panel a scenario, and its failure rate."""
    scenarios = summary["scenarios"]
    names = [row["policy"] for row in scenarios[0]["policies"]]
    columns = min(3, len(scenarios))
    rows = -(-len(scenarios) // columns)
    looks = styles(names, interesting(summary))
    figure = Figure(figsize=(3.0 + 2.8 * columns, 0.4 + rows * (1.1 + 0.4 * len(names))), layout="constrained")
    grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for axes, scenario in zip(grid.flat, scenarios, strict=False):
        primary = columns_of(scenario["policies"])[0]
        widest = _widest(scenario["policies"], primary.key)
        for place, row in enumerate(scenario["policies"]):
            error = row["metrics"][primary.key]
            colour = looks[row["policy"]]["color"]
            if error["value"] > widest:
                axes.plot(1.05 * widest, place, ">", color=colour, markersize=6)
                axes.annotate(
                    f"{error['value']:.2g} {primary.unit} ", (1.02 * widest, place), ha="right", va="center", fontsize=8
                )
            else:
                if error["low"] is not None:
                    axes.plot([error["low"], error["high"]], [place, place], color=colour, linewidth=3, alpha=0.5)
                axes.plot(error["value"], place, looks[row["policy"]].get("marker", "o"), color=colour, markersize=5)
            rate = 100 * row["failure_rate"]["value"]
            axes.annotate(
                f"{rate:.{0 if rate >= 1 else 1}f} %" if rate else "0",
                (1.02, place),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=8,
                color="#b00000" if rate else "#606060",
            )
        axes.annotate("failed", (1.02, 1.02), xycoords="axes fraction", fontsize=8, color="#606060")
        axes.set_title(scenario["scenario"], fontsize=10)
        axes.set_xlabel(f"{primary.label} [{primary.unit}]")
        axes.set_xlim(0, 1.1 * widest)
        axes.margins(y=0.15)
        axes.grid(axis="x", **GRID)
    for axes in grid.flat[len(scenarios) :]:
        axes.set_axis_off()
    grid[0, 0].set_yticks(range(len(names)), names)
    grid[0, 0].invert_yaxis()
    interval = f"bar: {100 * summary['confidence']:.0f} % interval of the mean"
    figure.suptitle(f"{summary['suite']}: {summary['episodes']} paired episodes, {interval}", fontsize=11)
    return png(figure)


def _widest(rows: Sequence[Mapping[str, Any]], key: str) -> float:
    """Largest error that the axis shows: that of the policies which mostly stay in their lane, if there are any."""
    kept = [row for row in rows if row["failure_rate"]["value"] <= 0.5] or rows
    return max(row["metrics"][key][end] or 0.0 for row in kept for end in ("value", "high"))


def plot_profiles(summary: Mapping[str, Any], values: Mapping[str, Mapping[str, NDArray[np.float64]]]) -> bytes:
    """Performance profiles: which share of episodes had at most so much of the first metric, a panel a scenario.

    ``values``: scenario and policy to the metric of each episode and training seed, infinite where it failed: a curve
    ends at the share that did not.
    """
    scenarios = summary["scenarios"]
    columns = min(3, len(scenarios))
    rows = -(-len(scenarios) // columns)
    shown = interesting(summary)
    figure = Figure(figsize=(1.0 + 3.6 * max(columns, 2), 1.2 + 2.8 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for axes, scenario in zip(grid.flat, scenarios, strict=False):
        table = scenario["policies"]
        metric = columns_of(table)[0]
        sign = -1.0 if metric.more_is_better else 1.0
        found = {row["policy"]: sign * values[scenario["scenario"]][row["policy"]] for row in table}
        ends = [_end(found[name]) for name in shown]
        least, most = min((low for low, _ in ends), default=0.0), max((high for _, high in ends), default=1.0)
        thresholds = np.linspace(min(0.0, least), most if most > least else least + 1.0, 400)
        for name, style in styles(list(found), shown).items():
            axes.plot(sign * thresholds, 100.0 * (1.0 - performance_profile(found[name], thresholds)), **style)
        axes.set_title(scenario["scenario"], fontsize=10)
        axes.set_xlabel(f"{metric.label} [{metric.unit}]" if metric.unit else metric.label)
        axes.grid(**GRID)
    for axes in grid.flat[len(scenarios) :]:
        axes.set_axis_off()
    for axes in grid[:, 0]:
        axes.set_ylabel("episodes with less [%]" if sign > 0.0 else "episodes with more [%]")
    figure.legend(
        *grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False, fontsize=8
    )
    figure.suptitle(f"{summary['suite']}: performance profiles over {summary['episodes']} episodes", fontsize=11)
    return png(figure)


def _end(numbers: NDArray[np.float64]) -> tuple[float, float]:
    kept = numbers[np.isfinite(numbers)]
    return (float(kept.min()), float(np.quantile(kept, 0.98, method="higher"))) if len(kept) else (0.0, 0.0)


#: Panels of an episode: names of truth or channels, the label, the scale. The first name that a trace has is drawn.
_PANELS: Sequence[tuple[Sequence[str], str, float]] = (
    (("lateral_error",), "lateral error [m]", 1.0),
    (("steering_angle",), "steering angle\n(road wheel) [°]", 180 / np.pi),
    (("speed",), "speed [km/h]", 3.6),
)
_WALLS = (*_PANELS[:2], (("speed",), "speed [m/s]", 1.0), (("distance_right",), "right wall [m]", 1.0))
_CAMERA = (*_PANELS, (("planned_curvature_0",), "curvature [1/m]", 1.0))
_DRIVE = (
    *_PANELS,
    (("gap", "lead_gap"), "gap to the\ncar ahead [m]", 1.0),
    (("stop_gap",), "way to the\nstop point [m]", 1.0),
)
_ROAD = (*_PANELS, (("curvature_preview_0",), "curvature [1/km]", 1000.0))


def _panels(traces: Mapping[str, Trace]) -> Sequence[tuple[Sequence[str], str, float]]:
    for name, panels in (("distance_right", _WALLS), ("lead_gap", _DRIVE), ("planned_curvature_0", _CAMERA)):
        if any(name in trace for trace in traces.values()):
            return panels
    return _ROAD


def plot_episode(
    title: str,
    traces: Mapping[str, Trace],
    control_step: float,
    lane_width: float | None,
    shown: Sequence[str] | None = None,
) -> bytes:
    """Lateral error, steering angle, speed and what else the task has over time of one episode, all policies.

    Those ``shown`` are in colours, all by default.
    """
    rows = _panels(traces)
    figure = Figure(figsize=(9, 4 + len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), 1, sharex=True, gridspec_kw={"height_ratios": [2, 1.4, *[1] * (len(rows) - 2)]})
    looks = styles(list(traces), list(traces) if shown is None else shown)
    for axes, (keys, label, scale) in zip(panels, rows, strict=True):
        for name, style in looks.items():
            values = next((traces[name][key] for key in keys if key in traces[name]), np.zeros(0))
            values = np.where(values < at.NOWHERE, values, np.nan)  # a gap to nobody is as large as that
            if np.isfinite(values).any():
                axes.plot(control_step * np.arange(1, len(values) + 1), scale * values, **style)
        axes.set_ylabel(label)
        axes.grid(**GRID)
    if lane_width is not None:
        _mark_lane(panels[0], lane_width)
    panels[-1].set_xlabel("time [s]")
    panels[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, frameon=False, fontsize=8)
    figure.suptitle(title, fontsize=11, parse_math=False)
    return png(figure)


def plot_map(
    title: str, road: Road, traces: Mapping[str, Trace], lane_width: float, shown: Sequence[str] | None = None
) -> bytes:
    """The road from above, the course's lateral error as colour for each policy, and the error over arc length.

    Those ``shown`` have a map and a colour, all by default.
    """
    looks = styles(list(traces), list(traces) if shown is None else shown)
    below_all, traces = traces, {name: traces[name] for name in (traces if shown is None else shown)}
    columns = min(3, len(traces))
    rows = -(-len(traces) // columns)
    figure = Figure(figsize=(4.2 * columns, 3.6 * rows + 3.2), layout="constrained")
    grid = figure.add_gridspec(rows + 1, columns)
    centre = road.position(np.linspace(0.0, road.length, 2000))
    # One scale for all maps: up to the lane's edge, spread out near zero, its own colour outside.
    scale = PowerNorm(0.5, vmin=0.0, vmax=lane_width / 2)
    colours = colormaps["viridis"].with_extremes(over="#d00000")
    maps, line = [], None
    for place, (name, trace) in enumerate(traces.items()):
        axes = figure.add_subplot(grid[place // columns, place % columns])
        axes.plot(*centre.T, color="#e4e4e4", linewidth=6, zorder=0)
        course = road.position(trace["arc_length"], trace["lateral_error"])
        error = np.abs(trace["lateral_error"])
        segments = list(np.stack([course[:-1], course[1:]], axis=1))
        line = LineCollection(segments, cmap=colours, norm=scale, linewidth=2.5)
        line.set_array(error[1:])
        axes.add_collection(line)
        axes.plot(*course[0], "k^", markersize=5)
        rms = np.sqrt(np.mean(error**2))
        axes.set_title(f"{name}: RMS {rms:.2f} m", fontsize=9, color=looks[name]["color"])
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_axis_off()
        scale_bar(axes, float(np.ptp(centre, axis=0).max()))
        maps.append(axes)
    if line is not None:
        figure.colorbar(line, ax=maps, label="|lateral error| [m], red outside the lane", shrink=0.7, extend="max")
    below = figure.add_subplot(grid[rows, :])
    for name, style in looks.items():
        trace = below_all[name]
        below.plot(travelled(trace["arc_length"], road.length), trace["lateral_error"], **style)
    _mark_lane(below, lane_width)
    below.set_xlabel("arc length [m]")
    below.set_ylabel("lateral error [m]")
    below.set_xlim(0.0, road.length)
    below.grid(**GRID)
    below.legend(ncols=5, fontsize=8, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    figure.suptitle(title, fontsize=11, parse_math=False)
    return png(figure)


def travelled(arc_length: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Arc length without the jump at the joint of a closed road."""
    return np.unwrap(arc_length, period=length)


def _mark_lane(axes: Axes, lane_width: float) -> None:
    """Lines at the lane's edges where the data come near them, and a range that shows the data."""
    low, high = axes.get_ylim()
    edges: Sequence[float] = (-lane_width / 2, lane_width / 2)
    if max(-low, high) > 2.0 * lane_width:  # a car that drove off would hide all others
        axes.set_ylim(max(low, -lane_width), min(high, lane_width))
    for edge in edges:
        if low - 0.3 < edge < high + 0.3:
            axes.axhline(edge, color="#b00000", linewidth=1, linestyle="--")
