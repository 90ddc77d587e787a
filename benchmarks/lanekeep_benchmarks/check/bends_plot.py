"""The picture of a car in steady bends: angle, sideslip and error over lateral acceleration."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from lanekeep_benchmarks.check.bends import Bends
from lanekeep_benchmarks.looks import GRID, colour_of, png


def draw_bends(bends: Bends) -> bytes:
    """Draw angle, sideslip and error over lateral acceleration, as PNG."""
    figure = Figure(figsize=(13, 4.6), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    names = {"linear tyre": bends.linear, "saturating tyre": bends.plain, "with load transfer": bends.honest}
    most = 1.15 * float(bends.honest.across.max())
    for place, (name, bend) in enumerate(names.items()):
        below = bend.across <= most
        look: dict[str, Any] = {"color": colour_of(place), "label": name}
        left.plot(bend.across[below], np.degrees(bend.steer[below]), **look)
        middle.plot(bend.across[below], np.degrees(bend.sideslip[below]), **look)
        if bend is not bends.honest:
            right.plot(bends.honest.across, 100.0 * bends.excess(bend), **look)
    for axes, title in (
        (left, "road-wheel angle [°]"),
        (middle, "sideslip [°]"),
        (right, "lateral acceleration too high at the same angle [%]"),
    ):
        axes.set_title(title, fontsize=10)
        axes.set_xlabel(
            "lateral acceleration with load transfer [m/s²]" if axes is right else "lateral acceleration [m/s²]"
        )
        axes.grid(**GRID)
    right.set_ylim(0.0, min(40.0, right.get_ylim()[1]))
    left.legend(frameon=False, fontsize=9)
    figure.suptitle(f"{bends.car.name} in steady bends at {bends.speed:.3g} m/s", fontsize=11)
    return png(figure)
