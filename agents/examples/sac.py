"""SAC of Stable-Baselines3 on compiled cars: train, save as a policy file, load it and drive an episode.

python agents/examples/sac.py --steps 500000 --out sac.json
"""

import argparse
from pathlib import Path

import gymnasium as gym
from stable_baselines3 import SAC
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import lanekeep_agents

parser = argparse.ArgumentParser(description="SAC on lanekeep/LaneKeep-v0")
parser.add_argument("--steps", type=int, default=500_000)
parser.add_argument("--out", default="sac.json")
arguments = parser.parse_args()
out = Path(arguments.out).with_suffix(".json")

task = {"preview": 20, "action": "steering_rate"}
cars = lanekeep_agents.sb3_vec_env("lanekeep/LaneKeep-v0", 64, dtype="float32", **task)
envs = VecNormalize(VecMonitor(cars), gamma=0.98)
options = {"batch_size": 512, "learning_starts": 10_000, "gamma": 0.98, "learning_rate": 1e-3}
model = SAC("MlpPolicy", envs, policy_kwargs={"net_arch": [64, 64]}, seed=0, device="cpu", **options)
model.learn(arguments.steps)
lanekeep_agents.save(out, model, overwrite=True)

env = gym.make("lanekeep/LaneKeep-v0", **task)
policy = lanekeep_agents.load(out, env.unwrapped.scenario)
observation, info = env.reset(seed=0)
total, over = 0.0, False
while not over:
    action, _ = policy.predict(observation)
    observation, reward, terminated, truncated, info = env.step(action)
    total, over = total + reward, terminated or truncated
print(f"return {total:.2f}, lane kept: {info['is_success']}")
