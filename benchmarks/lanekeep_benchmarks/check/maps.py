"""A map of map_server: walls, size, the circuit's middle and how wide it is, and a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lanekeep_benchmarks.check.report import Report
from lanekeep_env.walls import MapFile, World


def check_map(path: Path, record: MapFile) -> tuple[Report, World]:
    """Read a map and say what it holds; ValueError where no car can start in it.

    Without a centre line of its own the middle of the walls is looked for; that there is none is told and no fault.
    """
    report = Report(f"map {path.name}")
    try:
        (world,) = record.build() if record.centre_line is not None else _found(record).build()
    except ValueError as error:
        if record.centre_line is not None or "no circuit" not in str(error):
            raise
        report.notes.append("no circuit: WallFollow-v0 drives it, Circuit-v0 needs a centre_line")
        (world,) = record.build()
    left, low, right, high = world.bounds
    report.add("walls", len(world.segments))
    report.add("size", f"{right - left:.4g} x {high - low:.4g}", "m")
    x, y, heading = (float(value) for value in world.start[0])
    report.add("start", f"{x:.3f}, {y:.3f} m, {heading:.3f} rad")
    report.add("clearance at the start", world.distance(x, y), "m")
    if world.centre_line is not None:
        clearance = [world.distance(float(px), float(py)) for px, py in world.centre_line]
        report.add("lap", world.length, "m")
        report.add("narrowest place: width", 2.0 * min(clearance), "m")
        report.add("mean width", 2.0 * float(np.mean(clearance)), "m")
        report.add("lap time at 1 m/s", world.length, "s")
        how = "as given" if record.centre_line not in (None, "found") else "found in the middle of the walls"
        report.notes.append(f"assumed: the centre line is {how}")
    unknown = "stop a car" if record.unknown_is_wall else "do not stop a car"
    report.notes.append(f"assumed: unknown cells {unknown} (unknown_is_wall)")
    return report, world


def _found(record: MapFile) -> MapFile:
    return MapFile(record.path, record.x, record.y, record.heading, record.unknown_is_wall, "found")


def draw_map(world: World) -> bytes:
    """Return a PNG picture: walls, centre line and start."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    from lanekeep_benchmarks.looks import png, scale_bar

    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    plan = figure.add_subplot()
    plan.add_collection(LineCollection(list(world.segments.reshape(-1, 2, 2)), colors="k", linewidths=0.8))
    if world.centre_line is not None:
        plan.plot(*np.vstack([world.centre_line, world.centre_line[: int(world.closed)]]).T, lw=0.8)
    x, y, heading = world.start[0]
    plan.annotate("", (x + np.cos(heading), y + np.sin(heading)), (x, y), arrowprops={"arrowstyle": "->", "color": "r"})
    plan.set_aspect("equal")
    plan.margins(x=0.05, y=0.1)  # the scale bar is below the walls
    plan.autoscale_view()
    plan.set(title=world.name, xlabel="x [m]", ylabel="y [m]")
    scale_bar(plan, float(np.ptp(world.segments.reshape(-1, 2), axis=0).max()))
    return png(figure)
