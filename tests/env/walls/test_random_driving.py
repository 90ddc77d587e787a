"""Thousands of random episodes over the whole parameter range: no NaN, no exception, observations inside the space."""

import itertools
import math

import gymnasium as gym
import numpy as np
import pytest
from with_effect import with_effect

import lanekeep_env  # noqa: F401

pytestmark = pytest.mark.long
IDS = ("lanekeep/WallFollow-v0", "lanekeep/Circuit-v0")
#: What a car may have; each combination is compiled by itself. With a speed of its own it drives a circuit.
EQUIPMENT = ("own speed", "gear", "servo", "scan", "float32", "tyres", "sensors")
#: Of each two of them there is a car with both, with neither, and with either one.
FEW = (("own speed",), EQUIPMENT, ("own speed", "gear", "servo", "scan"), ("gear", "float32", "tyres"))
FEW += (("servo", "float32", "sensors"), ("scan", "tyres", "sensors"))
EVERY = tuple(itertools.chain.from_iterable(itertools.combinations(EQUIPMENT, count) for count in range(8)))


def random_keywords(rng, combinations=FEW):
    """An id and a point of its whole parameter space, with one of some combinations of equipment."""
    has = combinations[rng.integers(len(combinations))]
    geared, circuit = "gear" in has, "own speed" in has

    def pick(*values):
        return values[rng.integers(len(values))]

    glass = {"glass_share": pick(0.0, 0.0, 0.3, 1.0), "seed": int(rng.integers(100))}
    keywords = {
        "vehicle": {
            "base": pick("knightriders", "pses"),
            "steering": {
                "lag": pick(0.05, 0.1) if geared else pick(0.0, 0.0, 0.1),
                "backlash": 0.03 if geared else 0.0,
                "feedback": pick("motor", "road_wheel"),
                "delay": pick(0.0, 0.035),
                "rate_limit": pick(None, 4.0),
                "angle_limit": pick(None, 0.38, 1.0),
            },
        },
        "dynamics": "dynamic" if "tyres" in has else "kinematic",
        "world": pick(
            {"kind": "random-circuits", "count": 5, **glass},
            {"kind": "circuit", "corridor": float(rng.uniform(0.8, 3.0)), "clockwise": bool(rng.integers(2)), **glass},
            {"kind": "ell", "width": float(rng.uniform(0.8, 4.0)), "turn": pick("left", "right"), **glass},
            {"kind": "slalom", "gap": float(rng.uniform(0.6, 2.5)), **glass},
            {"kind": "corridor", "length": 20.0, "width": float(rng.uniform(0.6, 30.0)), **glass},
        ),
        "speed": pick(0.0, 0.3, 2.0, 20.0, {"minimum": 0.1, "maximum": 5.0, "hold": 0.45}),
        "action": pick("steering_angle", "steering_rate"),
        "max_steering_angle": float(rng.uniform(0.05, 1.3)),
        "steering_offset": pick(0.0, (-0.05, 0.05), 0.1),
        "servo": pick({"left": 0.5, "right": 0.2, "ticks": 50}, {"angles": (-1.3, -0.1, 0.2)})
        if "servo" in has
        else None,
        "set_distance": float(rng.uniform(0.1, 6.0)),
        "start_lateral_error": float(rng.uniform(0.0, 3.0)),
        "start_heading_error": float(rng.uniform(0.0, 3.1)),
        "contact": pick("terminate", "terminate", "cost", "off"),
        "cost_weight": pick(0.0, 1.0, 100.0),
        "scan": pick(
            "perfect",
            "kinect",
            {"beams": 7, "field_of_view": 6.2, "noise": 0.5, "jump_errors": 1.0, "nearest": 0.0, "missing_rim": 5},
        )
        if "scan" in has
        else "none",
        "encoder_ticks": pick(0, 8, 40),
        "encoder_direction": bool(rng.integers(2)),
        "observation": pick("measured", "full"),
        "randomisation": pick("nominal", "mismatch", "stress"),
        "sensors": pick(
            "production",
            "poor",
            {"distance_right": {"noise": 2.0, "bias": 3.0, "dropout": 0.5, "delay": 0.09}, "speed": {"noise": 30.0}},
        )
        if "sensors" in has
        else None,
        "control_step": pick(0.045, 0.045, 0.09, 0.015),
        "episode_steps": pick(40, 600),
        "dtype": "float32" if "float32" in has else "float64",
        "autoreset_mode": pick("next_step", "same_step"),
    }
    if circuit:
        keywords |= {
            "max_speed": pick(0.5, 2.0, 20.0),
            "max_acceleration": pick(0.5, 2.0, 500.0),
            "laps": int(rng.integers(1, 3)),
        }
    # At the highest speeds only angles at which the car does not make half a turn in a control step.
    fastest = keywords["max_speed"] if circuit else keywords["speed"]
    fastest = 5.0 if isinstance(fastest, dict) else max(fastest, 0.1)
    sharpest = math.atan(0.9 * math.pi * 0.25 / (fastest * keywords["control_step"])) - 0.1
    keywords["max_steering_angle"] = max(0.02, min(keywords["max_steering_angle"], sharpest))
    return IDS[circuit], with_effect(IDS[circuit], keywords)


@pytest.mark.parametrize(
    ("wanted", "combinations"), [(800, FEW), pytest.param(6000, EVERY, marks=pytest.mark.slow)], ids=["few", "every"]
)
def test_random_episodes_over_the_whole_parameter_range(wanted, combinations):
    rng = np.random.default_rng(2017)
    cars, steps, episodes, contacts = 16, 60, 0, 0
    for _ in range(10_000):
        if episodes >= wanted:
            break
        name, keywords = random_keywords(rng, combinations)
        keywords["episode_steps"] = min(keywords["episode_steps"], 50)
        env = gym.make_vec(name, cars, "vector_entry_point", **keywords)
        low, high = env.observation_space.low, env.observation_space.high
        observation, infos = env.reset(seed=int(rng.integers(2**31)))
        episodes += cars
        for _ in range(steps):
            inside = (observation >= low) & (observation <= high)
            assert inside.all(), (keywords, env.unwrapped.channels[np.flatnonzero(~inside.all(axis=0))[0]])
            assert all(np.isfinite(value).all() for name, value in infos.items() if name in env.unwrapped.truth), (
                keywords
            )
            assert (infos["clearance"] >= 0.0).all(), keywords
            actions = rng.uniform(-1.2, 1.2, env.action_space.shape).astype(np.float32)
            observation, reward, ended, truncated, infos = env.step(actions)
            assert np.isfinite(reward).all(), keywords
            episodes += int((ended | truncated).sum())
            contacts += int((ended & (infos["termination"] == 2)).sum())
    assert contacts > wanted // 6


def test_single_environments_run_random_episodes_too():
    rng = np.random.default_rng(7)
    for k in range(30):
        name, keywords = random_keywords(rng)
        del keywords["autoreset_mode"]
        env = gym.make(name, **keywords)
        env.reset(seed=k)
        env.action_space.seed(k)
        for _ in range(40):
            observation, reward, ended, truncated, _ = env.step(env.action_space.sample())
            assert env.observation_space.contains(observation) and np.isfinite(reward), keywords
            if ended or truncated:
                env.reset()
