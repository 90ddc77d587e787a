"""Cars honest at the limit against two-track cars: an own one (`two_track_oracle`) and CommonRoad's multi-body one."""

import itertools
import math
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from two_track_oracle import TwoTrack

from lanekeep_env.physics import load_transfer, models
from lanekeep_env.physics.parameters import SteeringActuator
from lanekeep_env.physics.vehicles import VEHICLES, vehicle_from
from lanekeep_env.scenario import LaneKeepScenario

IDEAL = SteeringActuator()
#: Verification's car: h 0.55 m, track 1.5 m, 15 % of friction lost per doubling of load.
YIN = replace(VEHICLES["yin"], cg_height=0.55, track_width=1.5, steering=IDEAL)
PASSAT = replace(VEHICLES["passat"], steering=IDEAL)
STEP, SHOWN = 0.01, 5  # s, and how many of them from one comparison to the next


def drive(car, speed, steer, seconds, **keywords):
    """Times, and sideslip, yaw rate, lateral acceleration and speed of our car at them."""
    steps = round(seconds / STEP)
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        **{"vehicle": car, "road": "straight", "speed": speed, "departure": "off", "control_step": STEP},
        **{"max_steering_angle": 0.5, "observation": "full", "episode_steps": steps + 1, **keywords},
    )
    env.reset(seed=0, options={"arc_length": 0.0, "lateral_error": 0.0, "heading_error": 0.0})
    names = [channel.name for channel in env.unwrapped.channels]
    columns = [names.index(name) for name in ("sideslip", "yaw_rate", "lateral_acceleration", "speed")]
    rows = [np.array([0.0, 0.0, 0.0, speed])]
    for k in range(steps):
        observation = env.step(np.array([steer((k + 0.5) * STEP) / 0.5], np.float32))[0]
        if (k + 1) % SHOWN == 0:
            rows.append(observation[columns])
    return STEP * SHOWN * np.arange(len(rows)), np.array(rows, dtype=float).T


def ramp(rate):
    return lambda t: rate * max(t, 0.0)


def sine(size, frequency):
    return lambda t: size * math.sin(2.0 * math.pi * frequency * t)


def off(found, expected):
    """Largest difference over the largest value."""
    return np.abs(found - expected).max() / np.abs(expected).max()


# Steering, seconds and the lateral acceleration that is reached at least.
MANOEUVRES = {
    "ramp at 25": (25.0, ramp(0.010), 14.0, 7.5),
    "ramp at 15": (15.0, ramp(0.012), 14.0, 6.5),
    "sine at 25": (25.0, sine(0.12, 0.2), 10.0, 7.0),
    "sine at 15": (15.0, sine(0.16, 0.2), 10.0, 6.0),
    "fast sine at 25": (25.0, sine(0.07, 0.5), 6.0, 4.5),
    "fast sine at 15": (15.0, sine(0.16, 0.5), 6.0, 6.0),
}


@pytest.mark.parametrize("car", [YIN, PASSAT], ids=["yin", "passat"])
@pytest.mark.parametrize("name", MANOEUVRES)
def test_load_sensitive_car_meets_the_two_track_car(car, name):
    speed, steer, seconds, reached = MANOEUVRES[name]
    times, (beta, _, across, _) = drive(car, speed, steer, seconds, tyre="load_sensitive")
    expected_beta, _, expected = TwoTrack(car, 1.0).drive(speed, steer, times)
    assert np.abs(expected).max() > reached
    assert off(across, expected) < 0.03
    assert off(beta, expected_beta) < 0.15


def test_without_load_transfer_the_car_is_too_good():
    """The first numbers of what the option is for: 8 % at 6 m/s² and more beyond, where the honest car keeps 3 %."""
    times, (_, _, across, _) = drive(YIN, 25.0, ramp(0.010), 14.0, tyre="magic_formula")
    _, _, expected = TwoTrack(YIN, 1.0).drive(25.0, ramp(0.010), times)
    assert across[-1] / expected[-1] > 1.08


# CommonRoad's multi-body car (vehicle 2): springs, roll and pitch, compliant joints, camber, combined slip.

RAMPS = {"at 15": (15.0, ramp(0.008), 13.5), "at 25": (25.0, ramp(0.006), 7.0)}
# Steering, seconds and how far amplitudes of the lateral acceleration may be off. At 0.5 Hz and 25 m/s the body no
# longer has the time to lean as far as it does when it is asked slowly, nor have its wheels: see below.
SINES = {
    "slow at 15": (15.0, sine(0.09, 0.2), 10.0, 0.03),
    "slow at 25": (25.0, sine(0.036, 0.2), 10.0, 0.03),
    "fast at 15": (15.0, sine(0.09, 0.5), 8.0, 0.03),
    "fast at 25": (25.0, sine(0.035, 0.5), 8.0, 0.05),
}


class MultiBody:
    """CommonRoad's car, whose speed a driver holds by braking and driving all wheels."""

    def __init__(self):
        dynamics = pytest.importorskip("vehiclemodels.vehicle_dynamics_mb").vehicle_dynamics_mb
        begin = pytest.importorskip("vehiclemodels.init_mb").init_mb
        module = pytest.importorskip("vehiclemodels.parameters_vehicle2")
        self.dynamics, self.begin, self.p = dynamics, begin, module.parameters_vehicle2()

    def upright(self):
        """Let neither body nor wheels lean: all springs 100 times as stiff."""
        springs = {name: 100.0 * getattr(self.p, name) for name in ("K_sf", "K_sr", "K_zt")}
        dampers = {name: 10.0 * getattr(self.p, name) for name in ("K_sdf", "K_sdr")}
        self.p = replace(self.p, **springs, **dampers, K_tsf=0.0, K_tsr=0.0)

    def indifferent(self):
        """Let tyres not notice that they lean."""
        camber = ("p_hy1", "p_hy3", "p_vy1", "p_vy3", "p_dy3", "r_vy3")
        self.p = replace(self.p, tire=replace(self.p.tire, **dict.fromkeys(camber, 0.0)))

    def drive(self, v, steer, times):
        """Sideslip and lateral acceleration (of all masses) at ``times``."""
        p = self.p

        def rates(t, x):
            x = [*x[:2], steer(t), *x[3:]]
            turning = (steer(t + 1e-4) - steer(t - 1e-4)) / 2e-4
            return np.array(self.dynamics(x, [turning, 3.0 * (v - x[3])], p))

        start = np.array(self.begin([0, 0, 0, v, 0, 0, 0], p), float)
        found = solve_ivp(rates, (0.0, times[-1]), start, "LSODA", t_eval=times, rtol=1e-6, atol=1e-8, max_step=0.02).y
        change = np.array([rates(t, x) for t, x in zip(times, found.T, strict=True)]).T
        lateral = (p.m_s * change[10] + p.m_uf * change[15] + p.m_ur * change[20]) / p.m
        return np.arctan2(found[10], found[3]), lateral + found[5] * found[3]


@pytest.fixture(scope="module")
def multi_body():
    return MultiBody()


@pytest.fixture(scope="module")
def identified(multi_body):
    return identify(multi_body)


def identify(multi_body):
    """Vehicle 2 and its friction, with what camber makes of its axles: from a ramp at 20 m/s, which nothing else uses.

    Its tyres are proportional to their load. Roll leans all wheels, and camber adds to each axle's force what a tenth
    more of stiffness adds: an axle's effective stiffness is what a car without roll can know of that.
    """
    car, times = replace(VEHICLES["commonroad-2"], steering=IDEAL), np.arange(0.0, 7.5, 0.1)
    beta, across = multi_body.drive(20.0, ramp(0.008), times)
    stiffness = car.front_cornering_stiffness, car.rear_cornering_stiffness

    def fitted(factors):
        front, rear = (float(one * factor) for one, factor in zip(stiffness, factors[:2], strict=True))
        changed = replace(car, front_cornering_stiffness=front, rear_cornering_stiffness=rear)
        return changed, float(1.0489 * factors[2])

    def misses(factors):
        found_beta, _, found = TwoTrack(*fitted(factors)).drive(20.0, ramp(0.008), times)
        return np.concatenate([(found - across) / 9.0, (found_beta - beta) / 0.03])

    return fitted(least_squares(misses, np.ones(3), diff_step=1e-3).x)


@pytest.mark.parametrize("name", RAMPS)
def test_ramps_of_the_multi_body_car(multi_body, identified, name):
    """Up to 8.6 m/s², where at 25 m/s the multi-body car begins to break away."""
    speed, steer, seconds = RAMPS[name]
    car, friction = identified
    times, (beta, _, across, _) = drive(car, speed, steer, seconds, tyre="load_sensitive", friction=friction)
    expected_beta, expected = multi_body.drive(speed, steer, times)
    below = expected <= 8.6
    assert expected[below].max() > 8.4
    assert off(across[below], expected[below]) < 0.03
    assert off(beta[below], expected_beta[below]) < 0.15


@pytest.mark.parametrize("name", SINES)
def test_sines_of_the_multi_body_car(multi_body, identified, name):
    """Amplitudes: its camber forces change their sign at once with that of the camber, which no tyre does."""
    speed, steer, seconds, bound = SINES[name]
    car, friction = identified
    times, (beta, _, across, _) = drive(car, speed, steer, seconds, tyre="load_sensitive", friction=friction)
    expected_beta, expected = multi_body.drive(speed, steer, times)
    settled = times > 0.25 * seconds
    for found, true, most in ((across, expected, bound), (beta, expected_beta, 0.15)):
        assert np.abs(found[settled]).max() == pytest.approx(np.abs(true[settled]).max(), rel=most)


@pytest.mark.slow
@pytest.mark.parametrize("change", [MultiBody.upright, MultiBody.indifferent])
def test_what_is_off_in_a_fast_sine_is_camber_behind_roll(change):
    """Take roll from the multi-body car, or what camber does to its tyres, and 1 % is left of the 3.6 %."""
    multi_body = MultiBody()
    change(multi_body)
    speed, steer, seconds, _ = SINES["fast at 25"]
    car, friction = identify(multi_body)
    times, (_, _, across, _) = drive(car, speed, steer, seconds, tyre="load_sensitive", friction=friction)
    expected = multi_body.drive(speed, steer, times)[1]
    settled = times > 0.25 * seconds
    assert np.abs(across[settled]).max() == pytest.approx(np.abs(expected[settled]).max(), rel=0.01)


def test_a_flat_car_on_proportional_tyres_is_the_plain_one():
    car = replace(PASSAT, cg_height=0.0, friction_load_sensitivity=0.0, stiffness_load_sensitivity=0.0)
    tables = [drive(car, 25.0, ramp(0.01), 8.0, tyre=tyre)[1] for tyre in ("load_sensitive", "magic_formula")]
    np.testing.assert_allclose(tables[0], tables[1], rtol=1e-6, atol=1e-7)


def test_a_loaded_car_on_proportional_tyres_steers_as_before():
    """Mass changes stiffness as tyres do: in proportion, and a little less where they lose by load."""
    angles = sine(0.01, 0.2)
    usual = {"tyre": "load_sensitive", "speed": 25.0, "steer": angles, "seconds": 4.0}
    proportional = replace(PASSAT, friction_load_sensitivity=0.0, stiffness_load_sensitivity=0.0)
    heavy = {"randomisation": {"mass": 1.3}}
    alike = [drive(proportional, **usual, **more)[1][1] for more in ({}, heavy)]
    np.testing.assert_allclose(alike[1], alike[0], rtol=1e-5, atol=1e-6)
    lighter, heavier = (np.abs(drive(PASSAT, **usual, **more)[1][0]).max() for more in ({}, heavy))
    assert heavier > 1.03 * lighter  # of sideslip
    unaware = np.abs(drive(PASSAT, **{**usual, "tyre": "magic_formula"}, **heavy)[1][1] - alike[0]).max()
    assert unaware > 0.02 * np.abs(alike[0]).max()


# Speed.


@pytest.mark.parametrize("tyre", ["magic_formula", "load_sensitive"])
def test_cornering_costs_speed(tyre):
    """In a steady bend the driver lacks the drag times 1 s; the drag is that of the axles' forces, from moments."""
    angle, car = 0.07, PASSAT
    _, (beta, _, across, speed) = drive(
        car, 20.0, ramp(0.0) if angle == 0 else lambda t: angle, 30.0, tyre=tyre, cornering_drag=True
    )
    b, a = float(beta[-1]), float(across[-1])
    # With no yaw acceleration both axles' forces follow from the lateral acceleration.
    front = a * car.cg_to_rear_axle / car.wheelbase
    rear = front * car.cg_to_front_axle / car.cg_to_rear_axle
    scale = a / (front * math.cos(angle - b) / math.cos(angle) + rear * math.cos(b))
    drag = scale * (front * math.sin(angle - b) / math.cos(angle) - rear * math.sin(b))
    assert drag > 0.3
    assert 20.0 - speed[-1] == pytest.approx(drag, rel=0.03)


def test_imposed_speeds_are_free():
    _, (_, _, _, speed) = drive(PASSAT, 20.0, ramp(0.01), 8.0, tyre="load_sensitive")
    np.testing.assert_array_equal(speed, np.full_like(speed, 20.0))


def test_a_driver_holds_the_profile_on_straights():
    road = {"kind": "random", "seed": 3, "count": 1}
    speed = {"lateral_acceleration": 2.0, "maximum": 30.0}
    env = gym.make("lanekeep/LaneKeep-v0", road=road, speed=speed, tyre="load_sensitive", cornering_drag=True)
    assert env.unwrapped.scenario.speed.friction_ellipse
    assert env.unwrapped.scenario.integration.slip_speed_floor <= 1.0


# Numbers that could be off.


@pytest.mark.parametrize("vehicle", ["yin", "f1tenth", "commonroad-3", "van"])
def test_no_loaded_car_leaves_the_region_of_stability(vehicle):
    """Jacobians of the model itself, over the corners of the stress set, acceleration and speed."""
    scenario = LaneKeepScenario.from_keywords(vehicle=vehicle, tyre="load_sensitive", randomisation="stress", speed=0.5)
    draws, step = scenario.randomisation, scenario.integration.step
    settings = load_transfer.read(load_transfer.numbers_of(scenario.vehicle))
    floor = scenario.integration.slip_speed_floor
    rng = np.random.default_rng(0)
    corners = list(
        itertools.product(
            draws.mass,
            draws.front_cornering_stiffness,
            draws.rear_cornering_stiffness,
            draws.cg_shift,
            (-9.0, 0.0, 9.0),
            (0.0, 5.0),
            (0.4, 1.0, 3.0),
        )
    )
    for mass, front, rear, shift, pull, across, v in rng.permutation(corners)[:150]:
        car = vehicle_from(vehicle)
        numbers = (
            *(car.cg_to_front_axle - shift, car.cg_to_rear_axle + shift),
            *(1 / (mass * car.mass), 1 / (mass * car.yaw_inertia)),
            *(front * car.front_cornering_stiffness, rear * car.rear_cornering_stiffness),
        )
        load = mass * car.mass * 9.81 / car.wheelbase
        numbers = (*numbers, load * numbers[1], load * numbers[0], floor)
        loaded = load_transfer.braked(numbers, None, pull, across, settings)

        def rates(beta, r, v=v, loaded=loaded):
            return np.array(models.LOAD_SENSITIVE.rates(0.0, 0.0, beta, r, 0.0, v, 0.0, loaded)[3:])

        small = 1e-6
        jacobian = np.column_stack(
            [(rates(small, 0.0) - rates(-small, 0.0)), (rates(0.0, small) - rates(0.0, -small))]
        ) / (2 * small)
        z = np.linalg.eigvals(jacobian) * step
        growth = np.abs(sum(z**k / math.factorial(k) for k in range(5)))
        assert np.abs(z).max() < 2.6
        assert (growth[z.real <= 0.0] <= 1.0 + 1e-9).all()  # a car that oversteers while it brakes does grow


def test_named_in_errors():
    with pytest.raises(ValueError, match=r"tyre='load' .*load_sensitive"):
        LaneKeepScenario(tyre="load")
    with pytest.raises(ValueError, match=r"cornering_drag=True .*has no effect"):
        LaneKeepScenario.from_keywords(cornering_drag=True)
    with pytest.raises(ValueError, match="cornering_drag=1 is not allowed"):
        LaneKeepScenario.from_keywords(tyre="magic_formula", cornering_drag=1)
    fast = {"speed": {"lateral_acceleration": 9.0}, "bank": 0.19}
    LaneKeepScenario.from_keywords(tyre="magic_formula", **fast)
    with pytest.raises(ValueError, match=r"bank=.* least friction gives 9.1 m/s² in all"):
        LaneKeepScenario.from_keywords(tyre="load_sensitive", **fast)
    with pytest.raises(ValueError, match="friction_load_sensitivity"):
        vehicle_from({"friction_load_sensitivity": 0.5})
