"""In highway-env's own tasks: its lane follower, and two yardsticks, a hand-tuned law and a wheel that is let go."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.declared import Need
from lanekeep_baselines.policy import Floats, PreviewScenario, Scenario, SteeringPolicy


class TheirScenario(Scenario, Protocol):
    """What tells their tasks from ours: the id of an environment of highway-env's."""

    @property
    def env(self) -> str: ...


class TheirPreviewScenario(PreviewScenario, TheirScenario, Protocol):
    """The same with curvature ahead."""


#: Where it is named: none of ours has such a field.
_THEIRS = Need("a task of highway-env's", lambda scenario: "" if scenario.env else "the id of a task of highway-env's")


class HighwayZero(SteeringPolicy):
    """`highway-zero`: the wheels stay straight."""

    name = "highway-zero"
    reads = ("speed",)
    needs = (_THEIRS,)

    def __init__(self, scenario: TheirScenario) -> None:
        super().__init__(scenario)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        return np.zeros_like(at["speed"]), None


class HighwayP(SteeringPolicy):
    """`highway-p`: a hand-tuned P law of lateral and heading error, the best on `lane-keeping-v0` of a grid of gains.

    delta = -0.25 rad/m lateral error - 0.9 heading error; the grid is 0.15 to 0.4 rad/m and 0.5 to 1.
    """

    name = "highway-p"
    reads = ("lateral_error", "heading_error")
    needs = (_THEIRS,)
    #: rad of road wheel per m, and per rad.
    lateral_gain: ClassVar[float] = 0.25
    heading_gain: ClassVar[float] = 0.9

    def __init__(self, scenario: TheirScenario) -> None:
        super().__init__(scenario)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        return -self.lateral_gain * at["lateral_error"] - self.heading_gain * at["heading_error"], None


class HighwayBuiltIn(SteeringPolicy):
    """`highway-built-in`: the lane follower of highway-env's own vehicles, `ControlledVehicle.steering_control`.

    Lateral error to lateral speed (1/0.6 s), that to a heading against the lane's 0.1 s ahead, the heading's error to a
    yaw rate (1/0.2 s), and that to the angle with which a car of 5 m without slip turns so.
    """

    name = "highway-built-in"
    reads = ("lateral_error", "heading_error", "speed", "curvature_preview_0")
    uses = ("curvature_preview_*",)
    needs = (_THEIRS,)
    #: Their constants, 1/s, s, m, rad.
    lateral_rate: ClassVar[float] = 1 / 0.6
    heading_rate: ClassVar[float] = 1 / 0.2
    pursuit: ClassVar[float] = 0.1
    length: ClassVar[float] = 5.0
    largest: ClassVar[float] = math.pi / 3

    def __init__(self, scenario: TheirPreviewScenario) -> None:
        super().__init__(scenario)
        ahead = self.pursuit / scenario.preview_interval
        last = f"curvature_preview_{round(ahead)}"
        self._last = last if abs(ahead - round(ahead)) < 1e-9 and last in self._order else "curvature_preview_0"

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        speed = at["speed"]
        floored = np.maximum(speed, 1e-2)
        asked = np.arcsin(np.clip(-self.lateral_rate * at["lateral_error"] / floored, -1.0, 1.0))
        turn = 0.5 * (at["curvature_preview_0"] + at[self._last]) * speed * self.pursuit
        missing = turn + np.clip(asked, -math.pi / 4, math.pi / 4) - at["heading_error"]
        missing = missing - 2.0 * math.pi * np.round(missing / (2.0 * math.pi))
        slip = np.arcsin(np.clip(self.length / 2 / floored * self.heading_rate * missing, -1.0, 1.0))
        return np.clip(np.arctan(2.0 * np.tan(slip)), -self.largest, self.largest), None
