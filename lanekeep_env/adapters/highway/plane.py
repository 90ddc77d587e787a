"""One of our cars in the plane: the compiled vehicle models over a simulation step of somebody else's world."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import kernel
from lanekeep_env.engine.delay import acting_row, delay_commands
from lanekeep_env.engine.episode import draw_car
from lanekeep_env.physics.integrate import named
from lanekeep_env.physics.models import CarModel


@functools.cache
def driver(model: CarModel) -> Callable[..., Any]:
    """Return the kernel that takes a block of cars of a model through a control step, commands and pull being set."""
    advance, show = model.advance, model.show

    @kernel()
    @named(model.name)
    def drive(block, settings, gear, floor):
        if settings[at.DELAY_DEPTH] > 0.0:
            delay_commands(block, settings, at.COMMAND)
        for substep in range(np.int64(settings[at.SUBSTEPS])):
            advance(block, acting_row(substep, block, settings, at.COMMAND), settings, gear, floor)
        show(block, floor)

    return drive


@kernel()
def fill(block, settings):
    """Write the nominal car of the settings into a block of one."""
    draw_car(np.int64(0), np.uint64(0), block, settings)
