"""TD3 by the one call behind `lanekeep train`: checkpoints, held-out evaluations and the policy file come with it.

python agents/examples/td3.py --steps 1000000 --out runs/td3
"""

import argparse

import gymnasium as gym

import lanekeep_agents

parser = argparse.ArgumentParser(description="TD3 on lanekeep/LaneKeep-v0")
parser.add_argument("--steps", type=int, default=1_000_000)
parser.add_argument("--out", default="runs/td3")
arguments = parser.parse_args()

lanekeep_agents.train("td3", "lanekeep/LaneKeep-v0", arguments.out, seed=0, steps=arguments.steps)

env = gym.make("lanekeep/LaneKeep-v0", preview=20, action="steering_rate")
policy = lanekeep_agents.load(f"{arguments.out}/td3-lane-keep-seed0.json", env.unwrapped.scenario)
observation, info = env.reset(seed=0)
total, over = 0.0, False
while not over:
    action, _ = policy.predict(observation)
    observation, reward, terminated, truncated, info = env.step(action)
    total, over = total + reward, terminated or truncated
print(f"return {total:.2f}, lane kept: {info['is_success']}")
