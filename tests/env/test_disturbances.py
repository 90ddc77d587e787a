"""What disturbs cars on roads, against closed forms, an independent integration, and invariants."""

import math

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import root

import lanekeep_env
from lanekeep_env.physics.parameters import AIR_DENSITY, GRAVITY
from lanekeep_env.physics.tyres import MAGIC_FORMULA_SHAPE as SHAPE
from lanekeep_env.scenario import LaneKeepScenario

#: A car whose road wheel goes where it is told at once.
IDEAL = {"base": "yin", "steering": {"lag": 0.0, "rate_limit": None, "delay": 0.0}}
STRAIGHT = {"road": "straight", "departure": "off", "observation": "full", "episode_steps": 4000}
CENTRED = {"lateral_error": 0.0}
STATE = ("lateral_error", "heading_error", "sideslip", "yaw_rate")
LIMIT = 0.125  # rad at action 1: sums of its binary parts are exact


def made(**keywords):
    return gym.make("lanekeep/LaneKeep-v0", **{**STRAIGHT, "max_steering_angle": LIMIT, **keywords}).unwrapped


def driven(env, angles, seed=0, **options):
    """Reset and steer by road-wheel angles, rad; the observations from the start on, by channel, (steps + 1,)."""
    seen = [env.reset(seed=seed, options=options or None)[0]]
    seen += [env.step(np.float32([angle / LIMIT]))[0] for angle in angles]
    return dict(zip([c.name for c in env.channels], np.array(seen, dtype=np.float64).T, strict=True))


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


@settings(max_examples=15, deadline=None)
@given(st.floats(-0.1, 0.1), st.floats(-15.0, 15.0), st.floats(-0.02, 0.02), st.integers(0, 2**31))
def test_the_mirrored_disturbance_drives_the_mirrored_way(bank, across, offset, seed):
    angles = np.random.default_rng(seed).uniform(-0.05, 0.05, 40)
    drives = []
    for sign in (1.0, -1.0):
        vehicle = {"base": "yin", "steering": {"offset": sign * offset}}
        env = made(vehicle=vehicle, bank=sign * bank, crosswind=sign * across, tyre="magic_formula", speed=20.0)
        options = {"lateral_error": sign * 0.3, "heading_error": sign * 0.01}
        drives.append(driven(env, sign * angles, **options))
    for name in ("lateral_error", "heading_error", "yaw_rate", "sideslip", "lateral_acceleration", "steering_angle"):
        np.testing.assert_array_equal(drives[0][name], -drives[1][name])


@pytest.mark.parametrize(
    "steering",
    [
        {},
        {"lag": 0.0},
        {"lag": 0.1, "rate_limit": 0.2, "delay": 0.07},
        {"lag": 0.2, "backlash": 0.02},
        {"lag": 0.2, "backlash": 0.02, "feedback": "motor"},
    ],
)
def test_offset_and_gain_are_another_command(steering):
    """Command c on a wheel with gain 2 and offset o is command 2 c + o on one without; all of them binary parts."""
    offset, rng = LIMIT / 8, np.random.default_rng(3)
    asked = rng.integers(-100, 100, 80) / 256 * LIMIT
    plain = made(vehicle={"base": "yin", "steering": steering}, speed=20.0)
    faulty = made(vehicle={"base": "yin", "steering": {**steering, "gain": 2.0, "offset": offset}}, speed=20.0)
    # Both stand still at first, with the wheel straight.
    start = {"lateral_error": 0.0, "heading_error": 0.0}
    expected, seen = driven(plain, 2.0 * asked + offset, **start), driven(faulty, asked, **start)
    for name in ("lateral_error", "heading_error", "yaw_rate", "sideslip", "steering_angle"):
        np.testing.assert_allclose(seen[name], expected[name], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(seen["steering_offset"], offset)
    np.testing.assert_allclose(seen["steering_gain"], 2.0)


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


def test_bounds_are_drawn_from_and_once_an_episode():
    n = 400
    keywords = {**STRAIGHT, "bank": (-0.02, 0.06), "crosswind": (-3.0, 9.0), "speed": 20.0}
    drawn = {"steering_offset": (-0.02, 0.01), "steering_gain": (0.9, 1.2)}
    env = gym.make_vec("lanekeep/LaneKeep-v0", n, "vector_entry_point", randomisation=drawn, **keywords)
    names = [c.name for c in env.unwrapped.channels]
    first, last = env.reset(seed=1)[0], env.step(np.zeros((n, 1), np.float32))[0]
    found = []
    for name, (low, high) in {"bank": (-0.02, 0.06), "crosswind": (-3.0, 9.0), **drawn}.items():
        values = first[:, names.index(name)].astype(np.float64)
        np.testing.assert_array_equal(values, last[:, names.index(name)])
        assert low - 1e-6 <= values.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < values.max() <= high + 1e-6
        assert abs(values.mean() - (low + high) / 2) < 5.0 * (high - low) / math.sqrt(12.0 * n)
        found.append(values)
    assert np.abs(np.corrcoef(found) - np.eye(len(found))).max() < 5.0 / math.sqrt(n)


def test_patches_take_the_share_of_the_road_that_they_are_given():
    """One of `length` in every `every` metres, the same ones however the car steers, the factors between bounds."""
    n, every, length = 200, 50.0, 10.0
    patches = {"friction": (0.5, 0.8), "every": every, "length": length}
    keywords = {**STRAIGHT, "speed": 20.0, "tyre": "magic_formula", "friction": 0.9, "patches": patches}
    env = gym.make_vec("lanekeep/LaneKeep-v0", n, "vector_entry_point", control_step=0.01, **keywords)
    column = [c.name for c in env.unwrapped.channels].index("friction")
    drives = []
    for action in (0.0, 0.02):
        env.reset(seed=2)
        acted = np.full((n, 1), action, np.float32)
        drives.append(np.array([env.step(acted)[0][:, column] for _ in range(2000)], dtype=np.float64))
    factor = drives[0] / 0.9
    on = factor < 0.999
    for i in range(n):  # who steers gets less far along the road, and meets the same patches
        met = [drive[1:, i][(drive[1:, i] < 0.899) & (drive[:-1, i] >= 0.899)] for drive in drives]
        np.testing.assert_array_equal(met[0][:6], met[1][:6])
    assert ((factor[on] > 0.5 - 1e-6) & (factor[on] < 0.8 + 1e-6)).all()
    # A drive of 400 m has 8 stretches: the share of each car varies by the ends of its way alone.
    assert abs(on.mean() - length / every) < 0.02
    entered = (on[1:] & ~on[:-1]).sum(axis=0)
    assert (entered >= 7).mean() > 0.9 and (entered <= 9).all()
    assert abs(factor[on].mean() - 0.65) < 0.02


def test_on_a_patch_the_tyres_give_no_more_than_its_friction():
    patches = {"friction": 0.3, "every": 60.0, "length": 40.0}
    env = made(speed=25.0, tyre="magic_formula", patches=patches, vehicle=IDEAL, control_step=0.01)
    seen = driven(env, [LIMIT] * 600, **CENTRED)
    friction, lateral = seen["friction"][1:], np.abs(seen["lateral_acceleration"][1:])
    both = (friction[1:] == friction[:-1]) & (np.abs(friction[1:] - 0.3) < 1e-6)  # the rear axle follows by 0.1 s
    settled = np.convolve(both, np.ones(20), mode="full")[: len(both)] == 20
    assert settled.any() and lateral[1:][settled].max() <= 0.3 * GRAVITY * (1.0 + 1e-9)
    off = np.convolve(friction == 1.0, np.ones(20), mode="full")[: len(friction)] == 20
    assert lateral[off].max() > 0.6 * GRAVITY


def step_response(env, wait, steps=60):
    """Wait on a straight, steer by a step and let go; lateral error and yaw rate from the steering on."""
    seen = driven(
        env, [0.0] * wait + [0.02] * (steps // 2) + [0.0] * (steps // 2), lateral_error=0.0, heading_error=0.0
    )
    return np.array([seen["lateral_error"][wait:], seen["yaw_rate"][wait:], seen["steering_angle"][wait:]])


@pytest.mark.parametrize("tyre", ["linear", "magic_formula", "load_sensitive"])
def test_a_changed_car_drives_as_one_that_was_so_from_the_start(tyre):
    factors = {"mass": 1.25, "front_cornering_stiffness": 0.8, "rear_cornering_stiffness": 0.75, "steering_lag": 2.0}
    factors |= {"friction": 0.55} if tyre != "linear" else {}
    keywords = {"speed": 25.0, "tyre": tyre}
    born = step_response(made(randomisation=factors, **keywords), 20)
    became = step_response(made(changes={**factors, "time": 1.0}, **keywords), 20)
    np.testing.assert_allclose(became, born, rtol=1e-6, atol=1e-9)
    plain = step_response(made(**keywords), 20)
    assert np.abs(plain - born).max() > 0.01
    still_itself = step_response(made(changes={**factors, "time": 5.0}, **keywords), 20)
    again = step_response(made(changes={**factors, "time": 0.2, "duration": 0.5}, **keywords), 20)
    for found in (still_itself, again):
        np.testing.assert_allclose(found, plain, rtol=1e-6, atol=1e-9)


def test_a_change_multiplies_what_the_episode_drew_and_comes_at_its_time():
    n = 300
    changes = {"friction": (0.5, 0.7), "time": (1.0, 3.0), "duration": (0.5, 1.0)}
    keywords = {**STRAIGHT, "speed": 20.0, "tyre": "magic_formula", "randomisation": {"friction": (0.8, 1.0)}}
    env = gym.make_vec("lanekeep/LaneKeep-v0", n, "vector_entry_point", changes=changes, **keywords)
    column = [c.name for c in env.unwrapped.channels].index("friction")
    seen = [env.reset(seed=3)[0][:, column]]
    seen = np.array(seen + [env.step(np.zeros((n, 1), np.float32))[0][:, column] for _ in range(120)], np.float64)
    low = seen < 0.99 * seen[0]
    begins, lasts = low.argmax(axis=0) * 0.05, low.sum(axis=0) * 0.05
    assert low.any(axis=0).all() and (np.abs(np.diff(low.astype(int), axis=0)).sum(axis=0) == 2).all()
    for values, (least, most) in ((begins - 0.05, changes["time"]), (lasts, changes["duration"])):
        assert least - 0.026 <= values.min() and values.max() <= most + 0.026
        assert abs(values.mean() - (least + most) / 2) < 5.0 * (most - least) / math.sqrt(12.0 * n) + 0.03
    share = np.array([seen[low[:, i], i][0] / seen[0, i] for i in range(n)])
    assert share.min() > 0.5 - 1e-6 and share.max() < 0.7 + 1e-6 and share.std() > 0.04
    np.testing.assert_array_equal(seen[-1], seen[0])


def test_a_car_that_changes_stays_the_one_that_was_drawn():
    """What `narrow` says holds from the next episode on, and so does what another car is reset with."""
    keywords = {"randomisation": {"friction": (0.5, 1.0), "speed": (0.8, 1.0)}, "changes": {"mass": 1.1, "time": 1.0}}
    keywords |= {**STRAIGHT, "speed": 20.0, "tyre": "magic_formula"}
    envs = gym.make_vec("lanekeep/LaneKeep-v0", 2, "vector_entry_point", **keywords).unwrapped
    names = [c.name for c in envs.channels]
    columns = names.index("friction"), names.index("speed")
    envs.reset(seed=3)
    seen = []
    for step in range(40):
        if step == 10:
            envs.reset(options={"friction": 0.5, "speed": 0.8, "reset_mask": np.array([False, True])})
        seen.append(envs.step(np.zeros((2, 1), np.float32))[0][:, columns])
    seen = np.array(seen)
    assert (seen[:, 0] == seen[0, 0]).all() and (seen[11:, 1] == seen[11, 1]).all()
    np.testing.assert_allclose(seen[-1, 1], [0.5, 16.0], rtol=1e-6)
    assert seen[0, 0, 0] > 0.51 and seen[0, 0, 1] > 16.1


@pytest.mark.parametrize("name", ["RoadWorks", "LaneSupport", "Evasive", "Drive", "Traffic"])
def test_every_road_with_tyres_feels_them_and_cars_are_those_of_single_environments(name):
    keywords = {
        "bank": (-0.03, 0.03),
        "crosswind": 5.0,
        "gusts": 1.0,
        "changes": {"mass": 1.2, "time": 0.3},
        "randomisation": {"steering_offset": (-0.01, 0.01)},
        "departure": "off",
    }
    many = gym.make_vec(f"lanekeep/{name}-v0", 2, "vector_entry_point", **keywords)
    many.reset(seed=4)
    plain = gym.make_vec(f"lanekeep/{name}-v0", 2, "vector_entry_point", departure="off")
    plain.reset(seed=4)
    actions = np.random.default_rng(0).uniform(-0.1, 0.1, (30, *many.action_space.shape)).astype(np.float32)
    drives = [many.step(action) for action in actions]
    unlike = [plain.step(action)[4]["lateral_error"] for action in actions]
    for i in range(2):
        one = gym.make(f"lanekeep/{name}-v0", **keywords)
        one.reset(seed=4 + i)
        for action, (seen, *_) in zip(actions, drives, strict=True):
            observation, *_, info = one.step(action[i])
            np.testing.assert_array_equal(observation, seen[i])
        assert info["lateral_error"] != unlike[-1][i]


@pytest.mark.parametrize("name", ["WallFollow", "Circuit"])
def test_between_walls_offset_and_gain_are_another_command(name):
    steering = {"angle_limit": None}
    keywords = {"max_steering_angle": LIMIT, "steering_offset": 0.0}
    plain = gym.make(f"lanekeep/{name}-v0", vehicle={"base": "knightriders", "steering": steering}, **keywords)
    faults = {**steering, "gain": 2.0, "offset": LIMIT / 4}
    faulty = gym.make(f"lanekeep/{name}-v0", vehicle={"base": "knightriders", "steering": faults}, **keywords)
    start = {"lateral_error": 0.0, "heading_error": 0.0}
    plain.reset(seed=0, options=start), faulty.reset(seed=0, options=start)
    for asked in np.random.default_rng(1).integers(-90, 90, 20) / 256:
        action = np.zeros(plain.action_space.shape, np.float32)
        action[0], second = 2.0 * asked + 0.25, action.copy()
        second[0] = asked
        expected, seen = plain.step(action)[4], faulty.step(second)[4]
        assert [seen[key] for key in ("x", "y", "heading_error")] == [
            expected[key] for key in ("x", "y", "heading_error")
        ]
    drawn = gym.make(f"lanekeep/{name}-v0", randomisation={"steering_gain": (0.5, 0.6)}).unwrapped
    drawn.reset(seed=0)
    with pytest.raises(ValueError, match=r"randomisation\.steering_offset=.* has no effect in this scenario"):
        gym.make(f"lanekeep/{name}-v0", randomisation={"steering_offset": (0.0, 0.1)})


def test_what_is_off_is_no_part_of_a_kernel():
    env = made(observation="measured")
    assert not env.scenario.disturbed
    assert {c.name for c in made().channels}.isdisjoint({"bank", "crosswind", "friction", "steering_offset"})
    measured = made(observation="measured", bank=0.03, crosswind=3.0, vehicle={"steering": {"offset": 0.01}})
    assert [c.name for c in measured.channels] == [c.name for c in env.channels]


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"bank": 0.3}, ["bank=0.3", "<= 0.2 rad"]),
        ({"bank": (0.1, 0.0)}, ["bank=", "low <= high"]),
        ({"crosswind": "strong"}, ["crosswind='strong'", "m/s"]),
        ({"gusts": -1.0}, ["gusts=-1.0", ">= 0.0"]),
        ({"dynamics": "kinematic", "bank": 0.03}, ["bank=", "has no effect", "rolls without slip"]),
        ({"gust_time": 1.0}, ["gust_time=1.0", "has no effect", "gusts=0"]),
        ({"patches": {"friction": 0.5}}, ["patches=", "has no effect", "saturating"]),
        (
            {"tyre": "magic_formula", "patches": {"friction": 0.5, "evry": 3.0}},
            ["patches has no field 'evry'", "every"],
        ),
        ({"tyre": "magic_formula", "patches": {"friction": 0.5, "every": 3.0}}, ["patches.every=3.0", ">= 20.0"]),
        ({"changes": {"friction": 0.5}}, ["changes.friction=", "has no effect", "saturating"]),
        ({"changes": {"time": 3.0}}, ["changes=", "has no effect", "factor"]),
        ({"changes": {"mass": 0.0}}, ["changes.mass=0.0", ">= 0.05"]),
        ({"vehicle": {"steering": {"gain": 0.0}}}, ["steering.gain=0.0", ">= 0.05"]),
        ({"max_steering_angle": 1.0, "vehicle": {"steering": {"gain": 3.0}}}, ["max_steering_angle=1.0", "1.5 rad"]),
        (
            {"changes": {"mass": 0.05, "front_cornering_stiffness": 20.0}, "vehicle": "pses", "speed": 1.0},
            ["vehicle.", "is not allowed", "integrated"],
        ),
        ({"tyre": "magic_formula", "friction": 0.4, "bank": 0.15}, ["bank=", "least friction gives 3.92 m/s²"]),
    ],
)
def test_refusals_are_one_line(keywords, words):
    with pytest.raises(ValueError) as error:
        gym.make("lanekeep/LaneKeep-v0", **keywords)
    text = str(error.value)
    assert "\n" not in text and all(word in text for word in words), text


def test_all_cars_that_occur_are_judged():
    """A car that becomes lighter and stiffer is integrated as one that is drawn so."""
    factors = {"mass": (0.3, 1.0), "front_cornering_stiffness": (1.0, 3.0)}
    car = {"vehicle": "pses", "speed": 1.0, "max_steering_angle": 0.15}
    drawn, becomes = LaneKeepScenario(randomisation=factors, **car), LaneKeepScenario(changes=factors, **car)
    assert becomes.integration == drawn.integration != LaneKeepScenario(**car).integration


def test_patches_that_grip_more_are_judged_as_a_road_that_does():
    """A tall, light car's loads move the more the harder it may brake."""
    car = {"base": "f1tenth", "cg_height": 0.3, "mass": 1.2, "yaw_inertia": 0.012}
    keywords = {"vehicle": car, "tyre": "load_sensitive", "speed": 1.0}
    patched = LaneKeepScenario(patches={"friction": (0.9, 2.0)}, **keywords)
    rough, smooth = LaneKeepScenario(friction=2.0, **keywords), LaneKeepScenario(**keywords)
    assert patched.integration == rough.integration != smooth.integration


def test_the_profile_asks_no_more_than_the_most_slippery_place_gives():
    """80 % of the friction there at the most, as on a road that is so all along."""
    keywords = {"road": {"kind": "circle", "radius": 200.0}, "tyre": "magic_formula", "speed": {"maximum": 60.0}}
    keywords["speed"]["lateral_acceleration"] = 6.0
    speeds = []
    for further in (
        {"friction": 0.5},
        {"patches": {"friction": (0.5, 0.9)}},
        {"changes": {"friction": 0.5}},
    ):
        env = gym.make("lanekeep/LaneKeep-v0", departure="off", **keywords, **further)
        env.reset(seed=0)
        speeds.append(env.step(np.zeros(1, np.float32))[4]["speed"])
    np.testing.assert_allclose(speeds, math.sqrt(0.8 * 0.5 * GRAVITY * 200.0), rtol=1e-6)


def test_in_highway_env_s_worlds_nothing_disturbs_a_car():
    pytest.importorskip("highway_env")
    from lanekeep_env.adapters.highway.plant import FreeScenario

    with pytest.raises(ValueError, match="gain 1 and offset 0"):
        FreeScenario(road="straight", speed=20.0, vehicle={"base": "yin", "steering": {"offset": 0.01}})
