"""Smoke test of an installed wheel with the light core alone; run by .ci/smoke."""

import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import gymnasium as gym
import numpy as np

import lanekeep_env

HEAVY = ("torch", "stable_baselines3", "matplotlib", "scipy", "control", "pygame", "typer")
assert not [name for name in HEAVY if name in sys.modules], "import lanekeep_env must stay light"

for name in ("lanekeep_env", "lanekeep_baselines", "lanekeep_agents", "lanekeep_benchmarks"):
    assert files(import_module(name)).joinpath("py.typed").is_file(), name

env_ids = [env_id for env_id in gym.registry if env_id.startswith("lanekeep/")]
assert env_ids, "no environment is registered"
for env_id in env_ids:
    env = gym.make(env_id)
    observation, _ = env.reset(seed=1)
    for _ in range(20):
        observation, reward, terminated, truncated, info = env.step(np.zeros(env.action_space.shape, np.float32))
        assert env.observation_space.contains(observation), env_id
        assert np.isfinite(reward), env_id
    vector = gym.make_vec(env_id, num_envs=3)
    vector.reset(seed=1)
    vector.step(np.zeros(vector.action_space.shape, np.float32))


def names_extra(extra: str, call: Callable[[], object]) -> bool:
    """Whether ``call`` fails with an ImportError that says how to install ``extra``."""
    try:
        call()
    except ImportError as error:
        return f'pip install "lanekeep[{extra}]"' in str(error)
    return False


baselines, agents = import_module("lanekeep_baselines"), import_module("lanekeep_agents")
scenario = lanekeep_env.LaneKeepScenario()
assert names_extra("baselines", lambda: baselines.make("yin-lqr", scenario))
assert names_extra("agents", lambda: agents.sb3_vec_env("lanekeep/LaneKeep-v0", 2))

command = subprocess.run([str(Path(sys.executable).with_name("lanekeep")), "envs"], capture_output=True, text=True)
assert command.returncode == 1, command
assert command.stderr.count("\n") == 1, command.stderr
assert 'pip install "lanekeep[bench]"' in command.stderr, command.stderr

print(f"smoke: lanekeep {version('lanekeep')} from {Path(lanekeep_env.__file__).parent}: {', '.join(env_ids)}")
