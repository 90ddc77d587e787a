"""Cars that drive a lap of a circuit between walls, steering and speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from lanekeep_env import layout as at
from lanekeep_env.checks import require
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.effects import Need, never
from lanekeep_env.scenario.scan import SCANS, Scan
from lanekeep_env.scenario.walls import WallFollowScenario
from lanekeep_env.walls import MapFile, RandomCircuits, WorldRecord
from lanekeep_env.walls.corners import swept_corner, turned_corner
from lanekeep_env.walls.map_file import FOUND
from lanekeep_env.walls.sets import world_set

#: Share of the largest speed at which there is time for a lap.
_LAP_PACE = 0.25


@dataclass(frozen=True)
class CircuitScenario(WallFollowScenario):
    """Everything that defines `lanekeep/Circuit-v0`: the fields of `WallFollowScenario` with other defaults, and these.

    Attributes:
        max_speed: that the second action 1 asks for, m/s; -1 asks for as much backwards (kinematic cars only).
        max_acceleration: either way, m/s².
        laps: after which the episode is done.

    ``speed``, ``set_distance`` and the four numbers of the running cost have no meaning here: the car starts at rest in
    the middle of one of the circuit's sides, within ``start_lateral_error`` of it, and time is the cost.
    """

    task: ClassVar[int] = at.CIRCUIT
    view: ClassVar[float] = 16.0
    _lateral_error: ClassVar[str] = "of the centre of gravity, left of the circuit's centre line"

    world: WorldRecord = field(default_factory=RandomCircuits)
    steering_offset: tuple[float, float] = (-math.radians(1.0), math.radians(1.0))
    start_lateral_error: float = 0.1
    start_heading_error: float = math.radians(5.0)
    scan: Scan = field(default_factory=lambda: SCANS["perfect"])
    episode_steps: int = 1800
    max_speed: float = 2.0
    max_acceleration: float = 2.0
    laps: int = 1

    _needs: ClassVar[tuple[Need, ...]] = (
        Need("speed", "set speeds", "the second action asks for the speed, up to max_speed", never),
        Need("set_distance", "from the wall on the right", "the car follows no wall here", never),
        Need("side_sensor", "place of the side ultrasonics", "on circuits they sit half-way between the axles", never),
        *(
            Need(name, "of the running cost", "time is what costs here", never)
            for name in ("reference_lateral_error", "cost_weight", "reference_steering_rate", "cost_cap", "effort")
        ),
        *(n for n in WallFollowScenario._needs if not n.field.startswith("speed.") and n.field != "effort"),
    )

    def _check(self) -> None:
        require("max_speed", self.max_speed, "m/s", at_least=1e-3, at_most=20.0)
        require("max_acceleration", self.max_acceleration, "m/s²", at_least=1e-3, at_most=1e3)
        require("laps", self.laps, "", at_least=1, at_most=1_000_000, whole=True)
        super()._check()
        self._check_drivable()

    def _check_drivable(self) -> None:
        """Raise ValueError for a world that the car cannot drive: too narrow for its body or its turning circle."""
        car, world = self.vehicle, self.world
        if world.passes and getattr(world, world.passes) <= car.width:
            gap = getattr(world, world.passes)
            raise ValueError(f"world.{world.passes}={gap!r} is not allowed: the car is {car.width:g} m wide")
        if world.turns:
            needed, how = turned_corner(car.length, car.width), "shunting as often as need be"
            if not self.reverses:
                angle = self._wheel_angle + max(map(abs, self.steering_offset))
                needed = swept_corner(car.length, car.width, car.wheelbase, angle)
                how = f"only forwards, with {math.degrees(angle):.3g} degrees of steering"
            corridor = getattr(world, world.turns)
            if corridor <= needed:
                raise ValueError(
                    f"world.{world.turns}={corridor!r} is not allowed: round a right angle the car, {car.length:g} m "
                    f"long and {car.width:g} m wide, needs more than {needed:.3g} m of corridor, {how}"
                )

    def _settle(self) -> None:
        if isinstance(self.world, MapFile) and self.world.centre_line is None:
            object.__setattr__(self, "world", replace(self.world, centre_line=FOUND))
        super()._settle()

    def _lap(self) -> float:
        """All laps at a quarter of the largest speed."""
        lengths = [one.length for one in world_set(self.world, self.world.fingerprint()) if one.centre_line is not None]
        if not lengths:
            return super()._lap()
        return self.laps * max(lengths) / (_LAP_PACE * self.max_speed)

    @property
    def num_actions(self) -> int:
        """Steering and speed."""
        return 2

    @property
    def sets_speed(self) -> bool:
        """The second action does."""
        return False

    @property
    def reverses(self) -> bool:
        """Whether the car may drive backwards."""
        return self.dynamics == "kinematic"

    @property
    def largest_speed(self) -> float:
        """Speed that action 1 asks for, m/s."""
        return self.max_speed

    @property
    def largest_cost(self) -> float:
        """What a second costs at most: twice that of standing still, 1/s."""
        return at.LARGEST_CIRCUIT_COST

    def numbers(self) -> dict[int, Any]:
        """The kernel's settings by row of `layout`."""
        change = self.max_acceleration * self.integration.step
        return {**super().numbers(), at.SPEED_HOLD: math.inf, at.SPEED_CHANGE: change, at.LAPS: self.laps}

    def _further(self) -> list[Channel]:
        return [Channel("speed_command", "m/s", -20.0, 20.0, "set speed that was asked for", at.SPEED_TARGET)]
