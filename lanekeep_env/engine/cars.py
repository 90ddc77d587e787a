"""The arrays behind an environment, on roads as between walls: n cars, their keys, settings and starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from gymnasium.utils import seeding

from lanekeep_env import layout as at
from lanekeep_env.engine.packed import Packed
from lanekeep_env.engine.reset_options import DRAWN, bounds, split, start_rows
from lanekeep_env.engine.step import Family, step_kernels
from lanekeep_env.engine.threads import Faster
from lanekeep_env.physics.models import CarModel
from lanekeep_env.plain import own
from lanekeep_env.sensing.measure import TRUTH

#: Cars that are advanced together: enough for SIMD, few enough for the first-level cache.
BLOCK = 256

#: What `_bind` fetches.
_NOT_KEPT = ("ground", "index", "equipment", "packed", "run", "run_parallel")


class Cars:
    """State and settings of n cars, with the calls of the compiled kernel; a family adds where the cars are.

    Args:
        scenario: what defines the environment.
        num_cars: n.
        dtype: "float64" or "float32", the precision of the simulation.
        autoreset: `layout.NO_AUTORESET`, `NEXT_STEP` or `SAME_STEP`.
        max_steps: control steps after which a car is truncated; None leaves that to others.
    """

    family: ClassVar[Family]
    #: What ``reset(options=...)`` may fix, in the order of the kernel's start rows.
    start_options: ClassVar[tuple[str, ...]]
    #: Row that is infinite where a column has no car.
    empty_row: ClassVar[int]
    #: Arrays that change while the cars drive.
    moving: tuple[str, ...] = ("cars", "counters", "ranges")

    # What `_bind` fetches, and no pickle keeps: tables and what the scenario has.
    ground: Any
    index: np.ndarray
    equipment: tuple[Any, ...]

    def __init__(
        self,
        scenario: Any,
        num_cars: int,
        dtype: str,
        autoreset: int = at.NO_AUTORESET,
        max_steps: int | None = None,
    ) -> None:
        self.scenario = scenario
        self.dtype = dtype
        self.num_cars = num_cars
        self.num_actions = scenario.num_actions
        self.num_channels = len(scenario.channels)
        self.sensors = self._sensors()
        self.settings = self._settings()
        self.settings[at.AUTORESET] = autoreset
        self.settings[at.MAX_STEPS] = max_steps or np.inf
        blocks = -(-num_cars // BLOCK)
        rows = at.CAR_ROWS + int(self.settings[at.DELAY_DEPTH])
        if self.sensors is not None:
            rows += int((TRUTH + 1 + self.sensors[:, 4]).sum())
        self.cars = np.zeros((blocks, rows, -(-num_cars // blocks)), dtype=dtype)
        self.cars[:, self.empty_row] = np.inf  # cars that fill up the last block stand still
        self.cars[:, at.CAR : at.CAR + at.CAR_SIZE] = 1.0
        self.counters = np.zeros((at.COUNTER_ROWS, num_cars), dtype=np.int64)
        self.action = np.zeros((num_cars, self.num_actions), dtype=np.float32)
        self.observation = np.zeros((num_cars, self.num_channels), dtype=np.float32)
        rows = self.outcome_rows
        self._outcome_shape = (2 * rows + self.num_channels if autoreset == at.SAME_STEP else rows), num_cars
        self.starting = np.zeros(num_cars, dtype=np.bool_)
        self.start = np.full((at.START_ROWS, num_cars), np.nan)
        self.seeded = False

    def _bind(self) -> None:
        """Fetch what is not kept in a pickle: tables (large, constant)."""
        raise NotImplementedError

    @cached_property
    def packed(self) -> Packed:
        """What kernels are given beside the outcome."""
        return self.pack(self.cars, self.counters, self.action.reshape(-1), self.observation)

    def pack(self, cars: np.ndarray, counters: np.ndarray, action: np.ndarray, observation: np.ndarray) -> Packed:
        """Pack what `run` is given, with its own arrays or others of their kinds: the kernel looks at no types."""
        _, _, *around = self.state
        return Packed(cars, counters, *around, (self.starting, self.start), action, observation)

    @property
    def step(self) -> Any:
        """The kernel of a control step, with what numba tells of it (`stats`); `run` is what to call."""
        return self._kernels[0]

    @cached_property
    def run(self) -> Callable[..., None]:
        """That kernel, compiled: (packed.handle, first block, the one behind the last, outcome)."""
        return self._stepper(0)

    @cached_property
    def run_parallel(self) -> Callable[..., None]:
        """The same on several threads, where they are faster."""
        return Faster(self.run, self._stepper(1))

    @property
    def _compiled(self) -> tuple[CarModel, Family]:
        """Model and family that kernels are made of."""
        if not self.scenario.motor_costs:
            return self.scenario.model, self.family
        from lanekeep_env.engine.effort import by_motor

        return self.scenario.model, by_motor(self.family)

    @property
    def _kernels(self) -> tuple[Callable[..., Any], Callable[..., Any]]:
        return step_kernels(*self._compiled, self.num_actions)

    def _stepper(self, which: int) -> Callable[..., None]:
        return self.packed.entry(self._kernels[which], 0, len(self.cars), self.new_outcome())

    def _settings(self) -> np.ndarray:
        gathered = self.scenario.gathered(perfect=self.sensors is None)
        values = np.zeros(at.CHANNELS, dtype=self.dtype)
        for row, number in self.scenario.numbers().items():
            values[row : row + np.size(number)] = number
        values[at.GATHERED] = len(gathered)
        return np.concatenate([values, self.scenario.channel_bounds().ravel(), np.ravel(gathered)]).astype(self.dtype)

    def _sensors(self) -> np.ndarray | None:
        """Numbers of the sensors, or None where all are perfect and always see."""
        s = self.scenario
        blind = (channel.sensor and (channel.sensor.valid or not channel.sensor.holds) for channel in s.channels)
        return s.sensor_table().astype(self.dtype) if s.sensors or any(blind) else None

    def _gear(self) -> np.ndarray | None:
        """Numbers of the steering gear, (`layout.GEAR_SIZE`,), or None without backlash."""
        steering = self.scenario.vehicle.steering
        if steering.backlash == 0.0:
            return None
        return np.array([steering.backlash / 2, steering.feedback == "motor"], dtype=self.dtype)

    @property
    def ranges(self) -> np.ndarray:
        """Low and high of each number that episodes draw, a view of the settings."""
        return self.settings[at.RANGES : at.RANGES + 2 * len(DRAWN)]

    @property
    def outcome_rows(self) -> int:
        """Rows of the outcome that a step writes."""
        return self.family.outcome_rows

    def new_outcome(self) -> np.ndarray:
        """Return an array for what a step tells beside the observation, (rows, n); nothing is written yet."""
        return np.empty(self._outcome_shape, dtype=self.dtype)

    @property
    def state(self) -> tuple[Any, ...]:
        """The arrays of the cars and what is around them, as kernels take them."""
        return self.cars, self.counters, self.ground, self.index, self.settings, self.equipment

    def reset(self, options: dict[str, Any] | None, mask: np.ndarray, outcome: np.ndarray) -> None:
        """Start the next episode of the cars in ``mask`` (bool, (n,)), writing their observations and truth."""
        self.starting[:], self.start[:] = mask, np.nan
        if options is not None and options != {}:
            fixed, drawn = split(options, self.start_options)
            start = start_rows(fixed, self.start_options, self.num_cars)
            self._check_place(start)
            self.start[:] = start
            if drawn:
                self.ranges[:] = bounds(drawn, self.scenario, self.ranges)
        self.run(self.packed.handle, 0, 0, outcome)

    def narrow(self, options: dict[str, Any]) -> None:
        """Keep those reset options that bound what episodes draw, for each car's next one on."""
        _, drawn = split(options, self.start_options)
        if drawn:
            self.ranges[:] = bounds(drawn, self.scenario, self.ranges)

    def seed(self, seeds: Sequence[int | None]) -> None:
        """Give car i the base key of ``seeds[i]``, the first draw of Gymnasium's generator for that seed."""
        for i, seed in enumerate(seeds):
            if seed is not None or not self.seeded:
                self.set_key(i, seeding.np_random(seed)[0])
        self.seeded = True

    def set_key(self, car: int, generator: np.random.Generator) -> None:
        """Draw a car's base key and start to count its episodes."""
        self.counters[at.KEY, car] = generator.integers(0, 2**64, dtype=np.uint64).astype(np.int64)
        self.counters[at.EPISODE, car] = -1

    def check_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Raise ValueError for a state, of the right shapes, that no car has."""
        raise NotImplementedError

    def check_ranges(self, ranges: np.ndarray) -> None:
        """Raise ValueError for bounds of the draws outside the scenario's."""
        declared = np.reshape(self.scenario.randomisation.bounds(), (-1, 2)).astype(self.dtype)
        low, high = np.reshape(ranges, (-1, 2)).T
        if not ((declared[:, 0] <= low) & (low <= high) & (high <= declared[:, 1])).all():
            raise ValueError("state: its bounds of what episodes draw are not within the scenario's randomisation")

    def _check_place(self, start: np.ndarray) -> None:
        """Raise ValueError where the last two start rows name a place that does not exist."""
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k not in _NOT_KEPT}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(own(state))
        self._bind()


def check_index(start: np.ndarray, name: str, count: int) -> None:
    """Raise ValueError unless the numbers (NaN for none) are whole ones from 0 to ``count`` - 1."""
    wrong = start[(start < 0) | (start >= count) | (start % 1 > 0)]
    if len(wrong):
        raise ValueError(
            f"reset option {name}={wrong[0]:.15g} is not allowed: it must be a whole number from 0 to {count - 1}"
        )
