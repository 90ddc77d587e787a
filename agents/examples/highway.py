"""PPO on highway-env's own lane-keeping-v0, begun as our `lqg`: train, save, load and drive an episode.

python agents/examples/highway.py --steps 20000 --out highway.json
"""

import argparse

from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.training.imitation import imitate
from lanekeep_agents.training.normalisation import Normalised
from lanekeep_env.adapters.highway.task import HighwayScenario, HighwayTask

parser = argparse.ArgumentParser(description="PPO on highway-env's lane-keeping-v0")
parser.add_argument("--steps", type=int, default=20_000)
parser.add_argument("--out", default="highway.json")
parser.add_argument("--observed", action="store_true", help="by the task's own observation, noisy and a step late")
arguments = parser.parse_args()
seen = {"observation": "theirs", "cost_weight": 0.01} if arguments.observed else {"cost_weight": 0.003}
task = {"env": "lane-keeping-v0", "preview": 10, **seen}
scenario = HighwayScenario(**task)
cars = lanekeep_agents.sb3_vec_env("lanekeep_env.adapters.highway:lanekeep/Highway-v0", 8, **task)
envs = Normalised(VecMonitor(cars))  # of which the speed, always the same, is not blown up
network = {"net_arch": [32, 32], "log_std_init": -4.0}
options = {"n_steps": 256, "batch_size": 512, "n_epochs": 5, "gamma": 0.98, "learning_rate": lambda left: 1e-5 * left}
model = PPO("MlpPolicy", envs, policy_kwargs=network, seed=0, device="cpu", **options)
imitate(model, envs, lanekeep_baselines.make("lqg", scenario), 0.98, seed=0)
model.learn(arguments.steps)
lanekeep_agents.save(arguments.out, model, overwrite=True)
policy, env = lanekeep_agents.load(arguments.out, scenario), HighwayTask(scenario)
(observation, info), total, over = env.reset(seed=0), 0.0, False
while not over:
    action, _ = policy.predict(observation)
    observation, reward, terminated, truncated, info = env.step(action)
    total, over = total + reward, terminated or truncated
print(f"return {total:.2f}, lane kept: {info['is_success']}")
