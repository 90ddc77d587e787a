"""Why an episode ended."""

from __future__ import annotations

from enum import IntEnum


class Termination(IntEnum):
    """Code of ``info["termination"]``; a time limit is not a termination but a truncation."""

    NONE = 0
    LANE_DEPARTURE = 1
    CONTACT = 2
    FINISHED = 3
    #: The car's state was no number any more: a fault of the simulation, counted as a failure of the episode.
    DIVERGED = 4
    #: The car drove past a stop point.
    STOP_PASSED = 5


#: Codes as the compiled loops write them, among numbers.
CONTACT, FINISHED, DIVERGED, STOP_PASSED = (
    float(code) for code in (Termination.CONTACT, Termination.FINISHED, Termination.DIVERGED, Termination.STOP_PASSED)
)
