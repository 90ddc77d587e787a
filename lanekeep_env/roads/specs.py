"""Roads by name, by settings or by file: reading them, and building a road set with its speeds."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lanekeep_env.checks import from_mapping, nearest, require, shown
from lanekeep_env.roads.file import make_road, read_content
from lanekeep_env.roads.generators import (
    CircleRoad,
    RandomRoads,
    RoadRecord,
    RoadWorksRoads,
    SineRoad,
    SlalomRoad,
    StraightRoad,
    YinRoad,
)
from lanekeep_env.roads.given import RoadClothoids, RoadPoints
from lanekeep_env.roads.manoeuvres import EvasiveRoads, ParkingPaths
from lanekeep_env.roads.readers import TABLES, Choice
from lanekeep_env.roads.road import Floats, Road
from lanekeep_env.roads.speed import SpeedSpec
from lanekeep_env.roads.yards import BypassRoads, TurnOffRoads, YardRoads


@dataclass(frozen=True)
class RoadFile(RoadRecord):
    """The road of a file: CSV, OpenDRIVE, CommonRoad, GPX, KML or GeoJSON (see `read_road`).

    Attributes:
        path: of the file.
        closed: None to tell from the distance between the last and the first point.
        smoothing: standard deviation by which the points scatter, m; None to estimate it.
        track, lane: which of several lines of a file (see `Choice`).

    The record stands for the file's content when it was made: a file that changes afterwards is refused.
    """

    kind: ClassVar[str] = "file"
    path: str
    closed: bool | None = None
    smoothing: float | None = None
    track: str | None = None
    lane: int | None = None
    _digest: str = field(init=False, repr=False, compare=True, default="")

    def __post_init__(self) -> None:
        if not isinstance(self.path, str) or not (self.closed is None or isinstance(self.closed, bool)):
            given = f"path={shown(self.path)}, closed={shown(self.closed)}"
            raise ValueError(f"road file: {given} are not allowed: they must be a path and a bool or None")
        require("road.smoothing", self.smoothing, "m", at_least=0.0, at_most=100.0, optional=True)
        require("road.lane", self.lane, "", at_least=-100, at_most=100, whole=True, optional=True)
        if isinstance(self.track, int) and not isinstance(self.track, bool):
            object.__setattr__(self, "track", str(self.track))
        if not (self.track is None or isinstance(self.track, str)):
            raise ValueError(f"road.track={shown(self.track)} is not allowed: it must be text, e.g. '3, 7'")
        object.__setattr__(self, "_digest", _digest(read_content(self.path)))

    def to_dict(self) -> dict[str, Any]:
        """Return kind and fields as JSON-able values."""
        return {"kind": self.kind, "path": self.path, "closed": self.closed, **self._choices()}

    def _choices(self) -> dict[str, Any]:
        """What is said beyond the file and the closed flag."""
        given = {name: getattr(self, name) for name in ("smoothing", "track", "lane")}
        return {name: value for name, value in given.items() if value is not None}

    def fingerprint(self) -> str:
        """Hash of the file's content, its ending, which decides how it is read, and the settings."""
        choices = "".join(f" {name}={value!r}" for name, value in self._choices().items())
        kind = "" if Path(self.path).suffix.lower() in TABLES else f" as {Path(self.path).suffix.lower()}"
        return f"file {self._digest} closed={self.closed}{kind}{choices}"

    def build(self) -> tuple[Road, ...]:
        """One road, fitted to the file's points."""
        content = read_content(self.path)
        if _digest(content) != self._digest:
            raise ValueError(f"road file {self.path!r} has changed since this scenario was made; make it anew")
        return (make_road(self.path, content, self.closed, self.smoothing, Choice(self.track, self.lane)),)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


RoadSpec = RoadRecord

_RECORDS = (
    StraightRoad,
    CircleRoad,
    SlalomRoad,
    SineRoad,
    RandomRoads,
    YinRoad,
    RoadWorksRoads,
    YardRoads,
    TurnOffRoads,
    BypassRoads,
    EvasiveRoads,
    ParkingPaths,
    RoadFile,
    RoadPoints,
    RoadClothoids,
)
ROADS: dict[str, type[RoadRecord]] = {record.kind: record for record in _RECORDS}
#: What kinds of roads cannot do without.
_NEEDED = {"file": "path", "points": "points", "clothoids": "segments"}


def road_from(value: Any) -> RoadRecord:
    """Read a road: the name of a generator, the path of a file, a mapping with ``kind``, points (n, 2), or a record.

    Raises:
        ValueError: unknown name or setting (the nearest valid one is named), or a value out of range.
    """
    if isinstance(value, RoadRecord):
        return value
    if isinstance(value, Path) or (isinstance(value, str) and value not in ROADS and _is_path(value)):
        return RoadFile(str(value))
    if isinstance(value, str):
        value = {"kind": value}
    if isinstance(value, list | tuple | np.ndarray):
        return RoadPoints(value)  # type: ignore[arg-type]
    if not isinstance(value, Mapping):
        raise ValueError(
            f"road={shown(value)} must be a name, a mapping with 'kind', points (n, 2), such as "
            "table[['x', 'y']].to_numpy(), or a file's path"
        )
    settings = dict(value)
    kind = settings.pop("kind", None)
    if not isinstance(kind, str) or kind not in ROADS:
        if kind is None:
            raise ValueError(f"road={shown(value)} lacks 'kind'; allowed: {', '.join(ROADS)}")
        generators = [name for name in ROADS if name not in _NEEDED]
        raise ValueError(
            f"road={shown(kind)} is unknown{nearest(kind, generators)}; "
            f"allowed: {', '.join(generators)}, or the path of a file"
        )
    if kind in _NEEDED and _NEEDED[kind] not in settings:
        raise ValueError(f"road of kind {kind!r} needs {_NEEDED[kind]!r}")
    return from_mapping(ROADS[kind], settings, f"road {kind!r}")


def _is_path(text: str) -> bool:
    return Path(text).suffix != "" or "/" in text or "\\" in text


def build_roads(road: RoadRecord, speed: SpeedSpec) -> tuple[tuple[Road, Floats], ...]:
    """Build a road set: each road with the speed at its segment borders, m/s."""
    return tuple(speed.along(one, road.minimum_speed) for one in road.build())
