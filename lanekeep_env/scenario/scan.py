"""A depth camera: its fan of beams and its faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import plain_numbers, record_from, require


@dataclass(frozen=True)
class Scan:
    """A depth camera's scan; each fault is off by default.

    Attributes:
        beams: number, 0 for no scan.
        field_of_view: from the first (right) to the last beam (left), rad, symmetric to the car's axis.
        nearest, farthest: range, m; outside it a beam shows 0.
        noise: standard deviation at 1 m, growing with the square of the range as that of depth cameras, m.
        missing_every: each that many beams one shows 0 (0 for none).
        missing_rim: beams that show 0 at either rim.
        jump_errors: share of the beams beside a depth jump that show something between both sides.
        period: s between scans, a multiple of the control step; 0 for one at each.
    """

    beams: int = 0
    field_of_view: float = math.radians(70.0)
    nearest: float = 0.5
    farthest: float = 12.0
    noise: float = 0.0
    missing_every: int = 0
    missing_rim: int = 0
    jump_errors: float = 0.0
    period: float = 0.0

    def __post_init__(self) -> None:
        require("scan.beams", self.beams, "beams", at_least=0, at_most=4096, whole=True)
        if self.beams == 1:
            raise ValueError("scan.beams=1 is not allowed: 0 for no scan, or at least 2")
        require("scan.field_of_view", self.field_of_view, "rad", above=0.0, at_most=6.2)
        require("scan.nearest", self.nearest, "m", at_least=0.0, at_most=999.0)
        require("scan.farthest", self.farthest, "m", above=self.nearest, at_most=1000.0)
        require("scan.noise", self.noise, "m", at_least=0.0, at_most=1e3)
        require("scan.missing_every", self.missing_every, "beams", at_least=0, at_most=1_000_000, whole=True)
        require("scan.missing_rim", self.missing_rim, "beams", at_least=0, at_most=1_000_000, whole=True)
        require("scan.jump_errors", self.jump_errors, "(a share)", at_least=0.0, at_most=1.0)
        require("scan.period", self.period, "s", at_least=0.0, at_most=5.0)
        plain_numbers(self)

    @property
    def step(self) -> float:
        """Angle between beams, rad."""
        return self.field_of_view / (self.beams - 1)

    def numbers(self, control_step: float) -> np.ndarray:
        """Numbers for the kernel, (`layout.SCAN_SIZE`,)."""
        values = np.zeros(at.SCAN_SIZE)
        values[at.SCAN_FIRST], values[at.SCAN_STEP] = -0.5 * self.field_of_view, self.step
        values[at.SCAN_NEAREST], values[at.SCAN_FARTHEST] = self.nearest, self.farthest
        values[at.SCAN_NOISE], values[at.SCAN_JUMP] = self.noise, self.jump_errors
        values[at.SCAN_EVERY], values[at.SCAN_RIM] = self.missing_every, self.missing_rim
        values[at.SCAN_PERIOD] = max(1, round(self.period / control_step))
        return values


#: The Kinect of the source as far as the report tells: nearest and farthest range, gaps, rims, jumps. Assumptions: 70
#: degrees and 141 beams (it tells of a depth image of 512 x 424, cut to a scan, and of a median over 41 values).
SCANS: dict[str, Scan] = {
    "none": Scan(),
    "perfect": Scan(beams=64, nearest=0.0),
    # The columns of its image, all of them, without a fault.
    "columns": Scan(beams=512, nearest=0.0),
    "kinect": Scan(beams=141, noise=0.002, missing_every=20, missing_rim=4, jump_errors=0.5),
    "kinect-columns": Scan(beams=512, noise=0.002, missing_every=20, missing_rim=15, jump_errors=0.5),
}


def scan_from(value: str | Mapping[str, Any] | Scan) -> Scan:
    """Read a scan: a name of `SCANS`, a mapping of fields, or a record; ValueError names what is wrong."""
    return record_from(Scan, value, "scan", SCANS)
