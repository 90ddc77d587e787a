"""What the single and the vector form of an environment share, and what both check of their arguments."""

from __future__ import annotations

import operator
from copy import copy
from typing import Any, ClassVar

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Box

from lanekeep_env.checks import choose, shown
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

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium made the environment from; its ``max_episode_steps`` is what this scenario's episodes have."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        # None is registered: a number there would cut every longer `episode_steps`. Trainers read it here.
        if spec is not None and spec.max_episode_steps is None:
            spec = copy(spec)
            spec.max_episode_steps = self.scenario.episode_steps
        self._spec = spec

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
