"""Maps of ROS's map_server (YAML and PGM or PNG) as walled worlds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.checks import require
from lanekeep_env.walls.image import read_grey
from lanekeep_env.walls.world import START_CLEARANCE, Floats, World

Cells = NDArray[np.bool_]

_FIELDS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_LARGEST_YAML = 100_000


@dataclass(frozen=True)
class MapSettings:
    """What a map's YAML file says: picture, cell size (m), pose of the lower left corner (m, m, rad), thresholds."""

    image: Path
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float


def read_map(
    path: str | Path,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    unknown_is_wall: bool = False,
    clearance: float = START_CLEARANCE,
) -> World:
    """Read a map_server map: the walls around the region that a car can reach from ``start``.

    Walls are the exact borders of cells; edges in one line become one wall. Occupied cells are solid, unknown ones
    only if ``unknown_is_wall``. Walls that cannot be reached, and so cannot be seen, are left out.

    Args:
        path: of the YAML file; the picture's path is relative to it.
        start: x (m), y (m), heading (rad) in the map's frame.
        unknown_is_wall: whether unknown cells stop a car.
        clearance: smallest distance of the start from a wall, m.

    Raises:
        ValueError: one line that names the file and the fault.
    """
    name = f"map {str(path)!r}"
    settings = read_settings(path)
    grey = read_grey(settings.image, f"{name}: image {str(settings.image)!r}")
    occupancy = grey[::-1] if settings.negate else 1.0 - grey[::-1]
    blocked = occupancy >= settings.free_thresh if unknown_is_wall else occupancy > settings.occupied_thresh
    reached = _reached(blocked, _cell(start, settings, blocked.shape, name), name)
    segments = _to_world(borders(reached), settings)
    world = World(Path(path).stem, segments, np.zeros(len(segments), np.bool_), np.array([start], dtype=np.float64))
    try:
        return world.check(clearance)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def read_settings(path: str | Path) -> MapSettings:
    """Read and check the YAML file of a map; nothing in it is executed."""
    name = f"map {str(path)!r}"
    try:
        import yaml
    except ImportError:
        raise ValueError(f"{name}: maps need PyYAML: pip install 'lanekeep[maps]'") from None
    try:
        data = Path(path).read_bytes()
        if len(data) > _LARGEST_YAML:
            raise ValueError(f"{name} has {len(data)} bytes; allowed are {_LARGEST_YAML}: is it the map's YAML file?")
        content = yaml.safe_load(data.decode("utf-8"))
    except OSError as error:
        raise ValueError(f"{name} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{name} is not a text file; expected YAML with {', '.join(_FIELDS)}") from None
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"{name} is not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(content, Mapping):
        raise ValueError(f"{name} holds no fields; expected {', '.join(_FIELDS)}")
    missing = [field for field in _FIELDS if field not in content]
    if missing:
        raise ValueError(f"{name} lacks {', '.join(missing)}; expected {', '.join(_FIELDS)}")
    try:
        return _settings(content, Path(path).parent)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _settings(content: Mapping[str, Any], folder: Path) -> MapSettings:
    image, origin = content["image"], content["origin"]
    if not isinstance(image, str) or not image or "\0" in image:
        raise ValueError(f"image={image!r} must be the path of a PGM or PNG picture")
    require("resolution", content["resolution"], "m a cell", above=0.0, at_most=100.0)
    if not isinstance(origin, list) or len(origin) != 3:
        raise ValueError(f"origin={origin!r} is not allowed: it must be [x in m, y in m, yaw in rad]")
    for axis, value in zip(("x", "y", "yaw"), origin, strict=True):
        require(f"origin {axis}", value, "rad" if axis == "yaw" else "m", at_least=-1e6, at_most=1e6)
    if content["negate"] not in (0, 1):
        raise ValueError(f"negate={content['negate']!r} is not allowed: it must be 0 or 1")
    require("free_thresh", content["free_thresh"], "", at_least=0.0, at_most=1.0)
    require("occupied_thresh", content["occupied_thresh"], "", at_least=0.0, at_most=1.0)
    if not content["free_thresh"] < content["occupied_thresh"]:
        raise ValueError(
            f"free_thresh={content['free_thresh']} must be below occupied_thresh={content['occupied_thresh']}"
        )
    if content.get("mode", "trinary") != "trinary":
        raise ValueError(f"mode={content['mode']!r} is not supported; allowed: trinary")
    return MapSettings(
        folder / image,
        float(content["resolution"]),
        (float(origin[0]), float(origin[1]), float(origin[2])),
        bool(content["negate"]),
        float(content["occupied_thresh"]),
        float(content["free_thresh"]),
    )


def _cell(
    start: tuple[float, float, float], settings: MapSettings, shape: tuple[int, ...], name: str
) -> tuple[int, int]:
    """Row (from below) and column of the cell that holds the start."""
    for axis, value in zip(("x", "y", "heading"), start, strict=True):
        require(f"{name}: start {axis}", value, "rad" if axis == "heading" else "m")
    x, y, yaw = settings.origin
    dx, dy = start[0] - x, start[1] - y
    column = math.floor((math.cos(yaw) * dx + math.sin(yaw) * dy) / settings.resolution)
    row = math.floor((math.cos(yaw) * dy - math.sin(yaw) * dx) / settings.resolution)
    if not (0 <= row < shape[0] and 0 <= column < shape[1]):
        raise ValueError(
            f"{name}: the start ({start[0]:g}, {start[1]:g}) m is outside the map of {shape[1]} x {shape[0]} cells "
            f"of {settings.resolution:g} m at origin ({x:g}, {y:g}) m"
        )
    return row, column


def _reached(blocked: Cells, cell: tuple[int, int], name: str) -> Cells:
    """Cells that share edges with one another and with the start's, through cells that are not blocked."""
    if blocked[cell]:
        raise ValueError(f"{name}: the start lies inside a wall (cell {cell[1]}, {cell[0]} from the lower left)")
    rows, columns = blocked.shape
    # A frame of one cell that counts as reached, so that no neighbour index leaves the array.
    closed = np.pad(blocked, 1, constant_values=True).ravel()
    wide = columns + 2
    front = np.array([(cell[0] + 1) * wide + cell[1] + 1])
    reached = np.zeros(closed.shape, np.bool_)
    reached[front] = closed[front] = True
    while len(front):
        around = np.concatenate([front - wide, front - 1, front + 1, front + wide])
        around = around[~closed[around]]
        closed[around] = True
        # Equal indices are next to each other after sorting; np.unique does the same, slower.
        around.sort()
        front = around[np.concatenate([[True], np.diff(around) > 0])] if len(around) else around
        reached[front] = True
    inside = reached.reshape(rows + 2, wide)[1:-1, 1:-1]
    edge = np.zeros_like(inside)
    edge[[0, -1]] = edge[:, [0, -1]] = True
    if (inside & edge).any():
        row, column = np.argwhere(inside & edge)[0]
        raise ValueError(
            f"{name}: the walls are open: from the start one gets out of the map at cell {column}, {row} "
            f"from the lower left (unknown cells count as open unless unknown_is_wall)"
        )
    return inside


def borders(reached: Cells) -> NDArray[np.int64]:
    """Borders between cells that are reached and those that are not, x0, y0, x1, y1 in cells, (n, 4).

    Cell (row, column) covers column..column+1 x row..row+1. Edges in one line that touch are one border.
    """
    row, first, last = _runs(reached[:-1] != reached[1:])
    flat = np.column_stack([first, row + 1, last, row + 1])
    column, first, last = _runs((reached[:, :-1] != reached[:, 1:]).T)
    return np.concatenate([flat, np.column_stack([column + 1, first, column + 1, last])])


def _runs(edges: Cells) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Line, begin and end of each run of True along the lines of an array."""
    steps = np.diff(np.pad(edges, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    line, begin = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return line, begin, end


def _to_world(cells: NDArray[np.int64], settings: MapSettings) -> Floats:
    """Cell corners in m, turned and moved by the map's origin; one corner gets one result wherever it occurs."""
    x, y, yaw = settings.origin
    points = settings.resolution * cells.reshape(-1, 2).astype(np.float64)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    turned = np.column_stack([cosine * points[:, 0] - sine * points[:, 1], sine * points[:, 0] + cosine * points[:, 1]])
    return (turned + np.array([x, y])).reshape(-1, 4)
