"""What a record of others may make happen: no file is opened for it, and what it says is repeated on one short line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lanekeep_agents.policy_record import PolicyRecord
from lanekeep_env.checks import shown
from lanekeep_env.physics.vehicles import VEHICLES
from lanekeep_env.roads.specs import ROADS, RoadFile
from lanekeep_env.walls.specs import WORLDS, MapFile

#: Fields of scenarios that may name a file, with what they name otherwise.
_GENERATED = {
    "road": [kind for kind, record in ROADS.items() if record is not RoadFile],
    "world": [kind for kind, record in WORLDS.items() if record is not MapFile],
}

#: Characters of other errors, and of lists of names, that an error repeats at the most.
LONGEST_LINE = 400


def refuse_files(record: PolicyRecord) -> None:
    """Raise ValueError where a record's scenario names anything but what is generated."""
    for field, kinds in _GENERATED.items():
        value = record.scenario.get(field, kinds[0])
        kind = value.get("kind") if isinstance(value, Mapping) else value
        if not isinstance(kind, str) or kind not in kinds:
            raise ValueError(
                f"policy {record.name!r}: scenario.{field}={shown(value)} is not allowed: no file is opened for a "
                f"policy; pass the scenario to drive, or allow_files=True if you trust it; allowed: {', '.join(kinds)}"
            )
    vehicle = record.scenario.get("vehicle", {})
    based = vehicle.get("base", "") if isinstance(vehicle, Mapping) else vehicle
    if not isinstance(based, str) or (based and based not in VEHICLES):
        raise ValueError(
            f"policy {record.name!r}: scenario.vehicle={shown(vehicle)} is not allowed: no file is opened for a "
            f"policy; pass the scenario to drive, or allow_files=True if you trust it; allowed: {', '.join(VEHICLES)}"
        )


def one_line(text: object) -> str:
    """Return what an error says, or some names, without what a terminal would act on, cut where it is long."""
    line = _printable(str(text)[: 2 * LONGEST_LINE])
    return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 3]}..."


def named(file: Path) -> str:
    """Return the path of a file for an error, its end where it is long."""
    line = _printable(str(file)[-LONGEST_LINE - 1 :])
    return line if len(line) <= LONGEST_LINE else f"...{line[3 - LONGEST_LINE :]}"


def _printable(text: str) -> str:
    return " ".join("".join(one if one.isprintable() else " " for one in text).split())
