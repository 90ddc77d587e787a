"""The arrays behind an environment on a road: n cars, their roads and settings, and calls of the kernel."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from lanekeep_env import layout as at
from lanekeep_env.checks import shown
from lanekeep_env.envs import road_kernel
from lanekeep_env.envs.given_state import check_state, row_of
from lanekeep_env.physics.integrate import DRIVEN
from lanekeep_env.rendering.road_picture import Pose
from lanekeep_env.roads import Road, RoadSpec, SetSpeeds, SpeedSpec, road_set
from lanekeep_env.scenario import (
    CameraLaneScenario,
    DriveScenario,
    LaneKeepScenario,
    ReversePathScenario,
    RoadScenario,
)
from lanekeep_env.sensing.measure import TRUTH

ACTIONS = {"steering_angle": at.STEERING_ANGLE, "steering_rate": at.STEERING_RATE}
DEPARTURES = {"terminate": at.TERMINATE, "cost": at.COST, "off": at.OFF}
#: Lanes that are advanced together: enough for SIMD, few enough for the first-level cache.
BLOCK = 256
#: What ``reset(options=...)`` may fix, in the order of the kernel's start rows.
START_OPTIONS = ("lateral_error", "heading_error", "arc_length", "road_index")


@functools.lru_cache(maxsize=16)
def road_tables(
    road: RoadSpec, speed: SpeedSpec, fingerprint: str, duration: float, dtype: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the kernel's tables of a road set: (segments, 8) in ``dtype`` and (roads, 4) in float64.

    An open road goes on beyond its end with its last curvature and speed; episodes of ``duration``
    seconds start so early that they do not get there, where the road is long enough.
    """
    segments, roads, first = [], [], 0
    for geometry, speeds in road_set(road, speed):
        n = len(geometry.lengths)
        squared = speeds**2
        table = np.zeros((n + (not geometry.closed), at.ROAD_COLUMNS))
        table[:n, at.R_LENGTH] = geometry.lengths
        table[:n, at.R_CURVATURE] = geometry.curvature_start
        table[:n, at.R_CURVATURE_SLOPE] = (geometry.curvature_end - geometry.curvature_start) / geometry.lengths
        table[:n, at.R_SPEED_SQUARED] = squared[:-1]
        table[:n, at.R_SPEED_SQUARED_SLOPE] = np.diff(squared) / geometry.lengths
        table[:, at.R_NEXT] = first + np.arange(1, len(table) + 1)
        table[:, at.R_STATION] = geometry.stations[: len(table)]
        table[:, at.R_PREVIOUS] = first + np.arange(len(table)) - 1
        latest = geometry.length
        if geometry.closed:
            table[-1, at.R_NEXT] = first
            table[0, at.R_PREVIOUS] = first + n - 1
        else:
            table[0, at.R_PREVIOUS] = -1
            table[-1, at.R_LENGTH] = np.inf
            table[-1, at.R_NEXT] = first + len(table) - 1  # nothing is behind it
            table[-1, at.R_CURVATURE] = geometry.curvature_end[-1]
            table[-1, at.R_SPEED_SQUARED] = squared[-1]
            with np.errstate(divide="ignore"):
                seconds = 2.0 * geometry.lengths / (speeds[:-1] + speeds[1:])
            to_end = np.concatenate([np.cumsum(seconds[::-1])[::-1], [0.0]])
            enough = np.flatnonzero(to_end >= duration)
            latest = geometry.stations[enough[-1]] if len(enough) else 0.0
        roads.append((first, len(table), 0.0 if road.from_start else latest, geometry.length))
        segments.append(table)
        first += len(table)
    tables = np.concatenate(segments).astype(dtype), np.array(roads, dtype=np.float64)
    for array in tables:
        array.flags.writeable = False
    return tables


class RoadLanes:
    """State and settings of n cars on roads, with the two calls of the compiled kernel.

    Args:
        scenario: what defines the environment.
        num_lanes: n.
        dtype: "float64" or "float32", the precision of the simulation.
        autoreset: `layout.NO_AUTORESET`, `NEXT_STEP` or `SAME_STEP`.
        max_steps: control steps after which a lane is truncated; None leaves that to others.
    """

    outcome_rows = at.OUTCOME_ROWS
    #: Arrays that change while the cars drive.
    moving: tuple[str, ...] = ("lanes", "counters")

    def __init__(
        self,
        scenario: RoadScenario,
        num_lanes: int,
        dtype: str,
        autoreset: int = at.NO_AUTORESET,
        max_steps: int | None = None,
    ) -> None:
        self.scenario = scenario
        shortest = np.inf
        for road, _ in self.road_set():
            road.check_lane(scenario.lane_width / 2)
            shortest = min(shortest, road.length)
        self._shortest = float(shortest)
        self.dtype = dtype
        self.num_lanes = num_lanes
        self.num_actions = scenario.num_actions
        self.num_channels = len(scenario.channels)
        self.settings = self._settings()
        self.settings[at.AUTORESET] = autoreset
        self.settings[at.MAX_STEPS] = max_steps or np.inf
        blocks = -(-num_lanes // BLOCK)
        self.sensors = self._sensors()
        self.gear = self._gear()
        rows = at.LANE_ROWS + int(self.settings[at.DELAY_DEPTH])
        if self.sensors is not None:
            rows += int((TRUTH + 1 + self.sensors[:, 4]).sum())
        self.lanes = np.zeros((blocks, rows, -(-num_lanes // blocks)), dtype=dtype)
        self._free_start = np.full((at.START_ROWS, num_lanes), np.nan)
        self.counters = np.zeros((at.COUNTER_ROWS, num_lanes), dtype=np.int64)
        self.lanes[:, at.SEGMENT_LENGTH] = np.inf  # lanes that fill up the last block stand still
        self.lanes[:, at.CAR : at.CAR + at.CAR_SIZE] = 1.0
        self.seeded = False
        self._bind()

    def _bind(self) -> None:
        """Fetch what is not kept in a pickle: road tables (large, constant) and compiled functions."""
        s = self.scenario
        self.road, self.roads = road_tables(
            s.road, s.speed, s.road.fingerprint(), s.episode_steps * s.control_step, self.dtype
        )
        # Flat: numba cannot hand a tuple of tuples to several threads.
        self.equipment = self.sensors, self.gear, s.integration.lowered_floor, self._camera(), *self._drive()
        self.step, self.step_parallel = road_kernel.step_kernels(s.model)

    def _settings(self) -> np.ndarray:
        s = self.scenario
        values = np.zeros(at.CHANNELS + at.CHANNEL_SIZE * self.num_channels, dtype=self.dtype)
        steering = s.vehicle.steering
        rate_mode = s.action == "steering_rate"
        step = s.integration.step
        values[at.STEP_TIME] = step
        values[at.SUBSTEPS] = round(s.control_step / step)
        values[at.SLIPS], values[at.SATURATES] = s.model.slips, s.model.saturates
        values[at.FRONT_SPEED], values[at.POWERED] = s.model.front_speed, s.model.pace == DRIVEN
        values[at.IDEAL_STEERING] = steering.lag == 0.0 and steering.rate_limit is None
        values[at.ACTION_KIND] = ACTIONS[s.action]
        values[at.ACTION_SCALE] = s.max_steering_rate if rate_mode else s.max_steering_angle
        values[at.COMMAND_LIMIT] = s.largest_angle
        values[at.HALF_LANE] = s.departure_limit
        values[at.DEPARTURE] = DEPARTURES[s.departure]
        values[at.COST_WEIGHT] = s.cost_weight
        values[at.COST_RATE] = s.reference_steering_rate
        values[at.COST_CAP] = s.cost_cap
        if isinstance(s, LaneKeepScenario):
            values[at.PREVIEW], values[at.PREVIEW_TIME] = s.preview, s.preview_interval
        if isinstance(s, ReversePathScenario):
            values[at.PREVIEW], values[at.PREVIEW_TIME], values[at.BACKWARDS] = s.preview, s.preview_interval, 1.0
        if isinstance(s, DriveScenario):
            values[at.SLOPES : at.SLOPES + 2], values[at.WINDS : at.WINDS + 2] = np.sin(s.slope), s.wind
            values[at.SPEED_REFERENCE] = s.reference_speed_error
        if isinstance(s, CameraLaneScenario):
            values[at.PREVIEW], values[at.PREVIEW_DISTANCE] = s.plan, s.plan_spacing
        if isinstance(s.speed, SetSpeeds):
            values[at.SPEED_LOW], values[at.SPEED_HIGH] = s.speed.minimum, s.speed.maximum
            values[at.SPEED_HOLD] = np.inf if s.speed.hold is None else round(s.speed.hold / s.control_step)
            values[at.SPEED_CHANGE] = s.speed.acceleration * step
            values[at.STANDSTILL] = s.speed.standstill
        values[at.FULL] = s.observation == "full"
        values[at.START_LATERAL] = s.start_lateral_error
        values[at.START_HEADING] = s.start_course_error
        values[at.COST_LATERAL] = s.reference_lateral_error
        values[at.LATERAL_LIMIT] = s.speed.lateral_limit
        values[at.NOMINAL : at.NOMINAL + at.NOMINAL_SIZE] = (
            s.vehicle.mass,
            s.vehicle.yaw_inertia,
            *s.axles,
            s.vehicle.front_cornering_stiffness,
            s.vehicle.rear_cornering_stiffness,
            getattr(s, "friction", 1.0),
            steering.lag,
            np.inf if steering.rate_limit is None else steering.rate_limit,
            steering.delay,
        )
        values[at.RANGES : at.RANGES + at.RANGES_SIZE] = s.randomisation.bounds()
        longest = steering.delay + s.randomisation.steering_delay[1]
        if longest > 0.0:
            values[at.DELAY_DEPTH] = round(longest / step) // values[at.SUBSTEPS] + 2
        values[at.HORIZON] = s.episode_steps
        values[at.CHANNELS :] = s.channel_table().ravel()
        values[at.FIRST_PREVIEW] = s.column(s.preview_channel)
        return values

    def _sensors(self) -> np.ndarray | None:
        """Numbers of the sensors, or None where all are perfect and always see."""
        s = self.scenario
        if not s.sensors and not any(channel.sensor and channel.sensor.valid for channel in s.channels):
            return None
        return s.sensor_table().astype(self.dtype)

    def _gear(self) -> np.ndarray | None:
        """Numbers of the steering gear, (`layout.GEAR_SIZE`,), or None without backlash."""
        steering = self.scenario.vehicle.steering
        if steering.backlash == 0.0:
            return None
        return np.array([steering.backlash / 2, steering.feedback == "motor"], dtype=self.dtype)

    def _drive(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Numbers of the powertrain and the timelines, None without a powertrain."""
        s = self.scenario
        if not isinstance(s, DriveScenario):
            return None, None
        return s.powertrain.numbers(s.integration.step).astype(self.dtype), s.traffic.build()

    def _camera(self) -> np.ndarray | None:
        """Numbers of the camera and the marking of each row of the road table, or None without a camera."""
        s = self.scenario
        if not isinstance(s, CameraLaneScenario):
            return None
        offset = s.set_distance if s.camera.edge == "left" else -s.set_distance
        marks = [
            np.append(np.ones(len(road.lengths)) if road.marked is None else road.marked, [1.0][: not road.closed])
            for road, _ in self.road_set()
        ]
        return np.concatenate([[s.reach, offset, s.camera.widest], *marks])

    @property
    def state(self) -> tuple[Any, ...]:
        """The kernel's arguments between the blocks and the action."""
        return self.lanes, self.counters, self.road, self.roads, self.settings, self.equipment

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
        road_kernel.reset(
            mask,
            start,
            self.lanes,
            self.counters,
            self.road,
            self.roads,
            self.settings,
            self.equipment,
            observation,
            outcome,
        )

    def check_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Raise ValueError for a state, of the right shapes, that no lane has."""
        drive, timelines = self.equipment[-2:]
        sizes: dict[int, np.ndarray | int] = {at.SEGMENT: len(self.road), at.ROAD: len(self.roads)}
        further = {}
        if drive is not None and timelines is not None:
            sizes[at.TIMELINE] = len(timelines)
            further[at.EVENT] = ("event", 0.0, float(timelines.shape[1]))
            further[at.GEAR] = ("gear", 0.0, float(drive[at.D_GEARS]) - 1.0)
        check_state(state, self.settings, sizes, further)
        length = row_of(state["lanes"], at.SEGMENT_LENGTH, self.num_lanes)
        along = row_of(state["lanes"], at.ALONG, self.num_lanes)
        elsewhere = length != self.road[state["counters"][at.SEGMENT], at.R_LENGTH]
        # Lanes that were never reset stand on no segment; others are at most on the way to the next one.
        if (elsewhere & np.isfinite(length)).any() or (along > length + 100.0).any():
            raise ValueError("state: a lane is not on its segment of the road")

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
        index, station = start[3], start[2]
        if np.any((index < 0) | (index >= len(self.roads)) | (index % 1 > 0)):
            raise ValueError(f"reset option road_index must be a whole number from 0 to {len(self.roads) - 1}")
        if np.any((station < 0) | (station > self._shortest)):
            raise ValueError(f"reset option arc_length must be from 0 to {self._shortest:.1f} m")
        if np.any(np.abs(start[:2]) > [[20.0], [np.pi]]):
            raise ValueError("reset options lateral_error and heading_error must be within 20 m and pi rad")
        return start

    def road_set(self) -> tuple[tuple[Road, np.ndarray], ...]:
        """The roads with their node speeds (m/s), as built for this scenario."""
        s = self.scenario
        return road_set(s.road, s.speed)

    def pose(self, lane: int) -> Pose:
        """Where a lane's car is, for pictures."""
        block, i = divmod(lane, self.lanes.shape[2])
        car = self.lanes[block, :, i].tolist()
        road, _ = self.road_set()[int(self.counters[at.ROAD, lane])]
        edge = car[at.EDGE] if self.equipment[3] is not None else None
        return Pose(
            road=road,
            s=car[at.STATION] + car[at.ALONG],
            d=car[at.LATERAL],
            theta=car[at.HEADING],
            steer=car[at.STEER],
            speed=car[at.SPEED],
            time=car[at.STEP] * self.scenario.control_step,
            departed=car[at.DEPARTED] > 0.0,
            edge=None if edge is None or np.isnan(edge) else edge,
        )

    def __getstate__(self) -> dict[str, Any]:
        return {
            k: v for k, v in self.__dict__.items() if k not in ("road", "roads", "equipment", "step", "step_parallel")
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind()
