"""What a road, map or vehicle file holds, for `lanekeep road check`, `lanekeep map check`, `lanekeep vehicle check`."""

from __future__ import annotations

from lanekeep_benchmarks.check.maps import check_map, draw_map
from lanekeep_benchmarks.check.report import Report
from lanekeep_benchmarks.check.roads import check_road, draw_road
from lanekeep_benchmarks.check.vehicles import check_vehicle

__all__ = ["Report", "check_map", "check_road", "check_vehicle", "draw_map", "draw_road"]
