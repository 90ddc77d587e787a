"""Maps of ROS's map_server (YAML and PGM or PNG) as walled worlds."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.checks import require, shown
from lanekeep_env.files import read_bounded
from lanekeep_env.roads.file import read_road
from lanekeep_env.walls.centre_line import MOST_POINTS, found
from lanekeep_env.walls.image import LARGEST_PICTURE, Grey, read_grey
from lanekeep_env.walls.map_yaml import MapSettings, parse_settings
from lanekeep_env.walls.region import Cells, borders, reached_from
from lanekeep_env.walls.world import START_CLEARANCE, Floats, World

#: What asks for the middle of the walls as centre line.
FOUND = "found"
_ELSEWHERE = "give another start, x and y in m, as the map's frame has them"
_LARGEST_YAML = 100_000
# Points of a centre line times walls: from each point all walls are looked at, which takes some seconds.
_MOST_CHECKS = 10_000_000
# Share of a centre line that may lie in walls: boxes stand on it, and specks. It is looked at in so many places.
_OUTSIDE, _MOST_PLACES = 0.05, 1_000_000


def read_map(
    path: str | Path,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    unknown_is_wall: bool = False,
    clearance: float = START_CLEARANCE,
) -> World:
    """Read a map_server map: the walls around the region that a car can reach from ``start``.

    Walls are the exact borders of cells; edges in one line become one wall. Occupied cells are solid, unknown ones
    only if ``unknown_is_wall``. Walls that cannot be reached, and so cannot be seen, are left out.

    Cells are judged as map_server does: in the modes trinary and scale by the picture's brightness against both
    thresholds (in trinary an alpha channel is averaged in as if it were a fourth colour; elsewhere it is left out); in
    the mode raw a value from 0 to 100 is the occupancy in percent, more is unknown, and ``negate`` has no meaning.

    Args:
        path: of the YAML file; the picture's path is relative to it.
        start: x (m), y (m), heading (rad) in the map's frame.
        unknown_is_wall: whether unknown cells stop a car.
        clearance: smallest distance of the start from a wall, m.

    Raises:
        ValueError: one line that names the file and the fault.
    """
    return MapContent.read(path).world(start, unknown_is_wall, clearance)


@dataclass(frozen=True)
class MapContent:
    """What the two files of a map held at one moment.

    Attributes:
        path: of the YAML file.
        settings: that it says.
        picture: content of the picture's file.
        digest: hash of both files.
    """

    path: Path
    settings: MapSettings
    picture: bytes
    digest: str

    @classmethod
    def read(cls, path: str | Path) -> MapContent:
        """Read both files; raises ValueError, one line that names the file and the fault."""
        name = f"map {str(path)!r}"
        data = _content(path, _LARGEST_YAML, name)
        try:
            settings = parse_settings(data, Path(path).parent)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
        picture = _content(settings.image, LARGEST_PICTURE, f"{name}: {_image(settings)}")
        digest = hashlib.sha256(hashlib.sha256(data).digest() + hashlib.sha256(picture).digest()).hexdigest()
        return cls(Path(path), settings, picture, digest)

    def world(
        self,
        start: tuple[float, float, float],
        unknown_is_wall: bool,
        clearance: float,
        centre_line: str | Floats | None = None,
    ) -> World:
        """Return the world that `read_map` describes, with a centre line if one is asked for (see `MapFile`)."""
        name, settings = f"map {str(self.path)!r}", self.settings
        grey = read_grey(self.picture, f"{name}: {_image(settings)}", with_alpha=settings.mode == "trinary")
        free, unknown = _free(grey, settings, unknown_is_wall)
        try:
            cell = _cell(start, settings, free.shape)
            if unknown is not None and unknown[grey.levels[::-1][cell]]:
                raise ValueError(
                    f"the start lies in unknown cells (cell {cell[1]}, {cell[0]}; mode raw: above 100); {_ELSEWHERE}"
                )
            inside = _reached(free, cell)
            walls = borders(inside)
            segments = _to_world(walls.reshape(-1, 2), settings).reshape(-1, 4)
            line = None if centre_line is None else self._centre_line(centre_line, walls)
            if line is not None:
                _check_inside(line, inside, settings)
            pose = start if line is None else _on_line(line, start)
            glass = np.zeros(len(segments), np.bool_)
            poses = np.array([pose], dtype=np.float64)
            return World(self.path.stem, segments, glass, poses, line, line is not None).check(clearance)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None

    def _centre_line(self, given: str | Floats, walls: NDArray[np.int64]) -> Floats:
        """Points of the centre line, m: those given, those of a road file, or those in the middle of the walls."""
        most = int(np.clip(_MOST_CHECKS // len(walls), 60, MOST_POINTS))
        if isinstance(given, str) and given == FOUND:
            return _to_world(found(walls, most), self.settings)
        if isinstance(given, str):
            road = read_road(given, closed=True)
            count = min(most, max(16, round(road.length / self.settings.resolution)))
            return road.position(np.arange(count) * road.length / count)
        return np.asarray(given, dtype=np.float64)


def _content(path: str | Path, largest: int, name: str) -> bytes:
    try:
        return read_bounded(path, largest)
    except OSError as error:
        raise ValueError(f"{name} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ValueError(f"{name} cannot be read: {error}") from None


def _image(settings: MapSettings) -> str:
    path = str(settings.image)
    return f"image {path!r}" if path.isprintable() and len(path) < 500 else f"image {shown(path)}"


def _cell(start: tuple[float, float, float], settings: MapSettings, shape: tuple[int, ...]) -> tuple[int, int]:
    """Row (from below) and column of the cell that holds the start."""
    for axis, value in zip(("x", "y", "heading"), start, strict=True):
        require(f"start {axis}", value, "rad" if axis == "heading" else "m")
    x, y, yaw = settings.origin
    dx, dy = start[0] - x, start[1] - y
    column = (math.cos(yaw) * dx + math.sin(yaw) * dy) / settings.resolution
    row = (math.cos(yaw) * dy - math.sin(yaw) * dx) / settings.resolution
    if not (0.0 <= row < shape[0] and 0.0 <= column < shape[1]):
        raise ValueError(
            f"the start ({start[0]:g}, {start[1]:g}) m is outside the map of {shape[1]} x {shape[0]} cells "
            f"of {settings.resolution:g} m at origin ({x:g}, {y:g}) m; {_ELSEWHERE}"
        )
    return math.floor(row), math.floor(column)


def _reached(free: Cells, cell: tuple[int, int]) -> Cells:
    """Cells that can be reached from one; raises ValueError where that is none, or where they leave the map."""
    if not free[cell]:
        raise ValueError(f"the start lies inside a wall (cell {cell[1]}, {cell[0]} from the lower left); {_ELSEWHERE}")
    inside = reached_from(free, *cell)
    edge = np.zeros_like(inside)
    edge[[0, -1]] = edge[:, [0, -1]] = True
    if (inside & edge).any():
        row, column = np.argwhere(inside & edge)[0]
        raise ValueError(
            f"the walls are open: from the start one gets out of the map at cell {column}, {row} "
            f"from the lower left (unknown cells count as open unless unknown_is_wall)"
        )
    return inside


def _free(grey: Grey, settings: MapSettings, unknown_is_wall: bool) -> tuple[Cells, NDArray[np.bool_] | None]:
    """Free cells, rows from below, and in the mode raw which levels are unknown."""
    if settings.mode == "raw":
        percent = np.round(255.0 * grey.brightness)
        unknown = percent > 100.0
        solid = unknown & unknown_is_wall | ~unknown & (percent > 100.0 * settings.occupied_thresh)
        return ~solid[grey.levels[::-1]], unknown
    occupancy = grey.brightness if settings.negate else 1.0 - grey.brightness
    solid = occupancy >= settings.free_thresh if unknown_is_wall else occupancy > settings.occupied_thresh
    # The brighter the less (or, negated, the more) occupied: the solid levels are the first or the last.
    count, levels = np.count_nonzero(solid), grey.levels[::-1]
    return (levels < len(solid) - count if settings.negate else levels >= count), None


def _check_inside(line: Floats, inside: Cells, settings: MapSettings) -> None:
    """Raise ValueError where much of a closed line, m, lies outside the cells that can be reached."""
    x, y, yaw = settings.origin
    cosine, sine = math.cos(yaw), math.sin(yaw)
    loop = np.vstack([line, line[:1]])
    with np.errstate(all="ignore"):  # what overflows lies outside
        station = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(loop, axis=0).T))])
        along = np.linspace(0.0, station[-1], int(min(_MOST_PLACES, 2.0 + station[-1] / settings.resolution)))
        place = np.column_stack([np.interp(along, station, loop[:, axis]) for axis in (0, 1)])
        column, row = np.floor((place - (x, y)) @ [[cosine, -sine], [sine, cosine]] / settings.resolution).T
        good = (column >= 0) & (column < inside.shape[1]) & (row >= 0) & (row < inside.shape[0])
    good[good] = inside[row[good].astype(np.intp), column[good].astype(np.intp)]
    if 1.0 - good.mean() > _OUTSIDE:
        first = place[np.argmin(good)]
        raise ValueError(
            f"{1.0 - good.mean():.0%} of the centre line lies in or behind walls, first at ({first[0]:.7g}, "
            f"{first[1]:.7g}) m; it must be this map's, in driving order, once round (its end leads back to its start)"
        )


def _on_line(line: Floats, start: tuple[float, float, float]) -> tuple[float, float, float]:
    """A given start as it is; without one (all 0) the centre line's place that is nearest, in its direction."""
    if any(start):
        return start
    nearest = int(np.argmin(np.hypot(*line.T)))
    ahead = line[(nearest + 1) % len(line)] - line[nearest - 1]
    return float(line[nearest, 0]), float(line[nearest, 1]), math.atan2(ahead[1], ahead[0])


def _to_world(points: NDArray[np.int64] | Floats, settings: MapSettings) -> Floats:
    """Points in cells, (..., 2), as points in m, turned and moved by the map's origin; a corner gets one result."""
    x, y, yaw = settings.origin
    points = settings.resolution * points.astype(np.float64)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    turned = np.column_stack([cosine * points[:, 0] - sine * points[:, 1], sine * points[:, 0] + cosine * points[:, 1]])
    return turned + np.array([x, y])
