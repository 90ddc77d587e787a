"""The vehicle models against other people's code, scipy and closed forms, all through `gym.make`."""

import math
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import lanekeep_env  # noqa: F401
from lanekeep_env import layout as at
from lanekeep_env.physics import VEHICLES

IDEAL = {"lag": 0.0, "rate_limit": None, "angle_limit": None, "delay": 0.0}


def drive(vehicle, speed, steering, *, road="straight", dt=0.01, start=None, **keywords):
    """Drive with road-wheel angles ``steering`` held for ``dt`` each; rows (s, d, theta) at the step ends."""
    steps = len(steering)
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        episode_steps=steps + 1,
        vehicle={"base": vehicle, "steering": IDEAL},
        road=road,
        speed=speed,
        control_step=dt,
        departure="off",
        max_steering_angle=0.9,
        **keywords,
    )
    start = {"arc_length": 0.0, "lateral_error": 0.0, "heading_error": 0.0} | (start or {})
    env.reset(seed=0, options=start)
    rows = []
    for angle in steering:
        info = env.step(np.array([angle / 0.9], dtype=np.float32))[4]
        rows.append((info["arc_length"], info["lateral_error"], info["heading_error"]))
    table = np.array(rows)
    table[:, 2] = np.unwrap(table[:, 2])
    return table


def as_sent(angles):
    """Road-wheel angles after the action's way through float32."""
    return np.clip(np.float32(np.asarray(angles) / 0.9).astype(float), -1, 1) * 0.9


def inputs(name, steps, dt):
    t = np.arange(steps) * dt
    return {
        "sine": 0.02 * np.sin(2 * np.pi * 0.5 * t),
        "ramp": np.clip(0.01 * t, 0, 0.03),
        "weave": 0.015 * np.sin(2 * np.pi * 0.3 * t) + 0.01 * np.sin(2 * np.pi * 1.1 * t),
    }[name]


def held(rates, state, steering, dt):
    """Integrate ``rates(state, steer)`` by scipy with the steering held over each step."""
    rows = []
    for angle in steering:
        solution = solve_ivp(lambda _, x, a=angle: rates(x, a), (0, dt), state, rtol=1e-11, atol=1e-12)
        state = solution.y[:, -1]
        rows.append(state)
    return np.array(rows)


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("speed", [5.0, 15.0, 30.0])
@pytest.mark.parametrize("kind", ["sine", "ramp"])
def test_linear_tyre_meets_commonroad_single_track(number, speed, kind):
    oracle = pytest.importorskip("vehiclemodels.vehicle_dynamics_st").vehicle_dynamics_st
    module = pytest.importorskip(f"vehiclemodels.parameters_vehicle{number}")
    parameters = getattr(module, f"parameters_vehicle{number}")()
    angles = as_sent(inputs(kind, 400, 0.01))

    def rates(x, steer):
        f = oracle([x[0], x[1], steer, speed, x[2], x[3], x[4]], [0.0, 0.0], parameters)
        return [f[0], f[1], f[4], f[5], f[6]]

    expected = held(rates, np.zeros(5), angles, 0.01)
    got = drive(f"commonroad-{number}", speed, angles)
    np.testing.assert_allclose(got, expected[:, :3], atol=1e-6, rtol=0)


@pytest.mark.parametrize("speed", [0.5, 5.0, 20.0])
@pytest.mark.parametrize("kind", ["sine", "ramp", "weave"])
def test_kinematic_meets_commonroad_rear_axle_model(speed, kind):
    oracle = pytest.importorskip("vehiclemodels.vehicle_dynamics_ks").vehicle_dynamics_ks
    parameters = pytest.importorskip("vehiclemodels.parameters_vehicle2").parameters_vehicle2()
    car = VEHICLES["commonroad-2"]
    angles = as_sent(10 * inputs(kind, 400, 0.01))

    def rates(x, steer):
        f = oracle([x[0], x[1], steer, speed, x[2]], [0.0, 0.0], parameters)
        return [f[0], f[1], f[4]]

    rear = held(rates, np.array([-car.cg_to_rear_axle, 0.0, 0.0]), angles, 0.01)
    got = drive("commonroad-2", speed, angles, dynamics="kinematic")
    centre = rear[:, :2] + car.cg_to_rear_axle * np.column_stack([np.cos(rear[:, 2]), np.sin(rear[:, 2])])
    np.testing.assert_allclose(got[:, :2], centre, atol=1e-6, rtol=0)
    np.testing.assert_allclose(got[:, 2], rear[:, 2], atol=1e-7, rtol=0)


def werling(car, speed, friction):
    """W08 (1) and (3) written from the paper, on a straight road: x = (s, d, theta, beta, r)."""
    load = friction * car.mass * 9.81 / car.wheelbase

    def tyre(slip, stiffness, peak):
        return peak * math.sin(1.5 * math.atan(stiffness * slip / (1.5 * peak)))

    def rates(x, steer):
        _, _, theta, beta, r = x
        front = steer - math.atan((car.cg_to_front_axle * r + speed * math.sin(beta)) / (speed * math.cos(beta)))
        rear = math.atan((car.cg_to_rear_axle * r - speed * math.sin(beta)) / (speed * math.cos(beta)))
        force_f = tyre(front, car.front_cornering_stiffness, load * car.cg_to_rear_axle)
        force_r = tyre(rear, car.rear_cornering_stiffness, load * car.cg_to_front_axle)
        beta_rate = -r + (force_f * math.cos(steer - beta) + force_r * math.cos(beta)) / (car.mass * speed)
        r_rate = (force_f * car.cg_to_front_axle * math.cos(steer) - force_r * car.cg_to_rear_axle) / car.yaw_inertia
        return [speed * math.cos(theta + beta), speed * math.sin(theta + beta), r, beta_rate, r_rate]

    return rates


@pytest.mark.parametrize(("speed", "friction", "gain"), [(5.0, 1.0, 5.0), (15.0, 0.6, 3.0), (30.0, 1.0, 2.0)])
def test_magic_formula_meets_scipy_on_werlings_equations(speed, friction, gain):
    angles = as_sent(gain * inputs("weave", 400, 0.01))
    expected = held(werling(VEHICLES["yin"], speed, friction), np.zeros(5), angles, 0.01)
    got = drive("yin", speed, angles, tyre="magic_formula", friction=friction)
    np.testing.assert_allclose(got, expected[:, :3], atol=1e-6, rtol=0)


def test_saturated_tyre_gives_the_friction_limit():
    """No steering angle pulls more than mu g out of the road."""
    env = gym.make(
        "lanekeep/LaneKeep-v0", road="straight", speed=25.0, tyre="magic_formula", friction=0.5, departure="off"
    )
    env.reset(seed=0)
    most = max(abs(env.step(np.array([1.0], np.float32))[4]["lateral_acceleration"]) for _ in range(100))
    assert 0.98 * 0.5 * 9.81 < most <= 0.5 * 9.81 + 1e-9


def test_small_slip_makes_both_tyres_equal():
    """The magic formula's slope at zero is the cornering stiffness: differences fall with the third power."""
    differences = []
    for size in (0.002, 0.001):
        angles = as_sent(np.full(100, size))
        linear, curved = (drive("yin", 25.0, angles, tyre=tyre)[-1, 1] for tyre in ("linear", "magic_formula"))
        differences.append(abs(linear - curved))
    assert differences[0] / differences[1] == pytest.approx(8.0, rel=0.05)


@pytest.mark.parametrize("steer", [0.3, -0.5])
def test_kinematic_circle_closes(steer):
    """Constant steering drives the rear axle round a circle of radius l / tan(delta)."""
    angle = float(as_sent([steer])[0])
    speed, wheelbase = 3.0, VEHICLES["yin"].wheelbase
    once = 2 * math.pi * wheelbase / abs(math.tan(angle)) / speed
    got = drive("yin", speed, np.full(math.ceil(once / 0.01), steer), dynamics="kinematic")
    times = 0.01 * np.arange(1, len(got) + 1)
    np.testing.assert_allclose(got[:, 2], speed * math.tan(angle) / wheelbase * times, atol=1e-9)
    # radius of the centre of gravity from the extent of its path
    radius = math.hypot(wheelbase / math.tan(angle), VEHICLES["yin"].cg_to_rear_axle)
    assert np.ptp(got[:, 1]) == pytest.approx(2 * radius, abs=1e-3)
    assert np.hypot(got[-1, 0], got[-1, 1]) < speed * 0.01


def steady_yaw_gain(car, speed):
    """r / delta of the linear single track: v / (l + EG v²)."""
    gradient = (
        car.mass
        / car.wheelbase
        * (car.cg_to_rear_axle / car.front_cornering_stiffness - car.cg_to_front_axle / car.rear_cornering_stiffness)
    )
    return speed / (car.wheelbase + gradient * speed**2)


@pytest.mark.parametrize("name", ["yin", "commonroad-1", "commonroad-3"])
def test_steady_turning_meets_the_understeer_formula(name):
    car = VEHICLES[name]
    for speed in (2.0, 10.0, 25.0):
        got = drive(name, speed, np.full(800, 0.01))
        yaw_rate = (got[-1, 2] - got[-2, 2]) / 0.01
        assert yaw_rate == pytest.approx(steady_yaw_gain(car, speed) * float(as_sent([0.01])[0]), rel=1e-4)


def test_understeer_and_decoded_coefficients_of_yins_car():
    """The digest's a11 ... b2 are those of the car's axle parameters."""
    car = VEHICLES["yin"]
    front, rear = car.front_cornering_stiffness, car.rear_cornering_stiffness
    lf, lr, m, inertia = car.cg_to_front_axle, car.cg_to_rear_axle, car.mass, car.yaw_inertia
    assert -(front + rear) / m == pytest.approx(-99.7, abs=0.05)
    assert (rear * lr - front * lf) / m == pytest.approx(47.7, abs=0.05)
    assert (rear * lr - front * lf) / inertia == pytest.approx(30.0, abs=0.05)
    assert -(front * lf**2 + rear * lr**2) / inertia == pytest.approx(-128.4, abs=0.05)
    assert front / m / car.steering_ratio == pytest.approx(2.274, abs=5e-4)
    assert front * lf / inertia / car.steering_ratio == pytest.approx(1.861, abs=5e-4)


def linear_system(car, speed):
    """x = (d, theta, beta, r) on a straight road for small angles, and its input column."""
    front, rear = car.front_cornering_stiffness, car.rear_cornering_stiffness
    lf, lr, m, inertia = car.cg_to_front_axle, car.cg_to_rear_axle, car.mass, car.yaw_inertia
    a = np.array(
        [
            [0, speed, speed, 0],
            [0, 0, 0, 1],
            [0, 0, -(front + rear) / (m * speed), (rear * lr - front * lf) / (m * speed**2) - 1],
            [0, 0, (rear * lr - front * lf) / inertia, -(front * lf**2 + rear * lr**2) / (inertia * speed)],
        ]
    )
    return a, np.array([0, 0, front / (m * speed), front * lf / inertia])


@pytest.mark.parametrize("speed", [1.0, 1.5, 20.0])
def test_linear_response_is_the_matrix_exponential(speed):
    """Small steering step from 1 m/s up: the bare model, no trace of the regularisation."""
    a, b = linear_system(VEHICLES["yin"], speed)
    size = float(as_sent([1e-5])[0])
    block = expm(np.block([[a, b[:, None]], [np.zeros((1, 5))]]) * 1.0)
    got = drive("yin", speed, np.full(100, 1e-5))[-1]
    np.testing.assert_allclose(got[1:], (block[:2, 4] * size), rtol=2e-4 if speed < 2 else 1e-6)


@pytest.mark.parametrize("tyre", ["linear", "magic_formula"])
def test_from_standstill_up_the_dynamic_car_meets_the_kinematic_one(tyre):
    """Below the slip-speed floor wheels roll where they point, after about a centimetre of travel."""
    for speed in (0.0, 0.01, 0.1, 0.3, 0.5, 0.9):
        angles = np.full(1000, 0.05)  # small, for the linear model's sake
        slipping = drive("yin", speed, angles, tyre=tyre)
        rolling = drive("yin", speed, angles, dynamics="kinematic")
        assert np.isfinite(slipping).all()
        curvature = math.tan(0.05) / VEHICLES["yin"].wheelbase
        allowed = 0.015 * curvature + 0.005 * abs(rolling[-1, 2])
        assert abs(slipping[-1, 2] - rolling[-1, 2]) <= allowed
        assert np.abs(slipping[:, :2] - rolling[:, :2]).max() <= allowed * speed * 10 + 0.002 + 0.02 * speed


def test_bare_model_would_fail_where_the_floor_holds():
    """Why the floor exists: one RK4 step of 10 ms multiplies the fast modes by more than 1 below about 0.5 m/s."""

    def growth(speed):
        eigenvalues = np.linalg.eigvals(linear_system(VEHICLES["yin"], speed)[0]) * 0.01
        return np.abs(sum(eigenvalues**k / math.factorial(k) for k in range(5))).max()

    assert growth(0.4) > 1.5
    assert growth(1.0) <= 1.0 + 1e-12


@pytest.mark.parametrize("model", [{"dynamics": "kinematic"}, {"tyre": "linear"}, {"tyre": "magic_formula"}])
def test_runge_kutta_has_order_four(model):
    """Error against a much finer step falls with the fourth power of the step."""

    def end(h, substeps):
        env = gym.make(
            "lanekeep/LaneKeep-v0",
            road={"kind": "circle", "radius": 200.0},
            speed=20.0,
            departure="off",
            vehicle={"steering": IDEAL},
            **model,
        )
        env.reset(seed=0, options={"lateral_error": 0.5, "heading_error": 0.1, "arc_length": 1.0})
        settings = env.unwrapped._core.settings
        settings[at.STEP_TIME], settings[at.SUBSTEPS] = h, substeps
        info = env.step(np.array([0.3], np.float32))[4]
        return np.array([info["arc_length"], info["lateral_error"], info["heading_error"]])

    exact = end(0.8 / 512, 512)
    errors = [np.abs(end(0.8 / n, n) - exact).max() for n in (16, 32)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)


@pytest.mark.parametrize(
    "road", [{"kind": "sine", "wavelength": 200.0}, {"kind": "slalom"}, {"kind": "circle", "radius": 60.0}]
)
def test_path_coordinates_meet_world_coordinates(road):
    """The same car integrated in x, y, psi by scipy stands where s, d, theta say, over many segments."""
    speed, steps = 15.0, 800
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        episode_steps=steps + 1,
        vehicle={"steering": IDEAL},
        road=road,
        speed=speed,
        control_step=0.01,
        departure="off",
    )
    env.reset(seed=0, options={"arc_length": 3.0, "lateral_error": 0.8, "heading_error": 0.02})
    geometry = env.unwrapped.road_set()[0][0]
    car = VEHICLES["yin"]
    front, rear = car.front_cornering_stiffness, car.rear_cornering_stiffness
    truth = SimpleNamespace(x=None)
    seen = env.unwrapped._core.cars[0, :, 0]
    truth.x = np.array(
        [*geometry.position(3.0, 0.8), geometry.heading(3.0) + 0.02, seen[at.SIDESLIP], seen[at.YAW_RATE]], dtype=float
    )

    def rates(x, steer):
        slip_f = steer - x[3] - car.cg_to_front_axle * x[4] / speed
        slip_r = car.cg_to_rear_axle * x[4] / speed - x[3]
        return [
            speed * math.cos(x[2] + x[3]),
            speed * math.sin(x[2] + x[3]),
            x[4],
            (front * slip_f + rear * slip_r) / (car.mass * speed) - x[4],
            (car.cg_to_front_axle * front * slip_f - car.cg_to_rear_axle * rear * slip_r) / car.yaw_inertia,
        ]

    worst = 0.0
    info = {"lateral_error": 0.8, "heading_error": 0.02, "arc_length": 3.0}
    for _ in range(steps):
        # any feedback will do, as long as the car stays near the road
        kappa = float(geometry.curvature(info["arc_length"]))
        wish = 3.2 * kappa - 0.02 * info["lateral_error"] - 0.4 * info["heading_error"]
        action = np.array([wish / 0.15], dtype=np.float32)
        steer = float(np.clip(np.float64(action[0]), -1, 1)) * 0.15
        truth.x = held(rates, truth.x, [steer], 0.01)[-1]
        info = env.step(action)[4]
        here = geometry.position(info["arc_length"], info["lateral_error"])
        worst = max(worst, math.hypot(here[0] - truth.x[0], here[1] - truth.x[1]))
    assert abs(info["lateral_error"]) < 20
    assert worst < 2e-3
