"""What the single and the vector form of an environment share, and what both check of their arguments."""

from __future__ import annotations

import inspect
import operator
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box

from lanekeep_env.checks import choose, shown
from lanekeep_env.engine.reset_options import page_section
from lanekeep_env.envs.info import Rows, info_reader, step_reader
from lanekeep_env.plain import json_able
from lanekeep_env.scenario import Channel
from lanekeep_env.scenario.car import CarScenario

PRECISIONS = ("float64", "float32")
RENDER_MODES = ("human", "rgb_array")
#: Section of an environment's page that the options of ``reset`` stand before.
_BEFORE = "## Episode End"


class Skin:
    """A family adds how its cars and pictures are made, a task its scenario.

    Kernels are imported with the first environment of a family, so that ``import lanekeep_env`` is quick.
    """

    scenario_class: type[CarScenario]
    #: What ``reset(options=...)`` may fix, and what that is.
    starts: ClassVar[Mapping[str, str]]
    #: Truth in the infos beside what all families tell, its name and its row in the outcome.
    further: ClassVar[Rows] = ()
    #: Makes an info of an outcome's rows, success and termination.
    _info: ClassVar[Callable[..., dict[str, Any]]]
    #: Makes of an observation and one car's outcome what a step returns.
    _told: ClassVar[Callable[..., tuple[Any, float, bool, bool, dict[str, Any]]]]
    scenario: Any
    _core: Any
    _spec: EnvSpec | None = None
    #: What the scenario says, and nobody can set.
    _settled: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        cls._info = staticmethod(info_reader(cls.further))
        cls._told = staticmethod(step_reader(cls.further))
        if "scenario_class" in cls.__dict__:
            cls._settled = frozenset({f.name for f in fields(cls.scenario_class)} | {"channels", "hash"})
        page = inspect.cleandoc(cls.__dict__.get("__doc__") or "")
        if _BEFORE in page:
            cls.__doc__ = page.replace(_BEFORE, page_section(cls.starts) + _BEFORE)

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made the environment from; its ``max_episode_steps`` is what this scenario's episodes have."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            self._check_limit(spec.max_episode_steps or _limit_of_make())
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
                "reset(options=...) or narrow(...) what episodes may differ in"
            )
        super().__setattr__(name, value)

    def narrow(self, options: dict[str, Any]) -> None:
        """Bound what the next episodes draw, and start none: for a curriculum in the middle of a rollout.

        Args:
            options: those of `reset`; what fixes the start of an episode is passed over.

        Raises:
            ValueError: an option is unknown, or a bound is outside the scenario's ``randomisation``.
        """
        self._core.narrow(options)

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


def _limit_of_make() -> int | None:
    """Return the limit of the ``gym.make`` that sets a spec, its own or that of what it makes: its wrapper is told, we
    are not. Where the call says how long episodes are, what a spec says of others is no matter."""
    caller = inspect.currentframe()
    for _ in range(3):  # behind the setter and `__setattr__`
        caller = caller and caller.f_back
    if caller is None or caller.f_code is not gym.make.__code__:
        return None
    told = caller.f_locals
    limit = told["max_episode_steps"]
    if limit is None and told["kwargs"].keys().isdisjoint(("episode_steps", "scenario")):
        limit = told["env_spec"].max_episode_steps
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


def require_numbers(actions: np.ndarray) -> None:
    """Raise TypeError for what NumPy would turn into numbers: text that reads like some, dates, complex ones."""
    if actions.dtype.kind not in "fiubO":
        raise TypeError


def check_modes(render_mode: str | None, dtype: str) -> None:
    """Raise ValueError for a render mode or precision that does not exist."""
    if render_mode is not None:
        choose("render_mode", render_mode, RENDER_MODES)
    choose("dtype", dtype, PRECISIONS)
