"""`lanekeep/Traffic-v0`: others who drive as highway-env's do, contacts that are judged, and nothing from outside."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env import Termination
from lanekeep_env import layout as at
from lanekeep_env.traffic.touch import touches

TRAFFIC = "lanekeep/Traffic-v0"
STEP = 0.02


def make(count=None, **keywords):
    if count is None:
        return gym.make(TRAFFIC, **keywords)
    return gym.make_vec(TRAFFIC, count, "vector_entry_point", autoreset_mode="disabled", **keywords)


def episode(seed, meddle=lambda: None):
    env = make(flow={"situation": "cut_in", "cars": 12})
    observation, _ = env.reset(seed=seed)
    shown, rng = [observation.tobytes()], np.random.default_rng(seed)
    for _ in range(150):
        meddle()
        observation, reward, *_, info = env.step(rng.uniform(-0.02, 0.02, 2).astype(np.float32))
        shown.append(observation.tobytes() + np.float64(reward).tobytes() + repr(info).encode())
    return shown


def test_a_seed_is_an_episode_whatever_the_global_state_of_others():
    highway = pytest.importorskip("highway_env")
    gym.register_envs(highway)
    other = gym.make("highway-fast-v0")
    other.reset(seed=3)

    def meddle():
        np.random.seed(1)  # noqa: NPY002
        np.random.random(7)  # noqa: NPY002
        other.unwrapped.road.np_random.random()
        highway.vehicle.behavior.IDMVehicle.TIME_WANTED = 0.3

    wanted = highway.vehicle.behavior.IDMVehicle.TIME_WANTED
    try:
        assert episode(5) == episode(5, meddle)
    finally:
        highway.vehicle.behavior.IDMVehicle.TIME_WANTED = wanted
    assert episode(5) != episode(6)


def test_the_others_drive_as_highway_env_s_around_the_same_car():
    """Its cars are put where ours start, and see our car where it is."""
    assert sum(changes_beside_highway_env_s(seed) for seed in range(3)) > 0


def changes_beside_highway_env_s(seed):
    """Steps of an episode of 20 s in which some of the others change lanes, all of them where highway-env's are."""
    road_ = pytest.importorskip("highway_env.road.road")
    behavior = pytest.importorskip("highway_env.vehicle.behavior")
    env = make(1, road="straight", flow={"cars": 14, "spacing": 25.0}, departure="off", episode_steps=1000)
    env.reset(seed=seed)
    cars = env.unwrapped._core.traffic[0]
    network = road_.RoadNetwork.straight_road_network(3, start=-1000.0, length=10_000.0, speed_limit=None)
    road = road_.Road(network=network)
    for j in range(cars.shape[1]):
        kind = Ours if j == 0 else behavior.IDMVehicle
        place = cars[[at.T_X, at.T_Y], j]
        car = kind(road, place, cars[at.T_HEADING, j], cars[at.T_SPEED, j], target_speed=cars[at.T_WISH, j])
        car.timer, car.DELTA, car.collidable = cars[at.T_TIMER, j], cars[at.T_EXPONENT, j], j > 0
        road.vehicles.append(car)
    rng, changes = np.random.default_rng(seed), 0
    for _ in range(1000):
        road.act()
        road.step(STEP)
        # Gently on, so that others brake behind and pass.
        env.step(np.array([[0.0, 0.1 * rng.random()]], dtype=np.float32))
        ours = road.vehicles[0]
        ours.position, ours.heading, ours.speed = cars[[at.T_X, at.T_Y], 0], cars[at.T_HEADING, 0], cars[at.T_SPEED, 0]
        ours.on_state_update()
        lanes = [car.target_lane_index[2] for car in road.vehicles[1:]]
        np.testing.assert_array_equal(cars[at.T_TARGET, 1:], lanes)
        changes += int((cars[at.T_TARGET, 1:] != cars[at.T_LANE, 1:]).any())
        places = np.array([car.position for car in road.vehicles[1:]]).T
        np.testing.assert_allclose(cars[[at.T_X, at.T_Y], 1:], places, rtol=0, atol=1e-9)
    return changes


try:
    from highway_env import utils
    from highway_env.vehicle.controller import ControlledVehicle

    class Ours(ControlledVehicle):
        """A car that something else moves."""

        def act(self, action=None):
            self.target_lane_index = self.lane_index

        def step(self, dt):
            pass
except ModuleNotFoundError:
    utils = Ours = None


@pytest.mark.skipif(utils is None, reason="highway-env is not installed")
def test_bodies_touch_where_highway_env_s_polygons_intersect():
    rng, both = np.random.default_rng(0), [0, 0]
    for _ in range(4000):
        cars = np.zeros((at.T_ROWS, 2))
        cars[[at.T_X, at.T_Y], 1] = rng.uniform(-6.0, 6.0, 2)
        turned = rng.uniform(-math.pi, math.pi, 2)
        cars[at.T_COSINE], cars[at.T_SINE] = np.cos(turned), np.sin(turned)
        corners = [
            utils.rect_corners(cars[[at.T_X, at.T_Y], j], length, width, turned[j])
            for j, (length, width) in enumerate(((4.4, 1.8), (5.0, 2.0)))
        ]
        closed = [np.vstack([each, each[:1]]) for each in corners]
        wanted, _, _ = utils.are_polygons_intersecting(*closed, np.zeros(2), np.zeros(2))
        assert touches(1, 2.2, 0.9, cars) == wanted
        both[wanted] += 1
    assert min(both) > 800


def test_channels_show_the_cars_around():
    env = make(32, flow={"cars": 20, "spacing": 30.0})
    observation, _ = env.reset(seed=1)
    scenario, core, rng = env.unwrapped.scenario, env.unwrapped._core, np.random.default_rng(0)
    for _ in range(60):
        observation, *_ = env.step(rng.uniform(-0.05, 0.05, (32, 2)).astype(np.float32))
    seen = {c.name: observation[:, k].astype(float) for k, c in enumerate(scenario.channels)}
    for i, cars in enumerate(core.traffic):
        x = cars[at.T_X, 1:] - cars[at.T_X, 0]
        for side, name in ((-1, "right"), (0, "own"), (1, "left")):
            lane = seen["lane"][i] + side
            there = np.abs(cars[at.T_Y, 1:] - lane * scenario.lane_width) <= scenario.lane_width / 2 + 1.0
            there &= (np.abs(x) < at.FAR) & (0 <= lane < scenario.lanes)
            for way, which in (("ahead", x >= 0.0), ("behind", x < 0.0)):
                found = np.flatnonzero(there & which)
                shown = [seen[f"{way}_{name}_{what}"][i] for what in ("distance", "speed", "lane")]
                if not len(found):
                    assert shown == [at.FAR if way == "ahead" else -at.FAR, 0.0, side]
                    continue
                j = 1 + found[np.argmin(np.abs(x[found]))]
                along = cars[at.T_SPEED, j] * math.cos(cars[at.T_HEADING, j])
                across = cars[at.T_Y, j] / scenario.lane_width - seen["lane"][i]
                assert shown == pytest.approx([x[j - 1], along, across], abs=1e-4)


def driven(situation, count, pedal, steps=600, **keywords):
    """What becomes of cars that go straight on with a pedal: terminations, avoidable contacts, the last rewards."""
    env = make(count, road="straight", flow=situation, **keywords)
    env.reset(seed=2, options={"heading_error": 0.0})
    found, avoidable, paid = np.zeros(count, int), np.zeros(count), np.zeros(count)
    alive = np.ones(count, bool)
    for _ in range(steps):
        _, reward, terminated, _, info = env.step(np.tile(np.float32([0.0, pedal]), (count, 1)))
        new = alive & terminated
        found[new], paid[new] = info["termination"][new], reward[new]
        avoidable[new] = info["avoidable_contact"][new] + info["avoidable_overrun"][new]
        alive &= ~terminated
    return found, avoidable, paid, env


def test_who_does_not_brake_behind_a_car_that_does_could_have():
    found, avoidable, paid, env = driven("braking_lead", 40, 0.3)
    met = found == Termination.CONTACT
    assert met.mean() > 0.8 and avoidable[met].all()
    # The cap for the rest of the episode: worse than anything that goes on.
    scenario = env.unwrapped.scenario
    rest = scenario.cost_cap * scenario.control_step * (scenario.episode_steps - 600)
    assert (paid[met] < -rest).all()


def test_a_lane_ends_where_it_says_and_who_brakes_stops_before():
    found, avoidable, _, _ = driven("merging", 20, 0.2)
    assert (found == Termination.STOP_PASSED).all() and avoidable.all()
    found, *_ = driven("merging", 20, -0.6)
    assert (found == Termination.NONE).all()


def test_what_the_car_ahead_did_is_written_down_as_it_was():
    """The timeline that judges a contact gives the way of the car ahead, to the PERIOD that it is sampled with."""
    env = make(16, road="straight", flow={"situation": "braking_lead", "cars": 4})
    env.reset(seed=4, options={"heading_error": 0.0})
    core = env.unwrapped._core
    starts, steps = core.traffic[:, at.T_X, 1].copy(), 100
    for _ in range(steps):
        env.step(np.tile(np.float32([0.0, 0.0]), (16, 1)))
    checked = 0
    for i, timeline in enumerate(core.timelines):
        if core.cars[0, at.LEAD_NUMBER, i] != 1 or core.cars[0, at.LEAD_SIGHT, i] != -1:
            continue
        speed = target = timeline[1, at.E_SECOND]
        rate, way, event = 0.0, 0.0, 2
        for k in range(steps):
            if timeline[event, at.E_TIME] <= k * STEP + 1e-6:
                target, rate, event = timeline[event, at.E_FIRST], timeline[event, at.E_SECOND], event + 1
            after = speed + np.clip(target - speed, -rate * STEP, rate * STEP)
            way, speed = way + 0.5 * (speed + after) * STEP, after
        assert way == pytest.approx(core.traffic[i, at.T_X, 1] - starts[i], abs=0.15)
        checked += 1
    assert checked > 8


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"lanes": 0}, ["lanes=0", ">= 1"]),
        ({"lanes": 1, "flow": "merging"}, ["lanes=1", "merging", "2 at least"]),
        ({"lane_width": 2.0}, ["lane_width=2.0", ">= 2.5"]),
        ({"flow": "rush hour"}, ["flow.situation", "rush hour", "braking_lead"]),
        ({"flow": 3}, ["flow=3", "braking_lead"]),
        ({"flow": {"cars": 500}}, ["flow.cars=500", "<= 200"]),
        ({"flow": {"carz": 5}}, ["carz", "cars"]),
        ({"flow": {"speeds": (20, 10)}}, ["flow.speeds", "low <= high"]),
        ({"set_speed": 80.0}, ["set_speed=80.0", "<= 45.0 m/s"]),
    ],
)
def test_what_is_not_allowed_is_said_in_a_line(keywords, words):
    with pytest.raises(ValueError) as error:
        make(**keywords)
    assert "\n" not in str(error.value) and all(word in str(error.value) for word in words)
