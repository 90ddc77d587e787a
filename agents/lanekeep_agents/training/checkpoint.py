"""Checkpoints: everything a run needs to go on to the last bit, in one file of plain arrays; nothing is pickled."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.save_util import recursive_getattr
from stable_baselines3.common.vec_env import VecNormalize

from lanekeep_agents.export import export_sb3
from lanekeep_agents.training.checkpoint_checks import (
    REPLAY,
    SEEN,
    Arrays,
    check_arrays,
    check_numbers,
    check_optimizers,
    check_replay,
    largest,
    optimizers_of,
)
from lanekeep_agents.training.residual import Corrections
from lanekeep_agents.vec_env import CarVecEnv
from lanekeep_env.files import write_atomic
from lanekeep_env.plain import parse_json, read_arrays

#: Characters of an error that its own repeats.
LONGEST_REASON = 300
#: Of the algorithm: how far it is.
_COUNTS = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")


def write_checkpoint(
    path: Path, model: BaseAlgorithm, env: VecNormalize, notes: Mapping[str, Any], best: Mapping[str, np.ndarray]
) -> None:
    """Write the state of a run between two rollouts.

    Args:
        path: of the file, written atomically.
        model, env: the algorithm and its environment.
        notes: what else there is to keep, JSON-able; its "settings" say which run it is.
        best: tensors of the best policy so far.
    """
    numbers: dict[str, Any] = {"notes": dict(notes)}
    arrays: dict[str, Any] = dict(_collect(model, env, best, numbers))
    arrays["numbers"] = np.array(json.dumps(numbers))
    content = io.BytesIO()
    np.savez(content, **arrays)
    write_atomic(path, content.getvalue())


def _collect(
    model: BaseAlgorithm, env: VecNormalize, best: Mapping[str, np.ndarray], numbers: dict[str, Any]
) -> Arrays:
    """Return the arrays of a state; ``numbers`` get the rest of it."""
    arrays: Arrays = {f"best.{name}": tensor for name, tensor in best.items()}
    numbers["counts"] = {name: getattr(model, name) for name in _COUNTS}
    for name, part in (*_parts(env).items(), ("random", _random(numbers))):
        arrays |= {f"{name}.{key}": value for key, value in part.items()}
    for name in SEEN:
        if getattr(model, name, None) is not None:
            arrays[f"seen.{name}"] = getattr(model, name)
    states, variables = model._get_torch_save_params()
    for name in states:
        numbers[name] = _flatten(recursive_getattr(model, name).state_dict(), f"torch.{name}", arrays)
    for name in variables:
        arrays[f"variable.{name}"] = recursive_getattr(model, name).detach().numpy()
    if isinstance(model, OffPolicyAlgorithm):
        numbers["replay"] = _keep_replay(model, arrays)
    numbers["action_space"] = model.action_space.np_random.bit_generator.state
    return arrays


def read_checkpoint(
    path: Path, model: BaseAlgorithm, env: VecNormalize, settings: Mapping[str, Any]
) -> tuple[dict[str, Any], Arrays]:
    """Bring a fresh model and its environment to where `write_checkpoint` left them; return the notes and the best.

    Args:
        path: of the file.
        model, env: the algorithm and its environment.
        settings: of the run, which the notes must have.

    Raises:
        ValueError: the file is not a checkpoint, or one of another run.
    """
    try:
        env.reset()  # cars must be seeded before they have a state
        fresh_numbers: dict[str, Any] = {}
        best = export_sb3(model, env)[2]
        fresh = _collect(model, env, best, fresh_numbers)
        arrays = read_arrays(path, largest(model, fresh))
        numbers = parse_json(str(arrays.pop("numbers")))
        if numbers["notes"]["settings"] != json.loads(json.dumps(settings)):  # tuples are lists there
            raise ValueError("it is of other settings")
        check_arrays(model, arrays, fresh)
        check_numbers(model, numbers, fresh_numbers)
        usual = {name: recursive_getattr(model, name).state_dict()["param_groups"] for name in optimizers_of(model)}
        _restore(model, env, arrays, numbers)
        check_optimizers(model, usual)
    except Exception as error:  # numpy and torch raise errors of many kinds
        told = " ".join(str(error).split())[:LONGEST_REASON] or type(error).__name__
        raise ValueError(f"{path} is not a checkpoint of this run: {told}") from None
    return numbers["notes"], _under("best", arrays)


def _restore(model: BaseAlgorithm, env: VecNormalize, arrays: Arrays, numbers: dict[str, Any]) -> None:
    for name, part in _layers(env).items():
        part.set_state(_under(name, arrays))
    mean, variance, count = (arrays[f"normalisation.{key}"] for key in ("mean", "variance", "count"))
    statistics = statistics_of(env)
    statistics.mean, statistics.var, statistics.count = mean, variance, float(count)
    for name in _COUNTS:
        setattr(model, name, type(getattr(model, name))(numbers["counts"][name]))
    for name in SEEN:
        if f"seen.{name}" in arrays:
            setattr(model, name, arrays[f"seen.{name}"])
    states, variables = model._get_torch_save_params()
    for name in states:
        whole = recursive_getattr(model, name)
        whole.load_state_dict(_unflatten(numbers[name], arrays))
    for name in variables:
        recursive_getattr(model, name).data = torch.from_numpy(arrays[f"variable.{name}"].copy())
    if isinstance(model, OffPolicyAlgorithm):
        _fill_replay(model, arrays, numbers["replay"])
    model.action_space.np_random.bit_generator.state = numbers["action_space"]
    torch.set_rng_state(torch.from_numpy(arrays["random.torch"]))
    kind, position, has_gauss, gauss = numbers["numpy"]
    np.random.set_state((kind, arrays["random.numpy"], position, has_gauss, gauss))  # noqa: NPY002


def statistics_of(env: VecNormalize) -> RunningMeanStd:
    """Mean and variance of the observations."""
    assert isinstance(env.obs_rms, RunningMeanStd)
    return env.obs_rms


def _layers(env: VecNormalize) -> dict[str, Any]:
    """The environment's layers that have a state, by what a checkpoint calls them."""
    found: dict[str, Any] = {}
    layer: Any = env.venv
    while not isinstance(layer, CarVecEnv):
        found["corrections" if isinstance(layer, Corrections) else "rewards"] = layer
        layer = layer.venv
    found["cars"] = layer.env.unwrapped
    return found


def _parts(env: VecNormalize) -> dict[str, Arrays]:
    found = statistics_of(env)
    statistics = {"mean": found.mean, "variance": found.var, "count": np.array(found.count)}
    return {name: layer.get_state() for name, layer in _layers(env).items()} | {"normalisation": statistics}


def _under(name: str, arrays: Arrays) -> Arrays:
    return {key.removeprefix(f"{name}."): value for key, value in arrays.items() if key.startswith(f"{name}.")}


def _random(numbers: dict[str, Any]) -> Arrays:
    """The generators that Stable-Baselines3 draws from."""
    kind, keys, position, has_gauss, gauss = np.random.get_state(legacy=True)  # noqa: NPY002
    numbers["numpy"] = [kind, int(position), int(has_gauss), float(gauss)]
    return {"torch": torch.get_rng_state().numpy(), "numpy": np.asarray(keys)}


def _flatten(value: Any, place: str, arrays: Arrays) -> Any:
    """Move the tensors of a state dict into ``arrays``; return the rest with their places instead, JSON-able."""
    if isinstance(value, torch.Tensor):
        arrays[place] = value.detach().numpy()
        return {"tensor": place}
    if isinstance(value, Mapping):
        return {"pairs": [[key, _flatten(one, f"{place}.{key}", arrays)] for key, one in value.items()]}
    if isinstance(value, list | tuple):
        return {"list": [_flatten(one, f"{place}.{k}", arrays) for k, one in enumerate(value)]}
    return value


def _unflatten(value: Any, arrays: Arrays) -> Any:
    if not isinstance(value, dict):
        return value
    if "tensor" in value:
        return torch.from_numpy(arrays[value["tensor"]].copy())
    if "pairs" in value:
        return {key: _unflatten(one, arrays) for key, one in value["pairs"]}
    return [_unflatten(one, arrays) for one in value["list"]]


def _keep_replay(model: OffPolicyAlgorithm, arrays: Arrays) -> list[int]:
    buffer = model.replay_buffer
    assert buffer is not None
    filled = buffer.buffer_size if buffer.full else buffer.pos
    for name in REPLAY:
        arrays[f"replay.{name}"] = getattr(buffer, name)[:filled]
    return [buffer.pos, int(buffer.full)]


def _fill_replay(model: OffPolicyAlgorithm, arrays: Arrays, places: list[int]) -> None:
    buffer = model.replay_buffer
    assert buffer is not None
    check_replay(arrays, buffer.buffer_size, places)
    for name in REPLAY:
        kept = arrays[f"replay.{name}"]
        getattr(buffer, name)[: len(kept)] = kept
    buffer.pos, buffer.full = places[0], bool(places[1])
