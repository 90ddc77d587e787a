"""How pictures look: colours and markers of policies, which of many are shown in colours, bars of scale, PNG."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from lanekeep_benchmarks.own_code import is_code
from lanekeep_benchmarks.summary import columns_of
from lanekeep_env.rendering.scale import bar_length

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito (2008), eight colours that colour-blind readers tell apart; brown for their yellow, too pale as a line.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D1F")
_MARKERS = "osD^vPX*"
GRID: dict[str, Any] = {"color": "#d0d0d0", "linewidth": 0.6}


def colour_of(index: int) -> str:
    """Colour of the policy with that place in the run."""
    return _COLOURS[index % len(_COLOURS)]


def interesting(summary: Mapping[str, Any]) -> list[str]:
    """The policies of a run that pictures show in colours: all, or where they are many the reference, a user's own, and
    those that come first over the scenarios, by the first metric and by whether they mostly fail.
    """
    tables = [scenario["policies"] for scenario in summary["scenarios"]]
    names = [row["policy"] for row in tables[0]]
    if len(names) <= len(_COLOURS):
        return names
    place = dict.fromkeys(names, 0)
    for rows in tables:
        metric = columns_of(rows)[0]
        sign = -1.0 if metric.more_is_better else 1.0
        ranked = sorted(
            rows, key=lambda row: (row["failure_rate"]["value"] > 0.5, sign * row["metrics"][metric.key]["value"])
        )
        for rank, row in enumerate(ranked):
            place[row["policy"]] += rank
    first = [names[0], *filter(is_code, names)]
    chosen = list(dict.fromkeys([*first, *sorted(names, key=lambda name: place[name])]))[: len(_COLOURS)]
    return [name for name in names if name in chosen]


def styles(names: Sequence[str], shown: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Each policy's line: those ``shown`` with colour, marker and label; the others grey, behind, under one label."""
    rest = [name for name in names if name not in shown]
    grey = {"color": "#b8b8b8", "linewidth": 0.8, "zorder": 1.0}
    found = {name: {**grey, "label": f"{len(rest)} others" if name == rest[0] else None} for name in rest}
    for place, name in enumerate(shown):
        look = {"color": colour_of(place), "marker": _MARKERS[place % len(_MARKERS)], "markersize": 4, "linewidth": 1.3}
        # Markers of lines that run together stand beside each other.
        found[name] = {**look, "markevery": (0.012 * place, 0.12), "zorder": 2.0, "label": name}
    return found


def png(figure: Figure) -> bytes:
    """Return the figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()


def scale_bar(axes: Axes, extent: float) -> None:
    """A bar of a round length, about a fifth of the ``extent`` in m: below the picture, inside where it has axes."""
    length = bar_length(extent)
    corner, place = ("lower right", (0.98, 0.02)) if axes.axison else ("lower left", (0.0, -0.02))
    bar = AnchoredSizeBar(
        axes.transData, length, f"{length:g} m", corner, bbox_to_anchor=place, frameon=False,
        bbox_transform=axes.transAxes, size_vertical=0.004 * extent, label_top=True, borderpad=0.0,
    )  # fmt: skip
    axes.add_artist(bar)
