"""`werling-drive` in traffic that takes more than comfort: what braking could avoid is avoided; and shunting."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.werling_multi import WerlingDrive
from lanekeep_env import Termination

START = {"lateral_error": 0.0, "heading_error": 0.0}


class Comfortable(WerlingDrive):
    """The article's one limit."""

    longitudinal = WerlingDrive.longitudinal._replace(emergency=WerlingDrive.longitudinal.least)


def endings(policy: type[WerlingDrive], count: int, seed: int, **keywords) -> tuple[np.ndarray, np.ndarray]:
    """How episodes full of hazards end, and what of that braking in time had avoided, (count,) each."""
    env = gym.make_vec(
        "lanekeep/Drive-v0", count, "vector_entry_point", autoreset_mode="disabled", observation="full",
        traffic={"count": count, "hazards": 1.0, "largest_speed": 25.0, "seed": seed},
        slope=(-0.0997, 0.0997), wind=(-15.0, 15.0), **keywords,
    )  # fmt: skip
    drives = policy(env.unwrapped.scenario)
    observation, _ = env.reset(seed=seed)
    state, first, alive = None, np.ones(count, bool), np.ones(count, bool)
    found, avoidable = np.zeros(count, int), np.zeros(count, bool)
    while alive.any():
        action, state = drives.predict(observation, state, first)
        first = np.zeros(count, bool)
        observation, _, terminated, truncated, info = env.step(action)
        new = alive & terminated
        found[new] = info["termination"][new]
        avoidable[new] = (info["avoidable_contact"] + info["avoidable_overrun"])[new] > 0.0
        alive &= ~(terminated | truncated)
    return found, avoidable


@pytest.mark.parametrize("count", [150, pytest.param(2000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("keywords", [{"road": "straight"}, {"sensors": "production"}], ids=["straight", "winding"])
def test_no_contact_and_no_overrun_that_braking_in_time_had_avoided(count: int, keywords: dict) -> None:
    found, avoidable = endings(WerlingDrive, count, 11, **keywords)
    assert not avoidable.any()
    assert set(found) <= {Termination.NONE, Termination.CONTACT, Termination.STOP_PASSED}
    assert 0 < (found > 0).sum() < 0.15 * count  # no one can brake in 0.7 of the way that it takes


@pytest.mark.parametrize("count", [150, pytest.param(2000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("keywords", [{"road": "straight"}, {}], ids=["straight", "winding"])
def test_on_friction_0_3_as_well(count: int, keywords: dict) -> None:
    """The hazards are those of a dry road: most stop points come later than tyres can brake for."""
    found, avoidable = endings(WerlingDrive, count, 11, friction=0.3, **keywords)
    assert not avoidable.any()
    assert set(found) <= {Termination.NONE, Termination.CONTACT, Termination.STOP_PASSED}
    assert (found == Termination.CONTACT).any() and (found == Termination.STOP_PASSED).sum() > 0.3 * count


def test_the_limit_of_comfort_alone_costs_safety() -> None:
    """The article calls 3.5 m/s² a limit "without reducing safety": in these hazards it is not."""
    found, avoidable = endings(Comfortable, 150, 11, road="straight")
    assert avoidable.sum() > 15 and (found > 0).sum() > 30


@pytest.mark.parametrize("slope", [-0.05, 0.0, 0.05])
def test_shunting_forwards_backwards_and_on_to_the_motorway_in_one_episode(slope: float) -> None:
    """On a circle of 15 m to a stop point, backwards to another one, and away."""
    events = [(0, "speed", 2), (6, "stop", 6), (16, "stop_gone"), (16, "speed", -1.5), (24, "stop", 5)]
    events += [(36, "stop_gone"), (36, "speed", 2.5)]
    env = gym.make(
        "lanekeep/Drive-v0", road={"kind": "circle", "radius": 15.0}, traffic=events, slope=slope, wind=0.0,
        observation="full", episode_steps=2200,
    )  # fmt: skip
    scenario = env.unwrapped.scenario
    policy = lanekeep_baselines.make("werling-drive", scenario)
    observation, _ = env.reset(seed=0, options=START)
    state, rows, truth = None, [], []
    for k in range(2200):
        action, state = policy.predict(observation, state, np.array(k == 0))
        observation, _, terminated, _, info = env.step(action)
        assert not terminated
        rows.append(observation), truth.append((info["stop_error"], info["arc_length"]))
    v, gear, d = (np.array(rows)[:, scenario.column(name)] for name in ("speed", "gear", "lateral_error"))
    stop, place = np.array(truth).T
    assert abs(stop[799]) < 0.02 and abs(stop[1790]) < 0.03 and v[799] == v[1790] == 0.0
    assert (gear[900:1790] == -1.0).all() and v[900:1790].min() == pytest.approx(-1.5, abs=0.25)
    backwards = (place[799] - place[1790]) % (2.0 * np.pi * 15.0)
    assert 12.0 < backwards < 25.0 and gear[-1] == 0.0 and v[-1] == pytest.approx(2.5, abs=0.3)
    # In steady curves the centre of gravity runs l_r²/(2 R) outside of the rear axle.
    assert np.abs(d[300:] + 1.51**2 / 30.0).max() < 0.06


@pytest.mark.parametrize(("slope", "speed"), [(0.12, 10), (0.3, 10), (0.05, 0.6), (0.2, 2), (-0.12, -2), (-0.3, -2)])
def test_a_standing_car_starts_on_every_slope_that_its_engine_climbs(slope: float, speed: float) -> None:
    """Comfort's 1 m/s² less the slope's pull is often less than nothing; the car must not stand there for ever."""
    events = [(0, "speed", 0.005 * min(speed, 0)), (2, "speed", speed)]  # in the gear in which it is to start
    env = gym.make(
        "lanekeep/Drive-v0", road="straight", traffic=events, slope=slope, wind=0.0, observation="full"
    )  # fmt: skip
    policy = lanekeep_baselines.make("werling-drive", env.unwrapped.scenario)
    observation, _ = env.reset(seed=0, options=START)
    state, speeds = None, []
    for k in range(1200):
        action, state = policy.predict(observation, state, np.array(k == 0))
        observation, _, terminated, _, info = env.step(action)
        assert not terminated
        speeds.append(info["speed"])
    way = np.sign(speed) * np.array(speeds)
    assert way[-1] == pytest.approx(abs(speed), rel=0.05) and way.max() < 1.15 * abs(speed) + 0.2
