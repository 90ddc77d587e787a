"""The slip limit: what it lets pass, where it holds the car, and what it finds out about friction."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import lanekeep_baselines
from lanekeep_agents.teacher import Teacher
from lanekeep_baselines import OneByOne
from lanekeep_baselines.slip_limit import SlipLimited
from lanekeep_env import EvasiveScenario
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.tyres import LINEAR_AT_PEAK, magic_formula, slip_at
from lanekeep_env.scenario import LaneKeepScenario

ID = "lanekeep/LaneKeep-v0"
CURVES: dict[str, Any] = {"tyre": "magic_formula", "preview": 20, "departure": "cost"}


class Lock:
    """Steers as far as the car can, from the first step on."""

    name = "lock"
    deterministic = True

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, None]:
        self.deterministic = deterministic
        return np.ones((len(observation), 1), dtype=np.float32), None


def peak(stiffness: float, force: float) -> float:
    """Slip at which the environment's tyre gives the most, rad."""
    tyre: Any = magic_formula
    most = 10.0 * force / stiffness
    found = minimize_scalar(lambda slip: -tyre(slip, stiffness, force) / force, bounds=(0.0, most), method="bounded")
    return float(found.x)


def rear_slip(limit: bool, speed: float, keywords: dict[str, Any]) -> float:
    """The largest true slip of the rear axle that full lock leads to within 3 s, over that of its peak."""
    road = {"kind": "straight", "length": 8000.0}
    cars = Teacher(ID, 1, **{**CURVES, **keywords}, road=road, speed=speed, dtype="float64")
    seen, state, most = cars.reset([3], {"lateral_error": 0.0, "heading_error": 0.0}), None, 0.0
    car = {name: float(values[0]) for name, values in cars.hidden.items()}
    policy: Any = SlipLimited(Lock(), cars.scenario) if limit else Lock()
    for _ in range(60):
        action, state = policy.predict(seen, state)
        seen, _, _ = cars.step(action[:, 0])
        now = dict(zip(cars.names, cars.states[0], strict=True))
        most = max(most, abs(car["cg_to_rear_axle"] * now["yaw_rate"] / speed - now["sideslip"]))
    return most / peak(car["rear_cornering_stiffness"], car["rear_peak"])


@pytest.mark.parametrize("action", ["steering_angle", "steering_rate"])
@pytest.mark.parametrize("tyres", [{"friction": 0.45}, {"friction": 0.8}, {"randomisation": {"friction": 0.45}}])
@pytest.mark.parametrize("speed", [30.0, 40.0])
def test_full_lock_spins_the_car_and_with_the_limit_does_not(speed: float, tyres: dict[str, Any], action: str) -> None:
    """The actuator's lag takes slips beyond the peak for a moment, and friction must be found out first."""
    keywords = {**tyres, "action": action}
    assert rear_slip(False, speed, keywords) > 2.5
    assert rear_slip(True, speed, keywords) < 2.0


def test_static_loads_do_where_loads_shift() -> None:
    keywords = {"tyre": "load_sensitive", "randomisation": {"friction": 0.45}}
    assert rear_slip(False, 30.0, keywords) > 2.5
    assert rear_slip(True, 30.0, keywords) < 2.0


def test_whether_actions_are_drawn_is_told_to_the_policy() -> None:
    lock, scenario = Lock(), LaneKeepScenario(**CURVES)
    SlipLimited(lock, scenario).predict(np.zeros((1, len(scenario.channels))), deterministic=False)
    assert not lock.deterministic


@pytest.mark.parametrize("share", [-1.0, -0.4, 0.0, 0.7, 1.0])
def test_slip_at_is_the_inverse_of_the_tyre(share: float) -> None:
    """Driven into the law itself; at the peak it is where a search finds it."""
    tyre: Any = magic_formula
    stiffness, most = 120000.0, 5000.0
    slip = slip_at(share * most, stiffness, most)
    assert tyre(slip, stiffness, most) == pytest.approx(share * most, abs=1e-6 * most)
    assert abs(slip) <= LINEAR_AT_PEAK * most / stiffness * (1.0 + 1e-12)
    assert peak(stiffness, most) == pytest.approx(LINEAR_AT_PEAK * most / stiffness, rel=1e-4)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("share", [0.2, 0.9, 1.0])
def test_in_steady_bends_the_limit_is_the_angle_at_both_peaks(share: float, side: float) -> None:
    """Closed form: both axles give the same share of their peak; where it is all of it, no angle beyond is let pass."""
    friction, speed = 0.6, 30.0
    scenario = LaneKeepScenario(**CURVES, friction=friction)
    limited, car = SlipLimited(Lock(), scenario), scenario.vehicle
    stiffness = np.array([car.front_cornering_stiffness, car.rear_cornering_stiffness])
    force = friction * car.mass * GRAVITY / car.wheelbase * np.array([car.cg_to_rear_axle, car.cg_to_front_axle])
    # sin(C atan(B alpha)) = share
    slip = side * 1.5 * force / stiffness * np.tan(np.arcsin(share) / 1.5)
    turn = side * share * friction * GRAVITY / speed
    sideslip = car.cg_to_rear_axle * turn / speed - slip[1]
    steer = slip[0] + sideslip + car.cg_to_front_axle * turn / speed
    offsets = side * share * force / stiffness - slip
    estimates = np.array([steer, sideslip, turn, 0.0, 0.0, *offsets])[:, None]
    _, low, high = limited._limits(estimates, np.array([speed]), np.zeros((2, 1)))
    edge, other = (high[0], low[0]) if side > 0.0 else (low[0], high[0])
    if share == 1.0:
        assert edge == pytest.approx(steer, rel=2e-3)
    else:
        assert side * edge > side * steer > side * other
        assert side * (edge - steer) <= (peak(stiffness[0], force[0]) - abs(slip[0])) * 1.002


@pytest.mark.parametrize("friction", [0.3, 0.6, 1.0])
@pytest.mark.parametrize("over", [-1.5, -0.7, 0.4, 1.0, 3.0])
def test_a_tyre_s_force_at_its_slip_tells_its_friction(friction: float, over: float) -> None:
    """Closed form: the law inverted at slips of so many peaks."""
    scenario = LaneKeepScenario(**CURVES)
    limited, car, tyre = SlipLimited(Lock(), scenario), scenario.vehicle, magic_formula
    stiffness = np.array([car.front_cornering_stiffness, car.rear_cornering_stiffness])
    force = friction * car.mass * GRAVITY / car.wheelbase * np.array([car.cg_to_rear_axle, car.cg_to_front_axle])
    found = over * np.array([peak(*one) for one in zip(stiffness, force, strict=True)])
    given = [tyre(*one) for one in zip(found, stiffness, force, strict=True)] / stiffness  # type: ignore[call-arg]
    weight, weighted = limited._told(found[:, None], given[:, None])
    assert weight[0] / weighted[0] == pytest.approx(friction, rel=2e-3)


def drive(policy: Any, env: Any, steps: int) -> list[np.ndarray]:
    seen, _ = env.reset(seed=5)
    state, start, told = None, np.ones(env.num_envs, dtype=bool), []
    for _ in range(steps):
        action, state = policy.predict(seen, state, start)
        told.append(np.array(action))
        seen, _, over, cut, _ = env.step(action)
        start = over | cut
    return told


def cars(number: int, **keywords: Any) -> Any:
    return gym.make_vec(ID, number, vectorization_mode="vector_entry_point", **{**CURVES, **keywords})


@pytest.mark.parametrize("action", ["steering_angle", "steering_rate"])
@pytest.mark.parametrize("name", ["stanley", "pure-pursuit"])
def test_commands_below_the_limits_pass_to_the_last_bit(name: str, action: str) -> None:
    env = cars(8, action=action)
    plain = lanekeep_baselines.make(name, env.unwrapped.scenario)
    limited = SlipLimited(plain, env.unwrapped.scenario)
    assert limited.name == f"slip-limited+{name}"
    np.testing.assert_array_equal(drive(plain, env, 150), drive(limited, env, 150))


def test_rows_are_independent_of_each_other_where_limits_act() -> None:
    scenario = cars(8, randomisation={"friction": 0.45}).unwrapped.scenario
    limited = SlipLimited(lanekeep_baselines.make("stanley", scenario), scenario)
    plain = lanekeep_baselines.make("stanley", scenario)
    random = np.random.default_rng(4)
    seen = random.uniform(-0.1, 0.1, (30, 8, len(scenario.channels))) * np.linspace(0.1, 3.0, 8)[:, None]
    seen[:, :, [channel.name for channel in scenario.channels].index("speed")] = 30.0
    state, alone, acts = None, [None] * 8, False
    for k, rows in enumerate(seen.astype(np.float32)):
        start = np.arange(8) == k % 11
        action, state = limited.predict(rows, state, start)
        acts |= bool((action != plain.predict(rows)[0]).any())
        for i in range(8):
            own, alone[i] = limited.predict(rows[i], alone[i], start[i])
            np.testing.assert_array_equal(own, action[i])
            for one, rows_ in zip(alone[i], state, strict=True):
                np.testing.assert_array_equal(one, rows_[i])
    assert acts


def test_a_policy_of_objects_is_limited_too() -> None:
    class Counts:
        def __init__(self) -> None:
            self.count = 0

        def act(self, observation: Any) -> float:
            self.count += 1
            return 0.001 * self.count

    scenario = cars(2).unwrapped.scenario
    limited, state = SlipLimited(OneByOne(Counts), scenario), None
    seen = np.zeros((2, len(scenario.channels)), dtype=np.float32)
    for k in range(3):
        action, state = limited.predict(seen, state, np.array([False, k == 2]))
    np.testing.assert_allclose(action[:, 0], [0.003, 0.001], rtol=1e-6)


def test_what_has_no_peak_is_refused_in_one_line() -> None:
    with pytest.raises(ValueError, match=r"^policy 'slip-limited' needs tyres that saturate: make the"):
        SlipLimited(Lock(), LaneKeepScenario(preview=20))
    # Its default tyre saturates, and a car that rolls without slip has none.
    with pytest.raises(ValueError, match=r"^policy 'slip-limited' needs tyres .* dynamics='kinematic' has none$"):
        SlipLimited(Lock(), EvasiveScenario(dynamics="kinematic"))
