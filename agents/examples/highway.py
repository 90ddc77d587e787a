"""PPO on highway-env's own lane-keeping-v0, begun as its hand-tuned law: train, save, load and drive an episode.

python agents/examples/highway.py --steps 300000 --out highway.json
"""

import argparse

from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.training.imitation import imitate
from lanekeep_env.adapters.highway.task import HighwayScenario, HighwayTask

parser = argparse.ArgumentParser(description="PPO on highway-env's lane-keeping-v0")
parser.add_argument("--steps", type=int, default=300_000)
parser.add_argument("--out", default="highway.json")
arguments = parser.parse_args()

scenario = HighwayScenario(env="lane-keeping-v0", preview=10)
cars = lanekeep_agents.sb3_vec_env("lanekeep_env.adapters.highway:lanekeep/Highway-v0", 8, preview=10)
envs = VecNormalize(VecMonitor(cars), gamma=0.95)
network = {"net_arch": [32, 32], "log_std_init": -3.0}
options = {"n_steps": 256, "batch_size": 512, "n_epochs": 5, "gamma": 0.95, "learning_rate": lambda left: 3e-4 * left}
model = PPO("MlpPolicy", envs, policy_kwargs=network, seed=0, device="cpu", **options)
imitate(model, envs, lanekeep_baselines.make("highway-p", scenario), 0.95, seed=0)
model.learn(arguments.steps)
lanekeep_agents.save(arguments.out, model, overwrite=True)

policy, task = lanekeep_agents.load(arguments.out, scenario), HighwayTask(scenario)
observation, info = task.reset(seed=0)
total, over = 0.0, False
while not over:
    action, _ = policy.predict(observation)
    observation, reward, terminated, truncated, info = task.step(action)
    total, over = total + reward, terminated or truncated
print(f"return {total:.2f}, lane kept: {info['is_success']}")
