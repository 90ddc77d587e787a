"""Thousands of episodes over the whole range of parameters: numbers stay numbers and inside their spaces."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from with_effect import with_effect

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_env import layout as at
from lanekeep_env.roads import road_from

EVASIVE, REVERSE, DRIVE = "lanekeep/Evasive-v0", "lanekeep/ReversePath-v0", "lanekeep/Drive-v0"
BUSY = [
    (0, "speed", 0),
    (0.1, "speed", 30),
    (0.2, "lead", 30, 8),
    (0.6, "lead_gone"),
    (0.7, "stop", 6),
    (2, "stop_gone"),
    (2.1, "lead", 0, 0),
]
CREEPING = {"minimum": 0.1, "maximum": 3.0, "hold": 0.2, "standstill": 0.4, "acceleration": 20.0}
CARS = {"mass": (0.7, 1.6), "friction": (0.2, 1.2), "cg_shift": (-0.3, 0.3), "steering_lag": (0.5, 3.0)}


def random_keywords(rng, name):
    """A point of the whole parameter space, down to bends inside the car's turning circle."""

    def pick(*values):
        return values[rng.integers(len(values))]

    sensors, dtype = pick(None, None, "production", "poor"), pick("float64", "float32")
    steering = {
        "lag": pick(0.01, 0.05, 0.3),
        "rate_limit": pick(None, 0.1, 1.0),
        "angle_limit": pick(None, 0.6, 1.4),
        # Not with everything: each combination is a kernel to compile.
        "backlash": 0.0 if sensors or dtype == "float32" else pick(0.0, 0.02),
        "delay": pick(0.0, 0.1, 0.25),
    }
    changed = {"base": pick("passat", "yin", "commonroad-1"), "steering": steering}
    radius, shift, low = float(rng.uniform(2.5, 60.0)), float(rng.uniform(0.1, 20.0)), float(rng.uniform(-0.3, 0.3))
    circle = {"kind": "circle", "radius": pick(-1.0, 1.0) * radius}
    evasive = {"kind": "evasive", "shift": shift, "shift_length": shift * float(rng.uniform(2.0, 20.0))}
    parking = {"kind": "parking", "count": 4, "smallest_radius": radius, "largest_radius": 80.0}
    yard = {"kind": "yard", "count": 4, "length": 400.0, "smallest_radius": 3.0}
    own = {
        EVASIVE: {
            "road": pick(evasive, evasive, circle, yard),
            "speed": pick(0.0, float(rng.uniform(0.0, 6.0)), float(rng.uniform(5.0, 60.0)), None),
            "friction": pick(0.1, 0.3, 1.0, 2.0),
            "tyre": pick("magic_formula", "magic_formula", "linear"),
        },
        REVERSE: {
            "road": pick("straight", circle, parking, parking),
            "speed": pick(0.0, float(rng.uniform(0.0, 8.0)), CREEPING, CREEPING, {**CREEPING, "maximum": 0.2}),
        },
        DRIVE: {
            "road": pick("straight", circle, yard, "random"),
            "friction": pick(0.1, 0.3, 1.0, 2.0),
            "traffic": pick(None, BUSY, BUSY, {"duration": 10.0, "largest_speed": 30.0}),
            "slope": (low, float(rng.uniform(low, 0.3))),
            "wind": pick(0.0, (-40.0, 40.0)),
        },
    }[name]
    # Starts up to the centre of curvature.
    tightest = max(float(np.abs(road.curvature_start).max()) for road in road_from(own["road"]).build())
    lane_width = min(float(rng.uniform(1.0, 12.0)), 1.999 / max(tightest, 1e-3))
    return own | {
        "vehicle": pick("passat", "passat", "yin", "commonroad-2", changed, changed),
        "action": pick("steering_angle", "steering_rate"),
        "max_steering_angle": float(rng.uniform(0.2, 1.4)),
        "lane_width": lane_width,
        "start_lateral_error": pick(0.5, 1.0) * 0.5 * lane_width,
        "start_course_error": float(rng.uniform(0.0, 1.0)),
        "departure": pick("terminate", "cost", "off"),
        "observation": pick("measured", "full", "full"),
        "randomisation": pick("nominal", "mismatch", "stress", CARS),
        "sensors": sensors,
        "preview": pick(1, 4, 11),
        # Samples of production sensors come every 40 ms.
        "control_step": 0.02 if sensors == "production" else pick(0.02, 0.02, 0.05, 0.1),
        "dtype": dtype,
        "autoreset_mode": pick("next_step", "same_step"),
    }


def driver(guided, scenario):
    """The one of the multi-controller's policies that has guided the least so far, or where none knows enough none."""
    able = [name for name in lanekeep_baselines.names(scenario) if name.startswith("werling")]
    return lanekeep_baselines.make(min(able, key=lambda name: guided.get(name, 0)), scenario) if able else None


@pytest.mark.parametrize("wanted", [2_000, pytest.param(10_000, marks=pytest.mark.slow)])
def test_random_episodes_give_numbers_inside_their_bounds(wanted):
    """Half of the cars hold random actions, gentle ones and ones at the limits; half are steered by a policy."""
    rng, cars, steps = np.random.default_rng(2008), 16, 120
    episodes, guided = 0, {}
    for name in (EVASIVE, REVERSE, DRIVE):
        until = episodes + wanted // 3 + 1
        while episodes < until:
            keywords = with_effect(name, random_keywords(rng, name))
            limit = int(np.exp(rng.uniform(np.log(5.0), np.log(steps))))
            env = gym.make_vec(name, cars, "vector_entry_point", episode_steps=limit, **keywords)
            space, each = env.observation_space, env.unwrapped.single_observation_space
            policy, state = driver(guided, env.unwrapped.scenario), None
            observation, infos = env.reset(seed=int(rng.integers(2**31)))
            over = np.ones(cars, dtype=bool)
            for k in range(steps):
                assert space.contains(observation), keywords
                assert all(np.isfinite(infos[key]).all() for key in infos if key[0] != "_" and key[:5] != "final"), (
                    keywords
                )
                if k % 10 == 0:
                    held = np.clip(rng.normal(0.0, 0.6, env.action_space.shape), -1.2, 1.2).astype(np.float32)
                action = held.copy()
                if policy is not None:
                    with warnings.catch_warnings():
                        warnings.simplefilter("error")
                        asked, state = policy.predict(observation, state, over)
                    assert np.isfinite(asked).all(), (policy.name, keywords)
                    action[::2] = asked[::2]
                observation, reward, terminated, truncated, infos = env.step(action)
                assert np.isfinite(reward).all() and (reward <= 0.0).all(), keywords
                over = terminated | truncated
                episodes += int(over.sum())
                if policy is not None:
                    guided[policy.name] = guided.get(policy.name, 0) + int(over[::2].sum())
                for last in infos["final_obs"][over] if "final_obs" in infos else ():
                    assert each.contains(last), keywords
            assert np.isfinite(env.unwrapped._core.cars[:, at.ALONG : at.COMMAND + 1]).all(), keywords
            if name == DRIVE:
                assert (env.unwrapped._core.cars[:, at.SPEED] >= 0.0).all(), keywords
            env.close()
    assert episodes >= wanted
    expected = {policy for policy in lanekeep_baselines.names() if policy.startswith("werling")}
    expected.remove("werling-traffic")  # needs others around it: tests/baselines/test_werling_lanes.py
    assert set(guided) == expected and min(guided.values()) > wanted // 100, guided
