"""The YAML file of a map_server map: plain fields only, each checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lanekeep_env.checks import nearest, require, shown
from lanekeep_env.plain_yaml import parse_yaml

MODES = ("trinary", "scale", "raw")
FIELDS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")

# A map has some 20 events (values, begins and ends of lists and mappings).
_MOST_EVENTS = 1000


@dataclass(frozen=True)
class MapSettings:
    """What a map's YAML file says: picture, cell size (m), pose of the lower left corner (m, m, rad), limits, mode."""

    image: Path
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str = "trinary"


def parse_settings(data: bytes, folder: Path) -> MapSettings:
    """Read and check the content of a map's YAML file; nothing in it is executed.

    Args:
        data: of the file.
        folder: that the picture's path is relative to.

    Raises:
        ValueError: one line without the file's name, for the caller to put it in front.
    """
    content = parse_yaml(data, _MOST_EVENTS, f"a map's settings: {', '.join(FIELDS)}", "maps")
    if not isinstance(content, Mapping):
        raise ValueError(f"it holds no fields; expected {', '.join(FIELDS)}")
    missing = [field for field in FIELDS if field not in content]
    if missing:
        raise ValueError(f"it lacks {', '.join(missing)}; expected {', '.join(FIELDS)}")
    return _settings(content, folder)


def _settings(content: Mapping[str, Any], folder: Path) -> MapSettings:
    image, origin = content["image"], content["origin"]
    if not isinstance(image, str) or not image or "\0" in image:
        raise ValueError(f"image={shown(image)} must be the path of a PGM or PNG picture")
    require("resolution", content["resolution"], "m a cell", at_least=1e-4, at_most=100.0)
    if not isinstance(origin, list) or len(origin) != 3:
        raise ValueError(f"origin={shown(origin)} is not allowed: it must be [x in m, y in m, yaw in rad]")
    for axis, value in zip(("x", "y", "yaw"), origin, strict=True):
        require(f"origin {axis}", value, "rad" if axis == "yaw" else "m", at_least=-1e6, at_most=1e6)
    if content["negate"] not in (0, 1):
        raise ValueError(f"negate={shown(content['negate'])} is not allowed: it must be 0 or 1")
    require("free_thresh", content["free_thresh"], "", at_least=0.0, at_most=1.0)
    require("occupied_thresh", content["occupied_thresh"], "", at_least=0.0, at_most=1.0)
    if not content["free_thresh"] < content["occupied_thresh"]:
        raise ValueError(
            f"free_thresh={content['free_thresh']} must be below occupied_thresh={content['occupied_thresh']}"
        )
    mode = content.get("mode", "trinary")
    if not isinstance(mode, str) or mode.lower() not in MODES:
        raise ValueError(f"mode={shown(mode)} is unknown{nearest(mode, MODES)}; allowed: {', '.join(MODES)}")
    return MapSettings(
        folder / image,
        float(content["resolution"]),
        (float(origin[0]), float(origin[1]), float(origin[2])),
        bool(content["negate"]),
        float(content["occupied_thresh"]),
        float(content["free_thresh"]),
        mode.lower(),
    )
