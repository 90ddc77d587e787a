"""What a car between walls sees and touches: ultrasonics, encoder, its body among the walls."""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper
from lanekeep_env.physics.numeric import like, sin_cos, smaller
from lanekeep_env.sensing.ultrasonic import FARTHEST, NEAREST, TANGENT, ULTRASONICS, cone_distance
from lanekeep_env.walls.contact import clearance, sweeps

_PLACES = tuple(ULTRASONICS.values())


@helper
def look_around(i, block, walls, span, settings, scratch):
    """Write the distances that the ultrasonics would tell without a fault, m, NaN for no echo."""
    sine, cosine = sin_cos(block[at.HEADING, i])
    x, y = block[at.ALONG, i], block[at.LATERAL, i]
    cone = like(x, TANGENT), like(x, NEAREST), like(x, FARTHEST)
    for row, arm, ahead, left in _PLACES:
        c, s = like(x, ahead), like(x, left)
        pose = x + settings[arm] * cosine, y + settings[arm] * sine, c * cosine - s * sine, c * sine + s * cosine
        block[row, i] = cone_distance(pose, cone, walls, span, scratch)


@helper
def _body(x, y, heading, settings):
    """Pose of the middle of a car's body whose reference point is at (x, y)."""
    sine, cosine = sin_cos(heading)
    middle = settings[at.BODY_MIDDLE]
    return x + middle * cosine, y + middle * sine, cosine, sine


@helper
def measure_clearance(i, block, walls, span, settings, scratch):
    """Write how far car i's body is from the nearest wall."""
    pose = _body(block[at.ALONG, i], block[at.LATERAL, i], block[at.HEADING, i], settings)
    block[at.CLEARANCE, i] = clearance(
        pose, (settings[at.BODY_HALF_LENGTH], settings[at.BODY_HALF_WIDTH]), walls, span, scratch
    )


@helper
def touch(i, block, walls, span, settings, scratch):
    """Whether car i's body touched a wall in this control step; writes its clearance."""
    measure_clearance(i, block, walls, span, settings, scratch)
    before = _body(block[at.BEFORE_X, i], block[at.BEFORE_Y, i], block[at.BEFORE_HEADING, i], settings)
    after = _body(block[at.ALONG, i], block[at.LATERAL, i], block[at.HEADING, i], settings)
    half_length, half_width = settings[at.BODY_HALF_LENGTH], settings[at.BODY_HALF_WIDTH]
    # No point of the body came farther than this, twice over for the bulge of its way: the sweep costs most of a step.
    moved = abs(after[0] - before[0]) + abs(after[1] - before[1])
    turned = abs(after[2] - before[2]) + abs(after[3] - before[3])
    reach = moved + turned * (half_length + half_width)
    if block[at.CLEARANCE, i] > reach + reach:
        return False
    return sweeps(before, after, (half_length, half_width), walls, span, scratch)


@helper
def read_encoder(i, block, settings):
    """Turn the wheels by the way of this control step and read the encoder."""
    seconds = settings[at.STEP_TIME] * settings[at.SUBSTEPS]
    half = like(seconds, 0.5)
    v, tick = block[at.SPEED, i], settings[at.TICK]
    signless = settings[at.SIGNLESS] > 0.0
    speed = v
    if tick > 0.0:
        # The speed rose or fell evenly, and then stood for the rest of the step.
        before, change = block[at.BEFORE_SPEED, i], settings[at.SPEED_CHANGE]
        ramp = abs(v - before) * settings[at.STEP_TIME] / (change if change > 0.0 else like(change, 1.0))
        way = block[at.WAY, i] + v * seconds - half * (v - before) * smaller(ramp, seconds)
        # Counted in ticks of the present wheel's turn, so that float32 stays exact on long ways.
        ticks = np.floor(way / tick)
        speed = (ticks - block[at.TICKS, i]) * tick / seconds
        turns = np.floor(ticks * like(tick, 1.0 / 1024.0))
        block[at.WAY, i] = way - turns * like(tick, 1024.0) * tick
        block[at.TICKS, i] = ticks - turns * like(tick, 1024.0)
    block[at.WHEEL_SPEED, i] = abs(speed) if signless else speed
