"""What a training run is: algorithm, environment, seed, steps and hyper-parameters, out of one YAML file each."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

import lanekeep_env
from lanekeep_agents.activations import ACTIVATIONS
from lanekeep_agents.training.parameters import check_parameters
from lanekeep_env.checks import choose, from_mapping, nearest, plain_numbers, require, shown
from lanekeep_env.plain import parse_json

HYPERPARAMETERS = Path(__file__).parents[1] / "hyperparameters"
ALGORITHMS = ("ppo", "sac", "td3")
#: Keywords of ``gym.make_vec`` that are not those of the environment.
_OWN_KEYWORDS = ("num_envs", "autoreset_mode", "vectorization_mode", "render_mode")
#: What has an option of its own.
_OPTIONS = {"algorithm": "ALGO", "env_id": "ENV"} | {
    name: f"--{name}" for name in ("seed", "steps", "base", "bound", "imitate")
}
#: Characters of a value that is given as text.
_LONGEST_TEXT = 1 << 14


@dataclass(frozen=True)
class TrainingSettings:
    """Everything that fixes a training run.

    Attributes:
        algorithm: "ppo", "sac" or "td3".
        env_id: a registered id.
        seed: of the run; what is drawn from it is hashed (`seed_of`).
        env: keywords of ``gym.make`` for that id.
        steps: environment steps in all, over all cars.
        num_envs: cars.
        hidden: neurons of each hidden layer of the actor.
        critic: the same of the critic, which nobody has to run later.
        activation: of the hidden layers, one of `ACTIVATIONS`.
        gamma: discount of a control step.
        learning_rate: at the start; it falls linearly to ``final_learning_rate`` times that.
        parameters: further arguments of Stable-Baselines3's algorithm (`parameters.py` has them).
        log_std: of the first actions' noise (PPO), natural logarithm.
        action_noise: standard deviation of the exploration (TD3).
        reward_scale: factor of the rewards, so that returns are of order one to a hundred.
        largest_cost: of a control step that is learned from, as a share of the environment's largest: with less, cars
            that are far out of the lane do not drown what those in it can learn.
        evaluations: times that the policy is tried on held-out seeds, evenly spread over the run.
        evaluation_episodes: each time.
        base: classical policy that is corrected, None for a policy on its own.
        bound: largest correction, as a share of the largest action.
        imitate: classical policy that is imitated first, or None.
    """

    algorithm: str
    env_id: str
    seed: int
    steps: int
    num_envs: int
    hidden: tuple[int, ...]
    critic: tuple[int, ...]
    gamma: float
    learning_rate: float
    activation: str = "relu"
    final_learning_rate: float = 0.0
    env: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    log_std: float = 0.0
    action_noise: float = 0.1
    reward_scale: float = 1.0
    largest_cost: float = 1.0
    evaluations: int = 20
    evaluation_episodes: int = 128
    base: str | None = None
    bound: float | None = None
    imitate: str | None = None

    def __post_init__(self) -> None:
        choose("ALGO", self.algorithm, ALGORITHMS)
        choose("ENV", self.env_id, lanekeep_env.ENVIRONMENTS)
        require("seed", self.seed, "", at_least=0, at_most=10**18, whole=True)
        require("steps", self.steps, "environment steps", at_least=1, at_most=10**15, whole=True)
        require("num_envs", self.num_envs, "cars", at_least=1, at_most=100_000, whole=True)
        for name, layers in (("hidden", self.hidden), ("critic", self.critic)):
            if not isinstance(layers, list | tuple) or len(layers) > 8:
                raise ValueError(
                    f"{name}={shown(layers)} is not allowed: it must be a list of at most 8 numbers of neurons"
                )
            for neurons in layers:
                require(name, neurons, "neurons", at_least=2, at_most=4096, whole=True)
            object.__setattr__(self, name, tuple(int(neurons) for neurons in layers))
        for name, value in (("env", self.env), ("parameters", self.parameters)):
            if not isinstance(value, Mapping):
                raise ValueError(f"{name}={shown(value)} is not allowed: it must be a mapping, e.g. {name}.NAME=VALUE")
        for name in self.env:
            if name in _OWN_KEYWORDS:
                raise ValueError(f"env.{name} is not allowed: training sets it itself")
        try:
            parse_json(json.dumps(dict(self.env)))
        except (TypeError, ValueError, RecursionError) as error:
            raise ValueError(
                f"env={shown(self.env)} is not allowed: a record must hold it as JSON ({shown(str(error))})"
            ) from None
        object.__setattr__(self, "parameters", check_parameters(self.algorithm, self.parameters))
        choose("activation", self.activation, ACTIVATIONS)
        require("gamma", self.gamma, "", above=0.0, at_most=0.9999)
        require("learning_rate", self.learning_rate, "", above=0.0)
        require("final_learning_rate", self.final_learning_rate, "(a share)", at_least=0.0, at_most=1.0)
        require("log_std", self.log_std, "", at_least=-20.0, at_most=2.0)
        require("action_noise", self.action_noise, "", at_least=0.0)
        require("reward_scale", self.reward_scale, "", above=0.0)
        require("largest_cost", self.largest_cost, "(a share)", above=0.0, at_most=1.0)
        require("evaluations", self.evaluations, "", at_least=1, at_most=10_000, whole=True)
        require("evaluation_episodes", self.evaluation_episodes, "", at_least=1, at_most=100_000, whole=True)
        if (self.base is None) != (self.bound is None):
            raise ValueError(f"base={shown(self.base)} and bound={shown(self.bound)}: both or neither must be given")
        require("bound", self.bound, "(a share of the largest action)", above=0.0, at_most=2.0, optional=True)
        if self.base is not None and self.imitate is not None:
            raise ValueError("base and imitate exclude each other: a correction starts with its base's actions")
        plain_numbers(self)

    def to_dict(self) -> dict[str, Any]:
        """JSON-able values; `TrainingSettings` of them is the same again."""
        return {**asdict(self), "hidden": list(self.hidden), "critic": list(self.critic)}

    @classmethod
    def from_dict(cls, values: Any, what: str) -> TrainingSettings:
        """Read what `to_dict` gave; ValueError or TypeError names the field."""
        return from_mapping(cls, values, what)

    def seed_of(self, purpose: str) -> int:
        """A seed for one purpose ("training", "evaluation", "imitation"): 31 bits of a hash.

        Cars get the seeds from there on, one each, so that the runs of seeds s and s + 1 share no car.
        """
        text = json.dumps([purpose, self.algorithm, self.env_id, self.seed])
        return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") >> 33


def settings_for(
    algorithm: str, env_id: str, seed: int = 0, steps: int | None = None, **changes: Any
) -> TrainingSettings:
    """Return the settings of the algorithm's YAML file for an id, with changes.

    Args:
        algorithm: "ppo", "sac" or "td3".
        env_id: a registered id, "lanekeep/" may be left out.
        seed: of the run.
        steps: environment steps; None takes the file's.
        changes: fields of `TrainingSettings`; mappings (``env``, ``parameters``) are merged into the file's.

    Raises:
        ValueError: a value that is not allowed. TypeError: an unknown field; the nearest one is named.
    """
    choose("ALGO", algorithm, ALGORITHMS)
    env_id = env_id if "/" in env_id else f"lanekeep/{env_id}"
    choose("ENV", env_id, lanekeep_env.ENVIRONMENTS)
    entries = yaml.safe_load((HYPERPARAMETERS / f"{algorithm}.yaml").read_text())
    allowed = [f.name for f in fields(TrainingSettings)]
    values: dict[str, Any] = {"algorithm": algorithm, "env_id": env_id, "seed": seed}
    asked = {name: value for name, value in changes.items() if value is not None or name not in _OPTIONS}
    if steps is not None:
        asked["steps"] = steps
    residual = entries.get("residual", {}) if asked.get("base") is not None else {}
    for layer in (entries["default"], entries.get(env_id, {}), residual, asked):
        for name, value in layer.items():
            if name not in allowed:
                raise TypeError(f"unknown setting {shown(name)}{nearest(name, allowed)}; allowed: {', '.join(allowed)}")
            merges = isinstance(value, Mapping) and isinstance(values.get(name), Mapping)
            values[name] = {**values[name], **value} if merges else value
    return TrainingSettings(**values)


def changes_from(texts: Sequence[str]) -> dict[str, Any]:
    """Read ``NAME=VALUE`` texts; VALUE is JSON or YAML, and NAME may be that of an entry: "env.preview=20".

    Raises:
        ValueError: a text that is not of that form.
    """
    changes: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        outer, dot, inner = name.partition(".")
        if not equals or not outer or (dot and not inner):
            raise ValueError(f"--set {shown(text)} is not allowed: it must be NAME=VALUE, e.g. learning_rate=1e-3")
        if outer in _OPTIONS:
            raise ValueError(f"--set {shown(text)} is not allowed: {outer} is given by {_OPTIONS[outer]}")
        read = _read(value, text)
        if dot:
            whole = changes.setdefault(outer, {})
            if not isinstance(whole, dict):
                raise ValueError(f"--set {shown(text)} is not allowed: {outer}={shown(whole)} is not a mapping")
            whole[inner] = read
        else:
            changes[outer] = read
    return changes


class _Loader(yaml.SafeLoader):  # type: ignore[misc]
    """YAML without names for its parts: what is repeated by name grows beyond any bound."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise ValueError("aliases (*) are not read")
        return super().compose_node(parent, index)


def _read(value: str, text: str) -> Any:
    try:
        if len(value) > _LONGEST_TEXT:
            raise ValueError(f"it has {len(value)} characters, allowed are {_LONGEST_TEXT}")
        with suppress(json.JSONDecodeError):
            return parse_json(value)  # to YAML, 1e-5 is a word
        return yaml.load(value, _Loader)
    except Exception as error:  # PyYAML has many kinds: IndexError for an empty int, AttributeError for a broken date
        told = shown(" ".join(str(error).split())) if str(error) else type(error).__name__
        raise ValueError(f"--set {shown(text)} is not allowed: {told}") from None
