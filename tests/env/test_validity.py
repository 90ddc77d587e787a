"""Cars that can be integrated, and those that are refused: RK4's region of stability, units, shorter steps."""

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env
from lanekeep_env.physics.stability import Cars
from lanekeep_env.scenario import LaneKeepScenario, WallFollowScenario

CAR = {
    "mass": 1700.0,
    "yaw_inertia": 2700.0,
    "cg_to_front_axle": 1.3,
    "cg_to_rear_axle": 1.5,
    "front_cornering_stiffness": 61850.0,
    "rear_cornering_stiffness": 107665.0,
}


def amplification(z):
    """Factor of RK4 by which a mode of eigenvalue times step ``z`` grows in a step."""
    return abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)


def matrix(car, v, floor):
    """The linear single track's, Yin 2010's a11/v and so on, with the speed held above ``floor`` where it divides."""
    mass, inertia, front, rear, stiff_front, stiff_rear = car
    floored = max(v, floor)
    return np.array(
        [
            [
                -(stiff_front + stiff_rear) * v / (mass * floored**2),
                (stiff_rear * rear - stiff_front * front) / (mass * floored**2) - 1.0,
            ],
            [
                (stiff_rear * rear - stiff_front * front) * v / (inertia * floored),
                -(stiff_front * front**2 + stiff_rear * rear**2) / (inertia * floored),
            ],
        ]
    )


factors = st.floats(-1.5, 1.5).map(lambda power: 10.0**power)
shares = st.floats(0.0, 1.0)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    st.tuples(*[factors] * 6),
    st.floats(0.0, 60.0),
    st.sampled_from(["nominal", "mismatch", "stress"]),
    st.tuples(*[shares] * 4),
)
def test_every_car_that_is_accepted_stays_in_the_region_of_stability(changes, speed, drawn, places):
    """Random cars up to 30 times lighter, stiffer, shorter ...: each member of the set, at the scenario's own speed."""
    car = {name: value * change for (name, value), change in zip(CAR.items(), changes, strict=True)}
    try:
        scenario = LaneKeepScenario.from_keywords(vehicle=car, randomisation=drawn, speed=speed)
    except ValueError as error:
        assert "is not allowed" in str(error) and "\n" not in str(error)
        return
    ranges = scenario.randomisation
    mass, front, rear, shift = (
        low + (high - low) * place
        for (low, high), place in zip(
            (ranges.mass, ranges.front_cornering_stiffness, ranges.rear_cornering_stiffness, ranges.cg_shift),
            places,
            strict=True,
        )
    )
    member = (
        car["mass"] * mass,
        car["yaw_inertia"] * mass,
        car["cg_to_front_axle"] - shift,
        car["cg_to_rear_axle"] + shift,
        car["front_cornering_stiffness"] * front,
        car["rear_cornering_stiffness"] * rear,
    )
    v = speed * ranges.speed[0]
    for mode in np.linalg.eigvals(matrix(member, v, scenario.integration.slip_speed_floor)):
        if mode.real <= 0.0:
            assert amplification(mode * scenario.integration.step) <= 1.0


def test_the_largest_eigenvalue_is_that_of_the_matrix():
    """Closed form against LAPACK, for the nominal car at one speed."""
    vehicle = lanekeep_env.VEHICLES["commonroad-1"]
    cars = Cars.drawn(vehicle, lanekeep_env.Randomisation())
    values = (cars.mass, cars.yaw_inertia, cars.front, cars.rear, cars.front_stiffness, cars.rear_stiffness)
    for v in (0.3, 1.0, 4.0, 30.0):
        eigenvalues = np.linalg.eigvals(matrix([value[0] for value in values], v, 1.0))
        assert cars.largest_eigenvalue(v, v, 1.0) == pytest.approx(np.abs(eigenvalues).max(), rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": 1.7}, ["vehicle.mass=1.7", ">= ", "kg", "given in t?", "1700 kg"]),
        ({"yaw_inertia": 2.7}, ["vehicle.yaw_inertia=2.7", "kg m²", "t m²", "2700 kg m²"]),
        ({"yaw_inertia": 1e-6}, ["vehicle.yaw_inertia", ">= "]),
        ({"cg_to_front_axle": 1300.0}, ["vehicle.cg_to_front_axle", "<= 100.0 m"]),
        ({"mass": 1.7, "yaw_inertia": 2.7}, ["vehicle.mass=1.7 and vehicle.yaw_inertia=2.7", "t and t m²", "1700 kg"]),
        ({"mass": 1.7e6}, ["vehicle.mass", "<= 1000000.0 kg"]),
        (
            {"front_cornering_stiffness": 6.2e7, "rear_cornering_stiffness": 1.1e8},
            ["front_cornering_stiffness", "mN/rad", "<= "],
        ),
    ],
)
def test_a_wrong_unit_is_named(changes, words):
    with pytest.raises(ValueError) as caught:
        gym.make("lanekeep/LaneKeep-v0", vehicle={**CAR, **changes})
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_model_car_on_the_tyres_of_a_full_size_one_is_refused():
    tyres = {"front_cornering_stiffness": 61850.0, "rear_cornering_stiffness": 107665.0}
    with pytest.raises(ValueError, match=r"vehicle.*is not allowed.*too fast to be integrated"):
        WallFollowScenario.from_keywords(dynamics="dynamic", vehicle={"base": "knightriders", **tyres})


def test_a_centre_of_gravity_beyond_an_axle_is_refused():
    with pytest.raises(ValueError, match=r"randomisation.cg_shift=.*between the axles"):
        LaneKeepScenario.from_keywords(vehicle="pses", randomisation={"cg_shift": [-0.5, 0.5]})


def test_a_wheelbase_that_turns_in_no_time_is_refused():
    car = {"cg_to_front_axle": 0.001, "cg_to_rear_axle": 0.001}
    with pytest.raises(ValueError, match=r"wheelbase of 0.002 m is not allowed: .* >= "):
        LaneKeepScenario.from_keywords(dynamics="kinematic", vehicle=car)


def test_shorter_steps_are_taken_where_they_are_needed_only():
    """Slow and stiff cars that differ; the hash tells, and no other scenario's has changed."""
    slow = LaneKeepScenario.from_keywords(vehicle="commonroad-1", randomisation="stress", speed=1.0)
    assert slow.integration.step == 0.005 and slow.integration.slip_speed_floor == 1.0
    fast = LaneKeepScenario.from_keywords(vehicle="commonroad-1", randomisation="stress", speed=20.0)
    assert fast.integration.step == 0.01
    for name in lanekeep_env.VEHICLES:
        assert LaneKeepScenario.from_keywords(vehicle=name).integration.step == 0.01
    assert "integration" in slow._fingerprint() and "integration" not in fast._fingerprint()


def test_a_speed_beyond_the_largest_is_refused():
    with pytest.raises(ValueError, match=r"randomisation.speed=.*100 m/s; it must be <= 2"):
        LaneKeepScenario.from_keywords(randomisation={"speed": [1.0, 3.0]})


@pytest.mark.parametrize(
    ("changes", "unit"),
    [
        ({"front_cornering_stiffness": 1079.5, "rear_cornering_stiffness": 1879.1}, "N/deg"),
        ({"front_cornering_stiffness": 61.85, "rear_cornering_stiffness": 107.665}, "kN/rad"),
        ({"yaw_inertia": 2.7e6}, "g m²"),
    ],
)
def test_a_unit_that_could_be_driven_is_warned_of(changes, unit):
    with pytest.warns(UserWarning, match=unit):
        LaneKeepScenario.from_keywords(vehicle={**CAR, **changes})


def test_no_shipped_car_is_warned_of(recwarn):
    for name in lanekeep_env.VEHICLES:
        for drawn in lanekeep_env.RANDOMISATIONS:
            LaneKeepScenario.from_keywords(vehicle=name, randomisation=drawn)
    assert not recwarn.list


@pytest.mark.parametrize(
    "keywords",
    [
        {"randomisation": "stress", "road": "slalom"},
        {"randomisation": "stress", "tyre": "magic_formula", "friction": 0.4},
        {"speed": {"maximum": 30.0, "minimum": 2.0}, "road": "yin", "randomisation": {"speed": [0.5, 0.9]}},
    ],
)
def test_no_episode_is_slower_than_what_is_judged(keywords):
    envs = gym.make_vec("lanekeep/LaneKeep-v0", 256, "vector_entry_point", departure="off", **keywords)
    slowest = envs.unwrapped.scenario._slowest()
    _, info = envs.reset(seed=0)
    for _ in range(100):
        assert info["speed"].min() >= slowest * (1.0 - 1e-9)
        info = envs.step(np.zeros((256, 1), np.float32))[4]
    assert info["speed"].min() < 3.0 * slowest


def test_set_speeds_change_at_control_steps():
    for scenario in (WallFollowScenario, lanekeep_env.ReversePathScenario, lanekeep_env.CameraLaneScenario):
        with pytest.raises(ValueError, match=r"speed.hold=1e-06 is not allowed: .* multiple of the control step"):
            scenario.from_keywords(speed={"maximum": 2.0, "hold": 1e-6})


def test_speeds_stay_inside_what_is_observed():
    for scenario in (WallFollowScenario, lanekeep_env.ReversePathScenario):
        with pytest.raises(ValueError, match=r"speed .*30.0 is not allowed: .*<= 20"):
            scenario.from_keywords(speed=30.0)
