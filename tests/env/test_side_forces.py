"""Banks and winds push cars as closed forms and an independent integration have it."""

import math

import gymnasium as gym
import numpy as np
import pytest
from disturbed_roads import IDEAL, LIMIT, STATE, STRAIGHT, driven, made
from scipy.integrate import solve_ivp
from scipy.optimize import root

import lanekeep_env
from lanekeep_env.physics.parameters import AIR_DENSITY, GRAVITY
from lanekeep_env.physics.tyres import MAGIC_FORMULA_SHAPE as SHAPE


def blown(car, v, across, beta=0.0, area=None, lever=None):
    """The wind's side force, N, and yaw moment, N m: c_y A rho/2 w², c_y = c_y' sin(tau), tau the angle of the air."""
    area = 0.62 * car.length * car.width if area is None else area
    middle = (car.cg_to_front_axle - car.cg_to_rear_axle) / 2
    lever = middle + 0.17 * car.wheelbase if lever is None else lever
    air = np.array([v * math.cos(beta), across - v * math.sin(beta)])
    force = AIR_DENSITY / 2 * area * (air @ air) * math.sin(math.atan2(air[1], air[0]))
    return force, force * lever


def steady(car, v, bank=0.0, across=0.0, **wind):
    """Sideslip and steering angle of straight driving: the balances of side forces and of yaw moments."""
    front, rear = car.front_cornering_stiffness, car.rear_cornering_stiffness
    a, b = car.cg_to_front_axle, car.cg_to_rear_axle

    def unbalanced(unknown):
        beta, delta = unknown
        force, moment = blown(car, v, across, beta, **wind) if across else (0.0, 0.0)
        at_front, at_rear = front * (delta - beta), -rear * beta
        weight = car.mass * GRAVITY * math.sin(bank)
        return [(at_front + at_rear + force - weight) / car.mass, (a * at_front - b * at_rear + moment) / car.mass]

    return root(unbalanced, [0.0, 0.0], tol=1e-13).x


@pytest.mark.parametrize("bank", [0.04, -0.1])
@pytest.mark.parametrize("dynamics", ["linear", "magic_formula"])
def test_steady_driving_on_a_bank_is_that_of_a_side_force(bank, dynamics):
    env = made(bank=bank, speed=30.0, tyre=dynamics)
    car = env.scenario.vehicle
    beta, delta = steady(car, 30.0, bank)
    assert np.sign(beta) == -np.sign(bank) and np.sign(delta) != -np.sign(bank)
    seen = driven(env, [0.0])
    if dynamics == "linear":
        np.testing.assert_allclose([seen["sideslip"][0], seen["steering_angle"][0]], [beta, delta], rtol=1e-6)
        env.reset(seed=0)
        held = driven(env, [seen["steering_command"][0]] * 200)
        np.testing.assert_allclose(held["sideslip"][-1], beta, rtol=1e-4)
        assert abs(held["yaw_rate"][-1]) < 1e-7 and abs(held["lateral_acceleration"][-1]) < 1e-5


def test_in_a_curve_the_bank_adds_to_what_the_curve_asks_for():
    """A bank of v² kappa/g to the inside takes all side force off the tyres: the car rolls round as at a crawl."""
    radius, v = 400.0, 20.0
    bank = -math.asin(v**2 / radius / GRAVITY)  # a left turn is banked with its right side up
    env = made(road={"kind": "circle", "radius": radius}, speed=v, bank=bank)
    car = env.scenario.vehicle
    seen = driven(env, [0.0])
    np.testing.assert_allclose(seen["steering_angle"][0], car.wheelbase / radius, rtol=1e-6)
    np.testing.assert_allclose(seen["sideslip"][0], car.cg_to_rear_axle / radius, rtol=1e-5)
    np.testing.assert_allclose(seen["lateral_acceleration"][0], v**2 / radius, rtol=1e-6)


@pytest.mark.parametrize("across", [6.0, -12.0])
@pytest.mark.parametrize(("area", "lever"), [(None, None), (3.0, 0.0), (8.0, -0.4)])
def test_steady_driving_in_a_crosswind(across, area, lever):
    v = 25.0
    vehicle = {"base": "yin", "side_area": area, "wind_lever": lever}
    env = made(crosswind=across, speed=v, vehicle=vehicle)
    beta, delta = steady(env.scenario.vehicle, v, across=across, area=area, lever=lever)
    seen = driven(env, [0.0])
    np.testing.assert_allclose([seen["sideslip"][0], seen["steering_angle"][0]], [beta, delta], rtol=1e-5)


def test_a_wind_at_the_neutral_steer_point_asks_for_no_steering():
    """It pushes the car sideways and does not turn it: beta = F/(C_f + C_r)."""
    car = lanekeep_env.VEHICLES["yin"]
    front, rear = car.front_cornering_stiffness, car.rear_cornering_stiffness
    lever = (front * car.cg_to_front_axle - rear * car.cg_to_rear_axle) / (front + rear)
    env = made(crosswind=10.0, speed=30.0, vehicle={"base": "yin", "wind_lever": lever})
    seen = driven(env, [0.0] * 100)
    force, _ = blown(car, 30.0, 10.0, seen["sideslip"][0], lever=lever)
    assert abs(seen["steering_angle"][0]) < 1e-9
    np.testing.assert_allclose(seen["sideslip"], force / (front + rear), rtol=1e-6)


def tyre_force(slip, stiffness, peak):
    """The magic formula without curvature factor, whose slope at zero slip is the stiffness."""
    return peak * math.sin(SHAPE * math.atan(stiffness * slip / (SHAPE * peak)))


def equations(car, v, bank, across, area, lever, saturates):
    """Rates of (d, theta, beta, r) on a straight road by a road-wheel angle, written anew in body axes."""
    weight = car.mass * GRAVITY * math.cos(bank)
    a, b = car.cg_to_front_axle, car.cg_to_rear_axle

    def rates(_, state, delta):
        _, theta, beta, r = state
        along, sideways = v * math.cos(beta), v * math.sin(beta)
        air_along, air_across = along, across - sideways
        wind = AIR_DENSITY / 2 * area * math.hypot(air_along, air_across) * air_across
        push, turn = wind - car.mass * GRAVITY * math.sin(bank), wind * lever
        if saturates:
            slip_front = delta - math.atan2(sideways + a * r, along)
            slip_rear = -math.atan2(sideways - b * r, along)
            front = tyre_force(slip_front, car.front_cornering_stiffness, weight * b / (a + b))
            rear = tyre_force(slip_rear, car.rear_cornering_stiffness, weight * a / (a + b))
            across_course = front * math.cos(delta - beta) + (rear + push) * math.cos(beta)
            turn += front * a * math.cos(delta) - rear * b
        else:
            front = car.front_cornering_stiffness * (delta - beta - a * r / v)
            rear = car.rear_cornering_stiffness * (b * r / v - beta)
            across_course = front + rear + push
            turn += front * a - rear * b
        course = theta + beta
        return [v * math.sin(course), r, across_course / (car.mass * v) - r, turn / car.yaw_inertia]

    return rates


@pytest.mark.parametrize("tyre", ["linear", "magic_formula"])
@pytest.mark.parametrize(("bank", "across"), [(0.08, 0.0), (0.0, 15.0), (-0.05, -10.0)])
def test_a_drive_is_that_of_an_independent_integration(tyre, bank, across):
    v, area, lever = 28.0, 6.0, 0.7
    vehicle = {**IDEAL, "side_area": area, "wind_lever": lever}
    env = made(vehicle=vehicle, speed=v, tyre=tyre, bank=bank, crosswind=across, control_step=0.05)
    angles = np.round(0.03 * np.sin(np.arange(60) * 0.2) * 2**12 / LIMIT) / 2**12 * LIMIT
    seen = driven(env, angles)
    rates = equations(env.scenario.vehicle, v, bank, across, area if across else 0.0, lever, tyre == "magic_formula")
    state = [seen[name][0] for name in STATE]
    found = [state]
    for angle in angles:
        state = solve_ivp(rates, (0.0, 0.05), state, args=(angle,), rtol=1e-10, atol=1e-12).y[:, -1]
        found.append(state)
    for name, expected in zip(
        ("lateral_error", "heading_error", "sideslip", "yaw_rate"), np.transpose(found), strict=True
    ):
        np.testing.assert_allclose(seen[name], expected, rtol=2e-5, atol=2e-6, err_msg=name)


def controlled(env, gain, heading_gain, seconds):
    """Drive by a P law of both errors; the last lateral error, m."""
    observation, _ = env.reset(seed=1)
    names = [c.name for c in env.channels]
    d, theta = names.index("lateral_error"), names.index("heading_error")
    for _ in range(round(seconds / env.scenario.control_step)):
        angle = -gain * observation[d] - heading_gain * observation[theta]
        observation, *_ = env.step(np.float32([angle / LIMIT]))
    return float(observation[d])


def test_the_steady_error_of_a_p_law():
    """delta = -k d - k_t theta with theta = -beta: d = (k_t beta - delta) / k, and offset over gain and k."""
    k, k_t, v = 0.01, 0.4, 20.0
    for keywords in ({"bank": 0.05}, {"crosswind": 9.0}):
        env = made(speed=v, **keywords)
        car = env.scenario.vehicle
        beta, delta = steady(car, v, keywords.get("bank", 0.0), keywords.get("crosswind", 0.0))
        np.testing.assert_allclose(controlled(env, k, k_t, 60.0), (k_t * beta - delta) / k, rtol=1e-3)
    env = made(speed=v, vehicle={"base": "yin", "steering": {"offset": 0.01, "gain": 0.8}})
    np.testing.assert_allclose(controlled(env, k, k_t, 60.0), 0.01 / 0.8 / k, rtol=1e-3)


def test_below_the_slip_speed_floor_a_standing_car_is_held():
    env = made(speed=0.0, bank=0.1, crosswind=10.0)
    seen = driven(env, [0.0] * 200)
    assert np.ptp(seen["lateral_error"]) == 0.0 and np.ptp(seen["heading_error"]) < 1e-9
    slow = made(speed=0.3, bank=0.1)
    beta = steady(slow.scenario.vehicle, 0.3, 0.1)[0]
    assert (np.abs(driven(slow, [0.0] * 400)["sideslip"]) < 3.0 * abs(beta)).all()


def test_gusts_are_a_first_order_process_about_the_mean():
    """Its mean, deviation and correlation exp(-t/T), and each car's own; whatever the cars do."""
    n, deviation, time = 512, 3.0, 1.0
    keywords = {**STRAIGHT, "speed": 20.0, "crosswind": 4.0, "gusts": deviation, "gust_time": time}
    env = gym.make_vec("lanekeep/LaneKeep-v0", n, "vector_entry_point", **keywords)
    column = [c.name for c in env.unwrapped.channels].index("crosswind")
    drives = []
    for action in (0.0, 0.02):
        wind = [env.reset(seed=5)[0][:, column]]
        wind += [env.step(np.full((n, 1), action, np.float32))[0][:, column] for _ in range(200)]
        drives.append(np.array(wind, dtype=np.float64))
    np.testing.assert_array_equal(*drives)
    wind = drives[0] - 4.0
    independent = n * 10.0 / (2.0 * time)  # drives of 10 s hold about that many independent gusts
    assert abs(wind.mean()) < 5.0 * deviation / math.sqrt(independent)
    assert abs(wind.std() / deviation - 1.0) < 5.0 / math.sqrt(2.0 * independent)
    assert abs(wind[0].std() / deviation - 1.0) < 5.0 / math.sqrt(2.0 * n)
    for steps in (1, 5, 20, 40):
        found = (wind[steps:] * wind[:-steps]).mean() / deviation**2
        assert abs(found - math.exp(-steps * 0.05 / time)) < 10.0 / math.sqrt(independent)
