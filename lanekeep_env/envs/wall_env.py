"""The family between walls."""

from __future__ import annotations

from typing import Any, ClassVar

from lanekeep_env import layout as at
from lanekeep_env.engine.reset_options import WALL_STARTS
from lanekeep_env.envs.info import Rows
from lanekeep_env.envs.single import SingleEnv
from lanekeep_env.envs.skin import Skin
from lanekeep_env.scenario import WallFollowScenario
from lanekeep_env.walls import World


class BetweenWalls(Skin):
    """What environments between walls share, single or vector."""

    scenario_class: type[WallFollowScenario]
    starts = WALL_STARTS
    further: ClassVar[Rows] = (
        ("x", at.O_X),
        ("y", at.O_Y),
        ("distance", at.O_DISTANCE),
        ("clearance", at.O_CLEARANCE),
        ("lap_time", at.O_LAP_TIME),
    )

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        from lanekeep_env.families.wall.cars import WallCars

        return WallCars(*arguments)

    @staticmethod
    def make_picture(scenario: Any) -> Any:
        """Return what draws a car of the scenario."""
        from lanekeep_env.rendering.wall_picture import WallPicture

        return WallPicture(scenario)

    def world_set(self) -> tuple[World, ...]:
        """The worlds an episode is drawn from."""
        worlds: tuple[World, ...] = self._core.world_set()
        return worlds


class WallEnv(BetweenWalls, SingleEnv):
    """One car between walls; subclasses name the task's scenario, and are its page of documentation."""


class OnCourse(BetweenWalls):
    """What environments with modes and parking spaces share, single or vector."""

    further: ClassVar[Rows] = (
        *BetweenWalls.further,
        ("mode", at.O_MODE),
        ("space_share", at.O_SHARE),
        ("kerb_distance", at.O_KERB_DISTANCE),
    )

    @staticmethod
    def make_cars(*arguments: Any) -> Any:
        """Return the kernel's arrays; the arguments are those of `Cars`."""
        from lanekeep_env.families.wall.course_cars import CourseCars

        return CourseCars(*arguments)


class CourseEnv(OnCourse, SingleEnv):
    """One car on a course; subclasses name the task's scenario, and are its page of documentation."""
