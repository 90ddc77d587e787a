"""A whole episode of the default environment, written a second time in plain Python from its documentation.

Random draws, start, speed profile, steering, Runge-Kutta steps, reward, flags, every channel and the truth, step
by step. Nothing here is compiled, vectorised or shared with the kernel.
"""

import math

import gymnasium as gym
import numpy as np
import pytest

from lanekeep_env import VEHICLES

WORD = (1 << 64) - 1


def mixed(x):
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & WORD
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & WORD
    return x ^ (x >> 31)


def derived(key, counter):
    return mixed((key + (counter + 1) * 0x9E3779B97F4A7C15) & WORD)


def uniform(key, counter):
    return (derived(key, counter) >> 11) * 2.0**-53


class Profile:
    """A road with its speeds, looked up the slow way."""

    def __init__(self, road, speeds):
        self.start, self.end, self.lengths = road.curvature_start, road.curvature_end, road.lengths
        self.stations = np.concatenate([[0.0], np.cumsum(road.lengths)])
        self.squared = speeds**2
        seconds = [2 * length / (a + b) for length, a, b in zip(road.lengths, speeds[:-1], speeds[1:], strict=True)]
        left = np.concatenate([np.cumsum(seconds[::-1])[::-1], [0.0]])
        self.latest_start = self.stations[np.flatnonzero(left >= 30.0)[-1]]

    def at(self, s):
        """Curvature, speed and acceleration."""
        if s >= self.stations[-1]:
            return self.end[-1], math.sqrt(self.squared[-1]), 0.0
        i = int(np.searchsorted(self.stations, s, side="right")) - 1
        share = (s - self.stations[i]) / self.lengths[i]
        gain = (self.squared[i + 1] - self.squared[i]) / self.lengths[i]
        curvature = self.start[i] + (self.end[i] - self.start[i]) * share
        return curvature, math.sqrt(self.squared[i] + gain * (s - self.stations[i])), gain / 2


class Car:
    """The linear single track of Yin's car, or the kinematic one, with state (s, d, theta, beta, r)."""

    def __init__(self, dynamic):
        car = VEHICLES["yin"]
        self.dynamic = dynamic
        self.front, self.rear = car.cg_to_front_axle, car.cg_to_rear_axle
        self.stiff = car.front_cornering_stiffness, car.rear_cornering_stiffness
        self.mass, self.inertia, self.lag = car.mass, car.yaw_inertia, car.steering.lag

    def steady(self, v, kappa):
        base = self.front + self.rear
        if not self.dynamic:
            return math.atan(base * kappa), math.atan(self.rear * kappa), v * kappa
        force = self.mass * v * v * kappa / base
        slip_f, slip_r = force * self.rear / self.stiff[0], force * self.front / self.stiff[1]
        return base * kappa + slip_f - slip_r, self.rear * kappa - slip_r, v * kappa

    def forces(self, beta, r, steer, v):
        slip_f, slip_r = steer - beta - self.front * r / v, self.rear * r / v - beta
        return self.stiff[0] * slip_f, self.stiff[1] * slip_r

    def rates(self, x, steer, v, kappa):
        _, d, theta, beta, r = x
        if not self.dynamic:
            turn = v * math.tan(steer) / (self.front + self.rear)
            along = (v * math.cos(theta) - self.rear * turn * math.sin(theta)) / (1 - d * kappa)
            across = v * math.sin(theta) + self.rear * turn * math.cos(theta)
            return np.array([along, across, turn - kappa * along, 0.0, 0.0])
        force_f, force_r = self.forces(beta, r, steer, v)
        along = v * math.cos(theta + beta) / (1 - d * kappa)
        return np.array(
            [
                along,
                v * math.sin(theta + beta),
                r - kappa * along,
                (force_f + force_r) / (self.mass * v) - r,
                (self.front * force_f - self.rear * force_r) / self.inertia,
            ]
        )

    def shows(self, x, steer, v):
        """Sideslip, yaw rate, lateral acceleration."""
        if not self.dynamic:
            turn = math.tan(steer) / (self.front + self.rear)
            return math.atan(self.rear * turn), v * turn, v * v * turn
        return x[3], x[4], sum(self.forces(x[3], x[4], steer, v)) / self.mass


def good_driver(observation, step):
    return float(np.clip((3.2 * observation[6] - 0.03 * observation[0] - 0.6 * observation[1]) / 0.15, -1.2, 1.2))


def leaves(observation, step):
    return good_driver(observation, step) if step < 100 else 1.0


def wobbles(observation, step):
    return good_driver(observation, step) + 0.3 * math.sin(step)


@pytest.mark.parametrize("dynamic", [True, False])
@pytest.mark.parametrize(("seed", "driver"), [(0, good_driver), (1, good_driver), (5, leaves), (7, wobbles)])
def test_an_episode_is_what_the_documentation_says(seed, driver, dynamic):
    env = gym.make(
        "lanekeep/LaneKeep-v0",
        observation="full",
        preview=5,
        preview_interval=0.4,
        dynamics="dynamic" if dynamic else "kinematic",
    )
    observation, info = env.reset(seed=seed)
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    key = derived(int(generator.integers(0, 2**64, dtype=np.uint64)), 0)
    roads = env.unwrapped.road_set()
    road, car = Profile(*roads[int(uniform(key, 0) * len(roads))]), Car(dynamic)
    s = uniform(key, 1) * road.latest_start
    kappa, v, _ = road.at(s)
    steer, beta, r = car.steady(v, kappa)
    steer = min(max(steer, -0.15), 0.15)
    course = (2 * uniform(key, 3) - 1) * math.radians(2)
    x = np.array([s, (2 * uniform(key, 2) - 1) * 0.5, course - beta, beta, r])
    command, h = steer, 0.01

    def compare(seen, told):
        kappa, v, _ = road.at(x[0])
        slip, yaw, acceleration = car.shows(x, steer, v)
        ahead = [road.at(x[0] + 0.4 * k * v)[0] for k in range(5)]
        expected = [x[1], x[2], yaw, v, steer, command, *ahead, slip, kappa, acceleration]
        # where a segment ends inside a sub-step the kernel sees it at the sub-step's end
        low, high = env.observation_space.low, env.observation_space.high
        np.testing.assert_allclose(seen, np.clip(expected, low, high), atol=2e-4)
        truth = (told[k] for k in ("arc_length", "lateral_error", "heading_error", "speed", "lateral_acceleration"))
        np.testing.assert_allclose([*truth], [x[0], x[1], x[2], v, acceleration], atol=2e-4)

    compare(observation, info)
    for step in range(1, 601):
        action = np.float32(driver(observation, step))
        observation, reward, terminated, truncated, info = env.step(np.array([action]))
        command, before = min(max(float(action), -1.0), 1.0) * 0.15, steer
        for _ in range(5):
            _, v, gain = road.at(x[0])
            middle = command + (steer - command) * math.exp(-h / 2 / car.lag)
            end = command + (steer - command) * math.exp(-h / car.lag)
            stages = [(0.0, steer, v), (h / 2, middle, v + gain * h / 2), (h / 2, middle, v + gain * h / 2)]
            k = []
            for part, angle, pace in [*stages, (h, end, v + gain * h)]:
                here = x + part * k[-1] if k else x
                k.append(car.rates(here, angle, pace, road.at(here[0])[0]))
            x = x + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
            steer = end
        rate = (steer - before) / 0.05
        cost = min(16.0, (x[1] / 0.5) ** 2 + (rate / 0.1) ** 2)
        outside = abs(x[1]) > 1.75
        if outside:
            cost = 16.0 * (601 - step)
        assert reward == pytest.approx(-cost * 0.05, abs=2e-4)
        assert info["steering_rate"] == pytest.approx(rate, abs=1e-6)
        flags = (terminated, truncated, info["cost"], info["is_success"], info["termination"])
        assert flags == (outside, step == 600, float(outside), not outside, int(outside))
        compare(observation, info)
        if terminated or truncated:
            break
    assert terminated or step == 600
