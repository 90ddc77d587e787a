"""Engine, automatic gearbox, brake and resistances: the longitudinal acceleration of a car.

a = k(i) T(omega, throttle)/m - b brake - A_W(v) (Werling, Gröll, Bretthauer 2008 (25)), with what an automatic adds:
creep at standstill, gear changes that interrupt the torque, a reverse gear. All is told in the direction that is
engaged: backwards, speed, slope and wind change their sign. Numbers come in the vector of `Powertrain.numbers`.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.numeric import clip, larger, like, magnitude, select, sqrt
from lanekeep_env.physics.parameters import GRAVITY

#: Below this speed a car stands, m/s.
STANDS = 1e-3


#: The limiter takes the torque away over this engine speed, rad/s.
LIMITER_BAND = 20.0


@inline
def full_torque(omega, drive):
    """Return the engine's torque at full load, N m: a parabola about the speed of the largest, up to the limiter."""
    zero, one = like(omega, 0.0), like(omega, 1.0)
    bend = (omega - drive[at.D_PEAK_SPEED]) * drive[at.D_NARROWNESS]
    limited = clip(one + (drive[at.D_LIMIT] - omega) * like(omega, 1.0 / LIMITER_BAND), zero, one)
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
def resistance(v, wind, drive, inverse_mass):
    """Return the deceleration by air and rolling, m/s²; ``wind`` is a headwind, m/s."""
    air = v + wind
    return drive[at.D_AIR] * air * magnitude(air) * inverse_mass + like(v, GRAVITY) * drive[at.D_ROLL]


@inline
def creep(v, drive):
    """Return what an automatic pulls with at standstill and little above, m/s²."""
    return drive[at.D_CREEP] * clip(like(v, 1.0) - v * drive[at.D_CREEP_FALL], like(v, 0.0), like(v, 1.0))


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
def wants_up(v, gear, throttle, acceleration, margin, inverse_mass, drive):
    """Return whether the next gear is due: fast enough, and strong enough for what the car is doing and a margin."""
    ratio, following = drive[at.D_RATIOS + gear], drive[at.D_RATIOS + gear + 1]
    omega, per = v * ratio, drive[at.D_EFFICIENCY] * inverse_mass
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


@helper
def change_gear(i, block, drive):
    """Change the gear of car i if it is time, at the start of a control step."""
    zero, one = like(drive[0], 0.0), like(drive[0], 1.0)
    engaged, rest, last = block[at.SPEED_TARGET, i], block[at.SHIFT, i], block[at.SHIFTED, i]
    way = one if engaged >= zero else -one
    v, gear = way * block[at.SPEED, i], np.int64(block[at.GEAR, i])
    following = gear
    if v < like(v, STANDS):
        if block[at.SET_SPEED, i] * way < zero:  # the lever is moved where the car stands
            block[at.SPEED_TARGET, i] = -engaged
            following = np.int64(-1 if way > zero else 0)
        elif gear > 0:
            following = np.int64(0)
    elif gear >= 0 and rest <= drive[at.D_SETTLE] - drive[at.D_HOLD]:
        throttle = block[at.THROTTLE, i]
        if gear > 0 and (rest == zero or last < zero):
            following -= wants_down(v, gear, throttle, drive)
        if following == gear and gear + 1 < np.int64(drive[at.D_GEARS]) and (rest == zero or last > zero):
            # Who had to shift down wants something left before it goes up again.
            margin = drive[at.D_RESERVE] if last < zero else zero
            following += wants_up(v, gear, throttle, way * block[at.PULL, i], margin, block[at.INVERSE_MASS, i], drive)
    if following != gear:
        block[at.SHIFTED, i] = one if following > gear else -one
        block[at.SHIFT, i] = drive[at.D_SETTLE]
        engage(i, following, block, drive)


@inline
def engage(i, gear, block, drive):
    """Engage a gear in car i, -1 for reverse, and note the speeds at which another one may be due."""
    block[at.GEAR, i] = gear
    block[at.RATIO, i] = drive[at.D_REVERSE] if gear < 0 else drive[at.D_RATIOS + gear]
    highest = gear < 0 or gear + 1 == np.int64(drive[at.D_GEARS])
    block[at.UP_FROM, i] = np.inf if highest else drive[at.D_UP] / drive[at.D_RATIOS + gear]
    slowest = drive[at.D_DOWN] + drive[at.D_DOWN_THROTTLE]
    block[at.DOWN_BELOW, i] = slowest / drive[at.D_RATIOS + gear - 1] if gear > 0 else 0.0


@helper
def find_due(n, block, drive):
    """Mark in the row DUE the first ``n`` cars of a block for which an event or a gear change may be due."""
    v_, up_, down_, throttle_ = block[at.SPEED], block[at.UP_FROM], block[at.DOWN_BELOW], block[at.THROTTLE]
    step_, event_, due_ = block[at.STEP], block[at.EVENT_STEP], block[at.DUE]
    gear_, set_, target_ = block[at.GEAR], block[at.SET_SPEED], block[at.SPEED_TARGET]
    zero, one, kick, stands = like(drive[0], 0.0), like(drive[0], 1.0), drive[at.D_KICK], like(drive[0], STANDS)
    for i in range(n):
        v = magnitude(v_[i])
        stops = (v < stands) & ((gear_[i] > zero) | (set_[i] * target_[i] < zero))
        changes = (v >= up_[i]) | (v < down_[i]) | stops | (throttle_[i] > kick)
        due_[i] = select(changes | (step_[i] >= event_[i]), one, zero)


@helper
def pull(n, block, settings, drive):
    """Advance pedals and brake of a block's first ``n`` cars by a sub-step; write their acceleration along, m/s².

    The car does not roll against the direction engaged: whoever stands on a slope is held. All four wheels are taken
    to drive. With the friction circle anti-lock and traction control keep to `layout.CIRCLE` of the friction, and an
    axle gives across what the rest leaves; without, what the tyres give along leaves what they give across alone.
    """
    speed_, pedal_, throttle_, brake_ = block[at.SPEED], block[at.PEDAL], block[at.THROTTLE], block[at.BRAKE]
    ratio_, shift_, target_, slope_, wind_ = (
        block[at.RATIO],
        block[at.SHIFT],
        block[at.SPEED_TARGET],
        block[at.SLOPE],
        block[at.WIND],
    )
    inverse_, pull_, way_ = block[at.INVERSE_MASS], block[at.PULL], block[at.WAY]
    front_, rear_, front_grip_, rear_grip_ = (
        block[at.FRONT_PEAK],
        block[at.REAR_PEAK],
        block[at.FRONT_GRIP],
        block[at.REAR_GRIP],
    )
    h, circle = settings[at.STEP_TIME], settings[at.CIRCLE]
    zero, one = like(h, 0.0), like(h, 1.0)
    circular, share = circle > zero, drive[at.D_PEDAL_SHARE]
    most = circle if circular else one
    idle, efficiency, brakes = drive[at.D_IDLE], drive[at.D_EFFICIENCY], drive[at.D_BRAKE]
    without = drive[at.D_SETTLE] - drive[at.D_WITHOUT]
    # A car that stops within the sub-step stands at its end, whatever rounding leaves of it.
    stopping = -like(h, 1.0 + 1e-6) / h
    for i in range(n):
        way = select(target_[i] >= zero, one, -one)
        v, ratio, inverse = way * speed_[i], ratio_[i], inverse_[i]
        throttle = throttle_[i] + (larger(pedal_[i], zero) - throttle_[i]) * share
        brake = brake_[i] + (larger(-pedal_[i], zero) - brake_[i]) * share
        throttle_[i], brake_[i] = throttle, brake
        torque = engine_torque(engine_speed(v, ratio, drive), throttle, drive)
        # On the slipping converter a closed throttle does not drag: the car creeps.
        torque = select(v * ratio < idle, larger(torque, zero), torque)
        drives = select(shift_[i] > without, zero, torque * ratio * efficiency * inverse)
        shift_[i] = larger(shift_[i] - one, zero)
        # Engine and brake together get no more out of the tyres than their friction, in either direction.
        grip = (front_grip_[i] + rear_grip_[i]) * inverse
        drives = clip(drives + creep(v, drive) - brake * brakes, -most * grip, most * grip)
        used = drives / grip
        left = select(circular, sqrt(larger(one - used * used, zero)), one)
        front_[i], rear_[i] = front_grip_[i] * left, rear_grip_[i] * left
        free = drives - like(h, GRAVITY) * way * slope_[i] - resistance(v, way * wind_[i], drive, inverse)
        stop = v * stopping
        stands = (v < like(h, STANDS)) & (free <= zero)
        free = select(stands, stop, larger(free, stop))
        pull_[i] = way * free
        way_[i] += like(h, 0.5) * (v + larger(v + free * h, zero)) * h
