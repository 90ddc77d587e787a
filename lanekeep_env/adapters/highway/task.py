"""Their tasks as our benchmark drives them: channels, one action scale, truth; road, traffic, car and reward theirs."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from highway_env.envs.lane_keeping_env import LaneKeepingEnv
from numpy.typing import NDArray

from lanekeep_env.adapters.highway.action import ACTION
from lanekeep_env.adapters.highway.axes import turned
from lanekeep_env.adapters.highway.observation import OBSERVATION, look, row, wrapped
from lanekeep_env.adapters.highway.path import LaneChoice
from lanekeep_env.adapters.highway.scenario import HighwayScenario
from lanekeep_env.checks import choose
from lanekeep_env.envs.skin import RENDER_MODES

#: What the infos tell.
TRUTH = ("lateral_error", "heading_error", "steering_rate", "speed", "cost")
_AUTORESET = {"next_step": AutoresetMode.NEXT_STEP, "same_step": AutoresetMode.SAME_STEP}


class HighwayTask(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """One of highway-env's environments; `HighwayScenario` says which, and its fields are the keywords.

    The action is the steering angle (and the acceleration, where it asks for one), in [-1, 1], to the left positive;
    the observation the scenario's channels; ``info`` has `TRUTH` (``cost`` is 1 where the episode ended as a failure)
    and ``is_success``. Reward, termination and pictures are theirs. On several lanes their MOBIL says which of them
    errors and curvatures are of: policies steer.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 15}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(
        self, scenario: HighwayScenario | None = None, *, render_mode: str | None = None, **keywords: Any
    ) -> None:
        given = keywords if scenario is None else {**keywords, "scenario": scenario}
        self.scenario = scenario = HighwayScenario.from_keywords(**given)
        config = dict(scenario.config)
        if scenario.observation == "exact":  # theirs is not looked at, and an occupancy grid costs more than all else
            config["observation"] = {"type": OBSERVATION, "preview": 0}
        if render_mode is not None:
            choose("render_mode", render_mode, RENDER_MODES)
        self.render_mode = render_mode
        if render_mode == "human":
            config["offscreen_rendering"] = False
        made: Any = gym.make(scenario.env, config=config, disable_env_checker=True)
        self._env = made.unwrapped
        self._env.render_mode = render_mode  # their lane keeping's constructor takes none
        self._lane: LaneChoice | None = None
        low, high = scenario.channel_bounds().T
        self.observation_space = Box(low.copy(), high.copy(), dtype=np.float32)
        self.action_space = Box(-1.0, 1.0, (scenario.num_actions,), dtype=np.float32)
        self._ours = made.unwrapped.config["action"]["type"] == ACTION
        self._steps, self._angle = 0, 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        theirs, _ = self._env.reset(seed=seed)
        self._steps, self._angle = 0, 0.0
        # Their lane keeping says itself which lane it judges.
        self._lane = None if isinstance(self._env, LaneKeepingEnv) else LaneChoice(self._env, self._env.vehicle)
        return self._told(theirs, False)

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Take one of their steps."""
        given = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        if not self._ours:
            given = np.array([*given[1:], turned(given[0])])  # theirs begins with the acceleration
        theirs, reward, terminated, truncated, _ = self._env.step(given)
        self._steps += 1
        observation, info = self._told(theirs, bool(terminated))
        over = bool(truncated) or self._steps >= self.scenario.episode_steps
        return observation, float(reward), bool(terminated), over and not terminated, info

    def _told(self, theirs: Any, failed: bool) -> tuple[NDArray[np.float32], dict[str, Any]]:
        scenario, before = self.scenario, self._angle
        index = None if self._lane is None else self._lane(scenario.control_step)
        seen = look(self._env, self._env.vehicle, scenario.preview, scenario.preview_interval, index)
        self._angle = seen["steering_angle"]
        rate = (self._angle - before) / scenario.control_step
        info = {name: seen[name] for name in ("lateral_error", "heading_error", "speed")}
        info |= {"steering_rate": rate, "cost": float(failed), "is_success": not failed}
        if scenario.observation == "theirs":
            seen |= _shown(theirs)
        return row(seen, scenario), info

    def render(self) -> Any:
        """Return their picture, uint8, (height, width, 3)."""
        return self._env.render()

    def close(self) -> None:
        """Let it go."""
        self._env.close()


def _shown(theirs: Any) -> dict[str, float]:
    """Errors and yaw rate as their lane keeping observes them: from (y, heading, lateral speed, yaw rate)."""
    y, heading, _, yaw_rate = theirs["state"][:, 0]
    wanted_y, wanted_heading, *_ = theirs["reference_state"][:, 0]
    return {
        "lateral_error": turned(float(y - wanted_y)),
        "heading_error": wrapped(turned(float(heading - wanted_heading))),
        "yaw_rate": turned(float(yaw_rate)),
    }


class HighwayVectorEnv(SyncVectorEnv):
    """Some of them, one after the other, for ``lanekeep bench``: keywords are those of `HighwayScenario`."""

    scenario_class: ClassVar[type[HighwayScenario]] = HighwayScenario

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: str = "next_step",
        max_episode_steps: int | None = None,
        **keywords: Any,
    ) -> None:
        choose("autoreset_mode", autoreset_mode, _AUTORESET)
        self.scenario = scenario = HighwayScenario.from_keywords(**keywords)
        if max_episode_steps is not None:
            scenario = replace(scenario, episode_steps=min(max_episode_steps, scenario.episode_steps))
        #: Truth in the infos by name; there are no rows of an outcome here.
        self.truth = dict.fromkeys(TRUTH, 0)
        super().__init__([partial(HighwayTask, scenario)] * num_envs, autoreset_mode=_AUTORESET[autoreset_mode])
