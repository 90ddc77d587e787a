"""Readers of roads by the ending of a file's name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lanekeep_env.checks import nearest, shown
from lanekeep_env.roads.readers.columns import read_columns
from lanekeep_env.roads.readers.commonroad import read_commonroad
from lanekeep_env.roads.readers.drawing import Choice, Drawing
from lanekeep_env.roads.readers.opendrive import read_opendrive
from lanekeep_env.roads.readers.tracks import read_geojson, read_gpx, read_kml

__all__ = ["READERS", "TABLES", "Choice", "Drawing", "read_drawing"]

#: Content, what errors call the file, and which of its lines is wanted.
Reader = Callable[[bytes, str, Choice], Drawing]

TABLES = (".csv", ".txt", ".tsv", ".dat")
READERS: dict[str, Reader] = {
    **dict.fromkeys(TABLES, read_columns),
    **dict.fromkeys((".geojson", ".json"), read_geojson),
    ".gpx": read_gpx,
    ".kml": read_kml,
    ".xodr": read_opendrive,
    ".xml": read_commonroad,
}
#: Most bytes of a file that is no table: as many points take longer to read from it.
LARGEST_MARKUP = 16 << 20
#: Those that hold several lines.
_CHOOSING = (".geojson", ".json", ".gpx", ".kml", ".xodr", ".xml")

#: What nobody reads here, and as what its programs write it too.
_EXPORTED = {
    **dict.fromkeys((".osm", ".pbf", ".shp", ".gpkg"), ".geojson"),
    **dict.fromkeys((".xlsx", ".xls", ".ods", ".parquet", ".mat", ".npy"), ".csv"),
}


def read_drawing(path: str | Path, content: bytes, choice: Choice, name: str) -> Drawing:
    """Read a road file's content with the reader of its ending; ``name`` is what errors call it.

    Raises:
        ValueError: an ending that no reader has, or what the reader says.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in READERS:
        if content.lstrip()[:1] in (b"<", b"{", b"[") or b"\0" in content[:1000].replace(b"\xff\xfe", b""):
            way = f"; export it as {_EXPORTED[suffix]}" if suffix in _EXPORTED else nearest(suffix, READERS)
            raise ValueError(f"{name}: the ending {shown(suffix)} is unknown{way}; allowed: {', '.join(READERS)}")
        suffix = ".csv"
    if choice.track is not None and suffix not in _CHOOSING:
        raise ValueError(f"{name}: track={shown(choice.track)} has no effect: such a file holds one line")
    if choice.lane is not None and suffix != ".xodr":
        raise ValueError(f"{name}: lane={shown(choice.lane)} has no effect: only .xodr has lanes")
    if suffix in _CHOOSING and len(content) > LARGEST_MARKUP:
        raise ValueError(f"{name} has {len(content)} bytes; allowed are {LARGEST_MARKUP}")
    return READERS[suffix](content, name, choice)
