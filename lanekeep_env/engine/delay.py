"""The transport delay of commands, for a block of cars."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import like


@helper
def delay_commands(block, settings, row):
    """Push the commands of a row into the delay line and pick the two that act in this control step.

    With a delay of w control steps and p sub-steps a command w steps old acts, and for the first p
    sub-steps the one before it.
    """
    depth, substeps = np.int64(settings[at.DELAY_DEPTH]), np.int64(settings[at.SUBSTEPS])
    for i in range(block.shape[1]):
        for k in range(depth - 1, 0, -1):
            block[at.CAR_ROWS + k, i] = block[at.CAR_ROWS + k - 1, i]
        block[at.CAR_ROWS, i] = block[row, i]
        whole = np.int64(block[at.DELAY, i]) // substeps
        block[at.DELAYED_THEN, i] = block[at.CAR_ROWS + whole, i]
        block[at.DELAYED_FIRST, i] = block[at.CAR_ROWS + min(whole + 1, depth - 1), i]


@helper
def acting_row(substep, block, settings, row):
    """Return the row of the commands that act in a sub-step of a block; ``row`` itself without a delay."""
    if settings[at.DELAY_DEPTH] == like(settings[0], 0.0):
        return row
    substeps = np.int64(settings[at.SUBSTEPS])
    for i in range(block.shape[1]):
        part = np.int64(block[at.DELAY, i]) % substeps
        block[at.ACTING, i] = block[at.DELAYED_FIRST, i] if substep < part else block[at.DELAYED_THEN, i]
    return at.ACTING
