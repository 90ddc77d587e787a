"""highway-env's tasks as the benchmark drives them: reward, road and car as they are."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from highway_env.vehicle.behavior import IDMVehicle

from lanekeep_env.adapters.highway import TASK, HighwayScenario
from lanekeep_env.adapters.highway.path import LaneChoice, curvature, foot
from lanekeep_env.adapters.highway.task import HighwayTask


def returned(env, actions, sign):
    env.reset(seed=4)
    rewards = []
    for action in actions:
        _, reward, terminated, truncated, _ = env.step(np.array([sign * action], dtype=np.float32))
        rewards.append(reward)
        if terminated or truncated:
            break
    return rewards


@pytest.mark.parametrize("world", ("lane-keeping-v0", "racetrack-v1"))
def test_rewards_are_those_of_their_environment_with_the_wheel_turned_the_other_way(world):
    actions = 0.1 * np.sin(np.arange(60) / 5.0)
    theirs = returned(gym.make(world, disable_env_checker=True).unwrapped, actions, 1.0)
    assert returned(HighwayTask(HighwayScenario(env=world)), actions, -1.0) == pytest.approx(theirs, abs=1e-7)


def test_straight_wheels_get_what_was_measured_by_others():
    task = HighwayTask(HighwayScenario())
    assert sum(returned(task, [0.0] * 200, 1.0)) == pytest.approx(-1412.0, abs=1.0)


def test_their_own_observation_is_a_step_late_and_noisy():
    exact, observed = HighwayTask(HighwayScenario()), HighwayTask(HighwayScenario(observation="theirs"))
    seen = []
    for task in (exact, observed):
        rows = [task.reset(seed=0)[0]]
        for _ in range(14):
            rows.append(task.step(np.array([0.05], dtype=np.float32))[0])
        seen.append(np.array(rows))
    true, shown = seen
    assert np.abs(shown[1:, 0] - true[:-1, 0]).max() <= 0.0501  # their noise is uniform within 0.05
    assert np.abs(shown[1:, :3] - true[1:, :3]).max() > 0.05
    assert (shown[:, 3:] == true[:, 3:]).all()


def test_errors_against_a_sine_are_distances():
    """Their lateral coordinate is measured along y; the nearest point is where the distance is smallest."""
    env = gym.make("lane-keeping-v0", disable_env_checker=True).unwrapped
    lane = env.road.network.get_lane(("a", "b", 0))
    s = np.linspace(0.0, 200.0, 200_001)
    middle = np.array([s, 5.0 * np.sin(2.0 * np.pi * s / 100.0)]).T
    for x in (20.0, 61.0, 118.0):
        place = np.array([x, 1.5 + 5.0 * np.sin(2.0 * np.pi * x / 100.0)])
        found, distance = foot(lane, place), np.hypot(*(middle - place).T)
        assert abs(found.lateral) == pytest.approx(distance.min(), abs=1e-6)
        assert found.lateral < 0.0  # to the right of it
        assert found.s == pytest.approx(s[np.argmin(distance)], abs=2e-3)
        bend = -np.sin(2.0 * np.pi * found.s / 100.0) * 5.0 * (2.0 * np.pi / 100.0) ** 2
        slope = 5.0 * 2.0 * np.pi / 100.0 * np.cos(2.0 * np.pi * found.s / 100.0)
        assert curvature(lane, found.s) == pytest.approx(-bend / (1.0 + slope**2) ** 1.5, abs=1e-6)


def test_their_mobil_goes_round_a_slower_car_and_not_into_one_beside():
    for beside in (False, True):
        env = gym.make("racetrack-v1", config={"other_vehicles": 0}, disable_env_checker=True).unwrapped
        env.reset(seed=0)
        vehicle = env.vehicle
        lane = vehicle.lane
        s, _ = lane.local_coordinates(vehicle.position)
        slow = IDMVehicle(env.road, lane.position(s + 12.0, 0.0), lane.heading_at(s), 1.0)
        env.road.vehicles.append(slow)
        other = (*vehicle.lane_index[:2], 1 - vehicle.lane_index[2])
        if beside:
            place = env.road.network.get_lane(other).position(s - 3.0, 0.0)
            env.road.vehicles.append(IDMVehicle(env.road, place, 0.0, 12.0))
        choice, count = LaneChoice(env, vehicle), len(env.road.vehicles)
        chosen = {choice(1.1) for _ in range(3)}
        assert (other in chosen) != beside
        assert len(env.road.vehicles) == count


def test_a_task_passes_gymnasiums_checks_and_is_made_by_its_name():
    env = gym.make(f"lanekeep_env.adapters.highway:{TASK}", env="lane-keeping-v0", episode_steps=20)
    assert env.unwrapped.scenario == HighwayScenario(episode_steps=20)
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("mode", ("next_step", "same_step"))
def test_cars_of_a_vector_are_single_ones(mode):
    cars = gym.make_vec(TASK, 3, vectorization_mode="vector_entry_point", autoreset_mode=mode, env="racetrack-v1")
    seen, _ = cars.reset(seed=[5, 6, 7])
    single = HighwayTask(cars.unwrapped.scenario)
    wanted, _ = single.reset(seed=6)
    assert (seen[1] == wanted).all()
    for _ in range(10):
        seen, rewards, terminated, *_, info = cars.step(np.full((3, 1), 0.02, dtype=np.float32))
        wanted, reward, failed, _, told = single.step(np.full(1, 0.02, dtype=np.float32))
        assert (seen[1] == wanted).all() and rewards[1] == reward and terminated[1] == failed
        assert info["lateral_error"][1] == told["lateral_error"]


@pytest.mark.parametrize(
    ("keywords", "message"),
    (
        ({"env": "lane-keping-v0"}, "did you mean 'lane-keeping-v0'"),
        ({"env": "highway-v0"}, "nothing is steered"),
        ({"env": "racetrack-v1", "observation": "theirs"}, "is not allowed with env='racetrack-v1'"),
        ({"control_step": 0.07}, "it is theirs, 0.1 s"),
        ({"sensors": "poor"}, "sensors"),
        ({"config": {"action": {"type": "ContinuousAction", "steering_range": [0.0, 1.0]}}}, "must be symmetric"),
        ({"config": 3}, "config=3 is not allowed"),
        ({"config": {"policy_freqency": 5}}, "did you mean 'policy_frequency'"),
        ({"config": {"action": {}}}, "action type None"),
        ({"config": {"action": {"type": "ContinuousAction", "lateral": False}}}, "nothing is steered"),
        ({"config": {"action": {"type": "LanekeepAction", "vehicel": "yin"}}}, "did you mean 'vehicle'"),
        ({"config": {"policy_frequency": "often"}}, "policy_frequency='often' is not allowed"),
        ({"config": {"policy_frequency": 7}}, "it must divide it"),
        ({"config": {"policy_frequency": 30}}, "it must divide it"),
    ),
)
def test_what_is_not_allowed_is_told_in_one_line(keywords, message):
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        HighwayScenario.from_keywords(**keywords)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("world", ("lane-keeping-v0", "racetrack-v1"))
def test_pictures_are_theirs(world, monkeypatch):
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)  # "dummy" makes their viewer draw nothing
    task = gym.make(TASK, render_mode="rgb_array", env=world)
    task.reset(seed=0)
    size = task.unwrapped._env.config["screen_width"], task.unwrapped._env.config["screen_height"]
    picture = task.render()
    task.close()
    assert picture.dtype == np.uint8 and picture.shape == (size[1], size[0], 3) and np.ptp(picture) > 0
    with pytest.raises(ValueError, match="render_mode='ansi' is unknown"):
        gym.make(TASK, render_mode="ansi")


def test_a_scenario_comes_back_from_json():
    scenario = HighwayScenario(env="racetrack-v1", config={"other_vehicles": 2}, preview=5)
    again = HighwayScenario.from_keywords(**scenario.to_dict())
    assert again == scenario and again.hash == scenario.hash != HighwayScenario(env="racetrack-v1").hash
