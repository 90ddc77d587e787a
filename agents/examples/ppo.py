"""PPO of Stable-Baselines3 on compiled cars: train, save as a policy file, load it and drive an episode.

python agents/examples/ppo.py --steps 1000000 --out ppo.json
"""

import argparse
from pathlib import Path

import gymnasium as gym
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import lanekeep_agents

parser = argparse.ArgumentParser(description="PPO on lanekeep/LaneKeep-v0")
parser.add_argument("--steps", type=int, default=1_000_000)
parser.add_argument("--out", default="ppo.json")
arguments = parser.parse_args()
out = Path(arguments.out).with_suffix(".json")

task = {"preview": 20, "action": "steering_rate"}
cars = lanekeep_agents.sb3_vec_env("lanekeep/LaneKeep-v0", 256, dtype="float32", **task)
envs = VecNormalize(VecMonitor(cars), gamma=0.98)
network = {"net_arch": [32, 32], "log_std_init": -2.5}
options = {"n_steps": 64, "batch_size": 2048, "n_epochs": 5, "gamma": 0.98, "learning_rate": 3e-3}
model = PPO("MlpPolicy", envs, policy_kwargs=network, seed=0, device="cpu", **options)
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
