"""Damaged and hostile roads, maps and cars: read, or refused in one line, within bounds of time and memory.

    python tests/fuzz/places.py --count 3000 --seed 0 [--only car|map|road]

Exits with 1 if anything else happened.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from car_cases import car_bombs, cars
from file_cases import Case
from harness import drive, special_files
from map_cases import YAML, map_bombs, maps, pictures, with_map
from road_cases import read_road, road_bombs, roads

from lanekeep_env.physics.vehicles import vehicle_from
from lanekeep_env.walls import MapFile


def specials(folder: Path, kind: str) -> Iterator[Case]:
    """What is no file, as a road, as a map's YAML file and as its picture."""
    (folder / "special").mkdir()
    for name, path in special_files(folder / "special"):
        if kind == "road":
            yield f"road: {name}", lambda p=path: read_road(p)
            continue
        if kind == "car":
            link = folder / "special" / f"{path.name[:20]}.yaml"
            link.symlink_to(path)
            yield f"car: {name}", lambda p=link: vehicle_from(str(p))
            continue
        yield f"map: {name} as YAML", lambda p=path: MapFile(str(p))
        text = YAML.replace(b"map.pgm", f"'{path}'".encode())
        yield f"map: {name} as picture", with_map(folder, text, b"")


def run(count: int, seed: int, only: str | None, bombs: bool = True) -> list[str]:
    """Drive all kinds; return the violations."""
    found: list[str] = []
    for kind, draws, large in (("road", roads, road_bombs), ("map", maps, map_bombs), ("car", cars, car_bombs)):
        if only not in (None, kind):
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            found += drive(_call, draws(count, seed, folder), name=f"{kind}s, mutated")
            found += drive(_call, specials(folder, kind), name=f"{kind}s, special files")
            if bombs:
                found += drive(_call, large(folder), name=f"{kind}s, large")
            if bombs and kind == "map":
                for label, cases in pictures(folder):
                    found += drive(_call, cases, name=label)
    return found


def _call(case: Callable[[], Any]) -> Any:
    return case()


def main() -> int:
    """Read the command line and drive."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=3000, help="mutations of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=("road", "map", "car"))
    arguments = parser.parse_args()
    return 1 if run(arguments.count, arguments.seed, arguments.only) else 0


if __name__ == "__main__":
    sys.exit(main())
