"""Many cars of a compiled kernel as a Gymnasium vector environment: what all tasks share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numba
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from lanekeep_env import layout as at
from lanekeep_env.checks import choose, require, shown
from lanekeep_env.engine.threads import start_threads
from lanekeep_env.envs.info import TRUTH
from lanekeep_env.envs.single import SingleEnv
from lanekeep_env.envs.skin import Skin, check_modes, observation_space, require_numbers, seed_from

_AUTORESET = {
    "next_step": (at.NEXT_STEP, AutoresetMode.NEXT_STEP),
    "same_step": (at.SAME_STEP, AutoresetMode.SAME_STEP),
    "disabled": (at.NO_AUTORESET, AutoresetMode.DISABLED),
}
#: Cars of one environment: what they take is within a few GB.
MOST_CARS = 1_000_000
_OWN_KEYWORDS = ("max_episode_steps", "autoreset_mode", "dtype", "num_threads", "render_mode")


class ManyEnvs(Skin, VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Vector form of a `SingleEnv`, whose docstring describes the task; `vector_twins` derives one a task.

    Args:
        num_envs: number of cars n.
        max_episode_steps: control steps after which a car is truncated, if fewer than ``episode_steps``.
        autoreset_mode: "next_step" (Gymnasium's default), "same_step" or "disabled".
        dtype: "float64" (cars equal single environments bitwise) or "float32" (twice as fast).
        num_threads: threads that share the cars; 1 by default, since threads cost more than they bring
            below a few hundred cars.
        scenario: every keyword of the scenario.

    ``reset(seed=)`` takes an int (car i gets seed + i) or one seed a car; ``options`` are those of the
    single environment, one number or one a car, and ``"reset_mask"`` (bool, (n,)) resets some cars only. What
    bounds the draws (``friction=0.8`` or ``(0.6, 0.8)``) is one for all cars and stays for their later episodes.
    """

    #: Whether there are episodes to go on with.
    _started = False

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = "next_step",
        dtype: str = "float64",
        num_threads: int = 1,
        render_mode: str | None = None,
        **scenario: Any,
    ) -> None:
        require("num_envs", num_envs, "", at_least=1, at_most=MOST_CARS, whole=True)
        require("num_threads", num_threads, "", at_least=1, at_most=numba.config.NUMBA_NUM_THREADS, whole=True)
        max_episode_steps = None if max_episode_steps == -1 else max_episode_steps  # as in gym.make
        require("max_episode_steps", max_episode_steps, "steps", at_least=1, whole=True, optional=True)
        if isinstance(autoreset_mode, AutoresetMode):
            autoreset_mode = autoreset_mode.name.lower()
        choose("autoreset_mode", autoreset_mode, _AUTORESET)
        check_modes(render_mode, dtype)
        if render_mode == "human":
            raise ValueError("render_mode='human' is not available for a vector environment; allowed: rgb_array, None")
        code, mode = _AUTORESET[autoreset_mode]
        self.metadata = {**SingleEnv.metadata, "autoreset_mode": mode}
        self.autoreset_mode = mode  # where Gymnasium's own vector environments have it as well
        self.render_mode = render_mode
        self._pictures: list[Any] = []
        self.num_envs = num_envs = int(num_envs)
        self.scenario = self.scenario_class.from_keywords(_OWN_KEYWORDS, **scenario)
        self.single_observation_space = observation_space(self.scenario)
        self._check_limit(max_episode_steps)
        self._core = self.make_cars(self.scenario, num_envs, dtype, code, max_episode_steps)
        self.single_action_space = Box(-1.0, 1.0, (self._core.num_actions,), dtype=np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        #: Truth in the infos by name, and its row in the outcome.
        self.truth = dict((*TRUTH, *self.further))
        self._masks = tuple(f"_{name}" for name in (*dict(TRUTH), "is_success", "termination", *dict(self.further)))
        self._threads = num_threads
        if num_threads > 1:
            start_threads(num_threads)
        self._same_step = code == at.SAME_STEP
        self._everyone = np.ones(num_envs, dtype=np.bool_)
        self._everyone.flags.writeable = False
        self._all_told = dict.fromkeys(self._masks, self._everyone)

    @property
    def clipped_actions(self) -> np.ndarray:
        """Actions outside [-1, 1] since the environment was made, one count a car."""
        return self._core.counters[at.CLIPPED].copy()

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode in every car, or in those of ``options["reset_mask"]``."""
        if not isinstance(options, dict | None):
            raise ValueError(f"reset options={shown(options)} must be a mapping")
        options = dict(options or {})
        mask = self._mask(options.pop("reset_mask", None))
        core = self._core
        if not isinstance(seed, Iterable):
            first = seed_from(seed)
            super().reset(seed=first)
            seeds = [None if first is None else first + i for i in range(self.num_envs)]
        else:
            seeds = [seed_from(one) for one in seed]
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed has {len(seeds)} entries; it must be one number or {self.num_envs} of them")
        if seed is not None or not core.seeded:
            core.seed([s if chosen else None for s, chosen in zip(seeds, mask, strict=True)])
        outcome = core.new_outcome()
        outcome[:] = 0.0  # of the others it tells nothing
        core.reset(options, mask, outcome)
        self._started = True
        return core.observation.copy(), self._infos(outcome[: core.outcome_rows], mask)

    def _mask(self, mask: np.ndarray | None) -> np.ndarray:
        if mask is None:
            return self._everyone
        if not isinstance(mask, np.ndarray) or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(
                f"options['reset_mask'] must be a bool array of shape ({self.num_envs},), got {shown(mask)}"
            )
        if not mask.any():
            raise ValueError("options['reset_mask'] must select at least one car")
        return np.ascontiguousarray(mask)

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance every car by one control step; actions (n, number of actions) in [-1, 1]."""
        core = self._core
        given = actions if isinstance(actions, np.ndarray) else np.asarray(actions)
        if given.shape != core.action.shape:
            raise ValueError(f"actions have shape {given.shape}; they must have shape {core.action.shape}")
        if not self._started:
            raise gym.error.ResetNeeded("call reset() before step()")
        try:
            require_numbers(given)
            core.action[...] = given
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"actions={shown(actions)} are not numbers; they must be some in [-1, 1]") from None
        least = np.minimum.reduce(core.action, axis=None)
        if least != least:  # a NaN
            self._clear_ignored(core.action)
        outcome = core.new_outcome()
        arguments = core.packed.handle, 0, len(core.cars), outcome
        if self._threads == 1:
            core.run(*arguments)
        else:
            numba.set_num_threads(self._threads)
            core.run_parallel(*arguments)
        told = outcome[: core.outcome_rows] if self._same_step else outcome
        terminated, truncated, success = told[at.O_FLAGS] > 0.0
        termination = told[at.O_TERMINATED].astype(np.int64)
        infos = self._info(told, success, termination) | self._all_told
        if self._same_step:
            self._add_final(infos, outcome, terminated | truncated)
            termination[:] = 0  # of the episodes that just began
        # What is handed out is the caller's, who may write to it.
        return core.observation.copy(), outcome[at.O_REWARD], terminated, truncated, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """Return copies of all that changes while the cars drive; `set_state` goes on from there, to the last bit.

        Raises:
            ResetNeeded: nothing drives yet.
        """
        if not self._started:
            raise gym.error.ResetNeeded("call reset() before get_state()")
        return {name: getattr(self._core, name).copy() for name in self._core.moving}

    def set_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from what `get_state` returned, in this or another environment of the same scenario, cars and dtype.

        Raises:
            ValueError: an array is missing, or its shape or dtype is another, or a number is none of a car.
        """
        wanted = {name: getattr(self._core, name) for name in self._core.moving}
        if not isinstance(state, Mapping) or not all(isinstance(array, np.ndarray) for array in state.values()):
            raise ValueError(f"state={shown(state)} must be a mapping of arrays, as get_state() returns it")
        if set(state) != set(wanted):
            raise ValueError(f"state has {', '.join(state) or 'nothing'}; it must have {', '.join(wanted)}")
        for name, array in wanted.items():
            given = state[name]
            if given.shape != array.shape or given.dtype != array.dtype:
                raise ValueError(
                    f"state[{name!r}] is {given.dtype} {given.shape}; it must be {array.dtype} {array.shape}: take it "
                    "from an environment of the same scenario, number of cars and dtype"
                )
        self._core.check_state(state)
        self._core.check_ranges(state["ranges"])
        for name, array in wanted.items():
            array[...] = state[name]
        self._core.seeded = self._started = True

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return the picture of every car (render_mode "rgb_array")."""
        if self.render_mode is None:
            gym.logger.warn('render() needs a render_mode: gym.make_vec(..., render_mode="rgb_array")')
            return None
        if not self._pictures:
            self._pictures = [self.make_picture(self.scenario) for _ in range(self.num_envs)]
        return tuple(picture.draw(self._core.pose(car)) for car, picture in enumerate(self._pictures))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_pictures": []}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._everyone.flags.writeable = False  # which no pickle keeps
        self._threads = min(self._threads, numba.config.NUMBA_NUM_THREADS)  # of this computer

    def _clear_ignored(self, action: np.ndarray) -> None:
        """Clear NaN actions of cars that only start anew in this step; any other NaN is an error."""
        wrong = np.isnan(action)
        over = self._core.cars[:, at.DONE].reshape(-1)[: self.num_envs] > 0.0
        cars = np.flatnonzero(wrong.any(axis=1) & ~over)
        if len(cars):
            raise ValueError(f"action of car {cars[0]} is NaN; it must be a number in [-1, 1]")
        action[wrong] = 0.0

    def _infos(self, told: np.ndarray, mask: np.ndarray) -> dict[str, Any]:
        """Return the truth of the cars in ``mask`` from the rows of an outcome."""
        success, termination = told[at.O_SUCCESS] > 0.0, told[at.O_TERMINATED].astype(np.int64)
        return self._info(told, success, termination) | dict.fromkeys(self._masks, mask)

    def _add_final(self, infos: dict[str, Any], outcome: np.ndarray, ended: np.ndarray) -> None:
        """Gymnasium's same-step convention: the last observation and info of the episodes that ended."""
        if not ended.any():
            return
        observations = np.full(self.num_envs, None, dtype=object)
        rows = self._core.outcome_rows
        for car in np.flatnonzero(ended):  # the other columns were never written
            observations[car] = outcome[2 * rows :, car].astype(np.float32)
        infos["final_obs"], infos["_final_obs"] = observations, ended
        truth = np.where(ended, outcome[rows : 2 * rows], 0.0)
        infos["final_info"], infos["_final_info"] = self._infos(truth, ended), ended
