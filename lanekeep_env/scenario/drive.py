"""Driving with steering, throttle and brake: set speeds, a car ahead, stop points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

from lanekeep_env import layout as at
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.effects import Need
from lanekeep_env.scenario.powered import PoweredScenario
from lanekeep_env.scenario.traffic import Traffic, traffic_from


def ahead_channels() -> list[Channel]:
    """What is seen of a car ahead and of a stop point."""
    far = float(at.FAR)
    return [
        Channel("lead_gap", "m", 0.0, far, f"to the car ahead, {far:g} without one", at.LEAD_GAP),
        Channel("lead_speed", "m/s", 0.0, 100.0, "of the car ahead", at.LEAD_SEEN),
        Channel("stop_gap", "m", -far, far, f"to the stop point, {far:g} without one", at.STOP_GAP),
    ]


@dataclass(frozen=True)
class DriveScenario(PoweredScenario):
    """Everything that defines `lanekeep/Drive-v0`: the fields of `PoweredScenario`, and these.

    Attributes:
        traffic: a list of events, or a mapping of `Traffic`; random timelines by default.
    """

    traffic: Traffic = field(default_factory=Traffic)

    _readers: ClassVar[dict[str, Callable[[Any], Any]]] = {**PoweredScenario._readers, "traffic": traffic_from}
    _needs: ClassVar[tuple[Need, ...]] = (
        *PoweredScenario._needs,
        *(
            Need(
                f"traffic.{name}", f"{name} of random timelines", "the events are given", lambda s: not s.traffic.events
            )
            for name in ("count", "duration", "largest_speed", "hazards", "seed")
        ),
    )

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        return {**super().numbers(), at.TRACKS: float(self.traffic.tracks)}

    def _channels(self) -> list[Channel]:
        return [*super()._channels(), *ahead_channels(), *(_position_channels() if self.traffic.tracks else ())]


def _position_channels() -> list[Channel]:
    far = float(at.FAR)
    what = f"along the road to the set position, {far:g} without one"
    return [
        Channel("position_gap", "m", -far, far, what, at.POSITION_GAP),
        Channel("position_speed", "m/s", 0.0, 100.0, "of the set position", at.POSITION_SPEED),
        Channel("position_acceleration", "m/s²", -20.0, 20.0, "of the set position", at.POSITION_PULL),
    ]
