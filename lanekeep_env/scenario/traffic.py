"""What happens around a car that drives: set speeds, cars ahead, stop points; a given timeline or random ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lanekeep_env import layout as at
from lanekeep_env.checks import LARGEST_SET, choose, from_mapping, plain_numbers, require, shown

#: Kinds of events and the units of the numbers that follow time and kind.
EVENTS: dict[str, tuple[int, tuple[str, ...]]] = {
    "speed": (at.SPEED_EVENT, ("m/s",)),
    "lead": (at.LEAD_EVENT, ("m", "m/s")),
    "lead_speed": (at.LEAD_SPEED_EVENT, ("m/s", "m/s²")),
    "lead_gone": (at.LEAD_GONE, ()),
    "stop": (at.STOP_EVENT, ("m",)),
    "stop_gone": (at.STOP_GONE, ()),
    "position": (at.POSITION_EVENT, ("m", "m/s")),
    "position_speed": (at.POSITION_SPEED_EVENT, ("m/s", "m/s²")),
    "position_gone": (at.POSITION_GONE, ()),
}
#: The largest of them: what stands as far as `layout.FAR` is not there, and speeds are observed up to 100 m/s.
LARGEST = {"m": at.FAR - 1.0, "m/s": 100.0, "m/s²": 20.0}
#: The fastest that a car is asked to go backwards, m/s.
LARGEST_BACKWARDS = 5.0
#: The least value of a kind's number, where that is not 0.
LEAST = {("speed", 0): -LARGEST_BACKWARDS, ("position", 0): -LARGEST["m"]}
#: The longest timeline, s: eleven days, far beyond any episode.
LONGEST = 1e6
#: Events of one timeline, and bytes of the kernel's table of all of them.
MOST_EVENTS = 10_000
LARGEST_TABLE = 64 << 20
#: Seconds for a random event at the least, in the mean: a car ahead takes 14 s for three; further ones in a timeline,
#: its first one and those that end others behind its end; bytes of one.
_SOONEST, _FURTHER, _EVENT_SIZE = 14.0 / 3.0, 3, 32
Event = tuple[float, str, tuple[float, ...]]


@dataclass(frozen=True)
class Traffic:
    """What happens around a car: one given timeline, or a set of random ones.

    Attributes:
        events: (time in s, kind, numbers ...) in order of time, or none for random timelines. Kinds: "speed" (m/s; the
            one at 0 s is also the car's speed at the start; down to -5 m/s, backwards: the car stops first, and changes
            into reverse), "lead" (gap in m, speed in m/s of a car that comes, or cuts in, ahead), "lead_speed" (m/s
            that it goes to from then on, and its acceleration or braking in m/s², of which its tyres give no more than
            the friction of the road), "lead_gone" (it turns off), "stop" (distance of a stop point in m),
            "stop_gone", "position" (way ahead in m, negative behind, and speed in m/s of a set position (x(t), y(t))
            that moves along the road: what speed is set is from then on what leads there), "position_speed" (m/s that
            it goes to, and with how many m/s²), "position_gone" (the speed set last stays); up to 199 m
            and 100 m/s. Cars and stop points are in the way, also backwards; set positions are driven to forwards.
        count: random timelines in the set; an episode's key chooses one.
        duration: of each of them, s; with ``count`` it bounds the table of all events to 64 MiB.
        largest_speed: m/s, 30 at the most: who sees 200 m cannot stop from more with 3 m/s².
        hazards: share of cars ahead and stop points that take more than comfort, some more than any brake gives: hard
            braking (4 to 9 m/s²), cut-ins (0.2 to 1.2 s ahead), stop points that come late.
        seed: of the set.
    """

    events: tuple[Event, ...] = ()
    count: int = 256
    duration: float = 60.0
    largest_speed: float = 20.0
    hazards: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.events, tuple | list):
            raise ValueError(f"traffic.events={shown(self.events)} is not allowed: a list of (time, kind, numbers ...)")
        if len(self.events) > MOST_EVENTS:
            raise ValueError(f"traffic.events has {len(self.events)} events, allowed are {MOST_EVENTS} at the most")
        object.__setattr__(self, "events", tuple(self._event(event) for event in self.events))
        times = [event[0] for event in self.events]
        if times != sorted(times):
            raise ValueError(f"traffic.events: times {shown(times)} are not allowed: they must rise")
        if self.events and (self.events[0][0] != 0.0 or self.events[0][1] != "speed"):
            raise ValueError('traffic.events must begin with (0.0, "speed", m/s)')
        self._check_there()
        require("traffic.count", self.count, "timelines", at_least=1, at_most=LARGEST_SET, whole=True)
        longest = min(LONGEST, (LARGEST_TABLE // _EVENT_SIZE // int(self.count) - _FURTHER) * _SOONEST)
        require("traffic.duration", self.duration, f"s for {int(self.count)} timelines", above=0.0, at_most=longest)
        require("traffic.largest_speed", self.largest_speed, "m/s", at_least=5.0, at_most=30.0)
        require("traffic.hazards", self.hazards, "", at_least=0.0, at_most=1.0)
        require("traffic.seed", self.seed, "", at_least=0, whole=True)
        plain_numbers(self)

    def _check_there(self) -> None:
        """Refuse a speed of what is not there: it would be lost."""
        there: set[str] = set()
        for time, kind, _ in self.events:
            thing, _, what = kind.partition("_")
            if what == "speed" and thing not in there:
                raise ValueError(f"traffic.events {kind!r} at {time:g} s is not allowed: no {thing!r} is there by then")
            (there.discard if what == "gone" else there.add)(thing)

    @staticmethod
    def _event(event: Sequence[Any]) -> Event:
        if not isinstance(event, Sequence) or len(event) < 2:
            raise ValueError(f"traffic.events: {shown(event)} is not allowed: (time, kind, numbers ...)")
        time, kind, *numbers = event
        numbers = [one for number in numbers for one in (number if isinstance(number, list | tuple) else [number])]
        require("traffic.events time", time, "s", at_least=0.0, at_most=LONGEST)
        choose("traffic.events kind", kind, EVENTS)
        units = EVENTS[kind][1]
        if len(numbers) != len(units):
            raise ValueError(f"traffic.events: {kind!r} takes {len(units)} numbers, not {shown(numbers)}")
        for place, (number, unit) in enumerate(zip(numbers, units, strict=True)):
            least = LEAST.get((kind, place), 0.0)
            require(f"traffic.events {kind}", number, unit, at_least=least, at_most=LARGEST[unit])
        return float(time), str(kind), tuple(float(number) for number in numbers)

    @property
    def tracks(self) -> bool:
        """Whether there are set positions."""
        return any(kind == "position" for _, kind, _ in self.events)

    def build(self) -> np.ndarray:
        """Return the kernel's timelines, (timelines, events, 4)."""
        if self.events:
            timelines: Iterable[Sequence[Event]] = [self.events]
            count, most = 1, len(self.events)
        else:
            rng = np.random.default_rng([self.seed, 0x7AFF])
            timelines = (self._random(rng) for _ in range(self.count))
            count, most = self.count, int(self.duration / _SOONEST) + _FURTHER
        table = np.full((count, most, 4), np.inf)
        for timeline, events in zip(table, timelines, strict=True):
            timeline[: len(events)] = [
                (time, EVENTS[kind][0], *(*numbers, 0.0, 0.0)[:2]) for time, kind, numbers in events
            ]
        used = np.isfinite(table[:, :, at.E_TIME]).any(axis=0).sum()
        return np.ascontiguousarray(table[:, :used])

    def _random(self, rng: np.random.Generator) -> list[Event]:
        """Set speeds; every other one meets a slower car that turns off again, or a stop point."""
        speed = float(rng.uniform(0.3, 1.0) * self.largest_speed)
        events: list[Event] = [(0.0, "speed", (speed,))]
        time = 0.0
        while True:
            time += float(rng.uniform(6.0, 12.0))
            if time > self.duration:
                return events
            chance, hazard = rng.random(), rng.random() < self.hazards
            if chance < 0.35:
                speed = float(rng.uniform(0.2, 1.0) * self.largest_speed)
                events.append((time, "speed", (speed,)))
            elif chance < 0.7:
                time = _lead(rng, events, time, speed, hazard)
            else:
                far = 10.0 + speed + speed**2 / 3.0
                if hazard:  # from more than any brake gives to what is just no comfort
                    far = float(rng.uniform(0.7, 2.5)) * speed**2 / 17.0 + 0.15 * speed
                events.append((time, "stop", (min(far, 190.0),)))
                time += float(rng.uniform(18.0, 24.0)) + speed
                events.append((time, "stop_gone", ()))


def _lead(rng: np.random.Generator, events: list[Event], time: float, speed: float, hazard: bool) -> float:
    """Add a slower car that drives as it likes and turns off; return when it does."""
    ahead = float(rng.uniform(0.4, 0.9) * speed)
    # Far enough that 3 m/s² are not needed to fall in behind it.
    gap, rate = 10.0 + 1.5 * speed + (speed - ahead) ** 2 / 3.0, float(rng.uniform(0.3, 1.0))
    then = float(rng.uniform(0.3, 1.2) * ahead)
    if hazard and rng.random() < 0.5:
        gap = float(rng.uniform(0.2, 1.2) * speed) + 1.0
    elif hazard:
        rate, then = float(rng.uniform(4.0, 9.0)), float(rng.choice([0.0, rng.uniform(0.0, 0.5)])) * ahead
    events.append((time, "lead", (min(gap, 150.0), ahead)))
    time += float(rng.uniform(4.0, 12.0))
    events.append((time, "lead_speed", (then, rate)))
    time += float(rng.uniform(4.0, 10.0))
    events.append((time, "lead_gone", ()))
    return time


def traffic_from(value: Mapping[str, Any] | Sequence[Any] | Traffic | None) -> Traffic:
    """Read traffic: None (random), a list of events, a mapping, or a record; ValueError names what is wrong."""
    if value is None:
        return Traffic()
    if isinstance(value, Traffic):
        return value
    if isinstance(value, Mapping):
        return from_mapping(Traffic, value, "traffic")
    if isinstance(value, Sequence) and not isinstance(value, str):
        return Traffic(events=tuple(value))
    raise ValueError(f"traffic={shown(value)} must be a list of events or a mapping of Traffic's fields")
