"""Lane keeping support: the assistant beside a driver, on Yin's lateral controller.

Yin 2010 names the use case and not how it is done; the controller is his LQR about the steady curve (`yin`), when it
intervenes and how it hands over are this project's.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats, LaneScenario
from lanekeep_baselines.yin import YinLqrFeedforward


class SupportScenario(LaneScenario, Protocol):
    """What an assistant may know besides; `lanekeep_env.LaneSupportScenario` is one."""

    @property
    def departure_limit(self) -> float: ...


class LaneSupport(YinLqrFeedforward):
    """`lane-support`: nothing while the car stays in its lane, `yin-lqr-feedforward` where it would leave it.

    It intervenes where the car, with the lateral speed and acceleration that it has against the lane, would be nearer
    to the edge than `margin` in `horizon` seconds. It hands back once the car is near the middle, will stay there, and
    the driver asks for nearly the same angle. What it adds to the driver's angle begins and ends at nothing and changes
    by no more than `rate`, so that no hand-over jumps.
    """

    name = "lane-support"
    reads = (*YinLqrFeedforward.reads, "driver_steering")
    actions = 2
    memory = 2  # whether it intervenes, and what it last added
    #: s, and m.
    horizon: ClassVar[float] = 0.8
    margin: ClassVar[float] = 0.3
    #: Lateral error (m), that of the horizon (m) and difference of angles (rad) below which it hands back.
    calm: ClassVar[tuple[float, float, float]] = (0.3, 0.3, 0.008)
    #: Largest change of what is added, at the road wheel, rad/s.
    rate: ClassVar[float] = 0.12

    def __init__(self, scenario: SupportScenario) -> None:
        super().__init__(scenario)
        self._edge = scenario.departure_limit - self.margin
        self._change = self.rate * scenario.control_step
        self._widest = scenario.max_steering_angle

    def foreseen(self, at: Mapping[str, Floats]) -> Floats:
        """Return the lateral error in `horizon` seconds, m, (n,), if the lateral acceleration stays what it is."""
        v, r = at["speed"], at["yaw_rate"]
        # Sideslip as in a steady curve of the present yaw rate.
        sideslip = (self._sideslip[0] + self._sideslip[1] * v * v) * r / np.maximum(v, 1.0)
        course, turn = at["heading_error"] + sideslip, r - v * at["curvature_preview_0"]
        return at["lateral_error"] + v * self.horizon * (course + 0.5 * self.horizon * turn)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        wanted, _ = super().command(at, memory, fresh)
        angle = np.clip(wanted, -self._widest, self._widest)
        driver, foreseen = at["driver_steering"], self.foreseen(at)
        off, later, apart = self.calm
        calm = (np.abs(at["lateral_error"]) < off) & (np.abs(foreseen) < later) & (np.abs(angle - driver) < apart)
        before = np.where(fresh, 0.0, memory[:, 0]) > 0.5
        intervenes = (np.abs(foreseen) > self._edge) | (before & ~calm)
        last = np.where(fresh, 0.0, memory[:, 1])
        added = last + np.clip(np.where(intervenes, angle - driver, 0.0) - last, -self._change, self._change)
        # With all authority, the driver's own angle is what it adds to.
        told = np.stack([driver + added, added != 0.0], axis=1)
        return told, np.stack([intervenes, added], axis=1).astype(np.float64)

    def _action(self, command: Floats, at: Mapping[str, Floats]) -> Floats:
        steering = super()._action(command[:, 0], at)
        return np.concatenate([steering, command[:, 1:]], axis=1)
