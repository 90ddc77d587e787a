"""Classical Runge-Kutta (RK4) over the cars of a block, one sub-step of ``h`` seconds.

Measured order: 4 while a sub-step stays inside one road segment. What comes from outside is known at
the start, middle and end of a sub-step: steering exactly (a held command through a first-order lag),
speed from the profile at the start and with the profile's acceleration from there (the profile is
linear in v² over arc length, so a car on the centre line keeps it exactly; any other is set right again
at the next sub-step), or, ``paced``, towards a set speed with a limited acceleration, and no faster than
the profile, or, ``driven``, with the acceleration of a powertrain, or, ``held``, with what a driver makes of the
tyres to follow the profile, less what cornering costs.
Curvature is looked up at every stage.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lanekeep_env import layout as at
from lanekeep_env.compile import helper, inline
from lanekeep_env.physics.load_transfer import LARGEST_ALONG, read, unchanged
from lanekeep_env.physics.numeric import clip, larger, like, smaller, sqrt, wrapped
from lanekeep_env.physics.side_forces import push_of
from lanekeep_env.physics.single_track import no_drag
from lanekeep_env.physics.steering import advance_gear, advance_steering

#: A sideslip (rad, on linear tyres) and a yaw rate (rad/s) at which a car is held, so that numbers stay finite.
LARGEST_SIDESLIP, LARGEST_YAW_RATE = 3.141592653589793, 50.0
#: Where a car's speed comes from: the road's profile, set speeds that it approaches, a powertrain, or a driver who
#: holds the profile.
PROFILE, PACED, DRIVEN, HELD = 0, 1, 2, 3
#: Time in which that driver makes up for a wrong speed, s.
HOLDING_TIME = 1.0
#: No car goes faster, m/s; speeds are observed up to it.
LARGEST_SPEED = 100.0


@inline
def _not_negative(x):
    """Return max(x, 0): behind its segment's start (driving backwards) a car meets the start's curvature."""
    return larger(x, like(x, 0.0))


@inline
def _profile_speed(along, speed_squared, slope):
    """Speed where the car is, m/s; ``along`` counts from the segment's start and is not negative."""
    squared = speed_squared + slope * along
    return sqrt(_not_negative(squared))


def named(name: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Give a closure a name of its own before it is compiled.

    Compiled code is linked by qualified name: kernels that different processes cached would otherwise
    take each other's ``advance`` once a third process loads both.
    """

    def rename(function: Callable[..., Any]) -> Callable[..., Any]:
        function.__qualname__ = function.__name__ = f"{function.__name__}_{name}"
        return function

    return rename


# Speed at the start, in the middle and at the end of a sub-step, by where it comes from. ``v`` is the speed that a car
# keeps, ``along`` (not negative) counts from its segment's start, where the profile's squared speed is ``squared``.


@inline
def _profile_speeds(v, along, squared, slope, target, pull, h, most):
    v = _profile_speed(along, squared, slope)
    middle = _not_negative(v + h * like(h, 0.25) * slope)  # the slope of v² is twice the acceleration
    return v, middle, _not_negative(v + h * like(h, 0.5) * slope)


@inline
def _paced_speeds(v, along, squared, slope, target, pull, h, most):
    allowed = _profile_speed(along, squared, slope)
    missing, half = smaller(target, allowed) - v, most * like(h, 0.5)
    # The profile itself is held even where it brakes harder than that (a car with a speed factor).
    return v, smaller(v + clip(missing, -half, half), allowed), smaller(v + clip(missing, -most, most), allowed)


@inline
def _driven_speeds(v, along, squared, slope, target, pull, h, most):
    # ``target`` is the fastest in the direction engaged: none beyond it, none the other way.
    none = like(h, 0.0)
    low, high = smaller(target, none), larger(target, none)
    return v, clip(v + h * like(h, 0.5) * pull, low, high), clip(v + h * pull, low, high)


@inline
def _held_speeds(v, along, squared, slope, target, pull, h, most):
    return v, _not_negative(v + h * like(h, 0.5) * pull), _not_negative(v + h * pull)


_SPEEDS = {PROFILE: _profile_speeds, PACED: _paced_speeds, DRIVEN: _driven_speeds, HELD: _held_speeds}


# Acceleration along, m/s².


@inline
def _profile_pull(v, slope, pull):
    return like(v, 0.5) * slope


@inline
def _driven_pull(v, slope, pull):
    return pull


@inline
def held_pull(v, r, along, squared, slope, car):
    """What a driver asks for who follows the profile and knows of no drag, with what the circle leaves beside v r."""
    most = like(v, LARGEST_ALONG) * (car[6] + car[7]) * car[2]
    left = sqrt(larger(most * most - v * v * r * r, like(v, 1e-4) * most * most))
    missing = _profile_speed(along, squared, slope) - v
    return clip(like(v, 0.5) * slope + missing * like(v, 1.0 / HOLDING_TIME), -left, left)


_PULLS = {PROFILE: _profile_pull, PACED: _profile_pull, DRIVEN: _driven_pull, HELD: _driven_pull}


# A car's numbers as its model takes them, with the rows of what pushes it from outside or without.


@inline
def _alone(car, rows, i):
    return car


@inline
def _with_push(car, rows, i):
    weight_, headwind_, crosswind_, area_, lever_ = rows
    return car, (weight_[i], headwind_[i], crosswind_[i], area_[i], lever_[i])


# Lateral acceleration, m/s², that a car's tyres give: what pushes it from outside transfers no load.


@inline
def _all_of_it(across, v, beta, floor, car):
    return across


@inline
def _less_the_push(across, v, beta, floor, car):
    own, push = car
    force, _ = push_of(v, beta, floor, push)
    return across - force * own[2]


@inline
def _push_rows(block):
    return block[at.SIDE_WEIGHT], block[at.WIND], block[at.CROSSWIND], block[at.WIND_AREA], block[at.WIND_LEVER]


def runge_kutta(rates: Callable[..., Any], name: str) -> Callable[..., Any]:
    """Return the scalar function that takes the state (s, d, theta, beta, r) of a car a sub-step further.

    It returns the rate of beta at the sub-step's start, too.

    ``steers`` and ``speeds`` are those at its start, middle and end, ``curvature`` is (at the segment's start, slope).
    """

    @inline
    @named(name)
    def stage(state, steer, v, curvature, car):
        along, d, theta, beta, r = state
        kappa, slope = curvature
        return rates(d, theta, beta, r, steer, v, kappa + slope * _not_negative(along), car)

    @inline
    @named(name)
    def step(state, steers, speeds, curvature, car, h):
        x, d, t, b, r = state
        half, sixth, two = h * like(h, 0.5), h * like(h, 1.0 / 6.0), like(h, 2.0)
        x1, d1, t1, b1, r1 = stage(state, steers[0], speeds[0], curvature, car)
        state = x + half * x1, d + half * d1, t + half * t1, b + half * b1, r + half * r1
        x2, d2, t2, b2, r2 = stage(state, steers[1], speeds[1], curvature, car)
        state = x + half * x2, d + half * d2, t + half * t2, b + half * b2, r + half * r2
        x3, d3, t3, b3, r3 = stage(state, steers[1], speeds[1], curvature, car)
        state = x + h * x3, d + h * d3, t + h * t3, b + h * b3, r + h * r3
        x4, d4, t4, b4, r4 = stage(state, steers[2], speeds[2], curvature, car)
        return (
            x + sixth * (x1 + two * (x2 + x3) + x4),
            d + sixth * (d1 + two * (d2 + d3) + d4),
            t + sixth * (t1 + two * (t2 + t3) + t4),
            b + sixth * (b1 + two * (b2 + b3) + b4),
            r + sixth * (r1 + two * (r2 + r3) + r4),
            b1,
        )

    return step


def holder(tyres: Callable[..., Any], drag: Callable[..., Any], name: str, pushed: bool = False) -> Callable[..., Any]:
    """Return the compiled loop that writes the acceleration (PULL) of cars whose speed a driver holds, less the drag.

    A loop of its own: one that writes as much as both together is no SIMD code.
    """
    numbers_of, by_tyres = (_with_push, _less_the_push) if pushed else (_alone, _all_of_it)

    @helper
    @named(name)
    def hold(block, command_row, settings, floor):
        along_, v_, beta_, r_ = block[at.ALONG], block[at.SPEED], block[at.SIDESLIP], block[at.YAW_RATE]
        steer_, command_ = block[at.STEER], block[command_row]
        squared_, gain_ = block[at.SPEED_SQUARED], block[at.SPEED_SQUARED_SLOPE]
        front_, rear_ = block[at.CG_TO_FRONT], block[at.CG_TO_REAR]
        mass_, inertia_ = block[at.INVERSE_MASS], block[at.INVERSE_INERTIA]
        stiff_f_, stiff_r_ = block[at.FRONT_STIFFNESS], block[at.REAR_STIFFNESS]
        peak_f_, peak_r_ = block[at.FRONT_PEAK], block[at.REAR_PEAK]
        pull_, across_, outside = block[at.PULL], block[at.ACCELERATION], _push_rows(block)
        ideal, numbers = settings[at.IDEAL_STEERING] > like(settings[0], 0.0), read(settings)
        for i in range(block.shape[1]):
            car = (front_[i], rear_[i], mass_[i], inertia_[i], stiff_f_[i], stiff_r_[i], peak_f_[i], peak_r_[i], floor)
            x, steer = _not_negative(along_[i]), command_[i] if ideal else steer_[i]
            pull = held_pull(v_[i], r_[i], x, squared_[i], gain_[i], car)
            across = by_tyres(across_[i], v_[i], beta_[i], floor, numbers_of(car, outside, i))
            car_now = tyres(car, peak_f_[i], pull, across, numbers)
            pull_[i] = pull - drag(beta_[i], r_[i], steer, v_[i], car_now)

    return hold


# Many lines, for the loop over a block is one piece of SIMD code, and what it calls per car is elsewhere already.
def integrator(
    rates: Callable[..., Any],
    pace: int,
    slips: bool,
    saturates: bool,
    name: str,
    tyres: Callable[..., Any] = unchanged,
    drag: Callable[..., Any] = no_drag,
    pushed: bool = False,
) -> Callable[..., Any]:
    """Return the compiled loop that advances a block of cars by ``rates``, a function of `single_track`.

    ``tyres`` is one of `load_transfer`, ``drag`` one of `single_track`.

    A car on tyres that saturate may spin: its sideslip comes round. A linear tyre's force has no end, nor has its spin,
    which is held. ``pushed``: the rates are those of `side_forces.pushed`.
    """
    numbers_of, by_tyres = (_with_push, _less_the_push) if pushed else (_alone, _all_of_it)
    step, speeds_of, pull_of, keeps = runge_kutta(rates, name), _SPEEDS[pace], _PULLS[pace], pace != PROFILE
    remembers, holds, hold = tyres is not unchanged, pace == HELD, holder(tyres, drag, name, pushed)
    keeps, keeps_later = keeps and not remembers, keeps and remembers

    @helper
    @named(name)
    def advance(block, command_row, settings, gear, floor):
        """Advance the cars of a block by one sub-step, in place; ``command_row`` holds the steering command."""
        along_, d_, theta_ = block[at.ALONG], block[at.LATERAL], block[at.HEADING]
        beta_, r_, steer_, command_ = block[at.SIDESLIP], block[at.YAW_RATE], block[at.STEER], block[command_row]
        curvature_, slope_ = block[at.CURVATURE], block[at.CURVATURE_SLOPE]
        squared_, gain_ = block[at.SPEED_SQUARED], block[at.SPEED_SQUARED_SLOPE]
        front_, rear_ = block[at.CG_TO_FRONT], block[at.CG_TO_REAR]
        mass_, inertia_ = block[at.INVERSE_MASS], block[at.INVERSE_INERTIA]
        stiff_f_, stiff_r_ = block[at.FRONT_STIFFNESS], block[at.REAR_STIFFNESS]
        peak_f_, peak_r_, grip_ = block[at.FRONT_PEAK], block[at.REAR_PEAK], block[at.FRONT_GRIP]
        response_, change_ = block[at.STEER_RESPONSE], block[at.STEER_CHANGE]
        motor_, share_ = block[at.MOTOR], block[at.STEER_GAIN]
        v_, target_, pull_, across_ = block[at.SPEED], block[at.SPEED_TARGET], block[at.PULL], block[at.ACCELERATION]
        outside = _push_rows(block)
        h, most = settings[at.STEP_TIME], settings[at.SPEED_CHANGE]
        widest, fastest = like(h, LARGEST_SIDESLIP), like(h, LARGEST_YAW_RATE)
        ideal, numbers = settings[at.IDEAL_STEERING] > like(h, 0.0), read(settings)
        if holds:  # decided when the loop is compiled, as all that follows
            hold(block, command_row, settings, floor)
        for i in range(block.shape[1]):
            x = _not_negative(along_[i])
            begin, command, response, change = steer_[i], command_[i], response_[i], change_[i]
            begin = command if ideal else begin  # the road wheel follows at once
            car = (front_[i], rear_[i], mass_[i], inertia_[i], stiff_f_[i], stiff_r_[i], peak_f_[i], peak_r_[i], floor)
            pull = pull_of(v_[i], gain_[i], pull_[i])
            across = by_tyres(across_[i], v_[i], beta_[i], floor, numbers_of(car, outside, i))
            car_now = tyres(car, grip_[i], pull, across, numbers)
            speeds = speeds_of(v_[i], x, squared_[i], gain_[i], target_[i], pull, h, most)
            if keeps:
                v_[i] = speeds[2]
            if gear is None:
                middle = advance_steering(begin, command, response, change)
                end = advance_steering(middle, command, response, change)
            else:
                gap, on_motor, gain = gear[at.GEAR_HALF_GAP], gear[at.GEAR_ON_MOTOR] > like(h, 0.0), share_[i]
                motor, middle = advance_gear(motor_[i], begin, command, response, gain, change, gap, on_motor)
                motor, end = advance_gear(motor, middle, command, response, gain, change, gap, on_motor)
                motor_[i] = motor
            state = along_[i], d_[i], theta_[i], beta_[i], r_[i]
            state = step(
                state, (begin, middle, end), speeds, (curvature_[i], slope_[i]), numbers_of(car_now, outside, i), h
            )
            if remembers:  # the lateral acceleration at the sub-step's start
                across_[i] = speeds[0] * (state[5] + r_[i])
            along_[i], d_[i], theta_[i], beta, r, _ = state
            if slips:  # else both follow from what is shown, and a loop with a gear that writes them is no SIMD code
                beta_[i] = wrapped(beta) if saturates else clip(beta, -widest, widest)
                r_[i] = clip(r, -fastest, fastest)
            steer_[i] = end
        if keeps_later:  # a loop that writes both is no SIMD code
            for i in range(block.shape[1]):
                v_[i] = speeds_of(v_[i], v_[i], squared_[i], gain_[i], target_[i], pull_[i], h, most)[2]

    return advance


def shower(
    outputs: Callable[..., Any],
    pace: int,
    name: str,
    tyres: Callable[..., Any] = unchanged,
    pushed: bool = False,
) -> Callable[..., Any]:
    """Return the compiled loop that writes speed, sideslip, yaw rate and lateral acceleration of cars."""
    keeps_speed, pull_of = pace != PROFILE, _PULLS[pace]
    numbers_of, by_tyres = (_with_push, _less_the_push) if pushed else (_alone, _all_of_it)

    @helper
    @named(name)
    def show(block, settings, floor):
        """Write the rows SPEED, SIDESLIP, YAW_RATE and ACCELERATION of a block; wrap its headings."""
        along_, speed_, gain_ = block[at.ALONG], block[at.SPEED_SQUARED], block[at.SPEED_SQUARED_SLOPE]
        theta_, beta_, r_, steer_ = block[at.HEADING], block[at.SIDESLIP], block[at.YAW_RATE], block[at.STEER]
        front_, rear_ = block[at.CG_TO_FRONT], block[at.CG_TO_REAR]
        mass_, inertia_ = block[at.INVERSE_MASS], block[at.INVERSE_INERTIA]
        stiff_f_, stiff_r_ = block[at.FRONT_STIFFNESS], block[at.REAR_STIFFNESS]
        peak_f_, peak_r_, grip_ = block[at.FRONT_PEAK], block[at.REAR_PEAK], block[at.FRONT_GRIP]
        v_, acceleration_, pull_ = block[at.SPEED], block[at.ACCELERATION], block[at.PULL]
        outside = _push_rows(block)
        numbers = read(settings)
        for i in range(block.shape[1]):
            car = (front_[i], rear_[i], mass_[i], inertia_[i], stiff_f_[i], stiff_r_[i], peak_f_[i], peak_r_[i], floor)
            v = v_[i] if keeps_speed else _profile_speed(_not_negative(along_[i]), speed_[i], gain_[i])
            v_[i] = v
            theta_[i] = wrapped(theta_[i])
            beta = clip(beta_[i], -like(v, LARGEST_SIDESLIP), like(v, LARGEST_SIDESLIP))
            r = clip(r_[i], -like(v, LARGEST_YAW_RATE), like(v, LARGEST_YAW_RATE))
            pull = pull_of(v, gain_[i], pull_[i])
            across = by_tyres(acceleration_[i], v, beta, floor, numbers_of(car, outside, i))
            car_now = numbers_of(tyres(car, grip_[i], pull, across, numbers), outside, i)
            beta_[i], r_[i], acceleration_[i] = outputs(beta, r, steer_[i], v, car_now)

    return show
