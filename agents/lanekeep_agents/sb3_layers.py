"""What lies between a Stable-Baselines3 model and the cars it was trained on, as far as a policy file can hold it."""

from __future__ import annotations

from pkgutil import resolve_name
from typing import Any, NamedTuple

import gymnasium as gym
from gymnasium.spaces import Box
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    SubprocVecEnv,
    VecCheckNan,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
    VecVideoRecorder,
)
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from lanekeep_agents.vec_env import CarVecEnv
from lanekeep_env.checks import shown
from lanekeep_env.envs.skin import observation_space
from lanekeep_env.scenario.car import CarScenario

#: Layers that leave observations and actions as they are.
_TRANSPARENT = (VecMonitor, VecVideoRecorder, VecCheckNan)
#: Wrappers of a single environment that do, by name; and so does any `gymnasium.RewardWrapper`.
_HARMLESS = {
    "ClipReward",
    "HumanRendering",
    "Monitor",
    "NormalizeReward",
    "OrderEnforcing",
    "PassiveEnvChecker",
    "RecordEpisodeStatistics",
    "RecordVideo",
    "RenderCollection",
    "TimeLimit",
    "TransformReward",
}


class Layers(NamedTuple):
    """What a model sees its cars through.

    Attributes:
        env_id, scenario: of the cars.
        normalize: the `VecNormalize`, None for none.
        frames: observations that are stacked.
        normalized_frames: whether each frame is normalised before it is stacked.
        rewards: wrappers of the reward, "module:class".
    """

    env_id: str
    scenario: CarScenario
    normalize: Any
    frames: int
    normalized_frames: bool
    rewards: tuple[str, ...] = ()


def layers_of(env: Any) -> Layers:
    """Read the layers of a model's environment.

    Raises:
        ValueError: a layer, wrapper or environment that a policy file cannot hold; names it.
    """
    normalize: Any = None
    frames, normalized_frames = 1, False
    layer = env
    while isinstance(layer, (VecNormalize, VecFrameStack, *_TRANSPARENT)):
        if isinstance(layer, VecNormalize):
            if normalize is not None:
                raise ValueError("env has two layers of VecNormalize; allowed: one")
            normalize, normalized_frames = layer, frames > 1
        if isinstance(layer, VecFrameStack):
            if frames > 1:
                raise ValueError("env has two layers of VecFrameStack; allowed: one")
            frames = layer.stacked_obs.n_stack
        layer = layer.venv
    if isinstance(layer, CarVecEnv):
        vector: Any = layer.env.unwrapped
        return Layers(vector.spec.id, vector.scenario, normalize, frames, normalized_frames)
    if not isinstance(layer, DummyVecEnv | SubprocVecEnv):
        raise ValueError(
            f"env has the layer {type(layer).__name__}, which a policy file cannot hold; allowed: VecNormalize, "
            "VecFrameStack, VecMonitor, VecVideoRecorder and VecCheckNan over sb3_vec_env(...), make_vec_env(...), "
            "DummyVecEnv or SubprocVecEnv"
        )
    env_id, scenario, rewards = _cars(layer)
    return Layers(env_id, scenario, normalize, frames, normalized_frames, rewards)


def _cars(layer: VecEnv) -> tuple[str, CarScenario, tuple[str, ...]]:
    """Id, scenario and reward wrappers of environments that Stable-Baselines3 drives one by one."""
    spec, *others = layer.get_attr("spec")
    try:
        scenario, *further = layer.get_attr("scenario")
    except AttributeError:
        scenario, further = None, []
    if spec is None or not isinstance(scenario, CarScenario):
        raise ValueError(f"env={shown(spec and spec.id)} is not allowed: it must be one of lanekeep's ids")
    if any(one != scenario for one in further):
        raise ValueError("env has cars of more than one scenario; a policy file is for one")
    wrappers = {w.entry_point: w.name for one in (spec, *others) for w in one.additional_wrappers}
    rewards = tuple(sorted(point for point, name in wrappers.items() if name not in _HARMLESS))
    for point in rewards:
        if not _changes_rewards(point):
            raise ValueError(
                f"env has the wrapper {wrappers[point]}, which a policy file cannot hold; allowed: "
                f"{', '.join(sorted(_HARMLESS))}, and what is derived from gymnasium.RewardWrapper, in a module or a "
                "script, not in a function"
            )
    expected = observation_space(scenario), Box(-1.0, 1.0, (scenario.num_actions,))
    if (layer.observation_space, layer.action_space) != expected:
        raise ValueError(
            "env observes or acts otherwise than its cars: it has a wrapper that a policy file cannot hold"
        )
    return spec.id, scenario, rewards


def _changes_rewards(entry_point: str) -> bool:
    """Whether a wrapper, "module:class", leaves observations and actions as they are by being a `RewardWrapper`."""
    try:
        wrapper = resolve_name(entry_point)
    except (ImportError, AttributeError, ValueError):  # a class within a function
        return False
    return isinstance(wrapper, type) and issubclass(wrapper, gym.RewardWrapper)
