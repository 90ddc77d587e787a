"""What a student learns from: sets of episodes, each a scenario and how noisy its sensors are, read from TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from lanekeep_env import ENVIRONMENTS
from lanekeep_env.checks import choose, from_mapping, require, shown, shown_path
from lanekeep_env.files import read_bounded

#: Bytes beyond which a mix is not read.
LARGEST_MIX = 1 << 16
MOST_SETS, MOST_EPISODES = 64, 256


@dataclass(frozen=True)
class Lessons:
    """A set of episodes.

    Attributes:
        name: short, for files.
        env_id: registered; its channels are those of the student's environment.
        keywords: of ``gym.make_vec``.
        episodes: of the teacher.
        weight: of the set.
        noise: factors of the sensor set "production", 0 for perfect sensors; the student drives the set once with each,
            and its controllers are told of factor 1 at most.
    """

    name: str
    env_id: str = "lanekeep/LaneKeep-v0"
    keywords: Mapping[str, Any] = field(default_factory=dict)
    episodes: int = 64
    weight: float = 1.0
    noise: tuple[float, ...] = (0.0,)

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name.replace("-", "").isalnum() and self.name.isascii()):
            raise ValueError(f"set.name={shown(self.name)} is not allowed: it must be letters, digits and hyphens")
        choose("set.env_id", self.env_id, tuple(ENVIRONMENTS))
        if not isinstance(self.keywords, Mapping):
            raise ValueError(f"set.keywords={shown(self.keywords)} is not allowed: it must be a table")
        require("set.episodes", self.episodes, "", at_least=1, at_most=MOST_EPISODES, whole=True)
        require("set.weight", self.weight, "", above=0.0, at_most=1e6)
        if not isinstance(self.noise, list | tuple) or not 1 <= len(self.noise) <= 8:
            raise ValueError(f"set.noise={shown(self.noise)} is not allowed: it must be a list of 1 to 8 factors")
        for factor in self.noise:
            require("set.noise", factor, "(a factor)", at_least=0.0, at_most=10.0)
        object.__setattr__(self, "noise", tuple(map(float, self.noise)))

    def with_noise(self, factor: float) -> dict[str, Any]:
        """The keywords with noisy sensors."""
        if not factor:
            return dict(self.keywords)
        keywords = {**self.keywords, "sensors": "production"}
        told: Any = ENVIRONMENTS[self.env_id].scenario.from_keywords(**keywords)
        noisy = {name: {**asdict(sensor), "noise": factor * sensor.noise} for name, sensor in told.sensors}
        return {**keywords, "sensors": noisy}


@dataclass(frozen=True)
class Mix:
    """What a student is and what it learns from; the fields of `Student` beside the sets and the number of rounds."""

    base: str
    beside: tuple[str, ...]
    bound: float
    fade: float
    rounds: int
    sets: tuple[Lessons, ...]

    def __post_init__(self) -> None:
        if not isinstance(self.base, str) or not all(isinstance(name, str) for name in self.beside):
            raise ValueError(
                f"base={shown(self.base)}, beside={shown(self.beside)} are not allowed: they must be names"
            )
        object.__setattr__(self, "beside", tuple(self.beside))
        require("bound", self.bound, "(a share of the action)", above=0.0, at_most=2.0)
        require("fade", self.fade, "s", at_least=0.1, at_most=1e6)
        require("rounds", self.rounds, "", at_least=1, at_most=100, whole=True)
        if not 1 <= len(self.sets) <= MOST_SETS:
            raise ValueError(f"a mix has {len(self.sets)} sets; allowed are 1 to {MOST_SETS}")
        names = [one.name for one in self.sets]
        if len(set(names)) < len(names):
            raise ValueError(f"names of sets must differ: {shown(names)}")


def read_mix(path: str | Path) -> Mix:
    """Read a mix; its ``common.keywords`` stand before those of every set, its ``common.env_id`` for sets without one.

    Raises:
        ValueError: it is missing or none; one line with file, field, value and what is allowed.
    """
    try:
        return _mix(tomllib.loads(read_bounded(path, LARGEST_MIX).decode()))
    except OSError as error:
        raise ValueError(f"mix {shown_path(path)}: {error.strerror}; allowed: the path of a .toml file") from None
    except (ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"mix {shown_path(path)}: {' '.join(str(error).split())}") from None


def _mix(table: dict[str, Any]) -> Mix:
    common, sets = table.pop("common", {}), table.pop("set", None)
    if not isinstance(sets, list) or not all(isinstance(one, dict) for one in sets):
        raise ValueError("it has no tables [[set]]")
    shared = common.get("keywords", {}) if isinstance(common, dict) else None
    if not isinstance(shared, dict):
        raise ValueError("common.keywords is not allowed: it must be a table")
    ids = {"env_id": common["env_id"]} if "env_id" in common else {}
    lessons = tuple(from_mapping(Lessons, {**ids, **one}, "set") for one in sets)
    lessons = tuple(replace(one, keywords={**shared, **one.keywords}) for one in lessons)
    for name in ("base", "beside", "bound", "fade", "rounds"):
        if name not in table:
            raise ValueError(f"{name} is missing")
    return from_mapping(Mix, {**table, "sets": lessons}, "the mix")
