"""Engine, automatic gearbox, brake and resistances: the longitudinal acceleration of a car.

a = k(i) T(omega, throttle)/m - b brake - A_W(v) (Werling, Gröll, Bretthauer 2008 (25)), with what an automatic adds:
creep at standstill, gear changes that interrupt the torque, a reverse gear. All is told in the direction that is
engaged: backwards, speed, slope and wind change their sign. Numbers come in the vector of `Powertrain.numbers`.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import clip, larger, like, select, sqrt
from lanekeep_env.physics.parameters import GRAVITY

#: Below this speed a car stands, m/s.
STANDS = 1e-3


#: The limiter takes the torque away over this engine speed, rad/s.
LIMITER_BAND = 20.0


@inline
def full_torque(omega, drive):
    """Return the engine's torque at full load, N m: a parabola about the speed of the largest, up to the limiter."""
    zero, one = like(omega, 0.0), like(omega, 1.0)
    bend = (omega - drive[at.D_PEAK_SPEED]) / drive[at.D_WIDTH]
    limited = clip(one + (drive[at.D_LIMIT] - omega) / like(omega, LIMITER_BAND), zero, one)
    return drive[at.D_PEAK_TORQUE] * larger(one - bend * bend, zero) * limited


@inline
def engine_torque(omega, throttle, drive):
    """Return the engine's torque, N m, at ``omega`` rad/s and a throttle from 0 (drag) to 1 (full load).

    Closed, the engine drags with t0 + t1 omega.
    """
    drag = drive[at.D_DRAG] + drive[at.D_DRAG_SLOPE] * omega
    return throttle * full_torque(omega, drive) - (like(omega, 1.0) - throttle) * drag


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


@inline
def upshift_speed(throttle, drive):
    """Return the engine speed at which the gearbox would shift up, rad/s."""
    part = drive[at.D_PART]
    beyond = larger(throttle - part, like(throttle, 0.0)) / (like(throttle, 1.0) - part)
    return drive[at.D_UP] + (drive[at.D_UP_FULL] - drive[at.D_UP]) * beyond


@inline
def wants_up(v, gear, throttle, acceleration, margin, mass, drive):
    """Return whether the next gear is due: fast enough, and strong enough for what the car is doing and a margin."""
    ratio, following = drive[at.D_RATIOS + gear], drive[at.D_RATIOS + gear + 1]
    omega, per = v * ratio, drive[at.D_EFFICIENCY] / mass
    if omega <= upshift_speed(throttle, drive):
        return False
    now = engine_torque(omega, throttle, drive) * ratio * per
    possible = acceleration - now + full_torque(engine_speed(v, following, drive), drive) * following * per
    enough = possible >= acceleration + margin or omega > drive[at.D_UP_FULL]
    return enough and possible >= drive[at.D_RESERVE]


@inline
def wants_down(v, gear, throttle, drive):
    """Return whether the gear below is due: the engine turns too slowly, or kick-down may make it turn faster."""
    omega = v * drive[at.D_RATIOS + gear - 1]
    slow = omega < drive[at.D_DOWN] + drive[at.D_DOWN_THROTTLE] * throttle
    return slow or (throttle > drive[at.D_KICK] and omega < drive[at.D_KICK_SPEED])


@inline
def change_gear(i, v, mass, block, drive):
    """Change the gear of car i, which drives ``v`` m/s in the direction engaged, if it is time."""
    zero, one = like(v, 0.0), like(v, 1.0)
    gear, following = np.int64(block[at.GEAR, i]), np.int64(block[at.GEAR, i])
    held, last = drive[at.D_SETTLE_TIME] - drive[at.D_HOLD_TIME], block[at.SHIFTED, i]
    rest = block[at.SHIFT, i]
    if v < like(v, STANDS):
        engaged = block[at.SPEED_TARGET, i]
        if block[at.SET_SPEED, i] * engaged < zero:  # the lever is moved where the car stands
            block[at.SPEED_TARGET, i] = -engaged
            following = np.int64(-1 if engaged > zero else 0)
        elif gear > 0:
            following = np.int64(0)
    elif gear >= 0 and rest <= held:
        throttle = block[at.THROTTLE, i]
        if gear > 0 and (rest == zero or last < zero):
            following -= wants_down(v, gear, throttle, drive)
        if following == gear and gear + 1 < np.int64(drive[at.D_GEARS]) and (rest == zero or last > zero):
            forward = block[at.PULL, i] if block[at.SPEED_TARGET, i] > zero else -block[at.PULL, i]
            # Who had to shift down wants something left before it goes up again.
            margin = drive[at.D_RESERVE] if last < zero else zero
            following += wants_up(v, gear, throttle, forward, margin, mass, drive)
    if following != gear:
        block[at.SHIFTED, i] = one if following > gear else -one
        block[at.SHIFT, i] = drive[at.D_SETTLE_TIME]
        block[at.GEAR, i] = following


@inline
def leave_across(i, along, grip, block, settings):
    """Leave what engine and brake of car i take, m/s² of ``grip``, no more to the tyres across: the friction circle."""
    if settings[at.CIRCLE] > like(grip, 0.0):
        used = along / grip
        share = sqrt(like(grip, 1.0) - used * used)
        block[at.FRONT_PEAK, i] = block[at.FRONT_GRIP, i] * share
        block[at.REAR_PEAK, i] = block[at.REAR_GRIP, i] * share


@helper
def pull(i, block, settings, drive):
    """Advance pedal, gearbox and brake of car i by a sub-step and write its longitudinal acceleration, m/s².

    The car does not roll against the direction engaged: whoever stands on a slope is held. All four wheels are taken
    to drive. Anti-lock and traction control keep to `layout.CIRCLE` of the friction; without the circle it is all of
    it, and what the tyres give along leaves what they give across alone.
    """
    h = settings[at.STEP_TIME]
    zero, one = like(h, 0.0), like(h, 1.0)
    mass = one / block[at.INVERSE_MASS, i]
    pedal, share = block[at.PEDAL, i], drive[at.D_PEDAL_SHARE]
    block[at.THROTTLE, i] += (larger(pedal, zero) - block[at.THROTTLE, i]) * share
    block[at.BRAKE, i] += (larger(-pedal, zero) - block[at.BRAKE, i]) * share
    block[at.SHIFT, i] = larger(block[at.SHIFT, i] - h, zero)
    way = one if block[at.SPEED_TARGET, i] >= zero else -one
    change_gear(i, way * block[at.SPEED, i], mass, block, drive)
    way = one if block[at.SPEED_TARGET, i] >= zero else -one
    v, gear = way * block[at.SPEED, i], np.int64(block[at.GEAR, i])
    ratio = drive[at.D_REVERSE] if gear < 0 else drive[at.D_RATIOS + gear]
    interrupted = block[at.SHIFT, i] > drive[at.D_SETTLE_TIME] - drive[at.D_SHIFT_TIME]
    torque = engine_torque(engine_speed(v, ratio, drive), block[at.THROTTLE, i], drive)
    # On the slipping converter a closed throttle does not drag: the car creeps.
    torque = larger(torque, zero) if v * ratio < drive[at.D_IDLE] else torque
    drives = zero if interrupted else torque * ratio * drive[at.D_EFFICIENCY] / mass
    drives += creep(v, drive)
    # Engine and brake together get no more out of the tyres than their friction, in either direction.
    grip = (block[at.FRONT_GRIP, i] + block[at.REAR_GRIP, i]) / mass
    most = grip * settings[at.CIRCLE] if settings[at.CIRCLE] > zero else grip
    drives = clip(drives - block[at.BRAKE, i] * drive[at.D_BRAKE], -most, most)
    leave_across(i, drives, grip, block, settings)
    slope, wind = way * block[at.SLOPE, i], way * block[at.WIND, i]
    free = drives - like(h, GRAVITY) * slope - resistance(v, wind, drive, mass)
    standing = v < like(h, STANDS)
    # A car that stops within the sub-step stands at its end, whatever rounding leaves of it.
    stop = -v / h * like(h, 1.0 + 1e-6)
    free = stop if standing and free <= zero else larger(free, stop)
    block[at.PULL, i] = way * free
    after = larger(v + free * h, zero)
    block[at.WAY, i] += like(h, 0.5) * (v + after) * h
