"""Suites: what is driven. One is a TOML file: those here, beside this module, and a user's own."""

from __future__ import annotations

from pathlib import Path

from lanekeep_benchmarks.suites.frozen import check_frozen
from lanekeep_benchmarks.suites.own_road import OWN_ROAD, road_suite
from lanekeep_benchmarks.suites.reader import ENDING, read_suite
from lanekeep_benchmarks.suites.records import Suite, SuiteScenario
from lanekeep_env.checks import nearest, shown, shown_path

__all__ = [
    "ENDING",
    "OWN_ROAD",
    "SUITES",
    "Suite",
    "SuiteScenario",
    "check_frozen",
    "find_suite",
    "read_suite",
    "road_suite",
]

#: The package's own by name.
SUITES: dict[str, Suite] = {
    suite.name: suite for suite in map(read_suite, sorted(Path(__file__).parent.glob(f"*{ENDING}")))
}


def find_suite(name: str) -> Suite:
    """Return the package's suite of that name, or read one's own where ``name`` is the path of a TOML file.

    Raises:
        ValueError: unknown, where the nearest one is named; or a file that is not a suite.
    """
    if not name.endswith(ENDING):
        if name not in SUITES:
            raise ValueError(
                f"suite {shown(name)} is unknown{nearest(name, SUITES)}; allowed: {', '.join(SUITES)}, "
                f"or a {ENDING} file"
            )
        return SUITES[name]
    suite = read_suite(name)
    if suite.name in SUITES or suite.name.startswith(OWN_ROAD):
        raise ValueError(
            f"suite {shown_path(name)}: name={suite.name!r} is not allowed: the package's own have the names "
            f"{', '.join(SUITES)} and {OWN_ROAD}..."
        )
    return suite
