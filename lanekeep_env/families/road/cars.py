"""The arrays behind an environment on a road: n cars, their roads and settings, and calls of the kernel."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.engine.cars import Cars, check_index
from lanekeep_env.engine.given_state import check_state, row_of
from lanekeep_env.engine.reset_options import ROAD_STARTS
from lanekeep_env.engine.step import Family
from lanekeep_env.families.road.kernel import ON_ROADS
from lanekeep_env.physics.models import CarModel, with_pushes
from lanekeep_env.rendering.road_picture import Pose
from lanekeep_env.roads import Road, RoadSpec, SpeedSpec, road_set
from lanekeep_env.scenario import CameraLaneScenario, RoadScenario


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


class RoadCars(Cars):
    """n cars on roads."""

    family = ON_ROADS
    start_options = tuple(ROAD_STARTS)
    empty_row = at.SEGMENT_LENGTH
    #: Rows of the axles' largest forces, before a powertrain takes its share, and of the steering angle asked for.
    axle_rows: ClassVar[tuple[int, int]] = (at.FRONT_PEAK, at.REAR_PEAK)
    asked_rows: ClassVar[tuple[int, ...]] = (at.COMMAND,)

    def __init__(self, scenario: RoadScenario, *arguments: Any) -> None:
        roads = [road for road, _ in road_set(scenario.road, scenario.speed)]
        for road in roads:
            road.check_lane(max(map(abs, scenario.edges)))
        self._shortest = min(road.length for road in roads)
        super().__init__(scenario, *arguments)
        self._bind()

    def _bind(self) -> None:
        """Fetch what is not kept in a pickle: road tables (large, constant)."""
        s = self.scenario
        self.ground, self.index = road_tables(
            s.road, s.speed, s.road.fingerprint(), s.episode_steps * s.control_step, self.dtype
        )
        # Flat: numba cannot hand a tuple of tuples to several threads.
        self.equipment = self.sensors, self._gear(), s.integration.lowered_floor, self._camera(), *self._drive()

    @property
    def _compiled(self) -> tuple[CarModel, Family]:
        model, family = super()._compiled
        if not self.scenario.disturbed:
            return model, family
        from lanekeep_env.families.road.disturbed import disturbed

        family = disturbed(family, self.axle_rows, self.asked_rows)
        return with_pushes(model) if self.scenario.pushed else model, family

    def _drive(self) -> tuple[np.ndarray | None, ...]:
        """Numbers of the powertrain and the timelines, None without a powertrain."""
        return None, None

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

    def check_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Raise ValueError for a state, of the right shapes, that no car has."""
        drive, timelines = self.equipment[4:6]
        segments, roads = self.ground, self.index
        sizes: dict[int, np.ndarray | int] = {at.SEGMENT: len(segments), at.ROAD: len(roads)}
        further = {}
        if drive is not None and timelines is not None:
            sizes[at.TIMELINE] = len(timelines)
            further[at.EVENT] = ("event", 0.0, float(timelines.shape[1]))
            further[at.GEAR] = ("gear", -1.0, float(drive[at.D_GEARS]) - 1.0)
            for row in (at.LEAD_SIGHT, at.STOP_SIGHT):
                further[row + at.SIGHT_STEP] = ("step", -1.0, 1e9)
                further[row + at.SIGHT_EVENT] = ("event", 0.0, float(timelines.shape[1]) - 1.0)
                further[row + at.SIGHT_SEGMENT] = ("segment", 0.0, float(len(segments)) - 1.0)
        check_state(state, self.settings, sizes, further)
        length = row_of(state["cars"], at.SEGMENT_LENGTH, self.num_cars)
        along = row_of(state["cars"], at.ALONG, self.num_cars)
        rows = segments[state["counters"][at.SEGMENT]]
        elsewhere = length != rows[:, at.R_LENGTH]
        for row, column in ((at.CURVATURE, at.R_CURVATURE), (at.CURVATURE_SLOPE, at.R_CURVATURE_SLOPE)):
            elsewhere |= row_of(state["cars"], row, self.num_cars) != rows[:, column]
        for row in (at.SPEED_SQUARED, at.SPEED_SQUARED_SLOPE):
            elsewhere |= ~np.isfinite(row_of(state["cars"], row, self.num_cars))
        # Cars that were never reset stand on no segment; others are at most on the way to the next one.
        if (elsewhere & np.isfinite(length)).any() or (along > length + 100.0).any():
            raise ValueError("state: a car is not on its segment of the road")

    def _check_place(self, start: np.ndarray) -> None:
        """Raise ValueError where the last two start rows name a place that does not exist."""
        check_index(start[3], "road_index", len(self.index))
        wrong = start[2][(start[2] < 0) | (start[2] > self._shortest)]
        if len(wrong):
            raise ValueError(
                f"reset option arc_length={wrong[0]:.15g} is not allowed: it must be from 0 to {self._shortest:.1f} m"
            )

    def road_set(self) -> tuple[tuple[Road, np.ndarray], ...]:
        """The roads with their node speeds (m/s), as built for this scenario."""
        s = self.scenario
        return road_set(s.road, s.speed)

    def pose(self, column: int) -> Pose:
        """Where the car of a column is, for pictures."""
        block, i = divmod(column, self.cars.shape[2])
        car = self.cars[block, :, i].tolist()
        road, _ = self.road_set()[int(self.counters[at.ROAD, column])]
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
