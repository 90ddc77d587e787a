"""Vehicles from YAML or JSON files: numbers with or without their unit, and CommonRoad's parameter files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lanekeep_env.checks import shown, shown_path
from lanekeep_env.files import read_bounded
from lanekeep_env.plain import parse_json
from lanekeep_env.plain_yaml import parse_yaml

ENDINGS = (".yaml", ".yml", ".json")
_LARGEST_FILE = 100_000
_MOST_EVENTS = 2000

_MASS = {"kg": 1.0, "t": 1e3, "g": 1e-3, "lb": 0.45359237}
_INERTIA = {"kg m²": 1.0, "kg m^2": 1.0, "kgm2": 1.0, "kg m2": 1.0, "kg*m^2": 1.0, "t m²": 1e3, "g m²": 1e-3}
_LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "ft": 0.3048, "in": 0.0254}
_STIFFNESS = {"n/rad": 1.0, "kn/rad": 1e3, "n/deg": 57.29577951308232, "kn/deg": 57295.77951308232}
_ANGLE = {"rad": 1.0, "deg": 0.017453292519943295, "°": 0.017453292519943295}
_RATE = {"rad/s": 1.0, "deg/s": 0.017453292519943295, "°/s": 0.017453292519943295}
_TIME = {"s": 1.0, "ms": 1e-3}
#: What each number may be given in; the first unit is that of a number without one.
SCHEMA: dict[str, dict[str, float]] = {
    "mass": _MASS,
    "yaw_inertia": _INERTIA,
    "cg_to_front_axle": _LENGTH,
    "cg_to_rear_axle": _LENGTH,
    "front_cornering_stiffness": _STIFFNESS,
    "rear_cornering_stiffness": _STIFFNESS,
    "steering_ratio": {"": 1.0},
    "length": _LENGTH,
    "width": _LENGTH,
    "wheel_radius": _LENGTH,
    "side_area": {"m²": 1.0, "m^2": 1.0, "m2": 1.0},
    "wind_lever": _LENGTH,
    "cg_height": _LENGTH,
    "track_width": _LENGTH,
    "front_roll_stiffness": {"": 1.0},
    "friction_load_sensitivity": {"": 1.0},
    "stiffness_load_sensitivity": {"": 1.0},
    "steering.lag": _TIME,
    "steering.rate_limit": _RATE,
    "steering.angle_limit": _ANGLE,
    "steering.delay": _TIME,
    "steering.backlash": _ANGLE,
    "steering.gain": {"": 1.0},
    "steering.offset": _ANGLE,
}
#: What tells a CommonRoad parameter file.
_COMMONROAD = ("m", "I_z", "a", "b", "l", "w")


def read_vehicle_file(path: str | Path) -> dict[str, Any]:
    """Return the mapping of changes that a vehicle file holds, in SI units; `vehicle_from` reads it.

    A file holds fields of `VehicleParameters`, each a number in its SI unit or a text with its unit ("1.7 t",
    "22 deg"), with ``base`` for a car of which they are changes; or CommonRoad's parameters (m, I_z, a, b, l, w,
    steering), whose tyres are those of its handbook.

    Raises:
        ValueError: one line that names file, field and unit.
    """
    name = f"vehicle file {shown_path(path)!r}"
    try:
        content = read_bounded(path, _LARGEST_FILE)
    except OSError as error:
        raise ValueError(f"{name} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ValueError(f"{name} cannot be read: {error}") from None
    try:
        value = (
            parse_json(content)
            if Path(path).suffix.lower() == ".json"
            else parse_yaml(content, _MOST_EVENTS, f"a vehicle's fields: {', '.join(SCHEMA)}", "maps")
        )
        if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
            raise ValueError(f"it holds no fields; expected {', '.join(SCHEMA)}")
        complete = all(key in value for key in _COMMONROAD)
        changes = _commonroad(value, Path(path).stem) if complete else _plain(value, "")
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{name}: {' '.join(str(error).split())}") from None
    changes.setdefault("name", _title(Path(path).stem))
    base = changes.get("base", "yin")
    told = "" if complete or not isinstance(base, str) else f", changes to {base}"
    changes.setdefault("source", f"file {_title(Path(path).name)}{told}")
    return changes


def _title(text: str) -> str:
    return text if text.isprintable() and len(text) < 200 else shown(text)


def _plain(fields: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Fields with their numbers in SI units; which of them there are is for `vehicle_from` to judge."""
    changes: dict[str, Any] = {}
    for key, value in fields.items():
        path = f"{prefix}{key}"
        if isinstance(value, Mapping):
            changes[key] = _plain(value, f"{path}.")
        elif isinstance(value, str) and path in SCHEMA:
            changes[key] = _with_unit(value, path)
        else:
            changes[key] = value
    return changes


def _with_unit(text: str, path: str) -> float:
    units = SCHEMA[path]
    found = re.fullmatch(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*", text)
    unit = re.sub(r"\s+", " ", found[2]).lower() if found else ""
    try:
        number = float(found[1]) if found else float("nan")
    except ValueError:
        found = None
    if not found or unit not in units:
        allowed = ", ".join(one for one in units if one) or "none"
        raise ValueError(
            f"{path}={shown(text)} is not allowed: a number, or one with its unit; allowed units: {allowed}"
        )
    return number * units[unit]


def _commonroad(fields: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A CommonRoad vehicle; its tyres C = mu C_S m g l_other / l with mu C_S = -p_ky1, the handbook's or the file's."""
    numbers = {}
    for key in _COMMONROAD:
        value = fields[key]
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < 1e9:
            raise ValueError(f"{key}={shown(value)} is not allowed: it must be a number > 0")
        numbers[key] = float(value)
    steering, tyre = fields.get("steering"), fields.get("tire")
    slope = tyre.get("p_ky1", -21.92) if isinstance(tyre, Mapping) else -21.92
    if isinstance(slope, bool) or not isinstance(slope, int | float) or not -1e9 < slope < 0.0:
        raise ValueError(f"tire.p_ky1={shown(slope)} is not allowed: it must be a number < 0")
    mass, front, rear = numbers["m"], numbers["a"], numbers["b"]
    scale = -slope * mass * 9.81 / (front + rear)
    limits = {"angle_limit": "max", "rate_limit": "v_max"}
    given = steering if isinstance(steering, Mapping) else {}
    return {
        "name": name,
        "mass": mass,
        "yaw_inertia": numbers["I_z"],
        "cg_to_front_axle": front,
        "cg_to_rear_axle": rear,
        "front_cornering_stiffness": scale * rear,
        "rear_cornering_stiffness": scale * front,
        "steering_ratio": 1.0,
        "steering": {
            **{"lag": 0.0, "delay": 0.0, "backlash": 0.0, "rate_limit": None, "angle_limit": None},
            **{field: given[key] for field, key in limits.items() if key in given},
        },
        "length": numbers["l"],
        "width": numbers["w"],
        "wheel_radius": fields.get("R_w", 0.3),
    }
