"""Whether heading and curvature that a table gives beside its points say what the points do; the points are read."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np

from lanekeep_env.roads.road import Floats

#: Length of the mean of unit vectors from which on angles differ by a constant, and by how much they may, rad.
_STEADY, _AXIS = 0.98, 0.1
#: How far a curvature's sum may be off the points' turning, as a share of that; and turning that says anything, rad.
_SHARE, _TURNING = 0.15, 0.3


def compare(points: Floats, columns: Mapping[str, Floats], name: str) -> tuple[str, ...]:
    """Return a phrase for each of "psi" (rad) and "kappa" (1/m) that is not what the points say; warn if it is wrong.

    A heading that counts from the y axis, as that of racelines does, is not wrong.

    Args:
        points: m, (n, 2).
        columns: by quantity, (n,) each.
        name: of the file, for the warning.
    """
    steps = np.diff(points, axis=0)
    moved = np.hypot(*steps.T) > 0.0
    steps, kept = steps[moved], np.append(moved, True)
    if len(steps) < 3:
        return ()
    told, wrong = [], []
    if "psi" in columns:
        phrase, bad = _heading(columns["psi"][kept], np.arctan2(steps[:, 1], steps[:, 0]))
        told += [phrase] if phrase else []
        wrong += [phrase] if bad else []
    if "kappa" in columns:
        phrase = _curvature(columns["kappa"][kept], steps)
        told += [phrase] if phrase else []
        wrong += [phrase] if phrase else []
    if wrong:
        warnings.warn(f"{name}: {'; '.join(wrong)}; the road is that of x, y", stacklevel=2)
    return tuple(told)


def _heading(psi: Floats, chords: Floats) -> tuple[str, bool]:
    """What is to be told of headings at the points, beside those of the chords between; whether that is a fault."""
    for unit, factor in (("", 1.0), ("degrees, ", np.pi / 180.0)):
        angles = factor * psi
        between = np.angle(np.exp(1j * angles[:-1]) + np.exp(1j * angles[1:]))
        for turns, word in ((1.0, "left"), (-1.0, "right")):
            mean = np.mean(np.exp(1j * (turns * between - chords)))
            if abs(mean) < _STEADY:
                continue
            return _words(unit, word, -float(np.angle(mean)))
    return "the heading psi does not follow x, y", True


def _words(unit: str, word: str, zero: float) -> tuple[str, bool]:
    """``zero``: where the heading is none, from the x axis to the left, rad."""
    axes = {"x": 0.0, "y": np.pi / 2.0}
    axis = next((axis for axis, angle in axes.items() if abs(zero - angle) < _AXIS), None)
    if axis == "x" and not unit and word == "left":
        return "", False
    where = f"the {axis} axis" if axis else f"{np.degrees(zero):.0f} deg from the x axis"
    return f"the heading psi is {unit}to the {word} of {where}", bool(unit) or word == "right" or axis is None


def _curvature(kappa: Floats, steps: Floats) -> str:
    """What is to be told of a curvature beside the points' steps."""
    turning = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    chord = np.hypot(*steps.T)
    summed = np.append(0.0, np.cumsum(kappa[1:-1] * 0.5 * (chord[:-1] + chord[1:])))
    turning, summed = turning - turning.mean(), summed - summed.mean()
    size = float(np.sqrt(np.mean(turning**2)))
    if size < _TURNING or np.sqrt(np.mean((summed - turning) ** 2)) < _SHARE * size:
        return ""
    times = float(summed @ turning / (turning @ turning))
    if np.sqrt(np.mean((summed - times * turning) ** 2)) < _SHARE * abs(times) * size:
        return f"the curvature kappa turns {times:.2g} times as far as x, y"
    return "the curvature kappa does not follow x, y"
