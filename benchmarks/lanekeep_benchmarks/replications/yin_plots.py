"""The figures of Yin 2010; y_d and θ_d are path minus vehicle, angles those of the steering wheel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from lanekeep_baselines.identification import DrivenRun
from lanekeep_benchmarks.looks import GRID, colour_of, png, scale_bar
from lanekeep_benchmarks.replications.passat import Floats
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.roads import Road

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _labelled(panels: Sequence[Axes], labels: Sequence[str], below: str) -> None:
    """Grid and labels of panels that stand on each other."""
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
        axes.grid(**GRID)
        axes.margins(x=0.01)
    panels[-1].set_xlabel(below)


def identification(run: DrivenRun, model: Floats) -> bytes:
    """Steering wheel, yaw rate, heading and course of a run: measured and from the identified model."""
    assert run.steering is not None and run.heading is not None and run.x is not None and run.y is not None
    figure = Figure(figsize=(10, 8), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=[1.6, 1.0])
    panels = [figure.add_subplot(grid[row, 0]) for row in range(3)]
    time = run.step * np.arange(len(run.speed))
    for place, (axes, measured) in enumerate(zip(panels, (run.steering, run.yaw_rate, run.heading), strict=True)):
        axes.plot(time, np.degrees(measured), color="#909090", linewidth=2.2, label="measured")
        axes.plot(time, np.degrees(model[:, place]), color=colour_of(1), linewidth=0.9, label="identified model")
    _labelled(panels, ("steering wheel [°]", "yaw rate [°/s]", "heading [°]"), "time [s]")
    panels[0].legend(frameon=False, fontsize=8, ncols=2, loc="upper left")
    course = figure.add_subplot(grid[:, 1])
    course.plot(run.x, run.y, color="#909090", linewidth=2.2)
    course.plot(model[:, 3], model[:, 4], color=colour_of(1), linewidth=0.9)
    course.set_aspect("equal")
    course.grid(**GRID)
    course.set_xlabel("x [m]")
    course.set_ylabel("y [m]")
    scale_bar(course, float(max(np.ptp(run.x), np.ptp(run.y))))
    figure.suptitle("Identification: a run that the model was not fitted to, from command and speed alone", fontsize=11)
    return png(figure)


def straight(time: Floats, error: Floats, heading: Floats, wheel: Floats) -> bytes:
    """Deviation, heading error and steering wheel over time."""
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for axes, values in zip(panels, (error, np.degrees(heading), np.degrees(wheel)), strict=True):
        axes.plot(time, values, color=colour_of(0))
    _labelled(panels, ("y_d [m]", "θ_d [°]", "steering wheel [°]"), "time [s]")
    panels[0].set_xlim(0.0, 12.0)
    figure.suptitle("Scenario (a): straight path, 60 km/h, 1.5 m beside it", fontsize=11)
    return png(figure)


def set_path(station: Floats, curvature: Floats, speed: Floats, lateral: Floats) -> bytes:
    """Curvature, speed and lateral acceleration along the set path."""
    figure = Figure(figsize=(9, 6.5), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for axes, values in zip(panels, (curvature, 3.6 * speed, lateral / GRAVITY), strict=True):
        axes.plot(station, values, color=colour_of(0))
    for sign in (-1.0, 1.0):
        panels[0].axhline(0.0109 * sign, color="#808080", linewidth=1.0, linestyle="--")
        panels[2].axhline(0.4 * sign, color="#808080", linewidth=1.0, linestyle="--")
    for limit in (68.0, 180.0):
        panels[1].axhline(limit, color="#808080", linewidth=1.0, linestyle="--")
    _labelled(panels, ("curvature [1/m]", "speed [km/h]", "lateral acceleration [g]"), "arc length [m]")
    figure.suptitle("Scenario (b): the set path (dashed: what the slides print)", fontsize=11)
    return png(figure)


def driven_path(road: Road, courses: Mapping[str, Floats]) -> bytes:
    """The set path and the cars' courses, and a detail where it turns most."""
    figure = Figure(figsize=(11, 5.5), layout="constrained")
    whole, detail = figure.subplots(1, 2)
    path = road.position(np.linspace(0.0, road.length, 4000))
    for axes in (whole, detail):
        axes.plot(*path.T, color="#606060", linewidth=2.0 if axes is detail else 1.2, label="set path")
        for place, (name, course) in enumerate(courses.items()):
            axes.plot(*course.T, color=colour_of(place), linewidth=1.0, label=name)
        axes.set_aspect("equal")
        axes.grid(**GRID)
        axes.set_xlabel("x [m]")
    middle = road.position(np.array([1575.0]))[0]  # of the first bend of full curvature
    detail.set_xlim(middle[0] - 40.0, middle[0] + 40.0)
    detail.set_ylim(middle[1] - 40.0, middle[1] + 40.0)
    detail.set_title("where it turns most", fontsize=10)
    low, high = path.min(axis=0) - 50.0, path.max(axis=0) + 50.0
    whole.set_xlim(low[0], high[0])
    whole.set_ylim(low[1], high[1])
    whole.set_ylabel("y [m]")
    whole.legend(frameon=False, fontsize=8)
    scale_bar(whole, float(np.ptp(path, axis=0).max()))
    scale_bar(detail, 80.0)
    figure.suptitle("Scenario (b): the driven path", fontsize=11)
    return png(figure)


def deviation(title: str, time: Floats, errors: Mapping[str, Floats]) -> bytes:
    """Deviations over time, one colour a controller."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    axes = figure.subplots()
    for place, (name, error) in enumerate(errors.items()):
        axes.plot(time[: len(error)], error, color=colour_of(place), linewidth=1.2, label=name)
    _labelled([axes], ("y_d [m]",), "time [s]")
    axes.legend(frameon=False, fontsize=8, ncols=3, loc="lower right")
    axes.set_ylim(-5.0, 4.2)
    figure.suptitle(f"Scenario (b): {title[0].lower()}{title[1:]}", fontsize=11)
    return png(figure)


def compensated(
    time: Floats, errors: Mapping[str, Floats], wheels: Mapping[str, Floats], shown: Sequence[str]
) -> bytes:
    """Deviation and steering of the controllers with an observer."""
    figure = Figure(figsize=(10, 6), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    for place, name in enumerate(errors):
        if name in shown:
            colour = colour_of(place)
            panels[0].plot(time[: len(errors[name])], errors[name], color=colour, linewidth=1.2, label=name)
            panels[1].plot(time[: len(wheels[name])], np.degrees(wheels[name]), color=colour, linewidth=1.2)
    _labelled(panels, ("y_d [m]", "steering wheel [°]"), "time [s]")
    panels[0].set_ylim(-4.0, 5.0)
    panels[0].legend(frameon=False, fontsize=8, ncols=2, loc="upper right")
    figure.suptitle("Scenario (b): LQR with compensation of the disturbance", fontsize=11)
    return png(figure)


def steering(time: Floats, curvature: Floats, wheels: Mapping[str, Floats]) -> bytes:
    """Steering over time, all of it and one bend."""
    figure = Figure(figsize=(10, 7), layout="constrained")
    panels = figure.subplots(2, 1)
    sharpest = time[int(np.argmax(np.abs(curvature)))]
    for axes in panels:
        for place, (name, wheel) in enumerate(wheels.items()):
            axes.plot(time[: len(wheel)], np.degrees(wheel), color=colour_of(place), linewidth=1.2, label=name)
    _labelled(panels, ("steering wheel [°]", "steering wheel [°]"), "time [s]")
    panels[1].set_xlim(sharpest - 14.0, sharpest + 14.0)
    panels[1].set_title("the sharpest bends", fontsize=10)
    panels[0].set_ylim(-85.0, 65.0)
    panels[0].legend(frameon=False, fontsize=8, ncols=3, loc="lower right")
    figure.suptitle("Scenario (b): comparison of the steering", fontsize=11)
    return png(figure)


def support(time: Floats, error: Floats, driver: Floats, added: Floats) -> bytes:
    """One episode with a driver: place in the lane, the driver's angle and what the assistant added (road wheel)."""
    figure = Figure(figsize=(10, 5.5), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    panels[0].plot(time, error, color=colour_of(0))
    for sign in (-1.0, 1.0):
        panels[0].axhline(0.975 * sign, color="#b00000", linewidth=1.0, linestyle="--")
    panels[1].plot(time, np.degrees(driver), color=colour_of(0), label="driver asks for")
    panels[1].plot(time, np.degrees(driver + added), color=colour_of(2), linewidth=1.0, label="actuator is told")
    panels[1].plot(time, np.degrees(added), color=colour_of(1), label="assistant adds")
    for axes in panels:
        axes.fill_between(
            time, 0, 1, where=(added != 0.0).tolist(), transform=axes.get_xaxis_transform(), color="#f0e4c8", zorder=0
        )
    _labelled(panels, ("lateral error [m]", "road-wheel angle [°]"), "time [s]")
    panels[1].legend(frameon=False, fontsize=8, ncols=3, loc="upper right")
    figure.suptitle(
        "Lane keeping support with a drowsy driver (shaded: interventions; red: the lane's edge)", fontsize=11
    )
    return png(figure)
