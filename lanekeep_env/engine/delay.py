"""The transport delay of commands, for a block of lanes."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import like


@helper
def delay_commands(lanes, settings, row):
    """Push the commands of a row into the delay line and pick the two that act in this control step.

    With a delay of w control steps and p sub-steps a command w steps old acts, and for the first p
    sub-steps the one before it.
    """
    depth, substeps = np.int64(settings[at.DELAY_DEPTH]), np.int64(settings[at.SUBSTEPS])
    for i in range(lanes.shape[1]):
        for k in range(depth - 1, 0, -1):
            lanes[at.LANE_ROWS + k, i] = lanes[at.LANE_ROWS + k - 1, i]
        lanes[at.LANE_ROWS, i] = lanes[row, i]
        whole = np.int64(lanes[at.DELAY, i]) // substeps
        lanes[at.DELAYED_THEN, i] = lanes[at.LANE_ROWS + whole, i]
        lanes[at.DELAYED_FIRST, i] = lanes[at.LANE_ROWS + min(whole + 1, depth - 1), i]


@helper
def acting_row(substep, lanes, settings, row):
    """Return the row of the commands that act in a sub-step of a block; ``row`` itself without a delay."""
    if settings[at.DELAY_DEPTH] == like(settings[0], 0.0):
        return row
    substeps = np.int64(settings[at.SUBSTEPS])
    for i in range(lanes.shape[1]):
        part = np.int64(lanes[at.DELAY, i]) % substeps
        lanes[at.ACTING, i] = lanes[at.DELAYED_FIRST, i] if substep < part else lanes[at.DELAYED_THEN, i]
    return at.ACTING
