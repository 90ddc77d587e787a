"""Worlds by name, by settings or by file."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lanekeep_env.checks import from_mapping, nearest, require, shown
from lanekeep_env.roads.file import read_content
from lanekeep_env.walls.centre_line import MOST_POINTS
from lanekeep_env.walls.generators import Circuit, Corridor, Ell, RandomCircuits, Slalom, WorldRecord
from lanekeep_env.walls.map_file import FOUND, MapContent
from lanekeep_env.walls.obstacles import ObstacleCircuit, RandomObstacleCircuits
from lanekeep_env.walls.parking import ParkingRow, RandomParkingRows
from lanekeep_env.walls.world import START_CLEARANCE, World


@dataclass(frozen=True)
class MapFile(WorldRecord):
    """A map of ROS's map_server (see `read_map`).

    Attributes:
        path: of the YAML file.
        x, y, heading: of the start in the map's frame, m, m, rad.
        unknown_is_wall: whether unknown cells stop a car.
        centre_line: of the circuit: a road file or a list of points, m, in the map's frame and in driving direction, or
            "found" for the middle between the outer wall and what the circuit goes round. Where x, y and heading are
            0, the start is the place on it that is nearest to (0, 0). `Circuit-v0` finds it where none is given.

    The record stands for the content of both files when it was made: files that change afterwards are refused.
    """

    kind: ClassVar[str] = "map"
    path: str
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    unknown_is_wall: bool = False
    centre_line: Any = None
    _digest: str = field(init=False, repr=False, compare=True, default="")

    def __post_init__(self) -> None:
        if not isinstance(self.path, str) or not isinstance(self.unknown_is_wall, bool):
            given = f"path={shown(self.path)}, unknown_is_wall={shown(self.unknown_is_wall)}"
            raise ValueError(f"world map: {given} are not allowed: they must be a path and a bool")
        for name in ("x", "y", "heading"):
            require(f"world.{name}", getattr(self, name), "rad" if name == "heading" else "m")
        super().__post_init__()
        object.__setattr__(self, "centre_line", _line_from(self.centre_line))
        object.__setattr__(self, "_digest", self._content().digest + self._line_digest())

    def _content(self) -> MapContent:
        return MapContent.read(self.path)

    def _line_digest(self) -> str:
        """Hash of the centre line's file, if it comes from one."""
        if not isinstance(self.centre_line, str) or self.centre_line == FOUND:
            return ""
        return hashlib.sha256(read_content(self.centre_line)).hexdigest()

    def to_dict(self) -> dict[str, Any]:
        """Return kind and fields as JSON-able values."""
        settings = super().to_dict()
        del settings["_digest"]
        if self.centre_line is None:
            del settings["centre_line"]
        return settings

    def fingerprint(self) -> str:
        """Hash of both files, and the settings without the path."""
        rest = (self.x, self.y, self.heading, self.unknown_is_wall)
        line = self.centre_line
        # The file of a centre line counts by its content.
        named = line is not None and (line == FOUND or not isinstance(line, str))
        return f"map {self._digest} {rest}" + (f" {line}" if named else "")

    def build(self) -> tuple[World, ...]:
        """One world."""
        content = self._content()
        if content.digest + self._line_digest() != self._digest:
            raise ValueError(f"map {self.path!r} has changed since this scenario was made; make it anew")
        line = np.array(self.centre_line) if isinstance(self.centre_line, tuple) else self.centre_line
        return (content.world((self.x, self.y, self.heading), self.unknown_is_wall, START_CLEARANCE, line),)


def _line_from(value: Any) -> str | tuple[tuple[float, float], ...] | None:
    """Read a centre line: None, "found", the path of a road file, or points."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, Path):
        return str(value)
    try:
        points = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        points = np.zeros(0)
    if points.ndim != 2 or points.shape[1] != 2 or not 8 <= len(points) <= MOST_POINTS or not np.isfinite(points).all():
        raise ValueError(
            f"world.centre_line={shown(value)} is not allowed: it must be a road file, 'found', or 8 to {MOST_POINTS} "
            f"points (x, y) in m"
        )
    return tuple((float(x), float(y)) for x, y in points)


_RECORDS = (
    Corridor,
    Ell,
    Slalom,
    Circuit,
    RandomCircuits,
    ObstacleCircuit,
    RandomObstacleCircuits,
    ParkingRow,
    RandomParkingRows,
    MapFile,
)
WORLDS: dict[str, type[WorldRecord]] = {record.kind: record for record in _RECORDS}


def world_from(value: str | Mapping[str, Any] | WorldRecord | Path) -> WorldRecord:
    """Read a world: the name of a generator, the path of a map's YAML file, a mapping with ``kind``, or a record.

    Raises:
        ValueError: unknown name or setting (the nearest valid one is named), or a value out of range.
    """
    if isinstance(value, WorldRecord):
        return value
    if isinstance(value, Path) or (isinstance(value, str) and value not in WORLDS and _is_path(value)):
        return MapFile(str(value))
    if isinstance(value, str):
        value = {"kind": value}
    if not isinstance(value, Mapping):
        raise ValueError(
            f"world={shown(value)} must be a name, a mapping with 'kind', or the path of a map's YAML file"
        )
    settings = dict(value)
    if "map" in settings and not settings.keys() & {"kind", "path"}:
        settings |= {"kind": MapFile.kind, "path": str(settings.pop("map"))}
    kind = settings.pop("kind", None)
    generators = [name for name in WORLDS if name != MapFile.kind]
    if kind is None:
        raise ValueError(f"world={shown(value)} lacks 'kind'; allowed: {', '.join(WORLDS)}")
    if not isinstance(kind, str) or kind not in WORLDS or (kind == MapFile.kind and "path" not in settings):
        raise ValueError(
            f"world={shown(kind)} is unknown{nearest(kind, generators)}; allowed: {', '.join(generators)}, "
            f"or the path of a map's YAML file"
        )
    return from_mapping(WORLDS[kind], settings, f"world {kind!r}")


def _is_path(value: str) -> bool:
    return "/" in value or "\\" in value or value.endswith((".yaml", ".yml")) or os.path.isfile(value)
