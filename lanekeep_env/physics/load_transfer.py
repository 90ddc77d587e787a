"""Load transfer and combined slip: what a car's acceleration leaves of its axles' tyres.

Quasi-static: pitch and roll have settled. A wheel whose load is n times the nominal one has the friction
mu (1 - k (n - 1)), and a cornering stiffness of n (1 - c (n - 1)) times its nominal one; k and c are what is lost as
the load doubles (load sensitivity: Pacejka, "Tire and vehicle dynamics", 3rd ed., 2012, 4.3). Over both wheels of an
axle, loaded n (1 +- e) by lateral load transfer, that sums up to factors of n (1 + e²) alone, with

    n = (g l_other -+ a_x h) / l over the nominal axle's, e = 2 share h |a_y| l / (t (g l_other -+ a_x h)),

``share`` the axle's of the roll stiffness, t the track width; e = 1 where the inner wheel lifts. a_y is that of the
sub-step before: no algebraic loop, and later by less than roll takes to build up. In a bend the steered wheels' forces
point backwards unequally, which turns the car out of it: by the front axle's force times t/2 sin(delta) times the share
of it by which the outer wheel's is larger, that of their peaks.

Longitudinal forces go to the axles by their loads, as anti-lock brakes have it, u of the friction each, at the most
`LARGEST_ALONG`. Across, sqrt(1 - u²) of the peak is left (the friction circle); at small slip angles the force of a
tyre that slips along as well has the direction of its slip, so the stiffness is that of the secant to the force along:
u / (C tan(asin(u) / C)) of it, which is 1 - (1 + 2/C²)/3 (1 - sqrt(1 - u²)) to 1 %.
"""

from __future__ import annotations

import math
from typing import Any

from lanekeep_env import layout as at
from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import clip, larger, like, smaller, sqrt
from lanekeep_env.physics.parameters import GRAVITY, VehicleParameters
from lanekeep_env.physics.tyres import MAGIC_FORMULA_SHAPE

#: Share of the friction that is taken along at the most.
LARGEST_ALONG = 0.95
#: Load of an axle up to which its sensitivity is that of the tyre, over the nominal one.
MOST_LOADED = 2.0
#: Share of the stiffness's loss in the circle's.
_SECANT = (1.0 + 2.0 / MAGIC_FORMULA_SHAPE**2) / 3.0


def numbers_of(car: VehicleParameters) -> dict[int, float]:
    """Return what the functions here read of a nominal car, by row of `layout`'s settings."""
    lever, front = 2.0 * car.height / car.track, car.front_roll_stiffness
    return {
        at.MASS: car.mass,
        at.NOMINAL_FRONT: car.cg_to_front_axle,
        at.NOMINAL_REAR: car.cg_to_rear_axle,
        at.CG_HEIGHT: car.height,
        at.ROLL_FRONT: front * lever,
        at.ROLL_REAR: (1.0 - front) * lever,
        at.FRICTION_SENSITIVITY: car.friction_load_sensitivity,
        at.STIFFNESS_SENSITIVITY: car.stiffness_load_sensitivity,
        at.HALF_TRACK: 0.5 * car.track,
    }


def largest_across(car: VehicleParameters, grip: float, mass: float) -> float:
    """Return the lateral acceleration that tyres bear at a steady speed, m/s², where they would bear ``grip`` alike.

    The axle's that gives way first: a = grip (1 - k (n (1 + e²) - 1)) with e in proportion to a; ``mass`` is n.
    """
    k, least, mass = car.friction_load_sensitivity, grip, min(mass, MOST_LOADED)
    axles = (car.front_roll_stiffness, car.cg_to_rear_axle), (1.0 - car.front_roll_stiffness, car.cg_to_front_axle)
    for share, other in axles:
        level = grip * (1.0 - k * (mass - 1.0))
        lift = 2.0 * share * car.height * car.wheelbase / (car.track * GRAVITY * other)
        bent = grip * k * mass * lift * lift
        across = 2.0 * level / (1.0 + math.sqrt(1.0 + 4.0 * bent * level))
        least = min(least, across if lift * across < 1.0 else level - grip * k * mass)
    return least


@inline
def read(settings: Any) -> tuple[Any, ...]:
    """Return the numbers of the functions below, before a loop: what a loop reads of an array makes it scalar."""
    return (
        settings[at.MASS],
        settings[at.NOMINAL_FRONT],
        settings[at.NOMINAL_REAR],
        settings[at.CG_HEIGHT],
        settings[at.ROLL_FRONT],
        settings[at.ROLL_REAR],
        settings[at.FRICTION_SENSITIVITY],
        settings[at.STIFFNESS_SENSITIVITY],
        settings[at.HALF_TRACK],
    )


@inline
def unchanged(car, grip, pull, across, numbers):
    """The tyres of a car whose loads stay as they are; the arguments are those of the next two."""
    return car


@inline
def braked(car, grip, pull, across, numbers):
    """The tyres of a car that accelerates with ``pull`` along and ``across`` (m/s²): circle and loads."""
    friction = (car[6] + car[7]) * car[2]
    most = like(pull, LARGEST_ALONG) * friction
    pull = clip(pull, -most, most)
    along = pull / friction
    left = sqrt(like(pull, 1.0) - along * along)
    return on_loads(car, left, (car[6] * left, car[7] * left), pull, across, numbers)


@inline
def driven(car, grip, pull, across, numbers):
    """The same of a car whose powertrain has taken its part of the peaks: ``grip`` is the front axle's before, N."""
    most = like(pull, LARGEST_ALONG * GRAVITY)
    left = smaller(car[6] / grip, like(pull, 1.0))
    return on_loads(car, left, (car[6], car[7]), clip(pull, -most, most), across, numbers)


@inline
def on_loads(car, left, peaks, pull, across, numbers):
    """Return the nine numbers of `single_track` with what accelerations (m/s²) make of a car's tyres, and a tenth.

    ``left`` is sqrt(1 - u²), ``peaks`` (N) are the axles' with it. The tenth is by how much the front axle's force acts
    off the middle, m to the right.
    """
    front, rear, base = car[0], car[1], car[0] + car[1]
    one, gravity, most = like(pull, 1.0), like(pull, GRAVITY), like(pull, MOST_LOADED)
    mass, nominal_front, nominal_rear, height, roll_front, roll_rear, friction, stiffness, half = numbers
    least = like(pull, 0.05 * GRAVITY) * base
    load_f = larger(gravity * rear - pull * height, least)  # times wheelbase over mass
    load_r = larger(gravity * front + pull * height, least)
    nominal = car[2] * mass * gravity * base / (nominal_front + nominal_rear)
    n_f, n_r = load_f / (nominal * nominal_rear), load_r / (nominal * nominal_front)
    lift_f = clip(across * roll_front * base / load_f, -one, one)
    lift_r = clip(across * roll_rear * base / load_r, -one, one)
    within = smaller(n_f, most)
    more_f, more_r = within * (one + lift_f * lift_f) - one, smaller(n_r, most) * (one + lift_r * lift_r) - one
    grip_f, secant = one - friction * more_f, one - like(pull, _SECANT) * (one - left)
    outer = lift_f * (one + friction - like(pull, 2.0) * friction * within) / grip_f
    return (
        front,
        rear,
        car[2],
        car[3],
        car[4] * n_f * secant * (one - stiffness * more_f),
        car[5] * n_r * secant * (one - stiffness * more_r),
        peaks[0] * load_f / (gravity * rear) * grip_f,
        peaks[1] * load_r / (gravity * front) * (one - friction * more_r),
        car[8],
        half * outer,
    )
