"""A curriculum: the road grows more slippery while PPO learns; only options change, the environment stays.

python agents/examples/curriculum.py --steps 1000000 --out slippery.json
"""

import argparse
from pathlib import Path

import gymnasium as gym
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import lanekeep_agents

parser = argparse.ArgumentParser(description="PPO on roads that grow more slippery")
parser.add_argument("--steps", type=int, default=1_000_000)
parser.add_argument("--out", default="slippery.json")
chosen = parser.parse_args()
out = Path(chosen.out).with_suffix(".json")

# The widest range is declared once: cars of all of it are known to be integrated rightly.
task = {"tyre": "magic_formula", "randomisation": {"friction": (0.4, 1.0)}, "preview": 20}
cars = lanekeep_agents.sb3_vec_env("lanekeep/LaneKeep-v0", 64, dtype="float32", **task)
envs = VecNormalize(VecMonitor(cars), gamma=0.98)
model = PPO("MlpPolicy", envs, n_steps=8, batch_size=512, gamma=0.98, seed=0, device="cpu")
for lowest in (1.0, 0.8, 0.6, 0.4):
    envs.set_options({"friction": (lowest, 1.0)})  # of each car's next episode, and of all after it
    model.learn(chosen.steps // 4, reset_num_timesteps=False)
lanekeep_agents.save(out, model, overwrite=True)

env = gym.make("lanekeep/LaneKeep-v0", **task)
policy = lanekeep_agents.load(out, env.unwrapped.scenario)
observation, info = env.reset(seed=0, options={"friction": 0.5})
total, over = 0.0, False
while not over:
    observation, reward, terminated, truncated, info = env.step(policy.predict(observation)[0])
    total, over = total + reward, terminated or truncated
print(f"return {total:.2f}, lane kept: {info['is_success']}")
