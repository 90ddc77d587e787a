"""A car on its road: view from above, trace of the lateral error, steering and numbers."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_env.rendering.scale import draw_bar
from lanekeep_env.roads import Road
from lanekeep_env.scenario import CameraLaneScenario, RoadScenario
from lanekeep_env.traffic.follow import LENGTH
from lanekeep_env.traffic.follow import WIDTH as WIDE

WIDTH, HEIGHT = 800, 460
#: Drawn at twice the size and scaled down, which smooths all edges.
SCALE = 2
#: Distance of the dots along the middle of a lane, m.
_DOTS = 2.0
#: Length of the dashes between two lanes and of the gaps between those, m.
_DASH = 4.0
VIEW_HEIGHT = 300
#: Share of the view that is ahead of the car.
SHARE_AHEAD = 0.78
#: Seconds of the error's trace.
TRACE_SECONDS = 15.0

_GRASS, _ASPHALT, _EDGE, _CENTRE = (226, 232, 222), (188, 193, 199), (250, 250, 250), (150, 156, 163)
_CAR, _GLASS, _WHEEL, _PATH = (0, 114, 178), (200, 224, 240), (35, 38, 42), (213, 94, 0)
_LEAD = (90, 96, 104)
_INK, _FAINT, _PAPER, _ALARM = (45, 48, 53), (150, 155, 160), (252, 252, 252), (190, 20, 20)


@dataclass(frozen=True)
class Pose:
    """What a picture needs of a car: road and place on it (m, rad), steering (rad), speed (m/s), time (s).

    ``others``: place and heading of cars around, (cars, 3); ``lane``: number of the lane that errors are those in.
    ``edge``: distance of the road's edge that a camera sees, m; None where it sees none, or there is no camera.
    ``lead_gap``, ``stop_gap``: way along the road to the car ahead and to the stop point, m, negative behind; None
    without. ``failure``: what ended the episode, if it was no departure. ``backwards``: whether reverse is engaged.
    """

    road: Road
    s: float
    d: float
    theta: float
    steer: float
    speed: float
    time: float
    departed: bool
    edge: float | None = None
    lead_gap: float | None = None
    stop_gap: float | None = None
    failure: str | None = None
    backwards: bool = False
    others: np.ndarray | None = None
    lane: int = 0


class RoadPicture:
    """Draws one car; remembers where it drove.

    Raises:
        ImportError: pygame is not installed; names the extra that brings it.
    """

    def __init__(self, scenario: RoadScenario) -> None:
        try:
            import pygame
        except ModuleNotFoundError as error:
            raise ImportError('rendering needs pygame: pip install "lanekeep[render]"') from error
        self._pg = pygame
        pygame.font.init()
        self._scenario = scenario
        self._sheet = pygame.Surface((WIDTH * SCALE, HEIGHT * SCALE))
        self._fonts = {size: pygame.font.Font(None, size * SCALE) for size in (18, 24, 34)}
        self._ahead, self._behind = SHARE_AHEAD * scenario.view, (1.0 - SHARE_AHEAD) * scenario.view
        self._pixels = WIDTH / scenario.view * SCALE
        self.forget()

    def forget(self) -> None:
        """Start a new episode: no path, no trace."""
        self._driven: deque[np.ndarray] = deque(maxlen=400)
        self._trace: deque[tuple[float, float]] = deque(maxlen=2000)

    def draw(self, pose: Pose) -> np.ndarray:
        """Return the picture as uint8 array, (HEIGHT, WIDTH, 3)."""
        if self._trace and pose.time < self._trace[-1][0]:
            self.forget()
        self._driven.append(pose.road.position(pose.s, pose.d))
        self._trace.append((pose.time, self._error(pose)))
        self._sheet.fill(_PAPER)
        self._view(pose)
        self._plot(pose)
        self._dial(pose)
        self._numbers(pose)
        small = self._pg.transform.smoothscale(self._sheet, (WIDTH, HEIGHT))
        return np.ascontiguousarray(self._pg.surfarray.array3d(small).transpose(1, 0, 2))

    def _view(self, pose: Pose) -> None:
        pg, sheet = self._pg, self._sheet
        window = pg.Rect(0, 0, WIDTH * SCALE, VIEW_HEIGHT * SCALE)
        sheet.fill(_GRASS, window)
        sheet.set_clip(window)
        centre, course = pose.road.position(pose.s), float(pose.road.heading(pose.s))
        turn = np.array([[math.cos(course), math.sin(course)], [-math.sin(course), math.cos(course)]])

        def screen(points: np.ndarray) -> list[tuple[float, float]]:
            there = (np.atleast_2d(points) - centre) @ turn.T * self._pixels
            x = there[:, 0] + self._behind * self._pixels
            y = VIEW_HEIGHT * SCALE / 2 - there[:, 1]
            return list(zip(x.tolist(), y.tolist(), strict=True))

        first = pose.s - self._behind - 8.0
        s = np.arange(
            first if pose.road.closed else max(first, 0.0), pose.s + self._ahead + 8.0, self._scenario.view / 100
        )
        left, right = (pose.road.position(s, edge) for edge in reversed(self._scenario.edges))
        pg.draw.polygon(sheet, _ASPHALT, screen(np.vstack([left, right[::-1]])))
        middles = np.arange(0.0, self._scenario.edges[1], self._scenario.lane_width)
        marked = pose.road.is_marked(s)
        runs = np.split(np.arange(len(s)), np.flatnonzero(np.diff(marked)) + 1)
        for side in (left, right):
            edge = screen(side)
            for run in runs:
                if marked[run[0]] and len(run) > 1:
                    pg.draw.lines(sheet, _EDGE, False, edge[run[0] : run[-1] + 1], 3 * SCALE)
        for dash in np.arange(math.ceil(s[0] / (2 * _DASH)) * 2 * _DASH, s[-1], 2 * _DASH):
            for mark in np.arange(0.5, len(middles) - 1) * self._scenario.lane_width:
                ends = pose.road.position(np.array([dash, dash + _DASH]), mark)
                pg.draw.line(sheet, _EDGE, *screen(ends), 2 * SCALE)
        # Dots, not dashes: it is the middle of a lane, and nobody's mark between two of them.
        dots = np.arange(math.ceil(s[0] / _DOTS) * _DOTS, s[-1], _DOTS)
        for middle in middles:
            for dot in screen(pose.road.position(dots, middle)):
                pg.draw.circle(sheet, _CENTRE, dot, SCALE)
        if len(self._driven) > 1:
            pg.draw.lines(sheet, _PATH, False, screen(np.array(self._driven)), 2 * SCALE)
        self._traffic(pose, screen)
        self._car(pose, screen)
        if isinstance(self._scenario, CameraLaneScenario):
            self._camera(pose, self._scenario, screen)
        draw_bar(pg, sheet, window, self._scenario.view, self._fonts[18], _INK)
        sheet.set_clip(None)

    def _car(self, pose: Pose, screen: Any) -> None:
        pg, car = self._pg, self._scenario.vehicle
        where = pose.road.position(pose.s, pose.d)
        heading = float(pose.road.heading(pose.s)) + pose.theta
        axes = np.array([[math.cos(heading), math.sin(heading)], [-math.sin(heading), math.cos(heading)]])
        half_width = car.width / 2
        overhang = (car.length - car.wheelbase) / 2
        to_front, to_rear = self._scenario.axles
        front, rear = to_front + overhang, -to_rear - overhang

        def body(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
            return screen(where + np.array(points) @ axes)

        for axle, angle in ((to_front, pose.steer), (-to_rear, 0.0)):
            along = 0.45 * np.array([math.cos(angle), math.sin(angle)])
            for side in (half_width, -half_width):
                hub = np.array([axle, side * 0.92])
                ends = body([tuple(hub - along), tuple(hub + along)])
                pg.draw.line(self._sheet, _WHEEL, *ends, round(0.34 * self._pixels))
        w = half_width
        outline = [(front, 0.6 * w), (front - 0.5, w), (rear + 0.3, w), (rear, 0.75 * w)]
        outline += [(x, -y) for x, y in reversed(outline)]
        pg.draw.polygon(self._sheet, _ALARM if pose.departed else _CAR, body(outline))
        screen_at = to_front - 0.4  # foot of the windscreen
        glass = [
            (screen_at, 0.8 * w),
            (screen_at - 0.6, 0.7 * w),
            (screen_at - 0.6, -0.7 * w),
            (screen_at, -0.8 * w),
        ]
        pg.draw.polygon(self._sheet, _GLASS, body(glass))

    def _traffic(self, pose: Pose, screen: Any) -> None:
        """Draw the stop line, and the car ahead; both are as far from the car's end as the gaps say."""
        pg, car = self._pg, self._scenario.vehicle
        half, overhang = car.width / 2, (car.length - car.wheelbase) / 2
        ends = self._scenario.axles[0] + overhang, -self._scenario.axles[1] - overhang
        if pose.stop_gap is not None:
            s = pose.s + pose.stop_gap + ends[pose.backwards]
            line = [pose.road.position(s, side * self._scenario.lane_width / 2) for side in (1.0, -1.0)]
            pg.draw.line(self._sheet, _ALARM, *screen(np.array(line)), max(round(0.3 * self._pixels), SCALE))
        if pose.lead_gap is not None:
            near = pose.s + pose.lead_gap + ends[pose.backwards]
            far = near + (-car.length if pose.backwards else car.length)
            body = [pose.road.position(s, side * half) for s, side in ((near, 1), (far, 1), (far, -1), (near, -1))]
            pg.draw.polygon(self._sheet, _LEAD, screen(np.array(body)))

        for s, y, turned in () if pose.others is None else pose.others:
            course = float(pose.road.heading(s)) + turned
            axes = np.array([[math.cos(course), math.sin(course)], [-math.sin(course), math.cos(course)]])
            corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (LENGTH / 2, WIDE / 2)
            pg.draw.polygon(self._sheet, _LEAD, screen(pose.road.position(s, y) + corners @ axes))

    def _error(self, pose: Pose) -> float:
        return pose.d - pose.lane * self._scenario.lane_width

    def _camera(self, pose: Pose, scenario: CameraLaneScenario, screen: Any) -> None:
        """Draw the look-ahead point, and the line from there to the edge where the camera sees it."""
        pg, sheet = self._pg, self._sheet
        heading = float(pose.road.heading(pose.s)) + pose.theta
        along, left = (
            np.array([math.cos(heading), math.sin(heading)]),
            np.array([-math.sin(heading), math.cos(heading)]),
        )
        point = pose.road.position(pose.s, pose.d) + scenario.reach * along
        seen = pose.edge is not None
        (there,) = screen(point)
        if pose.edge is not None:
            side = left if scenario.camera.edge == "left" else -left
            (edge,) = screen(point + pose.edge * side)
            pg.draw.line(sheet, _PATH, there, edge, 2 * SCALE)
            pg.draw.circle(sheet, _PATH, edge, 4 * SCALE)
        pg.draw.circle(sheet, _PATH if seen else _ALARM, there, 4 * SCALE, 0 if seen else 2 * SCALE)

    def _plot(self, pose: Pose) -> None:
        pg, sheet = self._pg, self._sheet
        left, top, width, height = 60 * SCALE, (VIEW_HEIGHT + 30) * SCALE, 480 * SCALE, 110 * SCALE
        limit = self._scenario.departure_limit
        span = 1.25 * limit
        begin = max(0.0, pose.time - TRACE_SECONDS)

        def at(time: float, d: float) -> tuple[float, float]:
            y = top + height / 2 - np.clip(d / span, -1, 1) * height / 2
            return left + (time - begin) / TRACE_SECONDS * width, float(y)

        pg.draw.rect(sheet, (244, 245, 246), pg.Rect(left, top, width, height))
        for level, colour in ((0.0, _FAINT), (limit, _ALARM), (-limit, _ALARM)):
            y = at(begin, level)[1]
            pg.draw.line(sheet, colour, (left, y), (left + width, y), SCALE)
            self._text(f"{level:+.2f}" if level else "0", 18, _INK, (left - 8 * SCALE, y), "midright")
        points = [at(time, d) for time, d in self._trace if time >= begin]
        if len(points) > 1:
            pg.draw.lines(sheet, _PATH, False, points, 2 * SCALE)
        pg.draw.circle(sheet, _PATH, points[-1], 4 * SCALE)
        self._text("lateral error [m], + left", 18, _INK, (left, top - 6 * SCALE), "bottomleft")

    def _dial(self, pose: Pose) -> None:
        pg, sheet = self._pg, self._sheet
        x, y, radius = 606 * SCALE, (VIEW_HEIGHT + 84) * SCALE, 38 * SCALE
        pg.draw.circle(sheet, _FAINT, (x, y), radius, 5 * SCALE)
        wheel = pose.steer * max(self._scenario.vehicle.steering_ratio, 8.0)
        for spoke in (0.0, 2.2, -2.2):
            angle = wheel + spoke
            tip = (x - radius * 0.9 * math.sin(angle), y - radius * 0.9 * math.cos(angle))
            colour, size = (_PATH, 6) if spoke == 0.0 else (_FAINT, 4)
            pg.draw.line(sheet, colour, (x, y), tip, size * SCALE)
        self._text(f"steering {math.degrees(pose.steer):+.1f}°", 18, _INK, (x, y + 58 * SCALE), "center")

    def _numbers(self, pose: Pose) -> None:
        x, y = 680 * SCALE, (VIEW_HEIGHT + 34) * SCALE
        self._text(f"{3.6 * pose.speed:.0f} km/h", 34, _INK, (x, y), "topleft")
        self._text(f"error {self._error(pose):+.2f} m", 24, _INK, (x, y + 40 * SCALE), "topleft")
        self._text(f"time {pose.time:.1f} s", 24, _INK, (x, y + 66 * SCALE), "topleft")
        if pose.edge is None and isinstance(self._scenario, CameraLaneScenario):
            self._text("no edge in sight", 24, _ALARM, (12 * SCALE, 12 * SCALE), "topleft")
        if pose.departed:
            self._text(pose.failure or "left its lane", 24, _ALARM, (x, y + 92 * SCALE), "topleft")

    def _text(self, text: str, size: int, colour: tuple[int, int, int], where: Any, anchor: str) -> None:
        picture = self._fonts[size].render(text, True, colour)
        self._sheet.blit(picture, picture.get_rect(**{anchor: where}))
