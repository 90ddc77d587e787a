"""The arrays behind an environment between walls: n cars, their worlds and settings, and calls of the kernel."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import shown
from lanekeep_env.engine.cars import Cars, check_index
from lanekeep_env.engine.given_state import check_state
from lanekeep_env.engine.reset_options import WALL_STARTS
from lanekeep_env.families.wall.kernel import BETWEEN_WALLS
from lanekeep_env.rendering.wall_picture import WallPose
from lanekeep_env.scenario.walls import WallFollowScenario
from lanekeep_env.walls import World, WorldRecord, pack
from lanekeep_env.walls.raycast import SCRATCH_ROWS, beam_table
from lanekeep_env.walls.sets import world_set

#: Farther from the origin a step of a millimetre is lost in float32, m.
LARGEST_FLOAT32 = 1000.0


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


class WallCars(Cars):
    """n cars between walls."""

    family = BETWEEN_WALLS
    start_options = tuple(WALL_STARTS)
    empty_row = at.SPEED_SQUARED
    moving: tuple[str, ...] = (*Cars.moving, "held")

    def __init__(self, scenario: WallFollowScenario, num_cars: int, dtype: str, *arguments: Any) -> None:
        front, rear = scenario.axles
        car = scenario.vehicle
        check_bodies(scenario.world, scenario.world.fingerprint(), 0.5 * (front - rear), car.length, car.width)
        super().__init__(scenario, num_cars, dtype, *arguments)
        self.held = np.zeros((num_cars, scenario.scan.beams), dtype=dtype)
        self._bind()

    def _bind(self) -> None:
        """Fetch what is not kept in a pickle: tables (large, constant) and scratch arrays."""
        s = self.scenario
        walls, index, line, starts = world_tables(s.world, s.world.fingerprint(), self.dtype)
        farthest = float(np.abs(walls).max())
        if self.dtype == "float32" and farthest > LARGEST_FLOAT32:
            raise ValueError(
                f"dtype='float32' is not allowed for this world: walls lie {farthest:.0f} m from its origin, allowed "
                f"are {LARGEST_FLOAT32:.0f} m; use float64, or an origin near the walls"
            )
        if s.task != at.WALL_FOLLOW and (index[:, at.I_POINTS] < 2).any():
            raise ValueError("world has no centre line, so there is no lap to drive; allowed: generated worlds")
        blocks = len(self.cars)
        most = int((index[:, at.I_END] - index[:, at.I_FIRST]).max())
        scratch = np.zeros((blocks, SCRATCH_ROWS, most), dtype=self.dtype)
        self.ground, self.index = (walls, line, starts, scratch), index
        floor, servo = s.integration.lowered_floor, s.servo.table(s.largest_angle)
        self.equipment = self._equip(self.sensors, self._gear(), floor, servo, *self._scan(scratch))

    def _equip(self, *parts: np.ndarray | None) -> tuple[np.ndarray | None, ...]:
        """The kernel's equipment: what all cars between walls have, to which a kind of course may add."""
        return parts

    def _scan(self, scratch: np.ndarray) -> tuple[np.ndarray | None, ...]:
        """The scan's numbers, beams, scratch arrays and the ranges shown last, or None for each without a scan."""
        s = self.scenario
        scan = s.scan
        if scan.beams == 0:
            return (None,) * 5
        beams = beam_table(scan.beams, scan.step, self.dtype)
        fan = np.zeros((len(self.cars), beams.shape[1]), dtype=self.dtype)
        return scan.numbers(s.control_step).astype(self.dtype), beams, scratch, fan, self.held

    def reset(self, options: dict[str, Any] | None, mask: np.ndarray, outcome: np.ndarray) -> None:
        """Start the next episode of the cars in ``mask`` (bool, (n,)), writing their observations and truth."""
        super().reset(options, mask, outcome)
        if options and not options.keys().isdisjoint(self.start_options[:2]):
            blocked = np.flatnonzero(mask & (self.cars[:, at.BLOCKED].reshape(-1)[: self.num_cars] > 0.0))
            if len(blocked):
                asked = ", ".join(f"{key}={shown(options[key])}" for key in self.start_options if key in options)
                raise ValueError(f"reset options {asked}: car {blocked[0]} would stand in or beyond a wall there")

    def check_state(self, state: Mapping[str, np.ndarray]) -> None:
        """Raise ValueError for a state, of the right shapes, that no car has."""
        index = self.index
        check_state(state, self.settings, {at.ROAD: len(index)}, {})
        segments = np.maximum(index[state["counters"][at.ROAD], at.I_POINTS] - 1, 1)
        check_state(state, self.settings, {at.SEGMENT: segments}, {})

    def _check_place(self, start: np.ndarray) -> None:
        """Raise ValueError where the last two start rows name a place that does not exist."""
        index = self.index
        check_index(start[2], "start_index", int(index[:, at.I_STARTS].min()))
        check_index(start[3], "world_index", len(index))

    def world_set(self) -> tuple[World, ...]:
        """The worlds, as built for this scenario."""
        return world_set(self.scenario.world, self.scenario.world.fingerprint())

    def pose(self, column: int) -> WallPose:
        """Where the car of a column is, for pictures."""
        block, i = divmod(column, self.cars.shape[2])
        car = self.cars[block, :, i].tolist()
        return WallPose(
            world=self.world_set()[int(self.counters[at.ROAD, column])],
            x=car[at.ALONG],
            y=car[at.LATERAL],
            heading=car[at.HEADING],
            steer=car[at.STEER],
            speed=car[at.SPEED],
            time=car[at.STEP] * self.scenario.control_step,
            distance=car[at.RIGHT],
            lap_time=car[at.LAP_TIME],
            touched=car[at.DEPARTED] > 0.0,
            scan=self.held[column].copy(),
        )
