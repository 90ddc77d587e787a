"""What a checkpoint must hold to be one of a run: all of it is checked against a fresh model of that run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.save_util import recursive_getattr

from lanekeep_agents.training.evaluation import number
from lanekeep_env.checks import require, shown

Arrays = dict[str, np.ndarray]

#: What a replay buffer holds.
REPLAY = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
#: What the algorithm saw last.
SEEN = ("_last_obs", "_last_original_obs", "_last_episode_starts")
#: Words that a generator of NumPy's kind MT19937 has.
_WORDS = 624
#: What Adam keeps of each parameter.
_ADAM = {"step", "exp_avg", "exp_avg_sq"}
#: Whose numbers need not be finite: NaN stands for what was never seen.
_MAY_LACK = ("cars.", "corrections.")
#: Bytes for names, numbers and scores.
_ROOM = 1 << 24


def largest(model: BaseAlgorithm, fresh: Arrays) -> int:
    """Return the bytes that a checkpoint may have at the most: an optimizer holds twice its parameters."""
    replay = model.replay_buffer if isinstance(model, OffPolicyAlgorithm) else None
    filled = 0 if replay is None else sum(getattr(replay, name).nbytes for name in REPLAY)
    return _ROOM + 4 * sum(array.nbytes for array in fresh.values()) + filled


def check_arrays(model: BaseAlgorithm, arrays: Arrays, fresh: Arrays) -> None:
    """Raise ValueError unless the arrays have the names, shapes and types of a fresh model's, and finite numbers."""
    optimizers = tuple(f"torch.{name}." for name in optimizers_of(model))
    wanted = {name: array for name, array in fresh.items() if not name.startswith(("replay.", *optimizers))}
    seen = np.zeros((model.n_envs, *(model.observation_space.shape or ())), dtype=np.float32)
    starts = np.ones(model.n_envs, dtype=bool)
    wanted |= dict(zip((f"seen.{name}" for name in SEEN), (seen, seen, starts), strict=True))
    replay = model.replay_buffer if isinstance(model, OffPolicyAlgorithm) else None
    if replay is not None:
        filled = len(arrays.get("replay.rewards", ()))
        wanted |= {f"replay.{name}": getattr(replay, name)[:filled] for name in REPLAY}
    for name, array in wanted.items():
        found = arrays.get(name)
        if found is None:
            raise ValueError(f"{name} is missing")
        if found.shape != array.shape or found.dtype != array.dtype:
            raise ValueError(f"{name} is {found.dtype} {shown(found.shape)}, allowed: {array.dtype} {array.shape}")
    for name, found in arrays.items():
        if name not in wanted and not name.startswith(optimizers):
            raise ValueError(f"{shown(name)} is unknown")
        if name not in wanted and found.dtype != np.float32:
            raise ValueError(f"{shown(name)} is {found.dtype}, allowed: float32")
        if found.dtype.kind == "f" and not name.startswith(_MAY_LACK) and not np.isfinite(found).all():
            raise ValueError(f"{shown(name)} holds {found[~np.isfinite(found)][0]}, allowed: finite numbers")
    for name in ("normalisation.variance", "normalisation.count", "best.variance"):
        if (arrays[name] < 0.0).any():
            raise ValueError(f"{name} holds {arrays[name].min()}, allowed: numbers >= 0")


def check_numbers(model: BaseAlgorithm, numbers: Mapping[str, Any], fresh: Mapping[str, Any]) -> None:
    """Raise ValueError, KeyError or TypeError unless the numbers are those of a run of this model."""
    for name, value in fresh["counts"].items():
        require(name, number(numbers["counts"][name], type(value)), "", at_most=1e15)
        if isinstance(value, int):
            require(name, numbers["counts"][name], "", at_least=0)
    kind, position, has_gauss, gauss = numbers["numpy"]
    if kind != fresh["numpy"][0]:
        raise ValueError(f"the generator {shown(kind)} is unknown; allowed: {fresh['numpy'][0]}")
    require("position", number(position, int), "", at_least=0, at_most=_WORDS)
    require("has_gauss", number(has_gauss, int), "", at_least=0, at_most=1)
    number(gauss, float)
    for name in model._get_torch_save_params()[0]:
        if name not in optimizers_of(model) and numbers[name] != fresh[name]:
            raise ValueError(f"{name} has not the tensors of this model")
    if isinstance(model, OffPolicyAlgorithm):
        place, full = numbers["replay"]
        assert model.replay_buffer is not None
        require("replay", number(place, int), "", at_least=0, at_most=model.replay_buffer.buffer_size - 1)
        require("replay", number(full, int), "", at_least=0, at_most=1)


def check_replay(arrays: Arrays, size: int, places: list[int]) -> None:
    """Raise ValueError unless as much is kept as the buffer says that it holds."""
    filled = size if places[1] else places[0]
    if len(arrays["replay.rewards"]) != filled:
        raise ValueError(f"replay.rewards has {len(arrays['replay.rewards'])} entries, allowed: {filled}")


def optimizers_of(model: BaseAlgorithm) -> list[str]:
    """Names of the model's optimizers."""
    return [name for name in model._get_torch_save_params()[0] if name.endswith("optimizer")]


def check_optimizers(model: BaseAlgorithm, fresh: Mapping[str, list[dict[str, Any]]]) -> None:
    """Raise ValueError unless the optimizers, loaded, are Adam's with the settings in ``fresh``, by name."""
    for name, groups in fresh.items():
        optimizer: torch.optim.Optimizer = recursive_getattr(model, name)
        for group, usual in zip(optimizer.state_dict()["param_groups"], groups, strict=True):
            require(f"{name}.lr", group["lr"], "", at_least=0.0)
            # A checkpoint has lists where there are tuples.
            others = [key for key in usual if key != "lr" and json.dumps(group.get(key)) != json.dumps(usual[key])]
            if others or set(group) != set(usual):
                raise ValueError(f"{name} has other settings ({', '.join(others)}): another version has trained it")
        for parameter, state in optimizer.state.items():
            if not isinstance(parameter, torch.Tensor) or set(state) != _ADAM:
                raise ValueError(f"{name} is not Adam's state")
            for part in ("exp_avg", "exp_avg_sq"):
                if not isinstance(state[part], torch.Tensor) or state[part].shape != parameter.shape:
                    raise ValueError(f"{name} has not the shapes of this model")
            require(f"{name}.step", float(state["step"]), "", at_least=0.0)
            if (state["exp_avg_sq"] < 0.0).any():
                raise ValueError(f"{name}.exp_avg_sq holds {float(state['exp_avg_sq'].min())}, allowed: numbers >= 0")
