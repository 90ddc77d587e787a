"""A road file: length, curvature, widths, fit, what was assumed, speed and lap time, and a picture."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from lanekeep_benchmarks.check.report import Report
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.roads import LimitedSpeed, Road, lap_time, read_road
from lanekeep_env.scenario.lane_keep import steering_range


def check_road(path: Path, closed: bool | None, smoothing: float | None, track: str | None, lane: int | None) -> Report:
    """Read a road file and say what it holds; ValueError where it is no road (see `read_road`)."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        road = read_road(path, closed, smoothing, track, lane)
    report = Report(f"road {road.name}")
    report.add("length", road.length, "m")
    report.add("closed", road.closed)
    report.add("segments", len(road.lengths))
    peaks = np.maximum(np.abs(road.curvature_start), np.abs(road.curvature_end))
    sharpest = int(np.argmax(peaks))
    report.add("largest curvature", road.peak_curvature, "1/m")
    report.add("there the radius is", 1.0 / max(road.peak_curvature, 1e-12), "m")
    report.add("at arc length", float(road.stations[sharpest]), "m")
    bend = np.average((0.5 * (road.curvature_start + road.curvature_end)) ** 2, weights=road.lengths)
    report.add("RMS curvature", float(np.sqrt(bend)), "1/m")
    report.add("largest distance of a point from the road", road.fit_error, "m")
    if road.beside is not None and np.isfinite(road.beside[:, 1:3]).any():
        report.add("narrowest to the left", float(np.nanmin(road.beside[:, 1])), "m")
        report.add("narrowest to the right", float(np.nanmin(road.beside[:, 2])), "m")
    driven, speed = LimitedSpeed().along(road)
    report.add("speed at 0.4 g, lowest", float(speed.min()), "m/s")
    report.add("speed at 0.4 g, highest", float(speed.max()), "m/s")
    report.add("lap time at 0.4 g" if road.closed else "time at 0.4 g", lap_time(driven, speed), "s")
    if road.beside is not None and np.isfinite(road.beside[:, 3]).any():
        report.add("speed of the file, highest", float(np.nanmax(road.beside[:, 3])), "m/s")
    wheelbase = VEHICLES["yin"].wheelbase
    report.add("steering range of the default car", steering_range(wheelbase, road.peak_curvature), "rad")
    report.notes += [f"assumed: {phrase}" for phrase in road.assumed]
    report.notes += [str(one.message) for one in caught]
    widest = 2.0 / max(road.peak_curvature, 1e-9)
    if widest < 3.5:
        report.notes.append(f"a lane of 3.5 m folds over itself here: lane_width must be below {widest:.3g} m")
    return report


def draw_road(road: Road) -> bytes:
    """Return a PNG picture: the line coloured by curvature, and curvature and speed along it."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    from lanekeep_benchmarks.looks import png, scale_bar

    s = np.linspace(0.0, road.length, 4000)
    points, bend = road.position(s), road.curvature(s)
    driven, speed = LimitedSpeed().along(road)
    figure = Figure(figsize=(11.0, 5.0), layout="constrained")
    axes = figure.subplot_mosaic([["plan", "curvature"], ["plan", "speed"]])
    plan, upper, lower = axes["plan"], axes["curvature"], axes["speed"]
    line = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)), array=bend[:-1], cmap="coolwarm", lw=3.5)
    most = max(float(np.percentile(np.abs(bend), 98.0)), 1e-6)  # a hairpin would leave all else grey
    line.set_clim(-most, most)
    plan.add_collection(line)
    if road.given is not None and len(road.given) < 400:  # more would hide the line and its colours
        plan.plot(*road.given.T, ".", ms=1.0, color="k")
    ahead = road.position(min(0.04 * road.length, 100.0))
    plan.annotate("", tuple(ahead), tuple(points[0]), arrowprops={"arrowstyle": "-|>", "color": "k", "lw": 2.0})
    figure.colorbar(line, ax=plan, label="curvature [1/m], + left", location="bottom", extend="both", shrink=0.7)
    plan.set_aspect("equal", adjustable="datalim")
    plan.autoscale_view()
    plan.set(title=f"{road.name}: {road.length:.0f} m", xlabel="x [m]", ylabel="y [m]")
    scale_bar(plan, float(np.ptp(points, axis=0).max()))
    upper.plot(s, bend, lw=0.8)
    upper.set(ylabel="curvature [1/m]")
    lower.plot(driven.stations, speed, lw=0.8)
    lower.set(xlabel="arc length [m]", ylabel="speed at 0.4 g [m/s]")
    return png(figure)
