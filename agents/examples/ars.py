"""Random search for a correction of `werling-traffic`: search in four kinds of traffic, save, load, drive an episode.

python agents/examples/ars.py --steps 24000000 --out ars-residual-traffic-seed0.json
"""

import argparse
import shlex
import sys
import time

import gymnasium as gym
import numpy as np

import lanekeep_agents
from lanekeep_agents.export import versions
from lanekeep_agents.policy_record import Training
from lanekeep_agents.training.random_search import Corrected, search

parser = argparse.ArgumentParser(description="ARS on Traffic-v0")
parser.add_argument("--steps", type=int, default=24_000_000)
parser.add_argument("--out", default="ars.json")
arguments, begun = parser.parse_args(), time.monotonic()
reads = ["lateral_error", "heading_error", "yaw_rate", "speed", "steering_angle", "acceleration", "pedal", "set_speed"]
reads += ["lead_gap", "lead_speed", *(f"ahead_{s}_{what}" for s in ("right", "left") for what in ("distance", "speed"))]
kinds = [{"flow": flow, "episode_steps": 1000} for flow in ("braking_lead", "cut_in", "merging", "flow")]
worlds = [Corrected("lanekeep/Traffic-v0", "werling-traffic", reads, 0.3, 128, kind) for kind in kinds]
width = np.array([[0.005], [0.1]])  # of the search, of steering and pedal
weights, steps = search(worlds, width, 8, arguments.steps, np.random.default_rng(0))
told, command = {"env": {}, "width": [0.005, 0.1], "pairs": 8, "worlds": kinds}, shlex.join(["python", *sys.argv])
training = Training(command, told, 0, steps, round(time.monotonic() - begun, 1), versions(), {})
worlds[0].save(arguments.out, weights, training, overwrite=True)
env = gym.make("lanekeep/Traffic-v0")
policy = lanekeep_agents.load(arguments.out, env.unwrapped.scenario)
(observation, _), memory, total, over = env.reset(seed=0), None, 0.0, False
while not over:
    action, memory = policy.predict(observation, memory)
    observation, reward, terminated, truncated, _ = env.step(action)
    total, over = total + reward, terminated or truncated
print(f"return {total:.2f}")
