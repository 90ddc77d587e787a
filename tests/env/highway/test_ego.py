"""Our cars in highway-env's worlds: closed forms, the kernels' own cars, signs, and its environments' checks."""

import re
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordVideo
from highway_env.vehicle.kinematics import Vehicle

import lanekeep_baselines
import lanekeep_env
from lanekeep_env.adapters.highway import EgoVehicle, HighwayScenario
from lanekeep_env.adapters.highway.action import plant_of
from lanekeep_env.physics.parameters import GRAVITY
from lanekeep_env.physics.vehicles import vehicle_from

STEP = 0.05
WORLDS = ("highway-v0", "merge-v0", "roundabout-v0", "racetrack-v0", "lane-keeping-v0")
EGO = {"type": "LanekeepAction", "longitudinal": False}


def ego(speed, step=STEP, **car):
    """A car of ours without a road."""
    return EgoVehicle.of(plant_of(car, step))(None, [0.0, 0.0], 0.0, speed)


def drive(car, steering, acceleration=0.0, steps=100):
    for _ in range(steps):
        car.act({"steering": steering, "acceleration": acceleration})
        car.step(STEP)
    return car


# --- dynamics


@pytest.mark.parametrize("steering", (0.2, -0.35))
def test_a_rolling_car_drives_the_circle_that_its_wheels_point_along(steering):
    """Rear axle's radius l / tan(delta); the centre of gravity stays at its distance from the turning point."""
    vehicle = {"base": "yin", "steering": {"lag": 0.0}}
    car, lengths = ego(7.0, vehicle=vehicle, dynamics="kinematic"), vehicle_from(vehicle)
    radius = lengths.wheelbase / np.tan(steering)  # their y, and their turn, are to the right
    centre = np.array([-lengths.cg_to_rear_axle, radius])
    for k in range(1, 200):
        drive(car, steering, steps=1)
        assert np.hypot(*(car.position - centre)) == pytest.approx(np.hypot(*centre), abs=1e-8)
        turn = 7.0 / radius * k * STEP
        assert np.exp(1j * car.heading) == pytest.approx(np.exp(1j * turn), abs=1e-9)
        slip = np.arctan(lengths.cg_to_rear_axle / radius)
        direction = np.array([np.cos(turn + slip), np.sin(turn + slip)])
        assert car.velocity == pytest.approx(7.0 / np.cos(slip) * direction, abs=1e-8)


@pytest.mark.parametrize("friction", (1.0, 0.4))
def test_no_tyre_gives_more_than_friction_times_gravity(friction):
    car, most = ego(20.0, friction=friction), 0.0
    for _ in range(100):
        before = car.velocity
        drive(car, 0.3, steps=1)
        most = max(most, np.hypot(*(car.velocity - before)) / STEP)
        assert abs(car.derivative[4, 0] + car.speed * car.yaw_rate) < 1.02 * friction * GRAVITY
    assert 0.8 * friction * GRAVITY < most <= friction * GRAVITY * 1.001
    faster = drive(ego(10.0, friction=friction), 0.0, 50.0, 1)
    assert faster.speed == pytest.approx(10.0 + friction * GRAVITY * STEP)


@pytest.mark.parametrize("dynamics", ("dynamic", "kinematic"))
def test_the_car_is_that_of_our_environments(dynamics):
    """The same commands through lag, rate limit and delay on a straight of `lanekeep/LaneKeep-v0`: places to 1e-9 m."""
    vehicle = {"base": "yin", "steering": {"delay": 0.07, "rate_limit": 0.5, "angle_limit": 0.5}}
    tyre = {"tyre": "magic_formula", "friction": 0.7} if dynamics == "dynamic" else {}
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        vehicle=vehicle,
        dynamics=dynamics,
        road="straight",
        speed=18.0,
        departure="off",
        max_steering_angle=0.3,
        **tyre,
    )
    start = {"lateral_error": 0.0, "heading_error": 0.0, "arc_length": 0.0}
    env.reset(seed=0, options=start)
    car = ego(18.0, vehicle=vehicle, dynamics=dynamics, friction=tyre.get("friction", 1.0))
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, 60):
        *_, info = env.step(np.array([action], dtype=np.float32))
        drive(car, -0.3 * float(np.float32(action)), steps=1)
        assert car.position == pytest.approx([info["arc_length"], -info["lateral_error"]], abs=1e-9)
        assert car.heading == pytest.approx(-info["heading_error"], abs=1e-10)


def test_it_brakes_to_a_standstill_and_stays_there():
    car = drive(ego(5.0), 0.1, -4.0)
    place = car.position.copy()
    assert car.speed == 0.0 and (drive(car, 0.1, -4.0).position == place).all()


def test_to_the_other_side_it_drives_the_mirrored_course_to_the_last_bit():
    left, right = drive(ego(15.0), -0.1), drive(ego(15.0), 0.1)
    assert (left.position == right.position * [1.0, -1.0]).all() and left.heading == -right.heading


def test_derivatives_are_those_of_the_state():
    car = drive(ego(15.0), 0.1, 1.0, 7)
    state, rate = car.state, car.derivative
    # The first step of the lag is over; a thousandth of a second of the same car.
    short = ego(15.0, step=0.001)
    short.car[:] = car.car
    short.position, short.heading, short.speed, short.action = car.position, car.heading, car.speed, car.action
    short.step(0.001)
    assert (short.state - state) / 0.001 == pytest.approx(rate, abs=0.02)


def test_the_body_stands_between_the_axles():
    car, vehicle = ego(0.0), vehicle_from("yin")
    rear, front = car.polygon()[:, 0].min(), car.polygon()[:, 0].max()
    assert front - rear == pytest.approx(vehicle.length)
    assert front - vehicle.cg_to_front_axle == pytest.approx(-vehicle.cg_to_rear_axle - rear)


# --- their worlds


def made(world, **config):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return gym.make(world, config=config, disable_env_checker=True)


def complaints(env):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        check_env(env.unwrapped, skip_render_check=True)
    return {str(one.message) for one in told}


@pytest.mark.parametrize("world", WORLDS)
def test_their_worlds_pass_the_checks_with_our_car_as_they_do_without_it(world):
    theirs = {"type": "ContinuousAction", "longitudinal": False, "dynamical": world == "lane-keeping-v0"}
    assert complaints(made(world, action=EGO)) == complaints(made(world, action=theirs))
    assert not complaints(made(world, action=EGO, observation={"type": "LanekeepObservation"}))


@pytest.mark.parametrize("world", WORLDS)
def test_our_controllers_hold_our_car_in_their_lanes(world):
    """In the middle until the first bend is over, or somebody is in the way."""
    env = made(world, action={**EGO, "max_steering_angle": 0.7}, observation={"type": "LanekeepObservation"}, **FAST)
    policy = lanekeep_baselines.make("stanley", HighwayScenario.of(env.unwrapped))
    observation, _ = env.reset(seed=3)
    state, errors = None, []
    for _ in range(100):
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, _ = env.step(action)
        errors.append(abs(float(observation[0])))
        if terminated or truncated or env.unwrapped.vehicle.crashed:
            break
    assert len(errors) > 25 and env.unwrapped.vehicle.speed > 0.0
    if world == "lane-keeping-v0":  # 4 m off at its start, and where its lanes meet
        assert max(errors[20:30]) < 1.0
    else:
        assert max(errors[:-3]) < 1.5


FAST = {"policy_frequency": 15, "simulation_frequency": 15}


def test_actions_and_channels_have_our_signs():
    """Steering to the left raises yaw rate and lateral error, and drives to their negative y."""
    action = {**EGO, "vehicle": {"base": "yin", "steering": {"lag": 0.0}}}
    env = made("highway-v0", action=action, observation={"type": "LanekeepObservation"}, vehicles_count=0, **FAST)
    observation, _ = env.reset(seed=0)
    names = [channel.name for channel in HighwayScenario.of(env.unwrapped).channels]
    y, (before, *_) = env.unwrapped.vehicle.position[1], observation
    for _ in range(5):
        observation, *_ = env.step(np.array([0.1], dtype=np.float32))
    seen = dict(zip(names, observation, strict=True))
    assert env.unwrapped.vehicle.position[1] < y and seen["lateral_error"] > before
    assert seen["heading_error"] > 0.0 and seen["yaw_rate"] > 0.0
    assert seen["steering_angle"] == seen["steering_command"] == pytest.approx(0.1 * np.pi / 4)


def test_both_actions_are_steering_and_acceleration():
    env = made("highway-v0", action={"type": "LanekeepAction", "acceleration_range": [-6.0, 2.0]}, **FAST)
    env.reset(seed=0)
    env.step(np.array([0.0, 1.0], dtype=np.float32))
    assert env.unwrapped.vehicle.action == {"steering": 0.0, "acceleration": 2.0}
    assert HighwayScenario.of(env.unwrapped).num_actions == 2


def test_in_a_contact_both_are_told():
    env = made("highway-v0", action=EGO, **FAST)
    env.reset(seed=0)
    car = env.unwrapped.vehicle
    env.unwrapped.road.vehicles.append(Vehicle(env.unwrapped.road, car.position + np.array([8.0, 0.0])))
    crashed = False
    for _ in range(15):
        *_, crashed, _, _ = env.step(np.zeros(1, dtype=np.float32))
        if crashed:
            break
    assert crashed and car.crashed and env.unwrapped.road.vehicles[-1].crashed


def test_a_film_shows_our_car(tmp_path, monkeypatch):
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)  # "dummy" makes their viewer draw nothing
    env = gym.make("racetrack-v1", render_mode="rgb_array", config={"action": EGO, **FAST})
    env = RecordVideo(env, str(tmp_path), disable_logger=True)
    env.reset(seed=0)
    for _ in range(5):
        env.step(np.zeros(1, dtype=np.float32))
    picture = env.render()
    env.close()
    assert list(tmp_path.glob("*.mp4"))
    rows, columns = np.nonzero((picture == [200, 200, 0]).all(axis=2))
    car, scale = env.unwrapped.vehicle, env.unwrapped.config["scaling"]
    assert np.ptp(columns) == pytest.approx(car.LENGTH * scale, abs=4.0)  # its outline is black
    assert np.ptp(rows) == pytest.approx(car.WIDTH * scale, abs=4.0)


# --- what is refused


@pytest.mark.parametrize(
    ("config", "message"),
    (
        ({"action": {"type": "LanekeepAction", "vehicel": "yin"}}, "did you mean 'vehicle'"),
        ({"action": {"type": "LanekeepAction", "vehicle": "yinn"}}, "did you mean 'yin'"),
        ({"action": {"type": "LanekeepAction", "friction": -1.0}}, "friction=-1.0 is not allowed"),
        ({"action": {"type": "LanekeepAction", "friction": "wet"}}, "friction='wet' is not allowed"),
        ({"action": {"type": "LanekeepAction", "friction": 0.5, "dynamics": "kinematic"}}, "has no effect"),
        ({"action": {"type": "LanekeepAction", "max_steering_angle": [0.3]}}, r"max_steering_angle=\[0.3\]"),
        ({"action": {"type": "LanekeepAction", "acceleration_range": [3, -3]}}, "low <= high"),
        ({"action": {"type": "LanekeepAction", "acceleration_range": [1, 2, 3]}}, r"acceleration_range=\[1, 2, 3\]"),
        ({"action": {"type": "LanekeepAction", "lateral": "no"}}, "lateral='no' is not allowed"),
        ({"action": EGO, "vehicels_count": 3}, "did you mean 'vehicles_count'"),
        ({"observation": {"type": "LanekeepObservation"}}, "nothing is steered"),
        ({"action": EGO, "observation": {"type": "LanekeepObservation", "previw": 3}}, "did you mean 'preview'"),
    ),
)
def test_what_is_not_allowed_is_told_in_one_line(config, message):
    with pytest.raises(ValueError, match=message) as caught:
        made("highway-v0", **config)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("world", ("two-way-v0", "u-turn-v0", "merge-v1", "roundabout-v1"))
def test_worlds_whose_rewards_ask_for_another_action_are_refused_where_highway_env_would_trip(world):
    with pytest.raises((AttributeError, ValueError)) as theirs:
        made(world, action={"type": "ContinuousAction"})
    with pytest.raises(ValueError, match=r"(its reward|it) (reads|takes)") as ours:
        made(world, action={"type": "LanekeepAction"})
    assert "\n" not in str(ours.value) and str(theirs.value) != str(ours.value)


def test_a_u_turn_is_driven_by_our_channels():
    env = made("u-turn-v0", action=EGO, observation={"type": "LanekeepObservation"})
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(env.step(np.zeros(1, dtype=np.float32))[0])


def test_another_step_than_the_one_it_was_made_for_is_refused():
    with pytest.raises(ValueError, match=r"was made for 0\.05 s"):
        ego(5.0).step(0.1)


def test_nothing_else_of_the_package_knows_of_it():
    folder = Path(lanekeep_env.__file__).parent
    for file in folder.rglob("*.py"):
        if folder / "adapters" not in file.parents:
            imported = re.findall(r"^\s*(?:from|import) (\S+)", file.read_text("utf-8"), re.MULTILINE)
            assert not [name for name in imported if "highway" in name], file


def test_without_highway_env_an_import_says_what_to_install():
    code = "import sys; sys.modules['highway_env'] = None; import lanekeep_env.adapters.highway"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert told.stderr.splitlines()[-1] == (
        'ModuleNotFoundError: highway_env is missing: pip install "lanekeep[highway]"'
    )


def test_their_own_types_are_as_they_were():
    env = made("highway-v0")
    assert type(env.unwrapped.action_type).__module__ == "highway_env.envs.common.action"
    assert not isinstance(env.unwrapped.vehicle, EgoVehicle)
