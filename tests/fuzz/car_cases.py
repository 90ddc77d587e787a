"""Damaged and hostile vehicle files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from file_cases import Case, with_file
from harness import Watch, mutated

from lanekeep_env.physics.vehicles import vehicle_from

_CARS = (
    (".yaml", b"base: passat\nmass: 1.8 t\nyaw_inertia: 3000\nsteering:\n  angle_limit: 30 deg\n  delay: 0.02\n"),
    (
        ".json",
        b'{"base": "yin", "mass": "1800 kg", "width": "1800 mm", "steering": {"lag": 0.05, "rate_limit": "30 deg/s"}}',
    ),
    (
        ".yaml",
        b"l: 4.5\nw: 1.6\nm: 1093.3\na: 1.156\nb: 1.423\nI_z: 1.79e+3\nR_w: 0.344\n"
        b"steering:\n  max: 1.066\n  min: -1.066\n  v_max: 4e-1\ntire:\n  p_ky1: -21.92\n",
    ),
)


def read_car(path: Path) -> None:
    """Read a vehicle file as a scenario does; nothing else is opened."""
    with Watch() as watch:
        try:
            car = vehicle_from(str(path))
        finally:
            watch.require_only(path)
    assert car.mass > 0.0 and car.wheelbase > 0.0


def cars(count: int, seed: int, folder: Path) -> Iterator[Case]:
    """Mutations of vehicle files."""
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        ending, original = _CARS[number % len(_CARS)]
        yield f"car {seed} {number}", with_file(folder / f"car{ending}", mutated(original, rng), read_car)


def car_bombs(folder: Path) -> Iterator[Case]:
    """Vehicle files that are large, or ask for a lot of work."""
    for name, content in (
        ("100 KB of brackets", b"[" * 99_000),
        ("99 KB of fields", b"".join(b"f%d: 1\n" % k for k in range(9000))),
        ("1 MB", b"mass: 1\n" * 125_000),
        ("400 digits", b"mass: " + b"9" * 400),
        ("a text of 4000 digits", b"mass: '" + b"9" * 4000 + b" kg'"),
    ):
        yield f"car: {name}", with_file(folder / "car.yaml", content, read_car)
