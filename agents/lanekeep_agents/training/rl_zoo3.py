"""Our hyper-parameters as RL Baselines3 Zoo reads them: a YAML file an algorithm.

python -m lanekeep_agents.training.rl_zoo3 ppo > ppo.yml
python -m rl_zoo3.train --algo ppo --env lanekeep/LaneKeep-v0 --gym-packages lanekeep_env --conf-file ppo.yml
"""

from __future__ import annotations

import argparse
from typing import Any

import yaml

import lanekeep_env
from lanekeep_agents.training.rewards import LearnersRewards
from lanekeep_agents.training.run import network_of
from lanekeep_agents.training.settings import ALGORITHMS, settings_for


def zoo_settings(algorithm: str, env_id: str) -> dict[str, Any]:
    """Return the zoo's entry for an id: what `lanekeep train` takes, with `VecNormalize` of observations as it is.

    The zoo trains and evaluates on rewards as `LearnersRewards` gives them.

    Args:
        algorithm: "ppo", "sac" or "td3".
        env_id: a registered id.

    Raises:
        ValueError: an algorithm or id that there is not.
    """
    settings = settings_for(algorithm, env_id)
    scenario = lanekeep_env.ENVIRONMENTS[settings.env_id].scenario.from_keywords(**settings.env)
    rewards = {
        "largest_cost": settings.largest_cost * scenario.largest_cost * scenario.control_step,
        "gamma": settings.gamma,
        "scale": settings.reward_scale,
    }
    network = network_of(settings)
    layer = network.pop("activation_fn").__name__
    options = [f"activation_fn=nn.{layer}", *(f"{name}={value!r}" for name, value in network.items())]
    noise = {"noise_type": "normal", "noise_std": settings.action_noise} if algorithm == "td3" else {}
    return {
        "n_timesteps": settings.steps,
        "n_envs": settings.num_envs,
        "env_kwargs": {"dtype": "float32", **settings.env},
        "vec_env_wrapper": [{f"{LearnersRewards.__module__}.{LearnersRewards.__name__}": rewards}],
        "normalize": {"norm_obs": True, "norm_reward": False},
        "policy": "MlpPolicy",
        "policy_kwargs": f"dict({', '.join(options)})",  # the zoo evaluates it, as YAML names no class
        "gamma": settings.gamma,
        "learning_rate": f"lin_{settings.learning_rate}",
        **noise,
        **settings.parameters,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Hyper-parameters of all ids in the format of RL Baselines3 Zoo")
    parser.add_argument("algorithm", choices=ALGORITHMS)
    algorithm = parser.parse_args().algorithm
    entries = {env_id: zoo_settings(algorithm, env_id) for env_id in lanekeep_env.ENVIRONMENTS}
    print(yaml.safe_dump(entries, sort_keys=False), end="")
