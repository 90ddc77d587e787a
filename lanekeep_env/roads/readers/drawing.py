"""What a file draws of a road, before there is a road: the one thing that all readers return."""

from __future__ import annotations

from dataclasses import dataclass, field

from lanekeep_env.roads.road import Floats, Road

#: Most points of a line: 100 km every half metre.
MOST_POINTS = 200_000


@dataclass(frozen=True, eq=False)
class Drawing:
    """A line of points, or a road where the file gives curvature itself.

    Attributes:
        points: m, (n, 2), or None.
        road: exact, or None.
        lines: number in the file of each point's line, or None.
        widths: of the lane or track to the left and right of each point, m, (n, 2), or None.
        speeds: at each point, m/s, (n,), or None; of a road at each segment's border.
        assumed: what was taken for granted, one phrase each.
        rounding: how far rounded coordinates scatter the points, m, a standard deviation.
        tolerance: how far a road may miss the points of a line with kinks, m.
    """

    points: Floats | None = None
    road: Road | None = None
    lines: list[int] | None = field(default=None, repr=False)
    widths: Floats | None = None
    speeds: Floats | None = None
    assumed: tuple[str, ...] = ()
    rounding: float = 0.0
    tolerance: float = 0.0

    def place(self, number: int) -> str:
        """Where a point is, for errors."""
        return f"point {number + 1}" if self.lines is None else f"line {self.lines[number]}"


@dataclass(frozen=True)
class Choice:
    """Which line of a file that holds several, and which lane of a road with several; None for the reader's choice.

    Attributes:
        track: OpenDRIVE road or CommonRoad lanelet ids in the order they are driven, separated by commas; the number
            of a line in GPX, KML or GeoJSON, from 1.
        lane: of an OpenDRIVE road, negative to the right of its reference line, which is 0.
    """

    track: str | None = None
    lane: int | None = None
