"""`werling-traffic`: the multi-controller of Werling, Gröll, Bretthauer 2008 on a road of several lanes.

Beside `werling-drive` it follows whichever of the cars ahead asks for the least: that in its lane, one on its way into
it, and those of both lanes while it changes. It takes a car ahead that brakes to go on to a standstill, where the stop
law then ends. It changes lanes where the next one is quicker, or its own ends, and there is room, along the evasive
manoeuvre's path.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.lane_change import Room, passing_speed, quintic_at
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.werling_longitudinal import emergency_law, gap_law
from lanekeep_baselines.werling_multi import DriveScenario, WerlingDrive

#: Length of the others, m.
LENGTH = 5.0
_SIDES = ("right", "own", "left")


class TrafficScenario(DriveScenario, Protocol):
    """What it may know besides: the lanes."""

    @property
    def lanes(self) -> int: ...
    @property
    def lane_width(self) -> float: ...


class Change(NamedTuple):
    """A change of lanes, (n,) each.

    Attributes:
        origin, target: numbers of the lanes; the same where none is under way.
        way, length: driven of it and whole, m.
        rested: since the last one, s.
        speed: of the car ahead at the last step, m/s ...
        gap: ... and to it, m.
        ends: 1 where the right-most lane is known to end.
    """

    origin: Floats
    target: Floats
    way: Floats
    length: Floats
    rested: Floats
    speed: Floats
    gap: Floats
    ends: Floats


class WerlingTraffic(WerlingDrive):
    """`werling-traffic`: `werling-drive` with gap control over lanes and changes of lanes."""

    name = "werling-traffic"
    reads = (
        *WerlingDrive.reads,
        "lane",
        *(f"{way}_{side}_{what}" for side in _SIDES for way in ("ahead", "behind") for what in ("distance", "speed")),
        *(f"ahead_{side}_lane" for side in ("right", "left")),
    )
    room: ClassVar[Room] = Room()
    #: Time of a change and from one to the next, s; gain of speed that it takes, m/s; over which time, s.
    lasting: ClassVar[float] = 4.0
    rest: ClassVar[float] = 3.0
    gain: ClassVar[float] = 1.5
    horizon: ClassVar[float] = 10.0
    #: A car that is nearer to the side ends a change that has not left its lane, m.
    beside: ClassVar[float] = 1.0
    #: Before the end of a lane the car behind which to go is followed nearer than the gap law has it, s, and braking
    #: begins where it takes that much, m/s².
    closer: ClassVar[float] = 0.6
    late: ClassVar[float] = 2.5
    #: For how long braking is taken to last where a change is weighed, s.
    foresight: ClassVar[float] = 2.0
    #: A car of the next lane that is nearer than that many lanes is on its way into this one.
    coming: ClassVar[float] = 0.9
    #: Braking of the car ahead that is taken to go on, m/s².
    brakes: ClassVar[float] = 1.5

    def __init__(self, scenario: TrafficScenario) -> None:
        super().__init__(scenario)
        self._drives = self.memory
        self.memory += len(Change._fields)
        self._lanes, self._width = scenario.lanes, scenario.lane_width
        self._half = 0.5 * (LENGTH + scenario.vehicle.length)

    def _gap(self, at: Mapping[str, Floats], way: str, side: str) -> Floats:
        """Return the way between the bodies, m, inf without a car."""
        distance = at[f"{way}_{side}_distance"]
        distance = distance if way == "ahead" else -distance
        return np.where(distance >= self._far, np.inf, distance - self._half)

    def _start(self, at: Mapping[str, Floats], last: Change, ending: Floats) -> Change:
        """Return the change under way, or the one that begins now."""
        v, wish = at["speed"], at["set_speed"]
        last = self._turn_back(at, last)
        under_way = (last.origin != last.target) & (last.way < last.length)
        rested = np.where(under_way, 0.0, last.rested + self._step)
        lane = np.clip(np.rint(at["lane"]), 0, self._lanes - 1)
        own = passing_speed(wish, self._gap(at, "ahead", "own"), at["ahead_own_speed"], self.horizon)
        # Who brakes is slower in a moment than the one behind there takes it to be.
        soon = np.maximum(v + self.foresight * np.minimum(at["acceleration"], 0.0), 0.0)
        best, target = np.where(ending > 0.0, 0.0, own + self.gain), lane
        for side, step in (("right", -1.0), ("left", 1.0)):
            ahead, behind = self._gap(at, "ahead", side), self._gap(at, "behind", side)
            there = (lane + step >= 0.0) & (lane + step <= self._lanes - 1.0)
            there &= (lane + step > 0.0) | (last.ends == 0.0)
            free = self.room.enough(ahead, v, at[f"ahead_{side}_speed"])
            free &= self.room.enough(behind, at[f"behind_{side}_speed"], soon)
            quick = passing_speed(wish, ahead, at[f"ahead_{side}_speed"], self.horizon)
            better = there & free & (quick > best)
            best, target = np.where(better, quick, best), np.where(better, lane + step, target)
        starts = ~under_way & (target != lane) & (v > 3.0) & ((rested > self.rest) | (ending > 0.0))
        starts &= np.abs(at["lateral_error"]) < 0.5
        origin = np.where(under_way, last.origin, lane)
        return last._replace(
            origin=origin,
            target=np.where(under_way, last.target, np.where(starts, target, lane)),
            way=np.where(starts, 0.0, last.way),
            length=np.where(starts, np.maximum(self.lasting * v, 20.0), last.length),
            rested=rested,
        )

    def _turn_back(self, at: Mapping[str, Floats], last: Change) -> Change:
        """Return the change under way, or the way back where another car has come into the lane that it goes to."""
        going = (last.origin != last.target) & (last.way < last.length) & (np.rint(at["lane"]) == last.origin)
        taken = np.zeros_like(going)
        for side, step in (("right", -1.0), ("left", 1.0)):
            closing = np.maximum(at[f"behind_{side}_speed"] - at["speed"], 0.0)
            beside = (self._gap(at, "ahead", side) < self.beside) | (
                self._gap(at, "behind", side) < self.beside + closing
            )
            taken |= beside & (last.target - last.origin == step)
        back = going & taken
        return last._replace(
            origin=np.where(back, last.target, last.origin),
            target=np.where(back, last.origin, last.target),
            way=np.where(back, last.length - last.way, last.way),
        )

    def _seen_from_path(self, at: Mapping[str, Floats], change: Change) -> dict[str, Floats]:
        """Return the channels as they are seen from the path: errors, and the curvature ahead."""
        shift = (change.target - change.origin) * self._width
        here = quintic_at(change.way / change.length, shift, change.length)
        lateral = at["lane"] * self._width + at["lateral_error"]
        wanted = change.origin * self._width + here.lateral
        seen = {"lateral_error": lateral - wanted, "heading_error": at["heading_error"] - np.arctan(here.slope)}
        for k, name in enumerate(self._samples):
            way = change.way + at["speed"] * (k * self._interval)
            bend = quintic_at(way / change.length, shift, change.length)
            road = at[name] / np.maximum(1.0 - at[name] * (change.origin * self._width + bend.lateral), 0.1)
            seen[name] = road + bend.curvature
        return seen

    def _leads(self, at: Mapping[str, Floats], change: Change, ending: Floats) -> tuple[Floats, Floats]:
        """Return gap (m) and speed (m/s) of the car ahead that asks for the least acceleration, (n,) each."""
        v, tuning = at["speed"], self.longitudinal
        side = np.where(at["lane"] == change.origin, change.target - change.origin, change.origin - change.target)
        gap = np.where(at["lead_gap"] >= self._far, np.inf, at["lead_gap"])
        speed, none = at["lead_speed"], np.full_like(gap, np.inf)

        def asked(gap: Floats, speed: Floats) -> Floats:
            return np.minimum(gap_law(tuning, v, gap, speed - v), emergency_law(tuning, v, gap, speed - v, none))

        least = asked(gap, speed)
        for name, sign in (("right", -1.0), ("left", 1.0)):
            comes = np.abs(at[f"ahead_{name}_lane"]) < self.coming
            counts = (side == sign) | comes
            beside = np.where(counts, np.maximum(self._gap(at, "ahead", name), 0.0), np.inf)
            if name == "left":  # where the lane ends, the place behind that car is the one to go to
                behind = np.maximum(self._gap(at, "ahead", name) + self.closer * v, 0.0)
                beside = np.where((ending > 0.0) & ~counts, behind, beside)
            asks = asked(beside, at[f"ahead_{name}_speed"])
            first = asks < least
            least = np.where(first, asks, least)
            gap, speed = np.where(first, beside, gap), np.where(first, at[f"ahead_{name}_speed"], speed)
        return gap, speed

    def _standstill(self, gap: Floats, speed: Floats, last: Change) -> Floats:
        """Return where a car ahead that brakes would come to a stand, m ahead, inf where it does not, (n,)."""
        brakes = (last.speed - speed) / self._step
        same = np.abs(gap - last.gap) < 2.0
        counts = same & (brakes > self.brakes) & np.isfinite(gap)
        return np.where(counts, gap - 1.0 + 0.5 * speed * speed / np.where(counts, brakes, 1.0), np.inf)

    def command(
        self, at: Mapping[str, Floats], memory: Floats, fresh: NDArray[np.bool_] | bool
    ) -> tuple[Floats, Floats | None]:
        last = Change(*memory[:, self._drives :].T)
        nothing = np.zeros_like(at["speed"])
        lane = np.rint(at["lane"])
        began = Change(lane, lane, nothing, nothing + 1.0, nothing + self.rest, nothing, nothing - 1e3, nothing)
        last = Change(*(np.where(fresh, new, old) for new, old in zip(began, last, strict=True)))
        ending = np.where((lane == 0.0) & (at["stop_gap"] < self._far), 1.0, 0.0)
        change = self._start(at, last._replace(ends=np.maximum(last.ends, ending)), ending)
        gap, speed = self._leads(at, change, ending)
        stop = np.where(at["stop_gap"] >= self._far, np.inf, at["stop_gap"])
        late = (at["speed"] ** 2 > 2.0 * self.late * stop) | (stop < 20.0)
        stop = np.where(late | (ending == 0.0), stop, np.inf)
        stop = np.minimum(stop, self._standstill(gap, speed, last))
        seen = {
            **at,
            **self._seen_from_path(at, change),
            "lead_gap": np.where(np.isfinite(gap), gap, self._far),
            "lead_speed": speed,
            "stop_gap": np.where(np.isfinite(stop), stop, self._far),
        }
        told, drives = super().command(seen, memory[:, : self._drives], fresh)
        assert drives is not None
        way = change.way + at["speed"] * self._step
        following = change._replace(way=way, speed=speed, gap=np.where(np.isfinite(gap), gap, -1e3))
        return told, np.concatenate([drives, np.stack(following, axis=1)], axis=1)
