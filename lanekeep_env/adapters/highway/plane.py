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
from lanekeep_env.physics import single_track
from lanekeep_env.physics.integrate import DRIVEN, named
from lanekeep_env.physics.models import CarModel

#: A rolling car that is told an acceleration; the one with tyres that saturate is `models.POWERED`.
KINEMATIC_DRIVEN = CarModel("kinematic_driven", single_track.kinematic, single_track.kinematic_outputs, DRIVEN)


@functools.cache
def kernels(model: CarModel) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return two kernels of a model: one writes the nominal car into a block of one, the other drives it.

    The second takes a control step; command, pull and fastest speed stand in their rows.
    """
    advance, show = model.advance, model.show

    @kernel()
    @named(model.name)
    def fill(block, settings):
        draw_car(np.int64(0), np.uint64(0), block, settings)

    @kernel()
    @named(model.name)
    def drive(block, settings, gear, floor):
        if settings[at.DELAY_DEPTH] > 0.0:
            delay_commands(block, settings, at.COMMAND)
        for substep in range(np.int64(settings[at.SUBSTEPS])):
            advance(block, acting_row(substep, block, settings, at.COMMAND), settings, gear, floor)
        show(block, settings, floor)

    return fill, drive
