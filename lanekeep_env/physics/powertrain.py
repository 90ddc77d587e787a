"""Engine, automatic gearbox, brake and resistances: the longitudinal acceleration of a car.

a = k(i) T(omega, throttle)/m - b brake - A_W(v) (Werling, Gröll, Bretthauer 2008 (25)), with what an automatic adds:
creep at standstill and gear changes that interrupt the torque. Numbers come in the vector of `Powertrain.numbers`.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import clip, larger, like, select
from lanekeep_env.physics.parameters import GRAVITY

#: Below this speed a car stands, m/s.
STANDS = 1e-3


@inline
def engine_torque(omega, throttle, drive):
    """Return the engine's torque, N m, at ``omega`` rad/s and a throttle from 0 (drag) to 1 (full load).

    Full load is a parabola about the speed of the largest torque; closed, the engine drags with t0 + t1 omega.
    """
    bend = (omega - drive[at.D_PEAK_SPEED]) / drive[at.D_WIDTH]
    full = drive[at.D_PEAK_TORQUE] * larger(like(omega, 1.0) - bend * bend, like(omega, 0.0))
    drag = drive[at.D_DRAG] + drive[at.D_DRAG_SLOPE] * omega
    return throttle * full - (like(omega, 1.0) - throttle) * drag


@inline
def engine_speed(v, ratio, drive):
    """Return the engine's speed, rad/s: that of the wheels, or idling on the converter's slip."""
    return larger(v * ratio, drive[at.D_IDLE])


@inline
def resistance(v, wind, drive, mass):
    """Return the deceleration by air and rolling, m/s²; ``wind`` is a headwind, m/s."""
    air = v + wind
    return drive[at.D_AIR] * air * abs(air) / mass + like(v, GRAVITY) * drive[at.D_ROLL]


@inline
def creep(v, drive):
    """Return what an automatic pulls with at standstill and little above, m/s²."""
    return drive[at.D_CREEP] * clip(like(v, 1.0) - v / drive[at.D_CREEP_SPEED], like(v, 0.0), like(v, 1.0))


@inline
def choose_gear(v, drive):
    """Return the gear in which a car at ``v`` starts an episode: the lowest one well below the upshift speed."""
    gear = last = np.int64(drive[at.D_GEARS]) - 1
    for lower in range(last, -1, -1):
        gear = select(v * drive[at.D_RATIOS + lower] < 0.9 * drive[at.D_UP], lower, gear)
    return gear


@helper
def pull(i, block, settings, drive):
    """Advance pedal, gearbox and brake of car i by a sub-step and write its longitudinal acceleration, m/s².

    The car does not roll backwards: whoever stands on a slope is held. All four wheels are taken to drive, and what
    they give along leaves what they give across alone.
    """
    h = settings[at.STEP_TIME]
    zero, one = like(h, 0.0), like(h, 1.0)
    v, mass = block[at.SPEED, i], one / block[at.INVERSE_MASS, i]
    pedal = block[at.PEDAL, i]
    share = drive[at.D_PEDAL_SHARE]
    block[at.THROTTLE, i] += (larger(pedal, zero) - block[at.THROTTLE, i]) * share
    block[at.BRAKE, i] += (larger(-pedal, zero) - block[at.BRAKE, i]) * share
    throttle = block[at.THROTTLE, i]
    gear, last = np.int64(block[at.GEAR, i]), np.int64(drive[at.D_GEARS]) - 1
    ratio = drive[at.D_RATIOS + gear]
    block[at.SHIFT, i] = larger(block[at.SHIFT, i] - h, zero)
    if block[at.SHIFT, i] == zero:
        omega = v * ratio
        if omega > drive[at.D_UP] + drive[at.D_UP_THROTTLE] * throttle and gear < last:
            gear += 1
            block[at.SHIFT, i] = drive[at.D_HOLD_TIME]
        elif omega < drive[at.D_DOWN] + drive[at.D_DOWN_THROTTLE] * throttle and gear > 0:
            gear -= 1
            block[at.SHIFT, i] = drive[at.D_HOLD_TIME]
        block[at.GEAR, i] = gear
        ratio = drive[at.D_RATIOS + gear]
    interrupted = block[at.SHIFT, i] > drive[at.D_HOLD_TIME] - drive[at.D_SHIFT_TIME]
    torque = engine_torque(engine_speed(v, ratio, drive), throttle, drive)
    # On the slipping converter a closed throttle does not drag: the car creeps.
    torque = larger(torque, zero) if v * ratio < drive[at.D_IDLE] else torque
    drives = zero if interrupted else torque * ratio * drive[at.D_EFFICIENCY] / mass
    drives += creep(v, drive)
    # Engine and brake together get no more out of the tyres than their friction, in either direction.
    grip = (block[at.FRONT_PEAK, i] + block[at.REAR_PEAK, i]) / mass
    drives = clip(drives - block[at.BRAKE, i] * drive[at.D_BRAKE], -grip, grip)
    free = drives - like(h, GRAVITY) * block[at.SLOPE, i] - resistance(v, block[at.WIND, i], drive, mass)
    standing = v < like(h, STANDS)
    # A car that stops within the sub-step stands at its end, whatever rounding leaves of it.
    stop = -v / h * like(h, 1.0 + 1e-6)
    block[at.PULL, i] = stop if standing and free <= zero else larger(free, stop)
    after = larger(v + block[at.PULL, i] * h, zero)
    block[at.WAY, i] += like(h, 0.5) * (v + after) * h
