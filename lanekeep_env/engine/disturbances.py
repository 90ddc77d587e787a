"""What disturbs a car in an episode: faults of its steering, bank and wind, patches of other friction, and changes.

Rows of `layout` hold it; how cars feel it is the models' matter (`side_forces`) and that of the axles' largest forces.
"""

from __future__ import annotations

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.engine.episode import GAIN, LAG, OFFSET, cars_in, drawn, set_lag
from lanekeep_env.physics.numeric import like
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.side_forces import side_weight, wind_force
from lanekeep_env.randomness import derive, uniform
from lanekeep_env.sensing.measure import normal

# Their draws have a key of their own under that of the episode, and these counters.
_KEY = np.int64(84)
_BANK, _CROSSWIND, _CHANGE, _LASTS = np.int64(0), np.int64(1), np.int64(2), np.int64(3)
_FACTORS = np.int64(4)  # and the following, one a factor of `Changes`, in this order:
_MASS, _FRICTION, _FRONT, _REAR, _LAG = (np.int64(k) for k in range(5))
_FIRST_GUST, _FIRST_PATCH = np.int64(1 << 32), np.int64(1 << 33)


@inline
def _between(key, which, low, high):
    """Draw number ``which`` between bounds; equal ones give it exactly."""
    low, high = np.float64(low), np.float64(high)
    return low + (high - low) * uniform(key, which)


@inline
def _draws(i, counted):
    """Return the keys of car i's episode and of what disturbs it."""
    key = derive(np.uint64(counted[at.KEY, i]), counted[at.EPISODE, i])
    return key, derive(key, _KEY)


@inline
def draw_gain(i, key, block, settings):
    """Write what the road wheel of car i turns by, of what the actuator is told."""
    block[at.STEER_FACTOR, i] = settings[at.STEERING_GAIN] * drawn(key, GAIN, settings)


@helper
def draw_disturbances(i, block, counted, settings):
    """Write what disturbs car i in its episode, and the car that it is at the start."""
    key, draws = _draws(i, counted)
    draw_gain(i, key, block, settings)
    block[at.STEER_OFFSET, i] = settings[at.STEERING_OFFSET] + drawn(key, OFFSET, settings)
    block[at.BANK, i] = _between(draws, _BANK, settings[at.BANK_LOW], settings[at.BANK_HIGH])
    block[at.MEAN_WIND, i] = _between(draws, _CROSSWIND, settings[at.CROSSWIND_LOW], settings[at.CROSSWIND_HIGH])
    block[at.GUST, i] = np.float64(settings[at.GUSTS]) * normal(derive(draws, _FIRST_GUST), np.int64(0))
    block[at.CROSSWIND, i] = block[at.MEAN_WIND, i] + block[at.GUST, i]
    block[at.WIND_AREA, i] = settings[at.SIDE_AREA]
    begins = np.floor(_between(draws, _CHANGE, settings[at.CHANGE_FROM], settings[at.CHANGE_TO]) + 0.5)
    lasts = np.floor(_between(draws, _LASTS, settings[at.CHANGE_SHORTEST], settings[at.CHANGE_LONGEST]) + 0.5)
    block[at.CHANGES_AT, i], block[at.CHANGES_UNTIL, i] = begins, begins + lasts
    # The car that was drawn: by the time of a change the bounds of the draws may be others.
    for row in range(at.DRAWN_SIZE):
        block[at.DRAWN + row, i] = block[at.INVERSE_MASS + row, i]
    block[at.DRAWN_LAG, i] = np.float64(settings[at.LAG]) * drawn(key, LAG, settings)


@helper
def dress(i, step, block, counted, settings):
    """Write the car that car i is in control step ``step`` of its episode: the one drawn, or what it has become."""
    _, draws = _draws(i, counted)
    for row in range(at.DRAWN_SIZE):
        block[at.INVERSE_MASS + row, i] = block[at.DRAWN + row, i]
    lag = np.float64(block[at.DRAWN_LAG, i])
    if block[at.CHANGES_AT, i] <= step and step < block[at.CHANGES_UNTIL, i]:
        mass, friction = _factor(draws, _MASS, settings), _factor(draws, _FRICTION, settings)
        block[at.INVERSE_MASS, i] /= mass
        block[at.INVERSE_INERTIA, i] /= mass
        block[at.FRONT_STIFFNESS, i] *= _factor(draws, _FRONT, settings)
        block[at.REAR_STIFFNESS, i] *= _factor(draws, _REAR, settings)
        block[at.FRONT_PEAK, i] *= mass * friction
        block[at.REAR_PEAK, i] *= mass * friction
        lag *= _factor(draws, _LAG, settings)
    set_lag(i, lag, block, settings)
    bank = np.float64(block[at.BANK, i])
    block[at.SIDE_WEIGHT, i] = side_weight(1.0 / np.float64(block[at.INVERSE_MASS, i]), bank)
    block[at.FRONT_HOLD, i] = block[at.FRONT_PEAK, i] * np.cos(bank)
    block[at.REAR_HOLD, i] = block[at.REAR_PEAK, i] * np.cos(bank)
    # The centre of pressure is a place of the body, which the centre of gravity may have moved away from.
    block[at.WIND_LEVER, i] = settings[at.NOMINAL_LEVER] + block[at.CG_TO_FRONT, i] - settings[at.NOMINAL_FRONT]


@inline
def _factor(draws, which, settings):
    return _between(draws, _FACTORS + which, settings[at.CHANGES + 2 * which], settings[at.CHANGES + 2 * which + 1])


@helper
def blow(k, cars, counters, settings):
    """Let the gusts of a block's cars go on by a control step: a first-order process, exact at the steps."""
    block, first = cars[k], k * cars.shape[2]
    kept, deviation = np.float64(settings[at.GUST_KEPT]), np.float64(settings[at.GUSTS])
    fresh = deviation * np.sqrt(1.0 - kept * kept)
    for i in range(cars_in(k, cars, counters)):
        step = np.int64(block[at.STEP, i])
        if step > 0:  # the first one is the start's
            _, draws = _draws(i, counters[:, first:])
            gust = kept * block[at.GUST, i] + fresh * normal(derive(draws, _FIRST_GUST + step), np.int64(0))
            block[at.GUST, i] = gust
            block[at.CROSSWIND, i] = block[at.MEAN_WIND, i] + gust


@inline
def _patch(draws, place, settings):
    """Return the factor of the friction at a place of the road: every so many metres one patch, somewhere in them."""
    every, length = np.float64(settings[at.PATCH_EVERY]), np.float64(settings[at.PATCH_LENGTH])
    stretch = np.floor(place / every)
    key = derive(draws, _FIRST_PATCH + np.int64(stretch))
    begins = uniform(key, np.int64(0)) * (every - length)
    along = place - stretch * every
    inside = begins <= along and along < begins + length
    return _between(key, np.int64(1), settings[at.PATCH_LOW], settings[at.PATCH_HIGH]) if inside else 1.0


@helper
def hold(i, rows, block, counted, settings):
    """Write the largest forces of car i's axles into two rows: on a patch each loses by itself."""
    front = rear = 1.0
    if settings[at.PATCH_EVERY] > 0.0:
        _, draws = _draws(i, counted)
        place = np.float64(block[at.STATION, i]) + np.float64(block[at.ALONG, i])
        front = _patch(draws, place + np.float64(block[at.CG_TO_FRONT, i]), settings)
        rear = _patch(draws, place - np.float64(block[at.CG_TO_REAR, i]), settings)
    block[rows[0], i] = front * block[at.FRONT_HOLD, i]
    block[rows[1], i] = rear * block[at.REAR_HOLD, i]
    load = GRAVITY / np.float64(block[at.INVERSE_MASS, i]) * np.float64(block[at.CG_TO_REAR, i])
    base = np.float64(block[at.CG_TO_FRONT, i]) + np.float64(block[at.CG_TO_REAR, i])
    block[at.FRICTION_HERE, i] = block[rows[0], i] * base / load if load > 0.0 else 0.0


@inline
def lean(i, v, block):
    """Return what side forces add to steering angle and sideslip of steady driving, rad, on tyres that slip little.

    Axle forces change by dF_f = -(M + l_r F)/l and dF_r = (M - l_f F)/l. The wind meets the car at its sideslip.
    """
    front, rear = np.float64(block[at.CG_TO_FRONT, i]), np.float64(block[at.CG_TO_REAR, i])
    headwind, crosswind = np.float64(block[at.WIND, i]), np.float64(block[at.CROSSWIND, i])
    area, before = np.float64(block[at.WIND_AREA, i]), np.float64(block[at.SIDESLIP, i])
    steer = beta = 0.0
    for _ in range(4):
        wind = wind_force(v, before + beta, headwind, crosswind, area)
        force, moment = block[at.SIDE_WEIGHT, i] + wind, wind * block[at.WIND_LEVER, i]
        beta = (front * force - moment) / ((front + rear) * np.float64(block[at.REAR_STIFFNESS, i]))
        steer = beta - (moment + rear * force) / ((front + rear) * np.float64(block[at.FRONT_STIFFNESS, i]))
    return steer, beta


@helper
def told(k, row, cars, counters):
    """Write what the road wheels of a block are turned to, by what the actuators are told in ``row``."""
    block = cars[k]
    asked_, gain_, offset_, told_ = block[row], block[at.STEER_FACTOR], block[at.STEER_OFFSET], block[at.TOLD]
    for i in range(block.shape[1]):
        told_[i] = asked_[i] * gain_[i] + offset_[i]


@inline
def tell(i, rows, block, settings):
    """Write into rows of car i what its actuator was told to have the road wheel where it is, as far as it can be."""
    limit = np.float64(settings[at.COMMAND_LIMIT])
    asked = (np.float64(block[at.STEER, i]) - block[at.STEER_OFFSET, i]) / np.float64(block[at.STEER_FACTOR, i])
    asked = min(max(asked, -limit), limit)
    steer = asked * block[at.STEER_FACTOR, i] + block[at.STEER_OFFSET, i]
    for row in rows:
        block[row, i] = asked
    for row in (at.STEER, at.STEER_BEFORE, at.MOTOR, at.TOLD):
        block[row, i] = steer
    for row in range(np.int64(settings[at.DELAY_DEPTH])):
        block[at.CAR_ROWS + row, i] = steer


@inline
def changes_now(i, block):
    """Whether car i becomes another, or itself again, in this control step."""
    step = block[at.STEP, i]
    return (step == block[at.CHANGES_AT, i] or step == block[at.CHANGES_UNTIL, i]) and step > like(step, 0.0)
