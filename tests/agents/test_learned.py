"""The policy that runs a learned network: rows, actions in other units, corrections of a controller."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
import lanekeep_env
from lanekeep_agents.learned import LearnedPolicy
from lanekeep_agents.policy_record import Network
from lanekeep_env.scenario import CircuitScenario, DriveScenario, LaneKeepScenario

CARS = 16


@pytest.mark.parametrize("hidden", [(32, 32), (64, 64), ()])
@pytest.mark.parametrize("activation", ["relu", "tanh"])
@pytest.mark.parametrize("scenario", [LaneKeepScenario(preview=20), DriveScenario()], ids=["26 inputs", "2 actions"])
def test_rows_are_independent_to_the_last_bit(scenario, activation, hidden, make_record, make_tensors):
    env_id = "lanekeep/Drive-v0" if isinstance(scenario, DriveScenario) else "lanekeep/LaneKeep-v0"
    record = make_record(scenario, env_id=env_id, network=Network(hidden, activation, True))
    policy = LearnedPolicy(record, make_tensors(record))
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(300, len(scenario.channels))).astype(np.float32)
    kept = rows.copy()
    alone = np.stack([policy.predict(row)[0] for row in rows])
    assert len(np.unique(alone)) > 290
    for _ in range(40):
        order = rng.choice(300, size=rng.integers(1, 301), replace=bool(rng.integers(2)))
        action, _ = policy.predict(rows[order])
        np.testing.assert_array_equal(action, alone[order])
    np.testing.assert_array_equal(rows, kept)
    first = policy.predict(rows)[0]
    policy.predict(rows[::-1])
    np.testing.assert_array_equal(first, alone)  # what was returned is the caller's


def test_the_network_is_the_sum_that_it_stands_for(make_record, make_tensors):
    """Written out in float64, number by number."""
    scenario = LaneKeepScenario(preview=2)
    record = make_record(scenario, hidden=(5, 3), network=Network((5, 3), "tanh", True))
    tensors = make_tensors(record)
    rows = np.random.default_rng(1).normal(size=(20, 8)).astype(np.float32) * 3.0
    wanted = []
    for row in rows.astype(np.float64):
        x = [
            min(max((a - m) / (v + 1e-8) ** 0.5, -10.0), 10.0)
            for a, m, v in zip(row, tensors["mean"].tolist(), tensors["variance"].tolist(), strict=True)
        ]
        for i in range(3):
            weight, bias = tensors[f"layers.{i}.weight"].tolist(), tensors[f"layers.{i}.bias"].tolist()
            x = [
                np.tanh(sum(w * a for w, a in zip(line, x, strict=True)) + b)
                for line, b in zip(weight, bias, strict=True)
            ]
        wanted.append(x)
    np.testing.assert_allclose(LearnedPolicy(record, tensors).predict(rows)[0], wanted, atol=1e-6)


def test_columns_are_found_by_name(make_record, make_tensors):
    trained = LaneKeepScenario(preview=2)
    channels = make_record(trained).channels
    record = make_record(trained, channels=[channels[i] for i in (7, 5, 3, 0, 2)])
    policy = LearnedPolicy(record, make_tensors(record), LaneKeepScenario(preview=6, observation="full"))
    wide = LaneKeepScenario(preview=6, observation="full").channels
    rows = np.random.default_rng(2).normal(size=(9, len(wide)))
    order = [[c.name for c in wide].index(c.name) for c in record.channels]
    same = make_record(trained, channels=record.channels)
    narrow = [[c.name for c in trained.channels].index(c.name) for c in record.channels]
    given = np.zeros((9, len(trained.channels)))
    given[:, narrow] = rows[:, order]
    np.testing.assert_array_equal(policy.predict(rows)[0], LearnedPolicy(same, make_tensors(record)).predict(given)[0])


def drive(policy, offset=None, **keywords):
    """Lateral errors, commands and actions of a drive, (steps, cars)."""
    envs = gym.make_vec("lanekeep/LaneKeep-v0", CARS, departure="off", preview=3, **keywords)
    policy = policy(envs.unwrapped.scenario)
    observation, _ = envs.reset(seed=0, options=offset)
    state, start = None, np.ones(CARS, dtype=bool)
    names = [channel.name for channel in envs.unwrapped.channels]
    told = []
    for _ in range(250):
        action, state = policy.predict(observation, state, start)
        observation, _, terminated, truncated, info = envs.step(action)
        start = terminated | truncated
        told.append((info["lateral_error"], observation[:, names.index("steering_command")], action[:, 0]))
    envs.close()
    return np.array(told).swapaxes(0, 1)


def steering(make_record, trained, bound=None):
    """A linear policy that steers towards the lane's centre, in the units that it was trained on."""
    record = make_record(trained, hidden=(), normalisation={"clip": 1e6, "epsilon": 1e-8})
    gains = {"lateral_error": -0.01, "heading_error": -0.3, "yaw_rate": -0.02, "steering_command": 0.0}
    scale = trained.max_steering_angle
    if trained.action == "steering_rate":  # the same angle in three steps
        gains = {name: gain / 3.0 for name, gain in gains.items()} | {"steering_command": -1.0 / 3.0}
        scale = trained.max_steering_rate * trained.control_step
    weight = np.array([[gains.get(channel.name, 0.0) / scale for channel in record.channels]], dtype=np.float32)
    tensors = {
        "mean": np.zeros(len(record.channels), np.float32),
        "variance": np.ones(len(record.channels), np.float32),
        "layers.0.weight": weight,
        "layers.0.bias": np.zeros(1, np.float32),
    }
    return lambda scenario: LearnedPolicy(record, tensors, scenario)


@pytest.mark.parametrize("largest", [0.15, 0.012], ids=["wide", "at the bound"])
@pytest.mark.parametrize(
    ("trained", "driven"),
    [
        ({"action": "steering_rate"}, {"action": "steering_angle"}),
        ({"action": "steering_angle"}, {"action": "steering_rate", "max_steering_rate": 20.0}),
        ({"action": "steering_rate"}, {"action": "steering_rate", "max_steering_rate": 0.9}),
        ({"action": "steering_rate"}, {"action": "steering_rate", "max_steering_angle": 0.4}),
        ({"action": "steering_rate"}, {"action": "steering_angle", "max_steering_angle": 0.4}),
        ({"action": "steering_angle"}, {"action": "steering_angle", "max_steering_angle": 0.4}),
    ],
    ids=str,
)
def test_a_policy_drives_alike_whatever_the_action(trained, driven, largest, make_record):
    trained = {"max_steering_angle": largest, **trained}
    driven = {"max_steering_angle": largest, **driven}
    policy = steering(make_record, LaneKeepScenario(preview=3, **trained))
    bounded = largest < 0.1
    # On a straight road the start does not depend on the largest angle either.
    start = {"offset": {"lateral_error": 1.5}, "road": "straight", "speed": 20.0} if bounded else {}
    wanted, found = drive(policy, **start, **trained), drive(policy, **start, **driven)
    np.testing.assert_allclose(found[:2], wanted[:2], rtol=0.0, atol=1e-5)
    assert np.abs(found[2]).max() <= 1.0
    assert np.isclose(np.abs(found[1]).max(), largest, rtol=1e-6) == bounded
    if bounded or driven["action"] != trained["action"]:
        assert np.abs(found[2] - wanted[2]).max() > 0.01  # other actions, or there was nothing to convert


@pytest.mark.parametrize("scenario", [DriveScenario(), CircuitScenario()], ids=["pedal", "set speed"])
def test_the_second_action_passes_unchanged(scenario, make_record, make_tensors):
    env_id = "lanekeep/Drive-v0" if isinstance(scenario, DriveScenario) else "lanekeep/Circuit-v0"
    record = make_record(scenario, env_id=env_id)
    tensors = make_tensors(record)
    rows = np.random.default_rng(3).normal(size=(50, len(scenario.channels)))
    halved = type(scenario)(max_steering_angle=scenario.max_steering_angle / 2)
    before, after = (LearnedPolicy(record, tensors, one).predict(rows)[0] for one in (scenario, halved))
    np.testing.assert_array_equal(after[:, 1], before[:, 1])
    np.testing.assert_allclose(after[:, 0], np.clip(2.0 * before[:, 0], -1.0, 1.0), rtol=1e-6)


def test_another_largest_speed_is_refused(make_record, make_tensors):
    record = make_record(CircuitScenario(), env_id="lanekeep/Circuit-v0")
    with pytest.raises(ValueError, match=r"max_speed=3.0; allowed: 2.0"):
        LearnedPolicy(record, make_tensors(record), CircuitScenario(max_speed=3.0))


def residual(make_record, make_tensors, trained, zero=False, base="yin-lqr-observer", **changes):
    record = make_record(trained, base=base, bound=0.2, **changes)
    tensors = make_tensors(record)
    if zero:
        for name, tensor in tensors.items():
            tensors[name] = tensor * np.float32(not name.startswith("layers.2"))
    return record, tensors


@pytest.mark.parametrize("action", ["steering_angle", "steering_rate"])
@pytest.mark.parametrize("trained_on", ["steering_angle", "steering_rate"])
def test_a_zero_correction_is_the_base(trained_on, action, make_record, make_tensors):
    keywords = {"action": action, **({"max_steering_rate": 20.0} if action == "steering_rate" else {})}
    trained = LaneKeepScenario(preview=3, action=trained_on, max_steering_rate=20.0)
    record, tensors = residual(make_record, make_tensors, trained, zero=True)
    found = drive(lambda scenario: LearnedPolicy(record, tensors, scenario), **keywords)
    wanted = drive(lambda scenario: lanekeep_baselines.make("yin-lqr-observer", scenario), **keywords)
    if action == trained_on:
        np.testing.assert_array_equal(found[:2], wanted[:2])
    np.testing.assert_allclose(found[:2], wanted[:2], rtol=0.0, atol=1e-5)
    assert np.abs(wanted[0][-50:]).max() < 1.75  # inside the lane: a drive worth comparing


def test_a_correction_is_bounded_and_sees_the_base(make_record, make_tensors):
    scenario = LaneKeepScenario(preview=3)
    record, tensors = residual(make_record, make_tensors, scenario)
    assert tensors["mean"].shape == (len(scenario.channels) + 1,)
    policy, base = LearnedPolicy(record, tensors), lanekeep_baselines.make("yin-lqr-observer", scenario)
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(64, 9)) * [0.5, 0.05, 0.1, 1.0, 0.05, 0.05, 1e-3, 1e-3, 1e-3] + [0, 0, 0, 20, 0, 0, 0, 0, 0]
    action, state = policy.predict(rows)
    own, own_state = base.predict(rows)
    np.testing.assert_array_equal(state, own_state)
    plain = make_record(scenario, channels=record.channels)
    assert plain.shapes["layers.0.weight"][1] == record.shapes["layers.0.weight"][1] - 1
    x = np.concatenate([rows, own.clip(-1.0, 1.0)], axis=1)
    x = np.clip((x - tensors["mean"]) / np.sqrt(tensors["variance"] + 1e-8), -10.0, 10.0)
    for i in range(2):
        x = np.maximum(x @ tensors[f"layers.{i}.weight"].T + tensors[f"layers.{i}.bias"], 0.0)
    x = np.clip(x @ tensors["layers.2.weight"].T + tensors["layers.2.bias"], -1.0, 1.0)
    np.testing.assert_allclose(action, np.clip(own.clip(-1.0, 1.0) + 0.2 * x, -1.0, 1.0), atol=2e-6)
    # State, episode starts and single observations are the base's.
    starts = rng.integers(2, size=64).astype(bool)
    second, after = policy.predict(rows, state, starts)
    np.testing.assert_array_equal(after, base.predict(rows, state, starts)[1])
    one, after_one = policy.predict(rows[5], state[5], starts[5])
    np.testing.assert_array_equal(one, second[5])
    np.testing.assert_array_equal(after_one, after[5])
    assert policy.predict(rows[:0])[0].shape == (0, 1)


def test_a_base_that_is_unknown_is_refused(make_record, make_tensors):
    record, tensors = residual(make_record, make_tensors, LaneKeepScenario(preview=3), base="yin-lqr-observed")
    with pytest.raises(ValueError, match=r"did you mean 'yin-lqr-observer'"):
        LearnedPolicy(record, tensors)


def test_an_observation_of_another_shape_is_refused(make_record, make_tensors):
    record = make_record(LaneKeepScenario())
    policy = LearnedPolicy(record, make_tensors(record))
    for shape in ((5,), (3, 7), (2, 3, 6), ()):
        with pytest.raises(ValueError, match=r"allowed: \(6,\) or \(n, 6\)"):
            policy.predict(np.zeros(shape))
    assert policy.predict(np.zeros((0, 6)))[0].shape == (0, 1)


@pytest.mark.parametrize("env_id", sorted(lanekeep_env.ENVIRONMENTS))
def test_a_policy_finds_the_scenario_that_it_was_trained_on(env_id, make_record, make_tensors):
    env = gym.make(env_id)
    scenario = env.unwrapped.scenario
    record = make_record(scenario, env_id=env_id)
    tensors = make_tensors(record)
    observation, _ = env.reset(seed=0)
    alone, given = LearnedPolicy(record, tensors), LearnedPolicy(record, tensors, scenario)
    action, _ = alone.predict(observation)
    assert env.action_space.contains(action)
    np.testing.assert_array_equal(action, given.predict(observation)[0])


def test_running_a_policy_needs_neither_torch_nor_stable_baselines():
    code = (
        "import sys\nimport lanekeep_agents\nlanekeep_agents.names()\n"
        "heavy = {'torch', 'stable_baselines3'}\nassert not heavy & set(sys.modules)\n"
        "assert 'safetensors' not in sys.modules\n"
        "import lanekeep_agents.learned, lanekeep_agents.policy_file\nassert not heavy & set(sys.modules)\n"
        "sys.modules['safetensors'] = None\n"
        "try:\n    lanekeep_agents.policy_file._safetensors()\nexcept ImportError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "lanekeep[agents]" in done.stdout


def reworded(record, **changes):
    """The record with each channel changed."""
    return replace(record, channels=tuple(replace(one, **changes) for one in record.channels))


def test_other_words_for_the_same_channels_change_nothing(make_record, make_tensors):
    """An older version described them otherwise; what they mean is told by its scenario, in today's words."""
    scenario = LaneKeepScenario(preview=3)
    record = make_record(scenario)
    old = reworded(record, description="as it was once put")
    rows = np.random.default_rng(0).normal(size=(20, len(scenario.channels))).astype(np.float32)
    wanted = LearnedPolicy(record, make_tensors(record)).predict(rows)[0]
    for driven in (None, scenario, LaneKeepScenario(preview=3, road="straight", vehicle="passat")):
        np.testing.assert_array_equal(LearnedPolicy(old, make_tensors(record), driven).predict(rows)[0], wanted)
    elsewhere = LaneKeepScenario(preview=3, preview_interval=0.2)
    for one in (old, record):
        with pytest.raises(ValueError, match="curvature_preview_1' has the description"):
            LearnedPolicy(one, make_tensors(record), elsewhere)


@pytest.mark.parametrize("change", [{"unit": "ft"}, {"low": -3.5}, {"high": 77.0}], ids=str)
def test_other_units_and_bounds_say_what_changed(change, make_record, make_tensors):
    record = reworded(make_record(LaneKeepScenario()), **change)
    with pytest.raises(ValueError, match=f"lateral_error' has the {next(iter(change))}"):
        LearnedPolicy(record, make_tensors(record))


def test_a_policy_says_what_it_is(make_record, make_tensors):
    record = make_record(LaneKeepScenario(), frames=4)
    text = repr(LearnedPolicy(record, make_tensors(record)))
    assert text == "<LearnedPolicy ppo-test: PPO trained on lanekeep/LaneKeep-v0, 4 frames>"
