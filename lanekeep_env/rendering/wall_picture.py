"""A car between walls: view from above with what its depth camera sees, trace of the wall's distance, numbers."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.rendering.scale import draw_bar
from lanekeep_env.scenario.walls import WallFollowScenario
from lanekeep_env.walls import World

WIDTH, HEIGHT = 800, 460
SCALE = 2
VIEW_HEIGHT = 300
TRACE_SECONDS = 15.0
# Beams that are drawn; of the others their ends are.
_MOST_BEAMS = 71

_FLOOR, _WALL, _GLASS, _LINE = (232, 233, 235), (60, 64, 70), (120, 190, 220), (205, 208, 212)
_CAR, _NOSE, _WHEEL, _PATH, _BEAM = (0, 114, 178), (200, 224, 240), (35, 38, 42), (213, 94, 0), (236, 196, 150)
_BACK, _BLOCK, _SPACE = (0, 158, 115), (176, 180, 186), (205, 232, 214)
_INK, _FAINT, _PAPER, _ALARM = (45, 48, 53), (150, 155, 160), (252, 252, 252), (190, 20, 20)


@dataclass(frozen=True)
class WallPose:
    """What a picture needs of a car: world and place in it (m, rad), steering (rad), speed (m/s), time (s).

    ``distance``: of the right wall, m, NaN without an echo; ``lap_time``: of the last lap, s, 0 before; ``scan``:
    ranges of the depth camera, m, 0 where a beam shows nothing, (beams,); ``mode``: what a car on a course is to do;
    ``done``: what it did in its ``lap_time``.
    """

    world: World
    x: float
    y: float
    heading: float
    steer: float
    speed: float
    time: float
    distance: float
    lap_time: float
    touched: bool
    scan: np.ndarray
    mode: str = ""
    done: str = "lap"


class WallPicture:
    """Draws one car; remembers where it drove.

    Raises:
        ImportError: pygame is not installed; names the extra that brings it.
    """

    def __init__(self, scenario: WallFollowScenario) -> None:
        try:
            import pygame
        except ModuleNotFoundError as error:
            raise ImportError('rendering needs pygame: pip install "lanekeep[render]"') from error
        self._pg = pygame
        pygame.font.init()
        self._scenario = scenario
        self._sheet = pygame.Surface((WIDTH * SCALE, HEIGHT * SCALE))
        self._fonts = {size: pygame.font.Font(None, size * SCALE) for size in (18, 24, 34)}
        self.forget()

    def forget(self) -> None:
        """Start a new episode: no path, no trace."""
        self._driven: deque[tuple[float, float, bool]] = deque(maxlen=4000)
        self._trace: deque[tuple[float, float]] = deque(maxlen=2000)

    def draw(self, pose: WallPose) -> np.ndarray:
        """Return the picture as uint8 array, (HEIGHT, WIDTH, 3)."""
        if self._trace and pose.time < self._trace[-1][0]:
            self.forget()
        self._driven.append((pose.x, pose.y, pose.speed < 0.0))
        self._trace.append((pose.time, pose.distance))
        self._sheet.fill(_PAPER)
        self._view(pose)
        self._plot(pose)
        self._numbers(pose)
        small = self._pg.transform.smoothscale(self._sheet, (WIDTH, HEIGHT))
        return np.ascontiguousarray(self._pg.surfarray.array3d(small).transpose(1, 0, 2))

    def _view(self, pose: WallPose) -> None:
        pg, sheet = self._pg, self._sheet
        window = pg.Rect(0, 0, WIDTH * SCALE, VIEW_HEIGHT * SCALE)
        sheet.fill(_FLOOR, window)
        sheet.set_clip(window)
        left, low, right, high = pose.world.bounds
        # The whole world if it is about as large as the view, else what is around the car.
        whole = max(right - left, (high - low) * WIDTH / VIEW_HEIGHT) * 1.05
        span = whole if whole <= 2.5 * self._scenario.view else self._scenario.view
        middle = ((left + right) / 2, (low + high) / 2) if span == whole else (pose.x + 0.2 * span, pose.y)
        pixels = WIDTH * SCALE / span

        def screen(points: np.ndarray) -> list[tuple[float, float]]:
            there = (np.atleast_2d(points) - middle) * pixels
            return [(WIDTH * SCALE / 2 + x, VIEW_HEIGHT * SCALE / 2 - y) for x, y in there.tolist()]

        self._fill(pose.world, screen)
        if pose.world.centre_line is not None:
            pg.draw.lines(sheet, _LINE, pose.world.closed, screen(pose.world.centre_line), SCALE)
        self._beams(pose, screen)
        for wall, glass in zip(pose.world.segments, pose.world.glass, strict=True):
            a, b = screen(wall.reshape(2, 2))
            pg.draw.line(sheet, _GLASS if glass else _WALL, a, b, 3 * SCALE)
        points = screen(np.array([(x, y) for x, y, _ in self._driven]))
        for a, b, (_, _, back) in zip(points[:-1], points[1:], list(self._driven)[1:], strict=True):
            pg.draw.line(sheet, _BACK if back else _PATH, a, b, 2 * SCALE)
        self._car(pose, screen)
        draw_bar(pg, sheet, window, span, self._fonts[18], _INK)
        sheet.set_clip(None)

    def _fill(self, world: World, screen: Any) -> None:
        """Shade the parking spaces of a course, and what the walls of a closed way or a course keep cars out of."""
        for x, y, heading, long, deep in () if world.spaces is None else world.spaces:
            ahead, left = (
                np.array([math.cos(heading), math.sin(heading)]),
                np.array([-math.sin(heading), math.cos(heading)]),
            )
            corners = [(x, y) + u * long * ahead + v * deep * left for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))]
            self._pg.draw.polygon(self._sheet, _SPACE, screen(np.array(corners)))
        if world.centre_line is None or not (world.closed or world.spaces is not None):
            return
        joined = (world.segments[1:, :2] == world.segments[:-1, 2:]).all(axis=1)
        for part in np.split(world.segments, 1 + np.flatnonzero(~joined)):
            if len(part) > 2 and not _encloses(_ends(part), world.centre_line[0]):
                self._pg.draw.polygon(self._sheet, _BLOCK, screen(_ends(part)))

    def _nose(self, pose: WallPose) -> np.ndarray:
        front, rear = self._scenario.axles
        ahead = 0.5 * (front - rear) + 0.5 * self._scenario.vehicle.length
        return np.array([pose.x + ahead * math.cos(pose.heading), pose.y + ahead * math.sin(pose.heading)])

    def _beams(self, pose: WallPose, screen: Any) -> None:
        scan, nose = self._scenario.scan, self._nose(pose)
        if scan.beams == 0:
            return
        angles = pose.heading - scan.field_of_view / 2 + scan.step * np.arange(scan.beams)
        ends = nose + pose.scan[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        (foot,) = screen(nose)
        every = math.ceil(scan.beams / _MOST_BEAMS)
        for k, (end, reading) in enumerate(zip(screen(ends), pose.scan.tolist(), strict=True)):
            if reading > 0.0:
                if k % every == 0:
                    self._pg.draw.line(self._sheet, _BEAM, foot, end, 1)
                self._pg.draw.circle(self._sheet, _PATH, end, 2 * SCALE)

    def _car(self, pose: WallPose, screen: Any) -> None:
        pg, car = self._pg, self._scenario.vehicle
        axes = np.array(
            [[math.cos(pose.heading), math.sin(pose.heading)], [-math.sin(pose.heading), math.cos(pose.heading)]]
        )
        to_front, to_rear = self._scenario.axles
        middle, half, w = 0.5 * (to_front - to_rear), 0.5 * car.length, 0.5 * car.width

        def body(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
            return screen(np.array([pose.x, pose.y]) + np.array(points) @ axes)

        nose, hub = body([(middle + 0.7 * half, 0.0), (middle + 0.7 * half, 0.3 * w)])
        thick = max(1, min(4 * SCALE, round(math.dist(nose, hub))))  # as wheels are, or no more than seen well
        outline = [(middle + half, 0.7 * w), (middle - half, w), (middle - half, -w), (middle + half, -0.7 * w)]
        for axle, angle in ((to_front, pose.steer), (-to_rear, 0.0)):
            along = 0.12 * car.length * np.array([math.cos(angle), math.sin(angle)])
            for side in (w, -w):
                wheel = np.array([axle, side])
                pg.draw.line(self._sheet, _WHEEL, *body([tuple(wheel - along), tuple(wheel + along)]), thick)
        pg.draw.polygon(self._sheet, _ALARM if pose.touched else _CAR, body(outline))
        pg.draw.circle(self._sheet, _NOSE, nose, min(2 * SCALE, thick))

    def _plot(self, pose: WallPose) -> None:
        pg, sheet = self._pg, self._sheet
        left, top, width, height = 60 * SCALE, (VIEW_HEIGHT + 30) * SCALE, 560 * SCALE, 110 * SCALE
        follows = self._scenario.task == at.WALL_FOLLOW
        wanted = self._scenario.set_distance if follows else 1.0
        span = 2.0 * wanted
        begin = max(0.0, pose.time - TRACE_SECONDS)

        def place(time: float, distance: float) -> tuple[float, float]:
            return left + (time - begin) / TRACE_SECONDS * width, top + height * (1.0 - min(distance / span, 1.0))

        pg.draw.rect(sheet, (244, 245, 246), pg.Rect(left, top, width, height))
        for level in (0.0, wanted, span):
            y = place(begin, level)[1]
            pg.draw.line(sheet, _FAINT if level else _WALL, (left, y), (left + width, y), SCALE)
            self._text(f"{level:.1f}", 18, _INK, (left - 8 * SCALE, y), "midright")
        runs: list[list[tuple[float, float]]] = [[]]
        for time, distance in self._trace:
            if time >= begin and math.isfinite(distance):
                runs[-1].append(place(time, distance))
            elif runs[-1]:
                runs.append([])
        for run in runs:
            if len(run) > 1:
                pg.draw.lines(sheet, _PATH, False, run, 2 * SCALE)
        self._text("distance of the right wall [m]", 18, _INK, (left, top - 6 * SCALE), "bottomleft")

    def _numbers(self, pose: WallPose) -> None:
        x, y = 650 * SCALE, (VIEW_HEIGHT + 30) * SCALE
        self._text(f"{pose.speed:.2f} m/s", 34, _INK, (x, y), "topleft")
        distance = f"{pose.distance:.2f} m" if math.isfinite(pose.distance) else "no echo"
        self._text(f"right {distance}", 24, _INK, (x, y + 36 * SCALE), "topleft")
        self._text(f"steering {math.degrees(pose.steer):+.1f}°", 24, _INK, (x, y + 60 * SCALE), "topleft")
        self._text(f"time {pose.time:.1f} s", 24, _INK, (x, y + 84 * SCALE), "topleft")
        self._text(pose.mode, 24, _INK, (WIDTH * SCALE - 12 * SCALE, 10 * SCALE), "topright")
        if pose.touched:
            self._text("contact", 24, _ALARM, (x, y + 108 * SCALE), "topleft")
        elif pose.lap_time > 0.0:
            self._text(f"{pose.done} {pose.lap_time:.2f} s", 24, _PATH, (x, y + 108 * SCALE), "topleft")

    def _text(self, text: str, size: int, colour: tuple[int, int, int], where: Any, anchor: str) -> None:
        picture = self._fonts[size].render(text, True, colour)
        self._sheet.blit(picture, picture.get_rect(**{anchor: where}))


def _ends(walls: np.ndarray) -> np.ndarray:
    """Corners of walls that follow each other, the last one's end among them."""
    return np.concatenate([walls[:, :2], walls[-1:, 2:]])


def _encloses(corners: np.ndarray, point: np.ndarray) -> bool:
    """Whether a polygon (n, 2) goes round a point: a ray from it crosses an odd number of its sides."""
    x, y = (corners - point).T
    next_x, next_y = np.roll(x, -1), np.roll(y, -1)
    ahead = x * next_y - next_x * y  # of the crossing, times the side's way up
    return bool(np.count_nonzero(((y > 0.0) != (next_y > 0.0)) & ((ahead > 0.0) == (next_y > 0.0))) % 2)
