"""The scalar physics as it is written, run by Python's floats, NumPy's arrays and JAX, against the compiled loops.

A sub-step is written here once more from the public scalar functions, without rows; what is compiled comes from the
table of models.
"""

import dataclasses
import functools

import numba
import numpy as np
import pytest

from lanekeep_env import layout as at
from lanekeep_env.physics import VEHICLES, models
from lanekeep_env.physics.integrate import DRIVEN, HELD, LARGEST_SIDESLIP, LARGEST_YAW_RATE, PACED, held_pull
from lanekeep_env.physics.load_transfer import read
from lanekeep_env.physics.numeric import clip, larger, smaller, sqrt, wrapped
from lanekeep_env.physics.steering import advance_gear, advance_steering

MODELS = [model for model in vars(models).values() if isinstance(model, models.CarModel)]
STATE = (at.ALONG, at.LATERAL, at.HEADING, at.SIDESLIP, at.YAW_RATE)
CHANGING = (*STATE, at.STEER, at.MOTOR, at.SPEED, at.ACCELERATION)
H, LARGEST_SPEED_CHANGE = 0.005, 0.01  # s, m/s a sub-step
N, STEPS = 48, 50
#: Steering gear (half the gap in rad, whether the motor's angle is measured) and slip-speed floor (m/s).
SETTINGS = np.zeros(at.CHANNELS)
SETTINGS[at.STEP_TIME], SETTINGS[at.SPEED_CHANGE] = H, LARGEST_SPEED_CHANGE
# Load transfer: some car's, so that all of `drawn` are loaded more or less than nominal.
SETTINGS[[at.MASS, at.NOMINAL_FRONT, at.NOMINAL_REAR, at.CG_HEIGHT, at.HALF_TRACK]] = 1500.0, 1.2, 1.4, 0.5, 0.75
SETTINGS[[at.ROLL_FRONT, at.ROLL_REAR, at.FRICTION_SENSITIVITY, at.STIFFNESS_SENSITIVITY]] = 0.35, 0.25, 0.15, 0.25
EQUIPMENT = [(None, None), ((0.01, 0.0), 0.4), ((0.01, 1.0), 0.4)]


def drawn(seed):
    """Cars at random, a row of the layout each (N,); the first stands on the path and drives straight along it."""
    rng = np.random.default_rng(seed)
    vehicles = [list(VEHICLES.values())[k] for k in rng.integers(len(VEHICLES), size=N)]
    numbers = np.array([dataclasses.astuple(vehicle)[1:7] for vehicle in vehicles]).T
    mass, inertia, front, rear, stiff_front, stiff_rear = numbers
    base, load = front + rear, rng.uniform(0.3, 1.0, N) * 9.81 * mass / (front + rear)
    speed = base * rng.uniform(0.0, 10.0, N)
    cars = (front, rear, 1 / mass, 1 / inertia, stiff_front, stiff_rear, load * rear, load * front)
    cars = {at.CAR + k: row for k, row in enumerate(cars)}
    spans = {
        at.LATERAL: 0.5,
        at.HEADING: 0.4,
        at.SIDESLIP: 0.1,
        at.YAW_RATE: 0.5,
        at.STEER: 0.3,
        at.COMMAND: 0.3,
        at.CURVATURE: 0.05,
        at.CURVATURE_SLOPE: 0.01,
        at.PULL: 3.0,
        at.ACCELERATION: 5.0,
    }
    cars |= {row: rng.uniform(-span, span, N) for row, span in spans.items()}
    for row in spans:
        cars[row][0] = 0.0
    speed[0] = 5.0
    return cars | {
        at.ALONG: rng.uniform(-1.0, 5.0, N),
        at.FRONT_GRIP: cars[at.FRONT_PEAK] * rng.uniform(1.0, 2.0, N),
        at.MOTOR: cars[at.STEER] + rng.uniform(-0.01, 0.01, N),
        at.SPEED: speed,
        at.SPEED_TARGET: speed + rng.uniform(-1.0, 1.0, N),
        at.SPEED_SQUARED: speed**2,
        at.SPEED_SQUARED_SLOPE: rng.uniform(-0.5, 1.0, N),
        at.STEER_RESPONSE: rng.uniform(0.02, 1.0, N),
        at.STEER_GAIN: rng.uniform(0.02, 1.0, N),
        at.STEER_CHANGE: np.where(rng.random(N) < 0.5, rng.uniform(1e-4, 5e-3, N), 1e9),
    }


@functools.cache
def loop_of(model):
    """The compiled loop of a model, for each kind of equipment once."""
    advance = model.advance

    @numba.njit
    def loop(cars, gear, floor, steps):
        for _ in range(steps):
            advance(cars, at.COMMAND, SETTINGS, gear, floor)

    return loop


def compiled(model, gear, floor):
    """Return a function of rows and a number of sub-steps: the compiled loop."""
    gear = None if gear is None else np.array(gear)

    def run(cars, steps):
        block = np.full((at.CAR_ROWS, N), np.nan)
        for row, values in cars.items():
            block[row] = values
        loop_of(model)(block, gear, floor, steps)
        return block[list(CHANGING)]

    return run


def steered(car, gear):
    """Motor and road-wheel angle in the middle and at the end of a sub-step."""
    wheel, command = car[at.STEER], car[at.COMMAND]
    response, change = car[at.STEER_RESPONSE], car[at.STEER_CHANGE]
    if gear is None:
        middle = advance_steering(wheel, command, response, change)
        return car[at.MOTOR], middle, advance_steering(middle, command, response, change)
    half_gap, on_motor = gear
    numbers = command, response, car[at.STEER_GAIN], change, half_gap, on_motor > 0.0
    motor, middle = advance_gear(car[at.MOTOR], wheel, *numbers)
    motor, end = advance_gear(motor, middle, *numbers)
    return motor, middle, end


def pulled(model, car, numbers, steer):
    """The numbers of a car with what its acceleration makes of its tyres, and that acceleration."""
    if model.pace == DRIVEN:
        pull = car[at.PULL]
    elif model.pace == HELD:
        along = larger(car[at.ALONG], 0.0)
        profile = along, car[at.SPEED_SQUARED], car[at.SPEED_SQUARED_SLOPE]
        pull = held_pull(car[at.SPEED], car[at.YAW_RATE], *profile, numbers)
        braked = model.tyres(numbers, None, pull, car[at.ACCELERATION], read(SETTINGS.tolist()))
        pull = pull - model.drag(car[at.SIDESLIP], car[at.YAW_RATE], steer, car[at.SPEED], braked)
    else:
        pull = 0.5 * car[at.SPEED_SQUARED_SLOPE]
    return model.tyres(numbers, car[at.FRONT_GRIP], pull, car[at.ACCELERATION], read(SETTINGS.tolist())), pull


def speeds(car, pace, pull):
    """Speed at the start, in the middle and at the end of a sub-step, and what is kept of it."""
    v = car[at.SPEED]
    if pace == HELD:
        middle, end = (larger(v + share * H * pull, 0.0) for share in (0.5, 1.0))
        return v, middle, end, end
    if pace == DRIVEN:
        low, high = smaller(car[at.SPEED_TARGET], 0.0), larger(car[at.SPEED_TARGET], 0.0)
        middle, end = (clip(v + share * H * car[at.PULL], low, high) for share in (0.5, 1.0))
        return v, middle, end, end
    squared = car[at.SPEED_SQUARED] + car[at.SPEED_SQUARED_SLOPE] * larger(car[at.ALONG], 0.0)
    profile = sqrt(larger(squared, 0.0))
    if pace == PACED:
        missing, most = smaller(car[at.SPEED_TARGET], profile) - v, LARGEST_SPEED_CHANGE
        middle, end = (smaller(v + clip(missing, -part, part), profile) for part in (0.5 * most, most))
        return v, middle, end, end
    middle, end = (larger(profile + share * H * car[at.SPEED_SQUARED_SLOPE], 0.0) for share in (0.25, 0.5))
    return profile, middle, end, v


def substep(model, car, gear, floor):
    """The rows of a car a sub-step later, by classical Runge-Kutta."""
    motor, steer_middle, steer_end = steered(car, gear)
    numbers, pull = pulled(model, car, (*(car[at.CAR + k] for k in range(at.CAR_SIZE)), floor), car[at.STEER])
    v, v_middle, v_end, kept = speeds(car, model.pace, pull)
    begin = [car[row] for row in STATE]

    def rates(share, before, steer, v):
        along, *rest = (x + share * H * rate for x, rate in zip(begin, before, strict=True))
        kappa = car[at.CURVATURE] + car[at.CURVATURE_SLOPE] * larger(along, 0.0)
        return model.rates(*rest, steer, v, kappa, numbers)

    k1 = rates(0.0, [0.0] * 5, car[at.STEER], v)
    k2 = rates(0.5, k1, steer_middle, v_middle)
    k3 = rates(0.5, k2, steer_middle, v_middle)
    k4 = rates(1.0, k3, steer_end, v_end)
    along, lateral, heading, beta, yaw_rate = (
        x + H / 6.0 * (a + 2.0 * (b + c) + d) for x, a, b, c, d in zip(begin, k1, k2, k3, k4, strict=True)
    )
    beta = wrapped(beta) if model.saturates else clip(beta, -LARGEST_SIDESLIP, LARGEST_SIDESLIP)
    yaw_rate = clip(yaw_rate, -LARGEST_YAW_RATE, LARGEST_YAW_RATE)
    across = v * (k1[3] + car[at.YAW_RATE]) if model.transfers_load else car[at.ACCELERATION]
    after = along, lateral, heading, beta, yaw_rate, steer_end, motor, kept, across
    return car | dict(zip(CHANGING, after, strict=True))


def driven_by_floats(model, rows, gear, floor):
    """The rows after a sub-step, car by car, with Python's floats alone."""
    cars = [{row: float(values[k]) for row, values in rows.items()} for k in range(N)]
    after = [substep(model, car, gear, floor) for car in cars]
    return np.array([[car[row] for car in after] for row in CHANGING])


every_model = pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
every_equipment = pytest.mark.parametrize("gear, floor", EQUIPMENT, ids=["plain", "behind-gear", "on-motor"])


#: Every model's rates and both kinds of steering; JAX takes seconds to compile each.
TRACED = [
    (models.KINEMATIC, *EQUIPMENT[0]),
    (models.LINEAR, *EQUIPMENT[0]),
    (models.MAGIC_FORMULA, *EQUIPMENT[0]),
    (models.POWERED, *EQUIPMENT[1]),
    (models.LOAD_SENSITIVE_HELD, *EQUIPMENT[0]),
    (models.FRONT_DRIVEN, *EQUIPMENT[2]),
]


def assert_same(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_all_models_are_compared():
    rates = {model.rates.__name__ for model in MODELS}
    single = {"kinematic", "front_driven", "dynamic_linear", "dynamic_magic_formula", "dynamic_both_ways"}
    assert rates == single | {"load_sensitive", "load_sensitive_both_ways"}


@every_equipment
@every_model
def test_a_substep_by_floats_and_by_arrays_is_the_compiled_one(model, gear, floor):
    """Arrays know no truth of their own: a branch on data would raise."""
    cars = drawn(1)
    expected = compiled(model, gear, floor)(cars, 1)
    assert_same(driven_by_floats(model, cars, gear, floor), expected)
    after = substep(model, cars, gear, floor)
    assert_same([np.broadcast_to(after[row], N) for row in CHANGING], expected)


@pytest.fixture(scope="module")
def jax():
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    return jax


def traced(jax, model, gear, floor):
    """Return the rows after `STEPS` sub-steps as a function of rows and commands, for JAX to transform."""

    def run(command, cars):
        def step(car, _):
            return substep(model, car, gear, floor), None

        cars = jax.tree.map(jax.numpy.asarray, cars | {at.COMMAND: command})
        after, _ = jax.lax.scan(step, cars, length=STEPS)
        return after

    return run


@pytest.mark.parametrize("model, gear, floor", TRACED, ids=lambda value: getattr(value, "name", ""))
def test_jax_traces_many_substeps_and_their_gradients(model, gear, floor, jax):
    """The gradient of the last lateral error by the steering command, against compiled central differences."""
    cars = drawn(2)
    many, plain = traced(jax, model, gear, floor), compiled(model, gear, floor)
    after = jax.jit(many)(cars[at.COMMAND], cars)
    assert_same([after[row] for row in CHANGING], plain(cars, STEPS))
    gradient = jax.jit(jax.grad(lambda command, cars: many(command, cars)[at.LATERAL].sum()))
    found = np.asarray(gradient(cars[at.COMMAND], cars))
    step = 1e-6
    up, down = (plain(cars | {at.COMMAND: cars[at.COMMAND] + change}, STEPS)[1] for change in (step, -step))
    assert np.isfinite(found).all() and (found != 0.0).any()
    np.testing.assert_allclose(found, (up - down) / (2.0 * step), rtol=1e-5, atol=1e-7)
