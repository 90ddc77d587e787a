"""From Stable-Baselines3's actors to the network and the tensors of a policy file."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import stable_baselines3
import torch
from numpy.typing import NDArray
from stable_baselines3.common.torch_layers import FlattenExtractor
from torch import nn

import lanekeep_env
from lanekeep_agents.policy_file import write_policy
from lanekeep_agents.policy_record import InputChannel, Network, Normalisation, PolicyRecord, Training
from lanekeep_agents.sb3_layers import layers_of

#: Activations of policy files; what can be set of them must be what torch sets by itself.
ACTIVATIONS: dict[type[Any], str] = {
    nn.ReLU: "relu",
    nn.Tanh: "tanh",
    nn.Sigmoid: "sigmoid",
    nn.SiLU: "silu",
    nn.Softplus: "softplus",
    nn.Mish: "mish",
    nn.ELU: "elu",
    nn.SELU: "selu",
    nn.LeakyReLU: "leaky_relu",
    nn.Softsign: "softsign",
}


def export_sb3(
    model: Any, vec_normalize: Any = None, frames: int = 1, normalized_frames: bool = False
) -> tuple[Network, Normalisation, dict[str, NDArray[np.float32]]]:
    """Return what a policy file needs of a model: its actor, acting deterministically, and its normalisation.

    Args:
        model: PPO, SAC or TD3 with "MlpPolicy", hidden layers of one of `ACTIVATIONS`, and actions in [-1, 1].
        vec_normalize: the `VecNormalize` that it was trained with, None for none.
        frames: observations that are stacked.
        normalized_frames: whether each was normalised before, and not the stack.

    Raises:
        ValueError: an actor that is made of anything else; names what.
    """
    space = model.action_space
    if (space.low != -1.0).any() or (space.high != 1.0).any():
        raise ValueError(f"action_space={space} is not allowed: actions must lie in [-1, 1]")
    extractor, layers, squash = _actor(model.policy)
    if type(extractor) is not FlattenExtractor:
        raise ValueError(f"features_extractor={type(extractor).__name__} is not allowed: it must be FlattenExtractor")
    dense, activation = _dense(layers)
    inputs = dense[0].in_features
    observed = int(np.prod(model.observation_space.shape))
    if inputs != observed:
        raise ValueError(
            f"policy={type(model.policy).__name__} is not allowed: its actor reads {inputs} numbers, which are not the "
            f"{observed} of the observation (a recurrent one reads its memory)"
        )
    normalisation, mean, variance = _statistics(vec_normalize, inputs // frames if normalized_frames else inputs)
    if normalized_frames:
        mean, variance = np.tile(mean, frames), np.tile(variance, frames)
    tensors = {"mean": _float32(mean), "variance": _float32(variance)}
    for i, layer in enumerate(dense):
        tensors[f"layers.{i}.weight"] = _float32(layer.weight.detach().cpu().numpy())
        tensors[f"layers.{i}.bias"] = _float32(layer.bias.detach().cpu().numpy())
    # What a mean loses as float32 is much where the channel hardly varies; the first bias takes it.
    lost = (tensors["mean"] - np.asarray(mean)) / np.sqrt(np.asarray(variance) + normalisation.epsilon)
    tensors["layers.0.bias"] += _float32(tensors["layers.0.weight"] @ lost)
    if frames > 1:  # zeros stand before the first frame, in the units in which frames are stacked
        zero = 0.0 if normalized_frames else -np.asarray(mean) / np.sqrt(np.asarray(variance) + normalisation.epsilon)
        zero = np.clip(zero, -normalisation.clip, normalisation.clip) - lost
        tensors["before"] = _float32(zero[: inputs - inputs // frames])
    hidden = tuple(layer.out_features for layer in dense[:-1])
    return Network(hidden, activation, squash), normalisation, tensors


def save_sb3(path: str | Path, model: Any, overwrite: bool = False) -> PolicyRecord:
    """Write the policy file of a model; see `lanekeep_agents.save`."""
    env = model.get_env()
    if env is None:
        raise ValueError("model has no env: it must have been trained on lanekeep's, e.g. sb3_vec_env(...)")
    layers = layers_of(env)
    network, normalisation, tensors = export_sb3(model, layers.normalize, layers.frames, layers.normalized_frames)
    record = PolicyRecord(
        name=Path(path).stem,
        algorithm=type(model).__name__,
        env_id=layers.env_id,
        network=network,
        normalisation=normalisation,
        training=Training(
            command=shlex.join(["python", *sys.argv]),
            hyperparameters={
                "gamma": model.gamma,
                "num_envs": model.n_envs,
                **({"rewards": layers.rewards} if layers.rewards else {}),
            },
            seed=model.seed or 0,
            steps=model.num_timesteps,
            seconds=round((time.time_ns() - model.start_time) / 1e9, 1) if model.num_timesteps else 0.0,
            versions=versions(),
            scores={},
        ),
        frames=layers.frames,
        **scenario_fields(layers.scenario),
    )
    Path(path).parent.mkdir(parents=True, exist_ok=True)  # nobody wants to train again for a missing folder
    return write_policy(path, record, tensors, overwrite)


def scenario_fields(scenario: Any) -> dict[str, Any]:
    """What a policy's record says of the scenario that it was trained on."""
    return {
        "scenario": scenario.to_dict(),
        "scenario_hash": scenario.hash,
        "channels": tuple(InputChannel(c.name, c.unit, c.description, c.low, c.high) for c in scenario.channels),
        "actions": scenario.num_actions,
        "action": scenario.action,
        "max_steering_angle": scenario.max_steering_angle,
        "max_steering_rate": scenario.max_steering_rate,
        "control_step": scenario.control_step,
    }


def versions() -> dict[str, str]:
    """Of the packages that train."""
    return {
        "lanekeep": lanekeep_env.__version__,
        "stable-baselines3": stable_baselines3.__version__,
        "torch": str(torch.__version__),
        "numpy": np.__version__,
    }


def _actor(policy: Any) -> tuple[nn.Module, list[nn.Module], bool]:
    """What reads the observation, the layers behind it, and whether tanh is what makes the action of their output."""
    if hasattr(policy, "mlp_extractor"):  # PPO
        if policy.squash_output:
            raise ValueError("squash_output=True is not allowed: PPO's actions must be clipped")
        return policy.features_extractor, [*policy.mlp_extractor.policy_net, policy.action_net], False
    actor: Any = getattr(policy, "actor", None)
    if hasattr(actor, "latent_pi"):  # SAC
        return actor.features_extractor, [*actor.latent_pi, actor.mu], True
    if isinstance(getattr(actor, "mu", None), nn.Sequential):  # TD3
        *layers, last = actor.mu
        if isinstance(last, nn.Tanh):
            return actor.features_extractor, layers, True
    raise ValueError(f"policy={type(policy).__name__} is not allowed: it must be the MlpPolicy of PPO, SAC or TD3")


def _dense(layers: list[nn.Module]) -> tuple[list[Any], str]:
    """Split layers into dense ones and the activation between them."""
    dense, between = layers[::2], layers[1::2]
    for layer in dense:
        if not isinstance(layer, nn.Linear):
            raise ValueError(f"layer {layer} is not allowed: it must be Linear")
    kinds = {type(layer) for layer in between}
    usual = kinds <= set(ACTIVATIONS) and all(str(layer) == str(type(layer)()) for layer in between)
    if len(kinds) > 1 or not usual:
        found = ", ".join(sorted({str(layer) for layer in between}))
        allowed = ", ".join(kind.__name__ for kind in ACTIVATIONS)
        raise ValueError(f"activation_fn={found} is not allowed: it must be one of {allowed}, as torch sets it")
    return dense, ACTIVATIONS[kinds.pop()] if kinds else "relu"


def _statistics(vec_normalize: Any, inputs: int) -> tuple[Normalisation, Any, Any]:
    """How inputs are normalised, their means and their variances."""
    if vec_normalize is None or not vec_normalize.norm_obs:
        return Normalisation(clip=float(np.finfo(np.float32).max)), np.zeros(inputs), np.ones(inputs)
    normalisation = Normalisation(vec_normalize.clip_obs, vec_normalize.epsilon)
    statistics = vec_normalize.obs_rms
    variance = vec_normalize.variance(statistics) if hasattr(vec_normalize, "variance") else statistics.var
    return normalisation, statistics.mean, variance


def _float32(values: Any) -> NDArray[np.float32]:
    return np.array(values, dtype=np.float32)
