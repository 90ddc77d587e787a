"""What a learned policy is: the record beside its weights, checked when it is built."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from itertools import pairwise
from typing import Any, ClassVar, Self

from lanekeep_agents.activations import ACTIVATIONS
from lanekeep_agents.student_record import Student
from lanekeep_env import ENVIRONMENTS
from lanekeep_env.adapters import ADAPTED
from lanekeep_env.checks import LONGEST_ECHO, choose, from_mapping, plain_numbers, require, shown

#: Of the files that this version writes and reads.
FORMAT = 1
#: The largest float32.
LARGEST_CLIP = (2.0 - 2.0**-23) * 2.0**127
#: Levels that the values of a scenario or a training may have; they have four.
DEEPEST = 32

Shape = tuple[int, ...]


@dataclass(frozen=True)
class InputChannel:
    """A channel of the observation that the policy reads; bounds are None in files that are older than them."""

    name: str
    unit: str
    description: str
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        for field in ("name", "unit", "description"):
            _text(f"channels.{field}", getattr(self, field), empty=field != "name")
        for field in ("low", "high"):
            require(f"channels.{field}", getattr(self, field), self.unit, optional=True)


@dataclass(frozen=True)
class Network:
    """A network of dense layers.

    Attributes:
        hidden: width of each hidden layer.
        activation: of the hidden layers, one of `ACTIVATIONS`.
        squash: whether the output goes through tanh, as the actors of SAC and TD3; PPO's is clipped.
    """

    hidden: tuple[int, ...]
    activation: str
    squash: bool

    def __post_init__(self) -> None:
        if not isinstance(self.hidden, tuple | list) or len(self.hidden) > 8:
            raise ValueError(
                f"network.hidden={shown(self.hidden)} is not allowed: it must be a list of at most 8 widths"
            )
        for width in self.hidden:
            require("network.hidden", width, "units", at_least=2, at_most=4096, whole=True)
        object.__setattr__(self, "hidden", tuple(int(width) for width in self.hidden))
        choose("network.activation", self.activation, ACTIVATIONS)
        if not isinstance(self.squash, bool):
            raise ValueError(f"network.squash={shown(self.squash)} is not allowed: it must be true or false")


@dataclass(frozen=True)
class Normalisation:
    """Inputs are clip((x - mean) / sqrt(variance + epsilon), -clip, clip); mean and variance are tensors."""

    clip: float = 10.0
    epsilon: float = 1e-8

    def __post_init__(self) -> None:
        require("normalisation.clip", self.clip, "", above=0.0, at_most=LARGEST_CLIP)
        require("normalisation.epsilon", self.epsilon, "", above=0.0)
        plain_numbers(self)


@dataclass(frozen=True)
class Training:
    """How the policy came about: enough to train it again.

    Attributes:
        command: that trains it.
        hyperparameters: of the algorithm.
        seed, steps, seconds: of the training run.
        versions: of the packages that trained it.
        scores: of the finished policy.
    """

    command: str
    hyperparameters: Mapping[str, Any]
    seed: int
    steps: int
    seconds: float
    versions: Mapping[str, Any]
    scores: Mapping[str, Any]

    def __post_init__(self) -> None:
        _text("training.command", self.command)
        for field in ("hyperparameters", "versions", "scores"):
            object.__setattr__(self, field, _mapping(f"training.{field}", getattr(self, field)))
        require("training.seed", self.seed, "", at_least=0, whole=True)
        require("training.steps", self.steps, "steps", at_least=0, whole=True)
        require("training.seconds", self.seconds, "s", at_least=0.0)
        plain_numbers(self)


@dataclass(frozen=True)
class PolicyRecord:
    """Everything about a learned policy but its weights; what `NAME.json` holds.

    Attributes:
        name: of the policy.
        algorithm: that trained it, e.g. "PPO".
        env_id: of the environment that it was trained in,
        scenario, scenario_hash: and its scenario, as `to_dict` and `hash` give them.
        channels: that it reads, in the order of its inputs.
        actions: numbers of an action.
        action, max_steering_angle, max_steering_rate, control_step: of the scenario: "steering_angle" or
            "steering_rate", rad, rad/s and s at action 1.
        network, normalisation: how the weights are used.
        training: how they came about.
        base: classical policy that this one corrects, None for none; its actions are inputs behind the channels.
        bound: largest correction of an action, None without a base.
        frames: observations that the policy sees at once, the present one and those before it.
        student: what makes it one with memory, whose network has no layer and reads nothing; None for another.
        sha256: of the file of weights; `write_policy` fills it in.

    Raises:
        ValueError: a field that is not allowed.
    """

    name: str
    algorithm: str
    env_id: str
    scenario: Mapping[str, Any]
    scenario_hash: str
    channels: tuple[InputChannel, ...]
    actions: int
    action: str
    max_steering_angle: float
    max_steering_rate: float
    control_step: float
    network: Network
    normalisation: Normalisation
    training: Training
    base: str | None = None
    bound: float | None = None
    frames: int = 1
    sha256: str = ""
    student: Student | None = None

    _parts: ClassVar[Mapping[str, Callable[[Any], Any]]] = {
        "channels": lambda value: _channels(value),
        "network": lambda value: _part(Network, value, "network"),
        "normalisation": lambda value: _part(Normalisation, value, "normalisation"),
        "training": lambda value: _part(Training, value, "training"),
        "student": lambda value: None if value is None else _part(Student, value, "student", True),
    }

    def __post_init__(self) -> None:
        for name, read in self._parts.items():
            object.__setattr__(self, name, read(getattr(self, name)))
        if not isinstance(self.name, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,199}", self.name):
            raise ValueError(
                f"name={shown(self.name)} is not allowed: it must be letters, digits and . _ + -, 200 of them at most"
            )
        _text("algorithm", self.algorithm)
        choose("env_id", self.env_id, (*ENVIRONMENTS, *ADAPTED))
        object.__setattr__(self, "scenario", _mapping("scenario", self.scenario))
        _digits("scenario_hash", self.scenario_hash, 16)
        require("actions", self.actions, "numbers", at_least=1, at_most=2, whole=True)
        choose("action", self.action, ("steering_angle", "steering_rate"))
        require("max_steering_angle", self.max_steering_angle, "rad", above=0.0, at_most=1.5)
        require("max_steering_rate", self.max_steering_rate, "rad/s", above=0.0)
        require("control_step", self.control_step, "s", above=0.0, at_most=1.0)
        if self.base is not None:
            _text("base", self.base)
            require("bound", self.bound, "(a share of the action)", above=0.0, at_most=2.0)
        elif self.bound is not None:
            raise ValueError(f"bound={shown(self.bound)} is not allowed: it must be null where base is null")
        require("frames", self.frames, "observations", at_least=1, at_most=256, whole=True)
        if self.frames > 1 and self.base is not None:
            raise ValueError(f"frames={self.frames} is not allowed: it must be 1 where there is a base")
        if self.student is not None:
            self._check_student(self.student)
        if self.sha256:
            _digits("sha256", self.sha256, 64)
        plain_numbers(self)

    def _check_student(self, student: Student) -> None:
        for field, value, wanted in (
            ("base", self.base is not None, "the controller that is corrected"),
            ("actions", self.actions == 1, "1"),
            ("frames", self.frames == 1, "1"),
            ("network.hidden", not self.network.hidden, "[]"),
        ):
            if not value:
                raise ValueError(f"{field} is not allowed: it must be {wanted} where there is a student")
        student.check([channel.name for channel in self.channels])

    @property
    def bases(self) -> tuple[str, ...]:
        """Classical policies that it takes: the one that it corrects, and those that it listens to beside it."""
        return () if self.base is None else (self.base, *(self.student.beside if self.student else ()))

    @property
    def inputs(self) -> int:
        """Inputs of the network."""
        return self.frames * len(self.channels) + (self.actions if self.base is not None else 0)

    @property
    def shapes(self) -> dict[str, Shape]:
        """Shape of each tensor."""
        if self.student is not None:
            products = enumerate(self.student.products)
            return {f"products.{i}": (len(product.left), len(product.right)) for i, product in products}
        shapes: dict[str, Shape] = {"mean": (self.inputs,), "variance": (self.inputs,)}
        if self.frames > 1:
            shapes["before"] = (self.inputs - len(self.channels),)
        widths = (self.inputs, *self.network.hidden, self.actions)
        for i, (before, after) in enumerate(pairwise(widths)):
            shapes |= {f"layers.{i}.weight": (after, before), f"layers.{i}.bias": (after,)}
        return shapes

    def to_dict(self) -> dict[str, Any]:
        """Return the record as JSON-able values; `from_dict` reads them back."""
        values = {"format": FORMAT, **asdict(self)}
        if self.student is None:  # as files were before there were any
            del values["student"]
        return values

    @classmethod
    def from_dict(cls, values: Any) -> Self:
        """Build a record from all of its fields.

        Raises:
            ValueError: another format, a field that is missing, unknown, or not allowed.
        """
        if not isinstance(values, Mapping) or "format" not in values:
            raise ValueError("format is missing: not the record of a learned policy")
        if values["format"] != FORMAT or isinstance(values["format"], bool):
            raise ValueError(f"format={shown(values['format'])} is unknown; allowed: {FORMAT}")
        given = {"frames": 1, "student": None, **values}  # of which older files do not know
        record = _part(cls, {name: value for name, value in given.items() if name != "format"}, "the record", True)
        _digits("sha256", record.sha256, 64)
        return record

    def with_sha256(self, sha256: str) -> Self:
        """Return the record of weights whose file has this sum."""
        return replace(self, sha256=sha256)


def _part(record: type[Any], value: Any, name: str, whole: bool = False) -> Any:
    """Read a part of the record; ``whole`` wants the fields that have defaults as well."""
    if isinstance(value, record):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be a mapping of {record.__name__}'s fields")
    for field in fields(record):
        if whole and field.name not in value:
            raise ValueError(f"{name} lacks the field {field.name!r}")
    return from_mapping(record, value, name)


def _channels(value: Any) -> tuple[InputChannel, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str) or not value:
        raise ValueError(f"channels={shown(value)} is not allowed: it must be a list of at least one channel")
    channels = tuple(_part(InputChannel, channel, f"channels[{i}]") for i, channel in enumerate(value))
    names = [channel.name for channel in channels]
    if len(set(names)) < len(names):
        raise ValueError(f"channels={shown(names)} is not allowed: a name appears twice")
    return channels


def _text(name: str, value: Any, empty: bool = False) -> None:
    if not isinstance(value, str) or not (value or empty):
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be text")


def _digits(name: str, value: Any, number: int) -> None:
    if not isinstance(value, str) or not re.fullmatch(f"[0-9a-f]{{{number}}}", value):
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be {number} hexadecimal digits")


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}={shown(value)} is not allowed: it must be a mapping")
    return _plain(name, value)


def _plain(name: str, value: Any, level: int = 0) -> Any:
    """Return a value as JSON gives it back."""
    if level > DEEPEST:
        raise ValueError(f"{name} is nested too deeply; allowed are {DEEPEST} levels")
    if isinstance(value, Mapping):
        for key in value:
            _text(f"a key of {name}", key, empty=True)
        return {key: _plain(f"{name}.{key[:LONGEST_ECHO]}", one, level + 1) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(name, one, level + 1) for one in value]
    if value is None or isinstance(value, bool | int | str) or (isinstance(value, float) and math.isfinite(value)):
        return value
    raise ValueError(
        f"{name}={shown(value)} is not allowed: it must be a finite number, text, true, false, null or a list"
    )
