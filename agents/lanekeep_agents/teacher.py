"""Cars whose hidden truth a teacher may read: for training and for bounds alone.

A policy that drives is handed observations and nothing else: no environment, scenario or policy file leads here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

import lanekeep_env  # noqa: F401
from lanekeep_env import layout as at
from lanekeep_env.checks import shown
from lanekeep_env.families.road.cars import RoadCars

Floats = NDArray[np.float64]

#: Rows that a step begins with and a command changes, by their names.
_STATES = {
    "along": at.ALONG,
    "lateral": at.LATERAL,
    "heading": at.HEADING,
    "sideslip": at.SIDESLIP,
    "yaw_rate": at.YAW_RATE,
    "steer": at.STEER,
}
#: Change of a state (m, rad, rad/s) and of an action in differences; actions are float32.
_STATE_CHANGE, _ACTION_CHANGE = 1e-6, 1e-2


class Linearised(NamedTuple):
    """The next states x+ = f(x, u) of n cars, (n, states), with their derivatives by x and by the action u.

    ``a`` (n, states, states), ``b`` (n, states).
    """

    states: Floats
    a: Floats
    b: Floats


class _Copies:
    """Blocks of cars like those of an environment, on its roads, for its kernel."""

    def __init__(self, cars: RoadCars, blocks: int) -> None:
        _, rows, size = cars.cars.shape
        self.cars = np.empty((blocks, rows, size))
        self.counters = np.empty((len(cars.counters), blocks * size), dtype=np.int64)
        self.action = np.zeros(blocks * size, dtype=np.float32)
        self.outcome = np.empty((cars.outcome_rows, blocks * size))
        seen = np.empty((blocks * size, cars.num_channels), dtype=np.float32)
        self.packed = cars.pack(self.cars, self.counters, self.action, seen)


class Teacher:
    """n cars on roads that one action steers, with what no sensor tells.

    Args:
        env_id: a registered id.
        num_cars: n.
        keywords: those of ``gym.make_vec`` for this id.

    Attributes:
        scenario: of the environment.
        names: of the states: "along" (arc length, m), "lateral" (m), "heading" (rad), "sideslip" (rad), "yaw_rate"
            (rad/s), "steer" (rad), with a commanded rate "command" (rad), with backlash "motor" (rad), and the commands
            that are on their way, "sent0" (rad) the last one.

    Raises:
        ValueError: the environment is none of those (`why_not`).
    """

    def __init__(self, env_id: str, num_cars: int, **keywords: Any) -> None:
        env: Any = gym.make_vec(
            env_id, num_cars, vectorization_mode="vector_entry_point", autoreset_mode="disabled", **keywords
        )
        self._env, self._cars, self.scenario = env, env.unwrapped._core, env.unwrapped.scenario
        if why := why_not(self._cars):
            raise ValueError(f"env_id={shown(env_id)} has no teacher: {why}")
        settings, rows = self._cars.settings, dict(_STATES)
        if settings[at.ACTION_KIND] == at.STEERING_RATE:
            rows["command"] = at.COMMAND
        if self._cars.equipment[1] is not None:
            rows["motor"] = at.MOTOR
        # A step moves the commands on before it takes the oldest: that one is none of its states.
        rows |= {f"sent{i}": at.CAR_ROWS + i for i in range(max(int(settings[at.DELAY_DEPTH]) - 1, 0))}
        self.names, self._rows = tuple(rows), np.array(list(rows.values()))
        self.num_cars = num_cars
        self._outcome = np.zeros((self._cars.outcome_rows, num_cars))
        self._copies: _Copies | None = None

    def reset(self, seeds: Sequence[int], options: Mapping[str, Any] | None = None) -> NDArray[np.float32]:
        """Start the episode of each car's seed; return what is observed, (n, channels)."""
        seen, _ = self._env.reset(seed=[int(seed) for seed in seeds], options=dict(options or {}) or None)
        return np.asarray(seen)

    def step(self, actions: ArrayLike) -> tuple[NDArray[np.float32], Floats, NDArray[np.bool_]]:
        """Advance every car by a control step.

        Args:
            actions: (n,), in [-1, 1].

        Returns:
            What is observed, (n, channels), until the next step; rewards (n,), 0 after an episode's end; which cars
            have never left their lane in this episode, (n,).
        """
        cars = self._cars
        cars.action.reshape(-1)[:] = _float32(actions)
        cars.run(cars.packed.handle, 0, len(cars.cars), self._outcome)
        return cars.observation, self._outcome[at.O_REWARD].copy(), self._outcome[at.O_SUCCESS] > 0.0

    @property
    def states(self) -> Floats:
        """The true states, (n, states)."""
        return self._columns(self._cars.cars[None])[0]

    @property
    def hidden(self) -> dict[str, Floats]:
        """The episode's car by name, (n,) each: kg, kg m², m, N/rad, N, s; ``speed`` is a share of the profile's."""
        settings, row = self._cars.settings, self._row
        with np.errstate(divide="ignore"):
            lag = -0.5 * settings[at.STEP_TIME] / np.log1p(-row(at.STEER_RESPONSE))
        return {
            "mass": 1.0 / row(at.INVERSE_MASS),
            "yaw_inertia": 1.0 / row(at.INVERSE_INERTIA),
            "cg_to_front_axle": row(at.CG_TO_FRONT),
            "cg_to_rear_axle": row(at.CG_TO_REAR),
            "front_cornering_stiffness": row(at.FRONT_STIFFNESS),
            "rear_cornering_stiffness": row(at.REAR_STIFFNESS),
            "front_peak": row(at.FRONT_PEAK),
            "rear_peak": row(at.REAR_PEAK),
            "steering_lag": lag,
            "steering_delay": row(at.DELAY) * settings[at.STEP_TIME],
            "speed": np.sqrt(row(at.SPEED_FACTOR)),
        }

    @property
    def cost(self) -> tuple[float, float]:
        """Factors of lateral error (1/m) and of a step's steering (1/rad) whose squares add to minus the reward.

        They hold below the cost's cap and inside the lane.
        """
        settings = self._cars.settings
        step = float(settings[at.STEP_TIME] * settings[at.SUBSTEPS])
        rate = np.sqrt(settings[at.COST_WEIGHT]) / settings[at.COST_RATE]
        return float(np.sqrt(step) / settings[at.COST_LATERAL]), float(rate / np.sqrt(step))

    def from_states(self, states: Floats, other: Floats) -> Floats:
        """Return the way from states ``other`` to ``states``, (..., n, states): headings a turn apart are the same, and
        so are places a lap apart."""
        way = states - other
        lap = self._cars.index[self._cars.counters[at.ROAD], at.S_LENGTH]
        for i, whole in ((0, lap), (2, 2.0 * np.pi)):
            way[..., i] -= whole * np.round(way[..., i] / whole)
        return way

    def linearise(self, actions: ArrayLike) -> Linearised:
        """Return what a step with ``actions`` (n,) would lead to, by differences of the kernel; the cars stay.

        Cars step from states moved by 1e-6, and with actions moved by 0.01 towards the middle of their range.
        """
        cars, n, given = self._cars, self.num_cars, _float32(actions)
        blocks, rows, size = cars.cars.shape
        count = len(self._rows) + 2
        if self._copies is None:
            self._copies = _Copies(cars, count * blocks)
        copies = self._copies
        moved = copies.cars.reshape(count, blocks, rows, size)
        moved[:] = cars.cars
        for i, row in enumerate(self._rows):
            moved[i + 1, :, row] += _STATE_CHANGE
        counted = copies.counters.reshape(-1, count, blocks * size)
        counted[:, :, n:] = 0
        counted[:, :, :n] = cars.counters[:, None]
        wanted = copies.action.reshape(count, blocks * size)
        wanted[:, :n] = given
        wanted[-1, :n] -= np.copysign(np.float32(_ACTION_CHANGE), given)
        cars.run(copies.packed.handle, 0, len(copies.cars), copies.outcome)
        after = self._columns(moved)
        change = self.from_states(after[1:], after[0])
        step = wanted[-1, :n].astype(np.float64) - given
        return Linearised(after[0], np.moveaxis(change[:-1] / _STATE_CHANGE, 0, 2), change[-1] / step[:, None])

    def _row(self, row: int) -> Floats:
        """A copy of a row of the cars, (n,)."""
        return np.array(self._cars.cars[:, row].reshape(-1)[: self.num_cars], dtype=np.float64)

    def _columns(self, cars: NDArray[Any]) -> Floats:
        """The states in arrays of cars, (copies, blocks, rows, size), as (copies, n, states)."""
        chosen = np.moveaxis(cars[:, :, self._rows], 2, 3).reshape(len(cars), -1, len(self._rows))[:, : self.num_cars]
        states = np.array(chosen, dtype=np.float64)
        states[:, :, 0] += cars[:, :, at.STATION].reshape(len(cars), -1)[:, : self.num_cars]
        return states


def why_not(cars: Any) -> str:
    """Return why there is no teacher for an environment's cars, "" where there is one."""
    if type(cars) is not RoadCars or cars.num_actions != 1:
        return "it has no road, or more on it than a car that is steered"
    return "a camera judges it" if cars.equipment[3] is not None else ""


def _float32(actions: ArrayLike) -> NDArray[np.float32]:
    return np.ascontiguousarray(actions, dtype=np.float32).reshape(-1)
