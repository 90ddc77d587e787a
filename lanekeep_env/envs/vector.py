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
from lanekeep_env.envs.single import SingleEnv
from lanekeep_env.envs.skin import Skin, check_modes, observation_space, seed_from

_AUTORESET = {
    "next_step": (at.NEXT_STEP, AutoresetMode.NEXT_STEP),
    "same_step": (at.SAME_STEP, AutoresetMode.SAME_STEP),
    "disabled": (at.NO_AUTORESET, AutoresetMode.DISABLED),
}
#: Cars of one environment: what they take is within a few GB.
MOST_CARS = 1_000_000
_OWN_KEYWORDS = ("max_episode_steps", "autoreset_mode", "dtype", "num_threads", "render_mode")
#: Truth in the infos of every family: its name and its row in the outcome.
_TRUTH = (
    ("lateral_error", at.O_LATERAL_ERROR),
    ("heading_error", at.O_HEADING_ERROR),
    ("lateral_acceleration", at.O_LATERAL_ACCELERATION),
    ("steering_rate", at.O_STEERING_RATE),
    ("speed", at.O_SPEED),
    ("arc_length", at.O_ARC_LENGTH),
    ("cost", at.O_COST),
)


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

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str = "next_step",
        dtype: str = "float64",
        num_threads: int = 1,
        render_mode: str | None = None,
        **scenario: Any,
    ) -> None:
        require("num_envs", num_envs, "", at_least=1, at_most=MOST_CARS, whole=True)
        require("num_threads", num_threads, "", at_least=1, at_most=numba.config.NUMBA_NUM_THREADS, whole=True)
        max_episode_steps = None if max_episode_steps == -1 else max_episode_steps  # as in gym.make
        require("max_episode_steps", max_episode_steps, "steps", at_least=1, whole=True, optional=True)
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
        # What the cars that a masked reset leaves alone showed last.
        self._last = np.zeros((num_envs, self._core.num_channels), dtype=np.float32)
        #: Truth in the infos by name, and its row in the outcome.
        self.truth: dict[str, int] = dict((*_TRUTH, *self.further))
        self._masks = tuple(f"_{name}" for name in (*self.truth, "is_success", "termination"))
        self._threads = num_threads
        if num_threads > 1:
            start_threads(num_threads)
        self._same_step = code == at.SAME_STEP
        self._everyone = np.ones(num_envs, dtype=np.bool_)
        self._everyone.flags.writeable = False

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
        outcome = np.zeros((core.outcome_rows, self.num_envs), dtype=core.dtype)  # of the others it tells nothing
        core.reset(options, mask, self._last, outcome)
        return self._last.copy(), self._infos(outcome, mask)

    def _mask(self, mask: np.ndarray | None) -> np.ndarray:
        if mask is None:
            return self._everyone
        if not isinstance(mask, np.ndarray) or mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(
                f"options['reset_mask'] must be a bool array of shape ({self.num_envs},), got {shown(mask)}"
            )
        if not mask.any():
            raise ValueError("options['reset_mask'] must select at least one car")
        return mask

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance every car by one control step; actions (n, number of actions) in [-1, 1]."""
        core = self._core
        given = np.asarray(actions, dtype=np.float32)
        shape = (self.num_envs, core.num_actions)
        if given.shape != shape:
            raise ValueError(f"actions have shape {given.shape}; they must have shape {shape}")
        given = np.ascontiguousarray(given).reshape(-1)
        if not core.seeded:
            raise gym.error.ResetNeeded("call reset() before step()")
        wrong = np.isnan(given)
        if wrong.any():
            given = self._without_ignored(given, wrong)
        n, channels, observation = self.num_envs, core.num_channels, self._last
        rows = 2 * core.outcome_rows + channels if self._same_step else core.outcome_rows
        outcome = np.empty((rows, n), dtype=core.dtype)
        arguments = (0, len(core.cars), *core.state, given, observation, outcome)
        if self._threads == 1:
            core.step(*arguments)
        else:
            numba.set_num_threads(self._threads)
            core.step_parallel(*arguments)
        terminated = outcome[at.O_TERMINATED] > 0.0
        truncated = outcome[at.O_TRUNCATED] > 0.0
        infos = self._infos(outcome, self._everyone)
        if self._same_step:
            infos["termination"] = np.zeros(n, dtype=np.int64)  # of the episodes that just began
            self._add_final(infos, outcome, terminated | truncated)
        # What is handed out is the caller's, who may write to it.
        return observation.copy(), outcome[at.O_REWARD], terminated, truncated, infos

    def get_state(self) -> dict[str, np.ndarray]:
        """Return copies of all that changes while the cars drive; `set_state` goes on from there, to the last bit.

        Raises:
            ResetNeeded: nothing drives yet.
        """
        if not self._core.seeded:
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
        self._core.seeded = True

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

    def _without_ignored(self, given: np.ndarray, wrong: np.ndarray) -> np.ndarray:
        """Clear NaN actions of cars that only start anew in this step; any other NaN is an error."""
        over = self._core.cars[:, at.DONE].reshape(-1)[: self.num_envs] > 0.0
        over = np.repeat(over, self._core.num_actions)
        cars = np.flatnonzero(wrong & ~over) // self._core.num_actions
        if len(cars):
            raise ValueError(f"action of car {cars[0]} is NaN; it must be a number in [-1, 1]")
        return np.where(wrong, np.float32(0.0), given)

    def _infos(self, outcome: np.ndarray, mask: np.ndarray) -> dict[str, Any]:
        infos: dict[str, Any] = {name: outcome[row] for name, row in self.truth.items()}
        infos["is_success"] = outcome[at.O_SUCCESS] > 0.0
        infos["termination"] = outcome[at.O_TERMINATED].astype(np.int64)
        infos.update(dict.fromkeys(self._masks, mask))
        return infos

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
