"""One car of a compiled kernel as a Gymnasium environment: what all tasks share."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box

from lanekeep_env import layout as at
from lanekeep_env.checks import shown
from lanekeep_env.envs.skin import RENDER_MODES, Skin, check_modes, observation_space, require_numbers, seed_from
from lanekeep_env.plain import own
from lanekeep_env.rendering.window import Window

#: Views, which would come back from a pickle as copies, and functions.
_NOT_KEPT = ("_action", "_look", "_tell", "_arguments", "_step")


def _never_reset(*_: Any) -> None:
    raise gym.error.ResetNeeded("call reset() before step()")


#: The one car, as a mask.
_ONE = np.ones(1, dtype=np.bool_)


class SingleEnv(Skin, gym.Env[np.ndarray, np.ndarray]):
    """One car; a family is mixed in, and subclasses name the task's scenario and are its page of documentation."""

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012 (as Gymnasium declares it)
    #: The kernel and its arguments, once there is an episode to go on with.
    _step: Callable[..., None] = staticmethod(_never_reset)
    _arguments: tuple[Any, ...] = ()

    def __init__(self, *, render_mode: str | None = None, dtype: str = "float64", **scenario: Any) -> None:
        check_modes(render_mode, dtype)
        self.scenario = self.scenario_class.from_keywords(("render_mode", "dtype"), **scenario)
        self.render_mode = render_mode
        self._shown = render_mode == "human"
        # Pictures are made when the first one is asked for: trainers ask for the mode alone, and need no pygame.
        self._picture: Any = self.make_picture(self.scenario) if self._shown else None
        self._window: Window | None = None
        self.observation_space = observation_space(self.scenario)
        self._core = self.make_cars(self.scenario, 1, dtype)
        self._shape = (self._core.num_actions,)
        self.action_space = Box(-1.0, 1.0, self._shape, dtype=np.float32)
        self._outcome = np.zeros((self._core.outcome_rows, 1), dtype=dtype)
        self._bind()

    @property
    def clipped_actions(self) -> int:
        """Actions outside [-1, 1] since the environment was made."""
        return int(self._core.counters[at.CLIPPED, 0])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode: the first one of ``seed``, or the next one of the running sequence."""
        core = self._core
        if seed is not None or not core.seeded:
            super().reset(seed=seed_from(seed))
            core.set_key(0, self.np_random)
            core.seeded = True
        core.reset(options, _ONE, self._outcome)
        if not self._arguments:
            self._bind()
        if self._picture is not None:
            self._picture.forget()
        if self._shown:
            self.render()
        observation, *_, info = self._told(self._look(), self._tell())
        return observation, info

    def _bind(self) -> None:
        """Keep what a step calls at hand: making views and arguments at each step costs a third of its time."""
        core = self._core
        self._action, self._look, self._tell = core.action[0], core.observation[0].copy, self._outcome[:, 0].tolist
        if core.seeded:
            self._arguments = core.packed.handle, 0, 1, self._outcome
            self._step = core.run

    def __getstate__(self) -> dict[str, Any]:
        kept = {k: v for k, v in self.__dict__.items() if k not in _NOT_KEPT}
        return {**kept, "_picture": None, "_window": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(own(state))
        self._bind()

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Refuse what is settled, which wrappers would else take for an attribute of their own."""
        return super().set_wrapper_attr(name, value, force=force or name in self._settled)

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Advance by one control step; see the class's docstring.

        Raises:
            ValueError: an action of another shape than the action space's, or NaN.
            gymnasium.error.ResetNeeded: no episode was started.
        """
        taken = self._action
        try:
            if len(taken) == 1:
                (one,) = action.tolist()
                taken[0] = one
                wrong = one - one
            else:
                one, other = action.tolist()
                taken[0], taken[1] = one, other
                wrong = (one - one) + (other - other)
        except (AttributeError, TypeError, ValueError, OverflowError):
            wrong = math.nan
        if wrong != 0.0:  # infinite, or no number
            self._take(action)
        self._step(*self._arguments)
        if self._shown:
            self.render()
        return self._told(self._look(), self._tell())

    def _take(self, action: Any) -> None:
        """Take an action that needs a closer look.

        Raises:
            ValueError: an action of another shape than the action space's, or NaN.
        """
        given = np.asarray(action)
        if given.shape != self._shape:
            raise ValueError(
                f"action={shown(action)} has shape {given.shape}; it must have shape {self._shape}, in [-1, 1]"
            )
        try:
            require_numbers(given)
            self._action[:] = [float(number) for number in given.tolist()]
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"action={shown(action)} is not a number; it must be one in [-1, 1]") from None
        if np.isnan(self._action).any():
            raise ValueError(f"action={shown(action)} is NaN; it must be a number in [-1, 1]")

    def render(self) -> np.ndarray | None:
        """Return the picture (rgb_array), or show it (human); other modes warn, as Gymnasium does."""
        if self.render_mode is None:
            gym.logger.warn('render() needs a render_mode: gym.make(..., render_mode="rgb_array" or "human")')
            return None
        if self._picture is None:
            self._picture = self.make_picture(self.scenario)
        frame = self._picture.draw(self._core.pose(0))
        if self.render_mode == "rgb_array":
            return frame
        if self._window is None:
            self._window = Window(self.spec.id if self.spec else "lanekeep", self.metadata["render_fps"])
        self._window.show(frame)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None
