"""Figures 8 to 10 of Werling, Gröll, Bretthauer 2008, and its robustness."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from lanekeep_baselines.werling_longitudinal import LongitudinalTuning
from lanekeep_benchmarks.looks import GRID, colour_of, png, scale_bar
from lanekeep_benchmarks.replications.passat import Drive, Floats
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def outline(axes: Axes, place: Floats, heading: float, car: VehicleParameters, to_rear: float, colour: str) -> None:
    """Draw a car whose reference point, ``to_rear`` m before the rear axle, is at ``place``."""
    overhang = 0.5 * (car.length - car.wheelbase)
    along = np.array([-overhang, car.length - overhang]) - to_rear
    corners = np.array([(along[i], side) for i, side in ((0, -1), (1, -1), (1, 1), (0, 1), (0, -1))], dtype=np.float64)
    corners[:, 1] *= 0.5 * car.width
    cosine, sine = np.cos(heading), np.sin(heading)
    x, y = corners.T
    axes.plot(place[0] + x * cosine - y * sine, place[1] + x * sine + y * cosine, color=colour, linewidth=0.8)


def figure_8(runs: Mapping[str, Drive]) -> bytes:
    """Course in the world, error, steering wheel angle and lateral acceleration, one colour a friction."""
    figure = Figure(figsize=(9, 10), layout="constrained")
    scaled, world, *panels = figure.subplots(5, 1, gridspec_kw={"height_ratios": [0.6, 1.1, 1, 1, 1]})
    first = next(iter(runs.values()))
    road, car = first.roads[0], first.scenario.vehicle
    for axes in (scaled, world):
        axes.plot(*road.position(np.linspace(0.0, 110.0, 800)).T, "--", color="#606060", linewidth=1.0, label="path")
    for place, (name, driven) in enumerate(runs.items()):
        colour, course = colour_of(place), driven.world()
        for axes in (scaled, world):
            axes.plot(*course.T, color=colour, linewidth=1.3, label=name)
        if place == 0:
            heading = road.heading(driven.station[:, 0]) + driven["heading_error"][:, 0]
            for step in range(0, len(course), 25):
                outline(scaled, course[step], float(heading[step]), car, car.cg_to_rear_axle, "#909090")
        wheel = np.degrees(driven["steering_angle"][:, 0]) * car.steering_ratio
        values = (driven["lateral_error"][:, 0], wheel, driven["lateral_acceleration"][:, 0])
        for axes, value in zip(panels, values, strict=True):
            axes.plot(driven.time, value, color=colour, linewidth=1.2)
    scaled.set_aspect("equal")
    scaled.set_ylim(-1.5, 5.5)
    world.set_xlabel("x [m]")
    for axes in (scaled, world):
        axes.set_xlim(-4.0, 106.0)
        axes.set_ylabel("y [m]")
    world.legend(frameon=False, fontsize=8, ncols=4, loc="lower right")
    labels = ("error d [m]", "steering wheel [°]", "lateral acceleration\n[m/s²]")
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        axes.set_xlim(0.0, first.time[-1])
        axes.sharex(panels[0])
    for axes in (scaled, world, *panels):
        axes.grid(**GRID)
    panels[-1].set_xlabel("time [s]")
    figure.suptitle("Figure 8: evasive path at 55 km/h, from 0.8 m beside it (to scale, and y stretched)", fontsize=11)
    return png(figure)


def figure_9(runs: Mapping[str, Drive], car: VehicleParameters) -> bytes:
    """Path and course of the rear axle in the world, and its error over the way."""
    figure = Figure(figsize=(9, 7.5), layout="constrained")
    world, error = figure.subplots(2, 1, gridspec_kw={"height_ratios": [1, 1.2]})
    driven = next(iter(runs.values()))
    road = driven.roads[0]
    world.plot(*road.position(np.linspace(0.0, road.length, 600)).T, "--", color="#606060", label="path")
    course = driven.world()
    world.plot(*course.T, color=colour_of(0), linewidth=1.2, label="rear axle")
    heading = road.heading(driven.station[:, 0]) + driven["heading_error"][:, 0]
    front = course + car.wheelbase * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    world.plot(*front.T, color=colour_of(4), linewidth=0.9, label="front axle")
    for step in np.linspace(0, len(course) - 1, 5).astype(int):
        outline(world, course[step], float(heading[step]), car, 0.0, "#909090")
    world.set_aspect("equal")
    world.set_xlim(3.0, 19.5)
    world.set_ylim(-4.6, 1.6)
    world.set_xlabel("x [m]")
    world.set_ylabel("y [m]")
    world.legend(frameon=False, fontsize=8, loc="upper right")
    scale_bar(world, 16.5)
    for place, (name, run) in enumerate(runs.items()):
        way = road.length - run.station[:, 0]
        error.plot(way, 100.0 * run["lateral_error"][:, 0], color=colour_of(place), linewidth=1.2, label=name)
    error.axhspan(-1.0, 1.0, color="#e8f0e8", zorder=0)
    error.set_xlabel("way of the rear axle [m]")
    error.set_ylabel("its error [cm] (shaded: 1 cm)")
    error.legend(frameon=False, fontsize=8)
    for axes in (world, error):
        axes.grid(**GRID)
    figure.suptitle("Figure 9: backwards through bends of 5 m radius, steering lag 0.1 s", fontsize=11)
    return png(figure)


def figure_10(driven: Drive, mean: Floats, takeover: float, laws: LongitudinalTuning) -> bytes:
    """Speed, pedals, gaps, acceleration and gear over time."""
    figure = Figure(figsize=(9, 10), layout="constrained")
    speed, pedal, gaps, rate, gear = figure.subplots(5, 1, sharex=True, gridspec_kw={"height_ratios": [2, 1, 2, 2, 1]})
    time, far = driven.time, 199.0
    speed.plot(time, driven["speed"][:, 0], color=colour_of(0), label="speed")
    speed.step(time, driven["set_speed"][:, 0], "--", where="post", color="#606060", label="set speed")
    lead, stop = driven["lead_gap"][:, 0], driven["stop_gap"][:, 0]
    ahead = lead < far
    speed.plot(time, np.where(ahead, driven["lead_speed"][:, 0], np.nan), color=colour_of(1), label="car ahead")
    speed.set_ylabel("speed [m/s]")
    asked = driven.action[:, 0, 1]
    pedal.plot(time, np.maximum(asked, 0.0), color=colour_of(2), label="throttle")
    pedal.plot(time, np.maximum(-asked, 0.0), color=colour_of(1), label="brake")
    pedal.set_ylabel("pedals")
    wanted = laws.standing_gap + laws.time_gap * driven["speed"][:, 0]
    gaps.plot(time, np.where(ahead, lead, np.nan), color=colour_of(0), label="to the car ahead")
    gaps.plot(time, np.where(ahead, wanted, np.nan), "--", color="#606060", label="L + τ v")
    gaps.plot(time, np.where(stop < far, stop, np.nan), color=colour_of(3), label="to the stop point")
    gaps.set_ylabel("distance [m]")
    rate.plot(time, driven["acceleration"][:, 0], color="#b0b0b0", linewidth=0.8, label="acceleration")
    rate.plot(time, mean, color=colour_of(0), linewidth=1.2, label="its mean over 0.3 s")
    rate.set_ylabel("acceleration [m/s²]")
    gear.step(time, driven["gear"][:, 0] + 1, where="post", color=colour_of(0))
    gear.set_ylabel("gear")
    gear.set_xlabel("time [s]")
    for axes in (speed, pedal, gaps, rate, gear):
        axes.grid(**GRID)
        axes.set_xlim(0.0, time[-1])
        for event in (4.0, 15.0, 30.0, 37.0):
            axes.axvline(event, color="#808080", linewidth=0.8, linestyle=":")
        axes.axvline(takeover, color=colour_of(3), linewidth=0.8, linestyle=":")
    for axes in (speed, pedal, gaps, rate):
        axes.legend(frameon=False, fontsize=8, loc="center right" if axes is speed else "upper right")
    events = ((4.0, "10 m/s"), (takeover, "speed law"), (15.0, "car ahead"), (30.0, "gone"), (37.0, "stop point"))
    for event, name in events:
        across = "right" if name == "speed law" else "left"
        speed.annotate(name, (event, 1.02), xycoords=("data", "axes fraction"), ha=across, fontsize=8, color="#505050")
    figure.suptitle("Figure 10: starting, set speed, car ahead, stop point (dotted: events, and who takes over)")
    return png(figure)


def braking_in_a_swerve(runs: Mapping[str, Drive]) -> bytes:
    """Course, errors along and across the path, and both accelerations within the circle of friction."""
    figure = Figure(figsize=(9, 10), layout="constrained")
    grid = figure.add_gridspec(4, 2, height_ratios=[1, 1, 1, 1.6])
    world, gap, error = (figure.add_subplot(grid[row, :]) for row in range(3))
    speed, circle = figure.add_subplot(grid[3, 0]), figure.add_subplot(grid[3, 1])
    first = next(iter(runs.values()))
    world.plot(*first.roads[0].position(np.linspace(0.0, 90.0, 800)).T, "--", color="#606060", linewidth=1.0)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for friction in sorted({driven.scenario.friction for driven in runs.values()}):
        most = friction * GRAVITY
        circle.plot(most * np.cos(turn), most * np.sin(turn), ":", color="#808080", linewidth=0.8)
    for place, (name, driven) in enumerate(runs.items()):
        style: dict[str, Any] = {"color": colour_of(place), "linewidth": 1.2}
        world.plot(*driven.world().T, label=name, **style)
        for axes, channel in ((gap, "position_gap"), (error, "lateral_error"), (speed, "speed")):
            axes.plot(driven.time, driven[channel][:, 0], **style)
        circle.plot(driven["lateral_acceleration"][:, 0], driven["acceleration"][:, 0], **style)
        if place < 2:  # the same for every friction
            speed.plot(driven.time, driven["position_speed"][:, 0], "--", color="#606060", linewidth=1.0)
    circle.set_aspect("equal")
    texts = (
        (world, "x [m]", "y [m]"),
        (gap, "", "way to the set position [m]"),
        (error, "time [s]", "lateral error [m]"),
        (speed, "time [s]", "speed [m/s] (dashed: set position)"),
        (circle, "lateral acceleration [m/s²]", "along [m/s²] (dotted: friction)"),
    )
    for axes, below, beside in texts:
        axes.set_xlabel(below)
        axes.set_ylabel(beside)
        axes.grid(**GRID)
    gap.set_ylim(-8.0, 1.0)
    world.set_xlim(0.0, 90.0)
    world.legend(frameon=False, fontsize=8, ncols=2)
    figure.suptitle("Braking in a swerve: Figure 8's path at 55 km/h behind a set position (x(t), y(t))", fontsize=11)
    return png(figure)


def robustness(
    jumps: Mapping[str, tuple[Floats, Floats]], sizes: Floats, steps: Mapping[str, tuple[Floats, Floats]]
) -> bytes:
    """Error after jumps of the measured position up to 2 m, and after a step of the path's curvature."""
    columns = 4
    rows = -(-(len(jumps) + 1) // columns)
    figure = Figure(figsize=(3.0 * columns, 2.8 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (name, (time, error)) in zip(panels, jumps.items(), strict=False):
        for k in range(int(np.sum(sizes <= 2.0))):
            axes.plot(time, error[:, k], color=colour_of(k), linewidth=1.2, label=f"{sizes[k]:g} m")
        axes.set_title(name, fontsize=8)
        axes.set_ylim(-0.7, 2.1)
    panels[0].legend(frameon=False, fontsize=8, title="jump of", title_fontsize=8, loc="upper right")
    last = panels[len(jumps)]
    for place, (name, (time, error)) in enumerate(steps.items()):
        last.plot(time, error, color=colour_of(place), linewidth=1.2, label=name)
    last.set_title("curvature steps to 4 m/s²", fontsize=8)
    last.legend(frameon=False, fontsize=8)
    for axes in panels[len(jumps) + 1 :]:
        axes.set_axis_off()
    for axes in panels[: len(jumps) + 1]:
        axes.grid(**GRID)
        axes.set_xlabel("time since [s]")
    for axes in panels[::columns]:
        axes.set_ylabel("lateral error [m]")
    figure.suptitle("Jumps of the measured position and of the path's curvature at 55 km/h", fontsize=11)
    return png(figure)
