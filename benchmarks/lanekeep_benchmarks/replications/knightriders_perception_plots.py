"""A picture of each step of the KnightRiders' perception: seen from above, the car drives upwards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle, Wedge
from numpy.typing import NDArray

from lanekeep_baselines.path_clearance import Body, aside
from lanekeep_baselines.path_planning import evade, roll
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.scan_classes import IMPROVED, KINDS, PUBLISHED, WALL, Perception, classify
from lanekeep_baselines.scan_corners import right_corner
from lanekeep_baselines.scan_glass import is_glass, shown_ahead
from lanekeep_baselines.scan_points import bridged, filled, median
from lanekeep_baselines.scan_targets import ASIDE, NEAR, jump_point, jumps
from lanekeep_benchmarks.plots import GRID, colour_of, png
from lanekeep_benchmarks.replications.knightriders_scenes import CAMERA, FIRST, box, cast, line, with_faults
from lanekeep_env.sensing.ultrasonic import HALF_CONE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The assumed car at 22 degrees of steering, 0.532 x 0.265 m; margin of the improved target and reverse, m.
_RADIUS = float(0.35 / np.tan(np.deg2rad(22.0)))
_CAR, _MARGIN, _REVERSE = Body(0.441, 0.091, 0.1325, _RADIUS, _RADIUS), 0.1, 0.3
_ANGLES = FIRST + CAMERA.step * np.arange(CAMERA.beams)
_WALLS: dict[str, Any] = {"color": "#909090", "linewidth": 3.0, "alpha": 0.5, "solid_capstyle": "butt"}
_RULES = {"published": PUBLISHED, "improved": IMPROVED}


def steps() -> dict[str, bytes]:
    """Return the pictures by their files' names."""
    return {
        "perception_1_points.png": _points(),
        "perception_2_classes.png": _classes(),
        "perception_3_jump_points.png": _jumps(),
        "perception_4_corner.png": _corner(),
        "perception_5_glass.png": _glass(),
    }


def confusions(tables: Mapping[str, NDArray[np.int64]]) -> bytes:
    """What each kind of scene was taken for, a panel a rule."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    for axes, (name, table) in zip(figure.subplots(1, len(tables)), tables.items(), strict=True):
        shares = table / table.sum(axis=1, keepdims=True)
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
        for (row, column), count in np.ndenumerate(table):
            colour = "white" if shares[row, column] > 0.6 else "black"
            text = f"{count}\n{100.0 * shares[row, column]:.1f} %"
            axes.text(column, row, text, ha="center", va="center", color=colour)
        axes.set_xticks(range(len(KINDS)), KINDS)
        axes.set_yticks(range(len(KINDS)), KINDS)
        right = 100.0 * np.trace(table) / table.sum()
        axes.set(xlabel="taken for", ylabel="truth", title=f"{name}: {right:.1f} % right")
    return png(figure)


def _scene(walls: Sequence[Floats], seed: int = 0) -> Floats:
    """Return a faulty scan of walls, (1, beams)."""
    return with_faults(cast(list(walls)), np.random.default_rng(seed))[None]


def _above(axes: Axes, walls: Sequence[Floats], shown: tuple[float, float, float, float], title: str) -> None:
    """Draw walls and the car's body from above; ``shown`` is left, right, behind, ahead, m."""
    for x0, y0, x1, y1 in walls:
        axes.plot([-y0, -y1], [x0, x1], **_WALLS)
    axes.add_patch(Rectangle((-_CAR.half_width, -_CAR.front - _CAR.rear), 2 * _CAR.half_width,
                             _CAR.front + _CAR.rear, facecolor="#d8d8d8", edgecolor="black"))  # fmt: skip
    left, right, behind, ahead = shown
    axes.set(xlim=(-left, right), ylim=(behind, ahead), aspect="equal", xlabel="to the right [m]", ylabel="ahead [m]")
    axes.set_title(title, fontsize=10)
    axes.grid(**GRID)


def _dots(axes: Axes, place: Floats, colour: str, label: str = "", size: float = 3.0) -> None:
    axes.plot(-place[:, 1], place[:, 0], "o", color=colour, markersize=size, label=label, linestyle="none")


def _points() -> bytes:
    """A slim box before a wall: the raw scan, the report's reading and the improved one, over the angle and above."""
    walls = [*box(1.05, 0.0, 0.1, 0.1), *box(1.3, -0.6, 0.3, 0.4), line(2.5, 0.5 * np.pi)]
    raw = _scene(walls, 3)
    figure = Figure(figsize=(13.0, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    known = raw[0] > 0.0
    far = CAMERA.farthest
    readings = {
        "NaN to the maximum": (filled(raw, far), ":"),
        "published: then the median over 41": (median(filled(raw, far)), "-"),
        "improved: bridged, median over 5": (median(bridged(raw, far, IMPROVED.bridge), IMPROVED.window), "-"),
    }
    for place, (name, (ranges, style)) in enumerate(readings.items()):
        left.plot(np.rad2deg(_ANGLES), ranges[0], style, color=colour_of(place), linewidth=1.4, label=name)
    left.plot(np.rad2deg(_ANGLES[known]), raw[0][known], "k.", markersize=4, label="shown by the camera")
    left.set(xlabel="angle, + left [°]", ylabel="range [m]", ylim=(0.0, 4.0), title="Range of each beam")
    left.invert_xaxis()
    left.grid(**GRID)
    left.legend(frameon=False, fontsize=8, loc="lower left")
    _above(right, walls, (1.9, 1.9, -0.6, 2.9), "The median over 41 erases what under 21 beams see")
    for place, (name, rule) in enumerate(_RULES.items(), 1):
        _dots(right, rule.points(raw, CAMERA)[0], colour_of(place), name)
    right.legend(frameon=False, fontsize=8, loc="lower left")
    return png(figure)


def _classes() -> bytes:
    """Detection box, hit and walk before a wall, a box and nothing, published above improved."""
    side = [np.array([-0.5, -0.8, 5.0, -0.8]), np.array([-0.5, 0.9, 5.0, 0.9])]
    scenes = {
        "a wall at 50°": [line(0.85, np.deg2rad(50.0)), *side],
        "a slim box": [*box(0.85, 0.05, 0.15, 0.12), line(3.0, 0.5 * np.pi), *side],
        "a wall at 6°": [line(1.9, np.deg2rad(6.0)), line(4.0, 0.5 * np.pi)],
        "a box at the rim": [*box(0.9, 0.4, 0.3, 0.4), line(3.0, 0.5 * np.pi), *side],
    }
    figure = Figure(figsize=(15.0, 9.0), layout="constrained")
    panels = figure.subplots(2, len(scenes))
    for row, (name, rule) in enumerate(_RULES.items()):
        for axes, (truth, walls) in zip(panels[row], scenes.items(), strict=True):
            place = rule.points(_scene(walls, 1), CAMERA)
            seen = classify(place, CAMERA, rule)
            kind = KINDS[seen.kind[0]] + (f" at {np.rad2deg(seen.angle[0]):.1f}°" if seen.kind[0] == WALL else "")
            _above(axes, walls, (1.0, 1.0, -0.6, 2.0), f"{truth}\n{name}: {kind}")
            _dots(axes, place[0], "#707070")
            axes.add_patch(_box(rule))
            if seen.hit[0] >= 0:
                _dots(axes, place[0, seen.first[0] : seen.last[0] + 1], colour_of(0), "walk", 4.0)
                _dots(axes, place[0, seen.hit[0] : seen.hit[0] + 1], colour_of(1), "hit", 8.0)
                axes.legend(frameon=False, fontsize=8, loc="lower right")
    return png(figure)


def _box(rule: Perception) -> Rectangle:
    where = (-rule.box_side, 0.0)
    return Rectangle(where, 2 * rule.box_side, rule.box_ahead, facecolor=colour_of(2), alpha=0.15, edgecolor="none")


def _jumps() -> bytes:
    """Jump points, the space beside the chosen one, the target and the body on its way, published beside improved."""
    walls = [*box(1.05, -0.1, 0.3, 0.4), *[np.array([-0.5, y, 5.0, y]) for y in (-0.7, 1.1)], line(4.0, 0.5 * np.pi)]
    raw = _scene(walls, 2)
    figure = Figure(figsize=(11.0, 7.5), layout="constrained")
    for axes, (name, rule) in zip(figure.subplots(1, 2), _RULES.items(), strict=True):
        place = rule.points(raw, CAMERA)
        found = jump_point(place, CAMERA, rule)
        offset = np.array([ASIDE])
        if name == "improved":
            offset = aside(found.ahead, found.left, found.side, _CAR, _MARGIN, _REVERSE)
        ahead, left = found.target(offset)
        segments = evade(ahead + _CAR.front, left, _RADIUS, _RADIUS, _REVERSE)[0]
        _above(axes, walls, (1.2, 1.0, -0.9, 1.9), f"{name}: target {offset[0]:.2f} m beside the jump point")
        _swept(axes, segments)
        _dots(axes, place[0], "#707070")
        ends = np.logical_or(*jumps(place, CAMERA, rule))[0] & (np.hypot(*place[0].T) < NEAR)
        _dots(axes, place[0, ends], colour_of(1), "jump points", 7.0)
        axes.add_patch(Circle((-found.left[0], found.ahead[0]), rule.free, fill=False, linestyle="--", edgecolor="k"))
        axes.plot(-left, ahead, "*", color=colour_of(2), markersize=14, label="target of the rear axle")
        axes.legend(frameon=False, fontsize=8, loc="lower left")
    return png(figure)


def _swept(axes: Axes, segments: Floats) -> None:
    """Draw the body along a path that starts with the nose at the origin."""
    pose, corners = (
        np.zeros(3),
        np.array([[-_CAR.rear, -1.0], [_CAR.front, -1.0], [_CAR.front, 1.0], [-_CAR.rear, 1.0]]),
    )
    corners = corners * [1.0, _CAR.half_width]
    for way, curvature in segments:
        for x, y, heading in roll(pose, np.linspace(0.0, way, 8), curvature):
            cosine, sine = np.cos(heading), np.sin(heading)
            ahead = x - _CAR.front + cosine * corners[:, 0] - sine * corners[:, 1]
            left = y + sine * corners[:, 0] + cosine * corners[:, 1]
            outline = np.stack([-left, ahead], axis=1)
            axes.add_patch(Polygon(outline, facecolor=colour_of(0), alpha=0.08, edgecolor=colour_of(0)))
        pose = roll(pose, way, curvature)


def _corner() -> bytes:
    """The right wall from the rim to its end."""
    walls = [np.array(wall) for wall in ((-0.5, -0.5, 1.9, -0.5), (1.9, -0.5, 1.9, -3.0), (3.4, -3.0, 3.4, 1.0))]
    walls.append(np.array([-0.5, 0.9, 3.4, 0.9]))
    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    for axes, (name, rule) in zip(figure.subplots(1, 2), _RULES.items(), strict=True):
        place = rule.points(_scene(walls, 5), CAMERA)
        corner = right_corner(place, CAMERA, rule)
        text = f"the wall ends {corner.ahead[0]:.2f} m ahead (truth: 1.90)" if corner.found[0] else "no corner"
        _above(axes, walls, (1.1, 2.0, -0.7, 3.6), f"{name}: {text}")
        _dots(axes, place[0], "#707070")
        if corner.found[0]:
            axes.plot(-corner.left, corner.ahead, "o", color=colour_of(1), markersize=9, label="corner")
            middle = (-corner.left[0], corner.ahead[0])
            axes.add_patch(Circle(middle, rule.free, fill=False, linestyle="--", edgecolor="k", label="free"))
            axes.legend(frameon=False, fontsize=8, loc="lower right")
    return png(figure)


def _glass() -> bytes:
    """A glass wall: the scan shows what is behind it, the ultrasonic hears it."""
    pane, behind = line(0.8, np.deg2rad(75.0)), [line(3.0, 0.5 * np.pi), np.array([-0.5, -0.9, 3.0, -0.9])]
    raw = _scene(behind, 4)
    heard = cast([pane, *behind], 181, HALF_CONE).min()
    shown = shown_ahead(raw, _ANGLES, HALF_CONE)
    figure = Figure(figsize=(7.0, 6.5), layout="constrained")
    axes = figure.subplots()
    said = "glass" if is_glass(heard, shown)[0] else "no glass"
    _above(axes, behind, (1.6, 1.6, -0.6, 3.2), f"heard at {heard:.2f} m, shown from {shown[0]:.2f} m: {said}")
    axes.plot([-pane[1], -pane[3]], pane[[0, 2]], "--", color=colour_of(5), linewidth=3.0, label="glass")
    spread = float(np.rad2deg(HALF_CONE))
    axes.add_patch(Wedge((0.0, 0.0), heard, 90.0 - spread, 90.0 + spread, color=colour_of(1), alpha=0.25,
                         label="what the ultrasonic hears"))  # fmt: skip
    _dots(axes, IMPROVED.points(raw, CAMERA)[0], "#707070", "scan")
    axes.legend(frameon=False, fontsize=8, loc="lower left")
    return png(figure)
