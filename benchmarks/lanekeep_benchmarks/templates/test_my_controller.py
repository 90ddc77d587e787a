"""What `my-controller` promises: python -m pytest test_my_controller.py."""

import gymnasium as gym
from my_controller import MyController

import lanekeep_env  # noqa: F401


def test_it_stays_in_its_lane() -> None:
    env = gym.make("lanekeep/LaneKeep-v0", road="slalom", preview=1)
    policy = MyController(env.unwrapped.scenario)  # type: ignore[attr-defined]
    observation, _ = env.reset(seed=0)
    state, over, info = None, False, {}
    while not over:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
    assert info["is_success"]
