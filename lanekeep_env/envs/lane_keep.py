"""`lanekeep/LaneKeep-v0`, one car."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box

from lanekeep_env import layout as at
from lanekeep_env.checks import choose
from lanekeep_env.envs.road_lanes import RoadLanes
from lanekeep_env.rendering.road_picture import RoadPicture
from lanekeep_env.rendering.window import Window
from lanekeep_env.roads import Road
from lanekeep_env.scenario import Channel, LaneKeepScenario, RoadScenario

PRECISIONS = ("float64", "float32")
RENDER_MODES = ("human", "rgb_array")
#: Views, which would come back from a pickle as copies, and the kernel.
_NOT_KEPT = ("_seen", "_truth", "_arguments", "_step")


def observation_space(scenario: RoadScenario) -> Box:
    """Box with the bounds of the scenario's channels."""
    low, high = scenario.channel_bounds().T
    return Box(low.copy(), high.copy(), dtype=np.float32)


class LaneKeepEnv(gym.Env[np.ndarray, np.ndarray]):
    """
    ## Description

    Keep a car in the middle of its lane. The car follows a road of changing curvature at a given speed
    profile (0.4 g of lateral acceleration, up to 180 km/h); the policy steers. This is the scenario
    family of Yin 2010 (lane keeping at 68 to 180 km/h), on his car with his steering actuator.

    ## Action Space

    `Box(-1, 1, (1,), float32)`. With `action="steering_angle"` (default) the road-wheel angle asked for,
    1 = `max_steering_angle` (0.15 rad), left positive; with `action="steering_rate"` the speed of that
    angle, 1 = `max_steering_rate` (0.4 rad/s). Values outside are clipped and counted
    (`env.unwrapped.clipped_actions`); NaN is an error.

    ## Observation Space

    A flat float32 box; `env.unwrapped.channels` names each entry with unit and bounds.

    | entry | unit | meaning |
    |---|---|---|
    | lateral_error | m | centre of gravity left of the lane's centre |
    | heading_error | rad | heading minus the road's |
    | yaw_rate | rad/s | |
    | speed | m/s | |
    | steering_angle | rad | of the road wheel |
    | steering_command | rad | the command that last entered the actuator |
    | curvature_preview_0 ... n-1 | 1/m | with `preview=n`: curvature at the car and every `preview_interval` s ahead |

    `observation="full"` adds sideslip (rad), curvature (1/m) and lateral_acceleration (m/s²).
    Values are clipped to the bounds. `info` holds the truth for metrics: lateral_error, heading_error,
    lateral_acceleration, steering_rate (mean of the step), speed, arc_length, cost (1 outside the
    lane), is_success (never departed so far), termination (`lanekeep_env.Termination`).

    ## Rewards

    Minus the running cost min(cap, (d / 0.5 m)² + w (steering rate / reference)²) times the control
    step, with w = 1, reference = 0.1 rad/s of the road wheel (at a steering ratio of 16 a brisk 92°/s of
    the steering wheel) and cap = 16 per second (a lane's edge costs 12.25). A departure charges the cap
    for the rest of `episode_steps` (30 s), so leaving the lane is worse than any drive inside it.

    ## Starting State

    Anywhere on the road (on open ones early enough for a whole episode), in curves as on straights, in the
    steady state of driving along the road there, moved by up to `start_lateral_error` (0.5 m) and turned by up
    to `start_course_error` (2°, heading plus sideslip against the road's) to either side.
    `reset(options={"lateral_error": m, "heading_error": rad, "arc_length": m, "road_index": i})` fixes any of
    it; heading_error is the heading's then.

    ## Episode End

    Terminates when the centre of gravity is more than half a `lane_width` (3.5 m) from the lane's centre
    (`departure="terminate"`; `"cost"` charges and goes on, `"off"` ignores it). Truncated after
    `episode_steps` (600) control steps of `control_step` (0.05 s); Gymnasium's `max_episode_steps` can
    shorten that. What an ended episode gives if stepped on means nothing; its rewards are 0.

    ## Arguments

    Every field of `lanekeep_env.LaneKeepScenario`: vehicle, dynamics, tyre, friction, road, speed, action,
    max_steering_angle, max_steering_rate, start_lateral_error, start_course_error, lane_width,
    departure, cost_weight, reference_steering_rate, cost_cap, preview, preview_interval, observation,
    randomisation, sensors, control_step, episode_steps; and dtype ("float64" or "float32"), the precision
    of the simulation.

    ```python
    gym.make("lanekeep/LaneKeep-v0", vehicle="commonroad-2", tyre="magic_formula", road="yin", preview=20)
    ```

    ## Vectorized environment

    ```python
    gym.make_vec("lanekeep/LaneKeep-v0", num_envs=1024, vectorization_mode="vector_entry_point", dtype="float32")
    ```

    Lane i after `reset(seed=s)` follows the single environment after `reset(seed=s + i)`.

    ## Version History

    * v0: first version.
    """

    scenario_class: type[RoadScenario] = LaneKeepScenario
    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": 20}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(self, *, render_mode: str | None = None, dtype: str = "float64", **scenario: Any) -> None:
        check_modes(render_mode, dtype)
        self.scenario = self.scenario_class.from_keywords(("render_mode", "dtype"), **scenario)
        self.render_mode = render_mode
        self._shown = render_mode == "human"
        self._picture: RoadPicture | None = RoadPicture(self.scenario) if render_mode else None
        self._window: Window | None = None
        self.observation_space = observation_space(self.scenario)
        self.action_space = Box(-1.0, 1.0, (1,), dtype=np.float32)
        self._core = RoadLanes(self.scenario, 1, dtype)
        self._action = np.zeros(1, dtype=np.float32)
        self._observation = np.zeros((1, self._core.num_channels), dtype=np.float32)
        self._outcome = np.zeros((at.OUTCOME_ROWS, 1), dtype=dtype)
        self._bind()

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Name, unit, bounds and meaning of each entry of the observation."""
        return self.scenario.channels

    def road_set(self) -> tuple[tuple[Road, np.ndarray], ...]:
        """The roads an episode is drawn from, each with its node speeds in m/s."""
        return self._core.road_set()

    @property
    def clipped_actions(self) -> int:
        """Actions outside [-1, 1] since the environment was made."""
        return int(self._core.counters[at.CLIPPED, 0])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode: the first one of ``seed``, or the next one of the running sequence."""
        super().reset(seed=None if seed is None else int(seed))
        core = self._core
        if seed is not None or not core.seeded:
            core.set_key(0, self.np_random)
            core.seeded = True
        core.reset(options, np.ones(1, dtype=np.bool_), self._observation, self._outcome)
        self._bind()
        if self._picture is not None:
            self._picture.forget()
        if self._shown:
            self.render()
        return self._seen.copy(), self._info(self._truth.tolist(), False)

    def _bind(self) -> None:
        """Keep views and the kernel's arguments at hand: making them at each step costs a third of its time."""
        core = self._core
        self._seen, self._truth = self._observation[0], self._outcome[:, 0]
        if core.seeded:
            state = (core.lanes, core.counters, core.road, core.roads, core.settings, core.equipment)
            self._arguments = (0, 1, *state, self._action, self._observation, self._outcome)
            self._step = core.step

    def __getstate__(self) -> dict[str, Any]:
        kept = {k: v for k, v in self.__dict__.items() if k not in _NOT_KEPT}
        return {**kept, "_picture": None, "_window": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Advance by one control step; see the class's docstring.

        Raises:
            ValueError: an action of another shape than (1,), or NaN.
            gymnasium.error.ResetNeeded: no episode was started.
        """
        given = action if isinstance(action, np.ndarray) else np.asarray(action)
        if given.shape != (1,):
            raise ValueError(f"action={action!r} has shape {given.shape}; it must have shape (1,), in [-1, 1]")
        try:
            self._action[0] = value = float(given.item())
        except (TypeError, ValueError):
            raise ValueError(f"action={action!r} is not a number; it must be one in [-1, 1]") from None
        if value != value:
            raise ValueError(f"action={action!r} is NaN; it must be a number in [-1, 1]")
        try:
            self._step(*self._arguments)
        except AttributeError:
            raise gym.error.ResetNeeded("call reset() before step()") from None
        told = self._truth.tolist()
        terminated = told[at.O_TERMINATED] > 0.0
        truncated = told[at.O_TRUNCATED] > 0.0
        if self._shown:
            self.render()
        return self._seen.copy(), told[at.O_REWARD], terminated, truncated, self._info(told, terminated)

    def render(self) -> np.ndarray | None:
        """Return the picture (rgb_array), or show it (human); other modes warn, as Gymnasium does."""
        if self.render_mode is None:
            gym.logger.warn('render() needs a render_mode: gym.make(..., render_mode="rgb_array" or "human")')
            return None
        if self._picture is None:
            self._picture = RoadPicture(self.scenario)
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

    @staticmethod
    def _info(told: list[float], terminated: bool) -> dict[str, Any]:
        _, _, _, lateral, heading, acceleration, rate, speed, station, cost, success = told
        return {
            "lateral_error": lateral,
            "heading_error": heading,
            "lateral_acceleration": acceleration,
            "steering_rate": rate,
            "speed": speed,
            "arc_length": station,
            "cost": cost,
            "is_success": success > 0.0,
            "termination": 1 if terminated else 0,
        }


def check_modes(render_mode: str | None, dtype: str) -> None:
    """Raise ValueError for a render mode or precision that does not exist."""
    if render_mode is not None:
        choose("render_mode", render_mode, RENDER_MODES)
    choose("dtype", dtype, PRECISIONS)
