"""Single-track vehicles in path coordinates (s, d, theta), as rates of change.

All models share one signature, so that one integrator serves them. State: ``d`` lateral error (m, left
of the path), ``theta`` heading error (rad), ``beta`` sideslip (rad, course minus heading), ``r`` yaw
rate (rad/s). ``steer`` is the road-wheel angle (rad), ``v`` the speed (m/s), ``kappa`` the path's
curvature (1/m, left positive) and ``car`` the tuple (l_f, l_r, 1/m, 1/J, C_f, C_r, peak_f, peak_r, floor)
with the slip-speed floor in m/s, or None.
Returned: (s', d', theta', beta', r').

Standstill. The bare dynamic models divide by v and become stiff below about 1 m/s. The SLIP-SPEED
FLOOR replaces v by max(v, floor) in every division, while the lateral velocities at the contact
patches keep the true v. Above the floor nothing changes. Below, tyres act as dampers of the contact
velocity, so the wheels still roll where they point: a steady circle is r = v delta / (l + K floor²),
which is 0.3 % off for an ordinary car and a floor of 1 m/s; where it would be more, the floor is lower
(`stability`).
"""

from __future__ import annotations

from lanekeep_env.compile import inline
from lanekeep_env.physics.numeric import arctan, larger, like, select, sin_cos
from lanekeep_env.physics.tyres import linear, magic_formula

#: Below this speed (m/s) divisions by the speed use it instead, or a lower one; see the module's docstring.
SLIP_SPEED_FLOOR = 1.0


@inline
def slip_speed_floor(v, floor):
    """Return the floor of a car, m/s, in the precision of ``v``; None stands for `SLIP_SPEED_FLOOR`.

    None is known when a kernel is compiled: the usual floor is a constant there.
    """
    if floor is None:
        return like(v, SLIP_SPEED_FLOOR)
    return like(v, floor)


#: 1 - d kappa is held at or above this: nearer to the path's centre of curvature s' has no meaning.
SMALLEST_PATH_SCALE = 0.1


@inline
def path_rates(v_along, v_across, angle, r, d, kappa):
    """Rates of s, d, theta for a point whose velocity (v_along, v_across) stands at ``angle`` to the path.

    s' = (v_along cos - v_across sin)/(1 - d kappa), d' = v_along sin + v_across cos, theta' = r - kappa s'
    (W08 (3)).
    """
    sine, cosine = sin_cos(angle)
    scale = larger(like(d, 1.0) - d * kappa, like(d, SMALLEST_PATH_SCALE))
    s_rate = (v_along * cosine - v_across * sine) / scale
    return s_rate, v_along * sine + v_across * cosine, r - kappa * s_rate


@inline
def kinematic(d, theta, beta, r, steer, v, kappa, car):
    """Kinematic single track: no slip, ``v`` is the rear axle's speed, d and theta the centre of gravity's.

    r = v tan(delta)/l; the centre of gravity moves with (v, l_r r) in body axes. Exact, any speed.
    Sideslip and yaw rate follow from the steering angle, so their states are not used.
    """
    front, rear = car[0], car[1]
    sine, cosine = sin_cos(steer)
    yaw_rate = v * sine / (cosine * (front + rear))
    s_rate, d_rate, theta_rate = path_rates(v, rear * yaw_rate, theta, yaw_rate, d, kappa)
    return s_rate, d_rate, theta_rate, like(d, 0.0), like(d, 0.0)


@inline
def front_driven(d, theta, beta, r, steer, v, kappa, car):
    """Kinematic single track whose front wheel has the speed ``v``; d and theta are the rear axle's.

    r = v sin(delta)/l, the front wheel turns on l/sin(delta) and the rear axle moves with v cos(delta) (Trächtler,
    Lohmann, Struck 1992 (5)). Exact, any speed, any steering angle. ``car`` starts with (l, 0).
    """
    sine, cosine = sin_cos(steer)
    yaw_rate = v * sine / (car[0] + car[1])
    s_rate, d_rate, theta_rate = path_rates(v * cosine, like(v, 0.0), theta, yaw_rate, d, kappa)
    return s_rate, d_rate, theta_rate, like(d, 0.0), like(d, 0.0)


@inline
def linear_forces(beta, r, steer, v, car):
    """Front and rear lateral axle force, N, for small angles and linear tyres."""
    inverse = like(v, 1.0) / larger(v, slip_speed_floor(v, car[8]))
    lateral = v * beta
    front = linear((v * steer - lateral - car[0] * r) * inverse, car[4])
    rear = linear((car[1] * r - lateral) * inverse, car[5])
    return front, rear


@inline
def dynamic_linear(d, theta, beta, r, steer, v, kappa, car):
    """Linear single track with sideslip (Yin 2010): small slip angles, linear tyres, exact path geometry.

    beta' = a11/v beta + (a12/v² - 1) r + b1/v delta, r' = a21 beta + a22/v r + b2 delta, written with
    the axle forces they stand for. ``v`` is the speed of the centre of gravity.
    """
    front, rear = linear_forces(beta, r, steer, v, car)
    beta_rate = (front + rear) * car[2] / larger(v, slip_speed_floor(v, car[8])) - r
    r_rate = (car[0] * front - car[1] * rear) * car[3]
    s_rate, d_rate, theta_rate = path_rates(v, like(v, 0.0), theta + beta, r, d, kappa)
    return s_rate, d_rate, theta_rate, beta_rate, r_rate


@inline
def magic_formula_forces(beta, r, steer, v, way, car):
    """Front and rear axle force, N, each across its own wheel, for any angle; and the sines, cosines used.

    ``way`` is 1 for a car that goes forwards and -1 backwards, where v is negative.

    alpha_f = delta - atan((l_f r + v sin beta)/(v cos beta)), alpha_r = atan((l_r r - v sin beta)/(v cos beta))
    (W08 (1)), written as the direction of the contact velocity in wheel axes. The longitudinal part is
    held above a tenth of the speed: a car sliding sideways or backwards keeps its tyres saturated.
    """
    sin_b, cos_b = sin_cos(beta)
    sin_d, cos_d = sin_cos(steer)
    floored = larger(way * v, slip_speed_floor(v, car[8]))
    least = like(v, 0.1) * floored
    across_f = v * sin_b + car[0] * r
    along_f = floored * cos_b * cos_d + (floored * sin_b + way * car[0] * r) * sin_d
    slip_f = -arctan((across_f * cos_d - v * cos_b * sin_d) / larger(along_f, least))
    slip_r = arctan((car[1] * r - v * sin_b) / larger(floored * cos_b, least))
    front = magic_formula(slip_f, car[4], car[6])
    rear = magic_formula(slip_r, car[5], car[7])
    return front, rear, sin_b, cos_b, sin_d, cos_d


@inline
def dynamic_magic_formula(d, theta, beta, r, steer, v, kappa, car):
    """Nonlinear single track with saturating tyres, W08 (1) and (3).

    beta' = -r + (F_f cos(delta - beta) + F_r cos beta)/(m v), r' = (F_f l_f cos delta - F_r l_r)/J.
    ``v`` is the speed of the centre of gravity along its course.
    """
    return _magic_formula_rates((d, theta, beta, r), steer, v, like(v, 1.0), kappa, car, None)


@inline
def dynamic_both_ways(d, theta, beta, r, steer, v, kappa, car):
    """The same, backwards as well, where ``v`` is negative and sideslip stays velocity across over velocity along."""
    return _magic_formula_rates((d, theta, beta, r), steer, v, _way(v), kappa, car, None)


@inline
def load_sensitive(d, theta, beta, r, steer, v, kappa, car):
    """The same on the tyres that `load_transfer` leaves; ``car`` is one of its."""
    return _magic_formula_rates((d, theta, beta, r), steer, v, like(v, 1.0), kappa, car, car[9])


@inline
def load_sensitive_both_ways(d, theta, beta, r, steer, v, kappa, car):
    """The same, backwards as well."""
    return _magic_formula_rates((d, theta, beta, r), steer, v, _way(v), kappa, car, car[9])


@inline
def _way(v):
    """Return -1 backwards, else 1."""
    return select(v < like(v, 0.0), like(v, -1.0), like(v, 1.0))


@inline
def _magic_formula_rates(state, steer, v, way, kappa, car, offset):
    """``offset`` is by how much the front axle's force acts to the right of the middle, m, or None."""
    d, theta, beta, r = state
    front, rear, sin_b, cos_b, sin_d, cos_d = magic_formula_forces(beta, r, steer, v, way, car)
    across = front * (cos_d * cos_b + sin_d * sin_b) + rear * cos_b
    beta_rate = across * car[2] / (way * larger(way * v, slip_speed_floor(v, car[8]))) - r
    r_rate = (front * car[0] * cos_d - rear * car[1]) * car[3]
    if offset is not None:  # known when a kernel is compiled
        r_rate -= front * offset * sin_d * car[3]
    s_rate, d_rate, theta_rate = path_rates(v, like(v, 0.0), theta + beta, r, d, kappa)
    return s_rate, d_rate, theta_rate, beta_rate, r_rate


# What a car shows at a given state: sideslip (rad), yaw rate (rad/s), lateral acceleration (m/s²,
# across the course). A kinematic car derives the first two from its steering angle.


@inline
def kinematic_outputs(beta, r, steer, v, car):
    """Sideslip, yaw rate and v r (the centre of gravity's turning; its change with steering is left out)."""
    sine, cosine = sin_cos(steer)
    turn = sine / (cosine * (car[0] + car[1]))
    return arctan(car[1] * turn), v * turn, v * v * turn


@inline
def front_driven_outputs(beta, r, steer, v, car):
    """Sideslip (none), yaw rate and lateral acceleration of the rear axle."""
    sine, cosine = sin_cos(steer)
    turn = sine / (car[0] + car[1])
    return like(v, 0.0), v * turn, v * v * cosine * turn


@inline
def linear_outputs(beta, r, steer, v, car):
    """Sideslip, yaw rate and tyre forces over mass."""
    front, rear = linear_forces(beta, r, steer, v, car)
    return beta, r, (front + rear) * car[2]


@inline
def magic_formula_outputs(beta, r, steer, v, car):
    """Sideslip, yaw rate and tyre forces across the course over mass."""
    return _magic_formula_shown(beta, r, steer, v, like(v, 1.0), car)


@inline
def both_ways_outputs(beta, r, steer, v, car):
    """The same, backwards as well."""
    return _magic_formula_shown(beta, r, steer, v, _way(v), car)


@inline
def _magic_formula_shown(beta, r, steer, v, way, car):
    front, rear, sin_b, cos_b, sin_d, cos_d = magic_formula_forces(beta, r, steer, v, way, car)
    return beta, r, (front * (cos_d * cos_b + sin_d * sin_b) + rear * cos_b) * car[2]


# What cornering costs: the deceleration by tyre forces across the wheels, which point backwards in part, m/s².


@inline
def no_drag(beta, r, steer, v, car):
    """None, of a car whose speed is imposed."""
    return like(v, 0.0)


@inline
def cornering_drag(beta, r, steer, v, car):
    """(F_f sin(delta - beta) - F_r sin beta)/m, along the course."""
    front, rear, sin_b, cos_b, sin_d, cos_d = magic_formula_forces(beta, r, steer, v, like(v, 1.0), car)
    return (front * (sin_d * cos_b - cos_d * sin_b) - rear * sin_b) * car[2]
