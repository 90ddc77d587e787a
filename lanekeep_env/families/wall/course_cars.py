"""The arrays behind an environment on a course: those between walls, and parking spaces."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.families.wall.cars import WallCars
from lanekeep_env.families.wall.course import ON_COURSES
from lanekeep_env.rendering.wall_picture import WallPose
from lanekeep_env.walls import ObstacleCircuit, WorldRecord
from lanekeep_env.walls.obstacles import passage
from lanekeep_env.walls.parking import longest_space
from lanekeep_env.walls.sets import world_set

#: What pictures call the modes.
_SHOWN = {at.ROUNDTRIP: "round trip", at.OBSTACLES: "among obstacles", at.PARK: "parking"}


@functools.lru_cache(maxsize=16)
def space_tables(world: WorldRecord, fingerprint: str, dtype: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the spaces of all worlds, (SPACE_COLUMNS, all), and each world's: first, behind its last, longest."""
    spaces = [np.zeros((0, 5)) if one.spaces is None else one.spaces for one in world_set(world, fingerprint)]
    counts = np.array([len(one) for one in spaces], dtype=np.int64)
    ends = np.cumsum(counts)
    longest = [
        int(end - count + np.argmax(one[:, at.S_LONG])) if count else -1
        for one, count, end in zip(spaces, counts, ends, strict=True)
    ]
    return np.ascontiguousarray(np.concatenate(spaces).T, dtype=dtype), np.column_stack([ends - counts, ends, longest])


class CourseCars(WallCars):
    """n cars on a course."""

    family = ON_COURSES

    def _bind(self) -> None:
        s = self.scenario
        self._check_course()
        self.course = s.course_numbers().astype(self.dtype), *space_tables(s.world, s.world.fingerprint(), self.dtype)
        super()._bind()

    def _equip(self, *parts: np.ndarray | None) -> tuple[np.ndarray | None, ...]:
        return *parts, *self.course

    def pose(self, column: int) -> WallPose:
        """Where the car of a column is, what it is to do and what it has done, for pictures."""
        block, i = divmod(column, self.cars.shape[2])
        done = "parked" if self.scenario.ends_parked else "lap"
        return replace(super().pose(column), mode=_SHOWN[int(self.cars[block, at.MODE, i])], done=done)

    def _check_course(self) -> None:
        """Raise ValueError for a world in which the car cannot do what it is to do."""
        s, car = self.scenario, self.scenario.vehicle
        if s.parks:
            for world in self.world_set():
                if world.spaces is None or len(world.spaces) == 0:
                    raise ValueError(f"world {world.name!r} has no parking space; modes={s.modes!r} ask for one")
                if longest_space(world) <= car.length:
                    raise ValueError(
                        f"world.gaps: the longest one of world {world.name!r} is {longest_space(world):g} m, shorter "
                        f"than the car, {car.length:g} m"
                    )
        if isinstance(s.world, ObstacleCircuit):
            width, box = passage(s.world)
            if width <= car.width:
                raise ValueError(
                    f"world.boxes[{box}] blocks the circuit: the passage is {width:.3g} m wide, the car {car.width:g} m"
                )
