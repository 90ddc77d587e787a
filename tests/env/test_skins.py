"""One kernel, two skins: cars of a vector environment are the single environments, to the last bit."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st

import lanekeep_env  # noqa: F401

pytestmark = pytest.mark.long
ID = "lanekeep/LaneKeep-v0"
CAMERA, TURN_OFF = "lanekeep/CameraLane-v0", "lanekeep/TurnOff-v0"
WALL, CIRCUIT = "lanekeep/WallFollow-v0", "lanekeep/Circuit-v0"
EVASIVE, REVERSE, DRIVE = "lanekeep/Evasive-v0", "lanekeep/ReversePath-v0", "lanekeep/Drive-v0"
TRAFFIC = "lanekeep/Traffic-v0"
CLOSE = [(0, "speed", 8), (0.2, "lead", 3, 4.0), (0.9, "lead_gone"), (1.0, "stop", 12.0), (1.1, "stop_gone")]
NARROW = {"kind": "random-circuits", "count": 5, "widest": 1.5, "glass_share": 0.3}
FAULTY_SCAN = {"beams": 23, "noise": 0.01, "missing_every": 7, "missing_rim": 1, "jump_errors": 0.5, "period": 0.09}
YARD = {"kind": "yard", "count": 8}
VARIANTS = [
    (ID, {}),
    (ID, {"dynamics": "kinematic", "action": "steering_rate"}),
    (ID, {"tyre": "magic_formula", "observation": "full", "preview": 3}),
    (ID, {"vehicle": {"steering": {"lag": 0.1, "delay": 0.07, "rate_limit": 0.3}}, "departure": "cost"}),
    (ID, {"tyre": "magic_formula", "randomisation": "stress", "sensors": "poor", "observation": "full", "preview": 2}),
    (ID, {"vehicle": {"steering": {"lag": 0.1, "backlash": 0.02}}, "observation": "full"}),
    (CAMERA, {"road": YARD, "speed": {"hold": 1.0}}),
    (CAMERA, {"road": YARD, "action": "steering_rate", "sensors": "production", "observation": "full", "plan": 3}),
    (CAMERA, {"road": YARD, "randomisation": "stress", "sensors": "poor", "camera": {"edge": "left"}, "plan": 0}),
    (CAMERA, {"vehicle": {"base": "van", "steering": {"lag": 0.2, "delay": 0.05}}, "departure": "cost"}),
    (TURN_OFF, {"sensors": "production"}),
    (WALL, {"servo": {"left": 0.35, "ticks": 50}, "start_heading_error": 0.6}),
    (WALL, {"world": NARROW, "sensors": "poor", "scan": FAULTY_SCAN, "encoder_ticks": 8}),
    (WALL, {"dynamics": "dynamic", "randomisation": "stress", "action": "steering_rate", "speed": {"hold": 0.9}}),
    (WALL, {"vehicle": {"base": "knightriders", "steering": {"lag": 0.05, "delay": 0.07}}, "contact": "cost"}),
    (CIRCUIT, {"world": NARROW, "sensors": "production", "scan": "kinect", "encoder_ticks": 40}),
    (CIRCUIT, {"world": NARROW, "dynamics": "dynamic", "randomisation": "stress", "observation": "full"}),
    (EVASIVE, {"friction": 0.4, "randomisation": "stress", "sensors": "poor"}),
    (REVERSE, {"speed": {"minimum": 0.5, "maximum": 3.0, "hold": 0.4, "standstill": 0.3}, "observation": "full"}),
    (REVERSE, {"randomisation": "stress", "sensors": "poor", "action": "steering_rate"}),
    (DRIVE, {}),
    (DRIVE, {"traffic": CLOSE, "randomisation": "stress", "sensors": "poor", "observation": "full", "preview": 2}),
    (DRIVE, {"traffic": CLOSE, "departure": "cost", "vehicle": {"steering": {"lag": 0.1, "delay": 0.07}}}),
    (TRAFFIC, {"flow": {"cars": 9, "spacing": 25.0}, "departure": "cost"}),
    (TRAFFIC, {"flow": "cut_in", "randomisation": "stress", "sensors": "poor", "lanes": 2}),
]
#: Ids whose vector form is compared over numbers of cars and threads.
MANY = [(ID, {}), (CAMERA, {"road": YARD, "sensors": "poor", "speed": {"hold": 0.4}})]
MANY += [(CIRCUIT, {"world": NARROW, "sensors": "poor", "scan": FAULTY_SCAN, "encoder_ticks": 8})]
MANY += [(DRIVE, {"traffic": CLOSE, "randomisation": "stress", "sensors": "poor"})]
MANY += [(TRAFFIC, {"flow": {"cars": 6, "spacing": 20.0, "situation": "braking_lead"}, "randomisation": "stress"})]


def gentle(rng, steps, env, spread=0.15):
    """Actions that keep some cars on the road and lose others; a second one asks for speed."""
    actions = rng.normal(0, spread, (steps, *env.action_space.shape))
    actions[..., 1:] += 0.7
    return np.clip(actions, -1, 1).astype(np.float32)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_gymnasiums_names_of_modes_are_taken(mode):
    cars = gym.make_vec("lanekeep/LaneKeep-v0", 2, autoreset_mode=mode)
    assert cars.metadata["autoreset_mode"] is mode


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
@pytest.mark.parametrize(("name", "keywords"), VARIANTS)
def test_cars_equal_single_environments_bitwise(name, keywords, mode):
    cars, steps, seed = 21, 150, 1234
    make = {"max_episode_steps": 60, **keywords}
    vector = gym.make_vec(name, cars, "vector_entry_point", autoreset_mode=mode, **make)
    singles = [gym.make(name, **make) for _ in range(cars)]
    observation, infos = vector.reset(seed=seed)
    for i, env in enumerate(singles):
        alone, info = env.reset(seed=seed + i)
        np.testing.assert_array_equal(observation[i], alone)
        assert {k: infos[k][i] for k in info} == info
    over = np.zeros(cars, dtype=bool)
    ended = 0
    for actions in gentle(np.random.default_rng(7), steps, vector):
        observation, rewards, terminated, truncated, infos = vector.step(actions)
        for i, env in enumerate(singles):
            if mode == "next_step" and over[i]:
                alone, info = env.reset()
                reward, dead, late = 0.0, False, False
            else:
                alone, reward, dead, late, info = env.step(actions[i])
            if mode == "same_step" and (dead or late):
                np.testing.assert_array_equal(infos["final_obs"][i], alone)
                assert {k: infos["final_info"][k][i] for k in info} == info
                alone, info = env.reset()
            np.testing.assert_array_equal(observation[i], alone)
            assert (rewards[i], terminated[i], truncated[i]) == (reward, dead, late)
            assert {k: infos[k][i] for k in info} == info
            over[i] = dead or late
            ended += over[i]
    assert ended > cars


@pytest.mark.parametrize(
    ("name", "keywords", "dtypes"),
    # Of a family one, the other between walls in one precision; each takes five seconds to compile, and for threads.
    [
        (*MANY[0], ("float64", "float32")),
        (*MANY[2], ("float64",)),
        *(pytest.param(*one, ("float64", "float32"), marks=pytest.mark.slow) for one in MANY[1:]),
    ],
)
@settings(max_examples=20, deadline=None)
@given(cars=st.integers(1, 600), seed=st.integers(0, 2**31), threads=st.sampled_from([1, 2]))
def test_a_car_does_not_depend_on_the_number_of_cars_or_threads(name, keywords, dtypes, cars, seed, threads):
    """SIMD bodies, remainders and blocks give the same bits; float32 too."""
    for dtype in dtypes:
        many = gym.make_vec(name, cars, "vector_entry_point", dtype=dtype, num_threads=threads, **keywords)
        few = gym.make_vec(name, 2, "vector_entry_point", dtype=dtype, **keywords)
        many.reset(seed=seed)
        few.reset(seed=[seed, seed + cars - 1])
        for actions in gentle(np.random.default_rng(seed), 40, many):
            wide = many.step(actions)
            narrow = few.step(actions[[0, cars - 1]])
            for a, b in zip(wide[:4], narrow[:4], strict=True):
                np.testing.assert_array_equal(a[[0, cars - 1]], b)


@pytest.mark.parametrize("name", [ID, TURN_OFF, WALL, CIRCUIT, EVASIVE, REVERSE, DRIVE])
@pytest.mark.parametrize("steps", [1, 7, 45])
def test_truncation_is_the_same_in_all_skins(steps, name):
    keywords = {"contact" if name in (WALL, CIRCUIT) else "departure": "off", "max_episode_steps": steps}
    single = gym.make(name, **keywords)
    sync = gym.make_vec(name, 2, "sync", **keywords)
    vector = gym.make_vec(name, 2, "vector_entry_point", **keywords)
    single.reset(seed=0), sync.reset(seed=0), vector.reset(seed=0)
    for k in range(1, steps + 1):
        action = np.zeros(single.action_space.shape, np.float32)
        flags = [
            single.step(action)[3],
            *sync.step(np.stack([action, action]))[3],
            *vector.step(np.stack([action, action]))[3],
        ]
        assert flags == [k == steps] * 5


@pytest.mark.parametrize("steps", [100, 600])
def test_departure_charges_the_rest_of_the_episode_in_both_skins(steps):
    rewards = []
    for env in (gym.make(ID, episode_steps=steps), gym.make_vec(ID, 1, "vector_entry_point", episode_steps=steps)):
        env.reset(seed=3)
        total, done, count = 0.0, False, 0
        while not done:
            _, reward, dead, late, _ = env.step(np.full(env.action_space.shape, 1.0, np.float32))
            done, count = bool(np.all(dead)) or bool(np.all(late)), count + 1
            last = float(np.asarray(reward).item())
            total += last
        rewards.append(total)
        assert last == pytest.approx(-16.0 * 0.05 * (steps - count + 1), rel=1e-12)
    assert rewards[0] == rewards[1]


@pytest.mark.parametrize(
    ("keywords", "steps"),
    [
        ({"episode_steps": 80}, 80),
        ({"episode_steps": 80, "max_episode_steps": 50}, 50),
        ({"episode_steps": 700, "max_episode_steps": 700}, 700),
        ({"max_episode_steps": -1}, 600),
    ],
)
def test_an_episode_ends_at_its_own_length_or_the_shorter_limit(keywords, steps):
    """One number rules charge and truncation; Gymnasium's limit can shorten an episode, never make leaving cheap."""
    for env in (
        gym.make(ID, departure="off", **keywords),
        gym.make_vec(ID, 1, "vector_entry_point", departure="off", **keywords),
    ):
        env.reset(seed=0)
        action = np.zeros(env.action_space.shape, np.float32)
        ends = [bool(np.all(env.step(action)[3])) for _ in range(steps)]
        assert ends == [False] * (steps - 1) + [True]


@pytest.mark.parametrize("name", [ID, CAMERA, WALL, CIRCUIT, EVASIVE, REVERSE, DRIVE])
def test_reset_mask_restarts_only_the_chosen_cars(name):
    vector = gym.make_vec(name, 5, "vector_entry_point", autoreset_mode="disabled")
    reference = gym.make_vec(name, 5, "vector_entry_point", autoreset_mode="disabled")
    rng = np.random.default_rng(0)
    for env in (vector, reference):
        env.reset(seed=2)
    for actions in gentle(rng, 10, vector):
        kept = reference.step(actions)[0]
        vector.step(actions)
    mask = np.array([True, False, False, True, False])
    observation, _ = vector.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(observation[~mask], kept[~mask])
    assert (observation[mask] != kept[mask]).any(axis=1).all()
    actions = gentle(rng, 1, vector)[0]
    np.testing.assert_array_equal(vector.step(actions)[0][~mask], reference.step(actions)[0][~mask])


@pytest.mark.parametrize("name", [ID, CAMERA, TURN_OFF, WALL, CIRCUIT, EVASIVE, REVERSE, DRIVE])
def test_episodes_of_one_seed_are_the_same_whatever_was_done_before(name):
    """The third episode of a seed does not depend on how the first two were driven."""
    starts = []
    for policy in (0.0, 0.9):
        env = gym.make(name)
        env.reset(seed=11)
        for _ in range(2):
            for _ in range(3 if policy else 17):
                env.step(np.full(env.action_space.shape, policy, np.float32))
            start = env.reset()[0]
        starts.append(start)
    np.testing.assert_array_equal(*starts)


def test_observations_are_fresh_arrays():
    env = gym.make(ID)
    first, _ = env.reset(seed=0)
    kept = first.copy()
    second = env.step(np.array([0.3], np.float32))[0]
    np.testing.assert_array_equal(first, kept)
    assert not np.shares_memory(first, second)
    vector = gym.make_vec(ID, 4, "vector_entry_point")
    first, infos = vector.reset(seed=0)
    kept, error = first.copy(), infos["lateral_error"].copy()
    vector.step(np.full((4, 1), 0.3, np.float32))
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(infos["lateral_error"], error)
