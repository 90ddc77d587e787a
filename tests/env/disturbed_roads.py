"""Cars on straight roads for the tests of what disturbs them."""

import gymnasium as gym
import numpy as np

#: A car whose road wheel goes where it is told at once.
IDEAL = {"base": "yin", "steering": {"lag": 0.0, "rate_limit": None, "delay": 0.0}}
STRAIGHT = {"road": "straight", "departure": "off", "observation": "full", "episode_steps": 4000}
CENTRED = {"lateral_error": 0.0}
STATE = ("lateral_error", "heading_error", "sideslip", "yaw_rate")
LIMIT = 0.125  # rad at action 1: sums of its binary parts are exact


def made(**keywords):
    return gym.make("lanekeep/LaneKeep-v0", **{**STRAIGHT, "max_steering_angle": LIMIT, **keywords}).unwrapped


def driven(env, angles, seed=0, **options):
    """Reset and steer by road-wheel angles, rad; the observations from the start on, by channel, (steps + 1,)."""
    seen = [env.reset(seed=seed, options=options or None)[0]]
    seen += [env.step(np.float32([angle / LIMIT]))[0] for angle in angles]
    return dict(zip([c.name for c in env.channels], np.array(seen, dtype=np.float64).T, strict=True))
