"""The arrays behind an environment between walls: n cars, their worlds and settings, and calls of the kernel."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from lanekeep_env import layout as at
from lanekeep_env.checks import shown
from lanekeep_env.envs import wall_kernel
from lanekeep_env.envs.given_state import check_state
from lanekeep_env.envs.road_lanes import ACTIONS, BLOCK, DEPARTURES
from lanekeep_env.rendering.wall_picture import WallPose
from lanekeep_env.scenario.walls import CircuitScenario, WallFollowScenario
from lanekeep_env.sensing.measure import TRUTH
from lanekeep_env.walls import World, WorldRecord, pack
from lanekeep_env.walls.raycast import SCRATCH_ROWS, beam_table

#: Farther from the origin a step of a millimetre is lost in float32, m.
LARGEST_FLOAT32 = 1000.0
#: What ``reset(options=...)`` may fix, in the order of the kernel's start rows.
START_OPTIONS = ("lateral_error", "heading_error", "start_index", "world_index")


@functools.lru_cache(maxsize=16)
def world_set(world: WorldRecord, fingerprint: str) -> tuple[World, ...]:
    """Build the worlds once a process and check their starts; ``fingerprint`` notices a changed file."""
    return tuple(one.check() for one in world.build())


@functools.lru_cache(maxsize=16)
def check_bodies(world: WorldRecord, fingerprint: str, middle: float, length: float, width: float) -> None:
    """Raise ValueError for a start at which a body of that size, ``middle`` m ahead of the pose, touches a wall."""
    for one in world_set(world, fingerprint):
        for x, y, heading in one.start:
            if one.touches(x + middle * math.cos(heading), y + middle * math.sin(heading), heading, length, width):
                raise ValueError(
                    f"world {one.name!r}: the car, {length:g} m long and {width:g} m wide, touches a wall at the start "
                    f"({x:.3f}, {y:.3f}) m, {heading:.3f} rad"
                )


@functools.lru_cache(maxsize=16)
def world_tables(world: WorldRecord, fingerprint: str, dtype: str) -> tuple[np.ndarray, ...]:
    """Return the kernel's tables of a world set: walls, index, centre lines and starts (see `layout`)."""
    worlds = world_set(world, fingerprint)
    walls, ranges = pack(worlds, dtype)
    index = np.zeros((len(worlds), at.INDEX_SIZE), dtype=np.int64)
    index[:, : at.I_END + 1] = ranges
    lines, starts, points, places = [], [], 0, 0
    for k, one in enumerate(worlds):
        line = np.zeros((3, 0))
        if one.centre_line is not None:
            way = np.concatenate([one.centre_line, one.centre_line[:1]]) if one.closed else one.centre_line
            line = np.vstack([way.T, one.stations])
        index[k, at.I_LINE], index[k, at.I_POINTS], index[k, at.I_CLOSED] = points, line.shape[1], one.closed
        index[k, at.I_START], index[k, at.I_STARTS] = places, len(one.start)
        lines.append(line)
        starts.append(one.start.T)
        points += line.shape[1]
        places += len(one.start)
    tables = (walls, index, np.ascontiguousarray(np.hstack(lines)), np.ascontiguousarray(np.hstack(starts)))
    for array in tables:
        array.flags.writeable = False
    return tables


class WallLanes:
    """State and settings of n cars between walls, with the two calls of the compiled kernel; as `RoadLanes`."""

    outcome_rows = at.WALL_OUTCOME_ROWS
    #: Arrays that change while the cars drive.
    moving: tuple[str, ...] = ("lanes", "counters", "held")

    def __init__(
        self,
        scenario: WallFollowScenario,
        num_lanes: int,
        dtype: str,
        autoreset: int = at.NO_AUTORESET,
        max_steps: int | None = None,
    ) -> None:
        front, rear = scenario.axles
        car = scenario.vehicle
        check_bodies(scenario.world, scenario.world.fingerprint(), 0.5 * (front - rear), car.length, car.width)
        self.scenario = scenario
        self.dtype = dtype
        self.num_lanes = num_lanes
        self.num_actions = scenario.num_actions
        self.num_channels = len(scenario.channels)
        self.settings = self._settings()
        self.settings[at.AUTORESET] = autoreset
        self.settings[at.MAX_STEPS] = max_steps or np.inf
        blocks = -(-num_lanes // BLOCK)
        self.sensors = scenario.sensor_table().astype(dtype)
        rows = at.LANE_ROWS + int(self.settings[at.DELAY_DEPTH]) + int((TRUTH + 1 + self.sensors[:, 4]).sum())
        self.lanes = np.zeros((blocks, rows, -(-num_lanes // blocks)), dtype=dtype)
        self.lanes[:, at.SPEED_SQUARED] = np.inf
        self.lanes[:, at.CAR : at.CAR + at.CAR_SIZE] = 1.0
        self.counters = np.zeros((at.COUNTER_ROWS, num_lanes), dtype=np.int64)
        self.held = np.zeros((num_lanes, scenario.scan.beams), dtype=dtype)
        self._free_start = np.full((at.START_ROWS, num_lanes), np.nan)
        self.seeded = False
        self._bind()

    def _bind(self) -> None:
        """Fetch what is not kept in a pickle: tables (large, constant), scratch arrays and compiled functions."""
        s = self.scenario
        walls, index, line, starts = world_tables(s.world, s.world.fingerprint(), self.dtype)
        farthest = float(np.abs(walls).max())
        if self.dtype == "float32" and farthest > LARGEST_FLOAT32:
            raise ValueError(
                f"dtype='float32' is not allowed for this world: walls lie {farthest:.0f} m from its origin, allowed "
                f"are {LARGEST_FLOAT32:.0f} m; use float64, or an origin near the walls"
            )
        if s.task == at.CIRCUIT and (index[:, at.I_POINTS] < 2).any():
            raise ValueError("world has no centre line, so there is no lap to drive; allowed: generated worlds")
        blocks = len(self.lanes)
        most = int((index[:, at.I_END] - index[:, at.I_FIRST]).max())
        scratch = np.zeros((blocks, SCRATCH_ROWS, most), dtype=self.dtype)
        self.worlds = walls, index, line, starts, scratch
        steering = s.vehicle.steering
        gear = None
        if steering.backlash > 0.0:
            gear = np.array([steering.backlash / 2, steering.feedback == "motor"], dtype=self.dtype)
        self.equipment = (
            self.sensors,
            gear,
            s.integration.lowered_floor,
            s.servo.table(self._limit()),
            *self._scan(scratch),
        )
        self.step, self.step_parallel = wall_kernel.step_kernels(s.model)

    @property
    def state(self) -> tuple[Any, ...]:
        """The kernel's arguments between the blocks and the action."""
        return self.lanes, self.counters, self.worlds, self.settings, self.equipment

    def _limit(self) -> float:
        s = self.scenario
        return min(s.max_steering_angle, s.vehicle.steering.angle_limit or np.inf)

    def _settings(self) -> np.ndarray:
        s, car, steering = self.scenario, self.scenario.vehicle, self.scenario.vehicle.steering
        step = s.integration.step
        values = np.zeros(at.CHANNELS + at.CHANNEL_SIZE * self.num_channels, dtype=self.dtype)
        rate_mode = s.action == "steering_rate"
        values[at.STEP_TIME] = step
        values[at.SUBSTEPS] = round(s.control_step / step)
        values[at.SLIPS], values[at.SATURATES] = s.model.slips, s.model.saturates
        values[at.IDEAL_STEERING] = steering.lag == 0.0 and steering.rate_limit is None
        values[at.ACTION_KIND] = ACTIONS[s.action]
        values[at.ACTION_SCALE] = s.max_steering_rate if rate_mode else s.max_steering_angle
        values[at.COMMAND_LIMIT] = self._limit()
        values[at.DEPARTURE] = DEPARTURES[s.contact]
        values[at.COST_WEIGHT], values[at.COST_RATE] = s.cost_weight, s.reference_steering_rate
        values[at.COST_CAP], values[at.COST_LATERAL] = s.cost_cap, s.reference_lateral_error
        values[at.FULL] = s.observation == "full"
        values[at.START_LATERAL], values[at.START_HEADING] = s.start_lateral_error, s.start_heading_error
        values[at.HORIZON] = s.episode_steps
        values[at.NOMINAL : at.NOMINAL + at.NOMINAL_SIZE] = (
            car.mass,
            car.yaw_inertia,
            *s.axles,
            car.front_cornering_stiffness,
            car.rear_cornering_stiffness,
            1.0,
            steering.lag,
            np.inf if steering.rate_limit is None else steering.rate_limit,
            steering.delay,
        )
        values[at.RANGES : at.RANGES + at.RANGES_SIZE] = s.randomisation.bounds()
        longest = steering.delay + s.randomisation.steering_delay[1]
        if longest > 0.0:
            values[at.DELAY_DEPTH] = round(longest / step) // values[at.SUBSTEPS] + 2
        values[at.SPEED_LOW], values[at.SPEED_HIGH] = s.speed.minimum, s.speed.maximum
        values[at.SPEED_HOLD] = np.inf if s.speed.hold is None else round(s.speed.hold / s.control_step)
        values[at.SPEED_CHANGE] = s.speed.acceleration * step
        values[at.STANDSTILL] = s.speed.standstill
        if isinstance(s, CircuitScenario):
            values[at.SPEED_HOLD], values[at.SPEED_CHANGE] = np.inf, s.max_acceleration * step
            values[at.LAPS] = s.laps
        values[at.LARGEST_SPEED] = s.largest_speed
        values[at.TASK], values[at.SET_DISTANCE] = s.task, s.set_distance
        if s.encoder_ticks:
            values[at.TICK] = 2.0 * math.pi * car.wheel_radius / s.encoder_ticks
        values[at.SIGNLESS] = not s.encoder_direction
        values[at.OFFSETS : at.OFFSETS + 2] = s.steering_offset
        front, rear = s.axles
        values[at.SIDE_ARM] = 0.5 * car.wheelbase - rear  # half the wheelbase ahead of the rear axle
        values[at.BODY] = 0.5 * (front - rear)
        values[at.BODY + 1], values[at.BODY + 2] = 0.5 * car.length, 0.5 * car.width
        values[at.FRONT_ARM] = values[at.BODY] + 0.5 * car.length
        values[at.CHANNELS :] = s.channel_table().ravel()
        values[at.FIRST_PREVIEW] = s.column("scan_0")
        return values

    def _scan(self, scratch: np.ndarray) -> tuple[np.ndarray | None, ...]:
        """The scan's numbers, beams, scratch arrays and the ranges shown last, or None for each without a scan."""
        s = self.scenario
        scan = s.scan
        if scan.beams == 0:
            return (None,) * 5
        numbers = np.zeros(at.SCAN_SIZE, dtype=self.dtype)
        numbers[at.SCAN_FIRST], numbers[at.SCAN_STEP] = -0.5 * scan.field_of_view, scan.step
        numbers[at.SCAN_NEAREST], numbers[at.SCAN_FARTHEST] = scan.nearest, scan.farthest
        numbers[at.SCAN_NOISE], numbers[at.SCAN_JUMP] = scan.noise, scan.jump_errors
        numbers[at.SCAN_EVERY], numbers[at.SCAN_RIM] = scan.missing_every, scan.missing_rim
        numbers[at.SCAN_PERIOD] = max(1, round(scan.period / s.control_step))
        beams = beam_table(scan.beams, scan.step, self.dtype)
        fan = np.zeros((len(self.lanes), beams.shape[1]), dtype=self.dtype)
        return numbers, beams, scratch, fan, self.held

    def seed(self, seeds: Sequence[int | None]) -> None:
        """Give lane i the base key of ``seeds[i]``, the first draw of Gymnasium's generator for that seed."""
        for i, seed in enumerate(seeds):
            if seed is not None or not self.seeded:
                self.set_key(i, seeding.np_random(seed)[0])
        self.seeded = True

    def set_key(self, lane: int, generator: np.random.Generator) -> None:
        """Draw a lane's base key and start to count its episodes."""
        self.counters[at.KEY, lane] = generator.integers(0, 2**64, dtype=np.uint64).astype(np.int64)
        self.counters[at.EPISODE, lane] = -1

    def reset(
        self, options: dict[str, Any] | None, mask: np.ndarray, observation: np.ndarray, outcome: np.ndarray
    ) -> None:
        """Start the next episode of the lanes in ``mask`` (bool, (n,)), writing their observations and truth."""
        start = self._start(options) if options else self._free_start
        wall_kernel.reset(mask, start, *self.state, observation, outcome)
        if options and not options.keys().isdisjoint(START_OPTIONS[:2]):
            blocked = np.flatnonzero(mask & (self.lanes[:, at.BLOCKED].reshape(-1)[: self.num_lanes] > 0.0))
            if len(blocked):
                asked = ", ".join(f"{key}={shown(options[key])}" for key in START_OPTIONS if key in options)
                raise ValueError(
                    f"reset options {asked}: the car of lane {blocked[0]} would stand in or beyond a wall there"
                )

    def check_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Raise ValueError for a state, of the right shapes, that no lane has."""
        index = self.worlds[1]
        check_state(state, self.settings, {at.ROAD: len(index)}, {})
        segments = np.maximum(index[state["counters"][at.ROAD], at.I_POINTS] - 1, 1)
        check_state(state, self.settings, {at.SEGMENT: segments}, {})

    def _start(self, options: dict[str, Any]) -> np.ndarray:
        start = np.full((at.START_ROWS, self.num_lanes), np.nan)
        if not isinstance(options, dict):
            raise ValueError(f"reset options={shown(options)} must be a mapping; allowed: {', '.join(START_OPTIONS)}")
        for key, value in options.items():
            if key not in START_OPTIONS:
                raise ValueError(f"reset option {shown(key)} is unknown; allowed: {', '.join(START_OPTIONS)}")
            try:
                start[START_OPTIONS.index(key)] = np.asarray(value, dtype=np.float64)
            except (TypeError, ValueError, OverflowError):
                raise ValueError(
                    f"reset option {key}={shown(value)} must be a number or one number a lane ({self.num_lanes})"
                ) from None
            if not np.isfinite(start[START_OPTIONS.index(key)]).all():
                raise ValueError(f"reset option {key}={shown(value)} must be finite; leave it out to have it drawn")
        index = self.worlds[1]
        for key, row, count in (("start_index", 2, int(index[:, at.I_STARTS].min())), ("world_index", 3, len(index))):
            if np.any((start[row] < 0) | (start[row] >= count) | (start[row] % 1 > 0)):
                raise ValueError(f"reset option {key} must be a whole number from 0 to {count - 1}")
        if np.any(np.abs(start[:2]) > [[20.0], [np.pi]]):
            raise ValueError("reset options lateral_error and heading_error must be within 20 m and pi rad")
        return start

    def world_set(self) -> tuple[World, ...]:
        """The worlds, as built for this scenario."""
        return world_set(self.scenario.world, self.scenario.world.fingerprint())

    def pose(self, lane: int) -> WallPose:
        """Where a lane's car is, for pictures."""
        block, i = divmod(lane, self.lanes.shape[2])
        car = self.lanes[block, :, i].tolist()
        return WallPose(
            world=self.world_set()[int(self.counters[at.ROAD, lane])],
            x=car[at.ALONG],
            y=car[at.LATERAL],
            heading=car[at.HEADING],
            steer=car[at.STEER],
            speed=car[at.SPEED],
            time=car[at.STEP] * self.scenario.control_step,
            distance=car[at.RIGHT],
            lap_time=car[at.LAP_TIME],
            touched=car[at.DEPARTED] > 0.0,
            scan=self.held[lane].copy(),
        )

    def __getstate__(self) -> dict[str, Any]:
        dropped = ("worlds", "equipment", "step", "step_parallel")
        return {k: v for k, v in self.__dict__.items() if k not in dropped}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()
