"""What the single and the vector form of an environment share, and what both check of their arguments."""

from __future__ import annotations

import inspect
import operator
from dataclasses import fields, replace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box

from lanekeep_env.checks import choose, shown
from lanekeep_env.plain import json_able
from lanekeep_env.scenario import Channel
from lanekeep_env.scenario.car import CarScenario

PRECISIONS = ("float64", "float32")
RENDER_MODES = ("human", "rgb_array")


class Skin:
    """A family adds how its cars and pictures are made, a task its scenario.

    Kernels are imported with the first environment of a family, so that ``import lanekeep_env`` is quick.
    """

    scenario_class: type[CarScenario]
    #: Truth in the infos beside what all families tell, its name and its row in the outcome.
    further: ClassVar[tuple[tuple[str, int], ...]] = ()
    scenario: Any
    _core: Any
    _spec: EnvSpec | None = None
    #: What the scenario says, and nobody can set.
    _settled: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if "scenario_class" in cls.__dict__:
            cls._settled = frozenset({f.name for f in fields(cls.scenario_class)} | {"channels", "hash"})

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made the environment from; its ``max_episode_steps`` is what this scenario's episodes have."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            self._check_limit(spec.max_episode_steps or _limit_given_to_make())
            # None is registered: a number there would cut every longer `episode_steps`. Trainers read it here.
            limit = spec.max_episode_steps or self.scenario.episode_steps
            spec = replace(spec, max_episode_steps=limit, kwargs=json_able(spec.kwargs))
        self._spec = spec

    def _check_limit(self, limit: int | None) -> None:
        """Raise ValueError for a limit of control steps that episodes do not reach: it would change nothing."""
        if limit is not None and limit > self.scenario.episode_steps:
            raise ValueError(
                f"max_episode_steps={shown(limit)} is not allowed: an episode of this scenario has "
                f"{self.scenario.episode_steps} steps, and more take episode_steps={shown(limit)} (or no limit)"
            )

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse what would change nothing: a scenario is settled when the environment is made."""
        if name in self._settled or (name == "scenario" and name in self.__dict__):
            raise AttributeError(
                f"{name} cannot be set: it is settled when the environment is made. Make another one with it, or give "
                "reset(options=...) what episodes may differ in"
            )
        super().__setattr__(name, value)

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        raise NotImplementedError

    @staticmethod
    def make_picture(scenario: Any) -> Any:
        """Return what draws a car of the scenario."""
        raise NotImplementedError

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Name, unit, bounds and meaning of each entry of an observation."""
        channels: tuple[Channel, ...] = self.scenario.channels
        return channels


def _limit_given_to_make() -> int | None:
    """Return ``max_episode_steps`` of the ``gym.make`` that sets a spec: it tells its own wrapper, but not us."""
    caller = inspect.currentframe()
    for _ in range(3):  # behind the setter and `__setattr__`
        caller = caller and caller.f_back
    limit = caller.f_locals.get("max_episode_steps") if caller and caller.f_code is gym.make.__code__ else None
    return limit if isinstance(limit, int) else None


def observation_space(scenario: CarScenario) -> Box:
    """Box with the bounds of the scenario's channels."""
    low, high = scenario.channel_bounds().T
    return Box(low.copy(), high.copy(), dtype=np.float32)


def seed_from(value: Any) -> int | None:
    """Read a seed: None or a whole number, of which Gymnasium refuses those below zero."""
    try:
        return None if value is None else operator.index(value)
    except TypeError:
        raise ValueError(f"seed={shown(value)} is not allowed: it must be a whole number >= 0 or None") from None


def check_modes(render_mode: str | None, dtype: str) -> None:
    """Raise ValueError for a render mode or precision that does not exist."""
    if render_mode is not None:
        choose("render_mode", render_mode, RENDER_MODES)
    choose("dtype", dtype, PRECISIONS)
