"""What disturbs cars on roads: bank and wind, patches of other friction, a car that changes while it drives.

Faults of the steering are the vehicle's (`SteeringActuator`) and the randomisation's, on roads as between walls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import copy
from dataclasses import asdict, dataclass, fields
from typing import Any

from lanekeep_env import layout as at
from lanekeep_env.checks import from_mapping, plain_numbers, require, shown
from lanekeep_env.physics.load_transfer import largest_across
from lanekeep_env.physics.parameters import AIR_DENSITY, GRAVITY
from lanekeep_env.randomisation import FRICTION, FRICTION_SHARE, LAG, TYRES, Randomisation, Range
from lanekeep_env.scenario.base import Channel
from lanekeep_env.scenario.car import NEEDED
from lanekeep_env.scenario.effects import Need

#: A change that lasts for the rest of the episode, control steps.
_FOR_GOOD = 1e12
#: Standard deviations of a gust that a car has to bear.
_WORST_GUST = 3.0


def bounds_from(name: str, unit: str, least: float, most: float, value: Any) -> Range:
    """Read bounds (low, high) or one number for both, from ``least`` to ``most``."""
    low, high = value if isinstance(value, tuple | list) and len(value) == 2 else (value, value)
    for bound in (low, high):
        require(name, bound, f"{unit}, or two, (low, high)", at_least=least, at_most=most)
    if high < low:
        raise ValueError(f"{name}={shown(value)} is not allowed: the bounds must be (low, high) with low <= high")
    return float(low), float(high)


@dataclass(frozen=True)
class Patches:
    """Patches of other friction along a road, one in every stretch of so many metres, somewhere in it.

    Attributes:
        friction: factor of the road's friction, bounds (low, high) between which each patch draws its own, or a number.
        length: m; an axle feels a patch while it is on it.
        every: m, at least ``length``.
    """

    friction: Range
    length: float = 20.0
    every: float = 200.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "friction", bounds_from("patches.friction", "", 0.05, 20.0, self.friction))
        require("patches.length", self.length, "m", at_least=0.1, at_most=1e5)
        require("patches.every", self.every, "m (patches.length)", at_least=float(self.length), at_most=1e6)
        plain_numbers(self)


@dataclass(frozen=True)
class Changes:
    """A car that becomes another in mid-episode: factors of its numbers, bounds (low, high) or a number each.

    Attributes:
        mass: factor of mass and yaw inertia.
        friction: factor of the road's friction.
        front_cornering_stiffness, rear_cornering_stiffness, steering_lag: factors.
        time: of the episode at which it changes, s, bounds or a number.
        duration: for which it does, s, bounds or a number; None for the rest of the episode.

    Each factor multiplies what the episode's randomisation has drawn. Times are rounded to control steps.
    """

    mass: Range = (1.0, 1.0)
    friction: Range = (1.0, 1.0)
    front_cornering_stiffness: Range = (1.0, 1.0)
    rear_cornering_stiffness: Range = (1.0, 1.0)
    steering_lag: Range = (1.0, 1.0)
    time: Range = (5.0, 25.0)
    duration: Range | None = None

    def __post_init__(self) -> None:
        for name in FACTORS:
            bounds = bounds_from(f"changes.{name}", "(a factor)", 0.05, 20.0, getattr(self, name))
            object.__setattr__(self, name, bounds)
        object.__setattr__(self, "time", bounds_from("changes.time", "s", 0.0, 1e6, self.time))
        if self.duration is not None:
            object.__setattr__(self, "duration", bounds_from("changes.duration", "s", 0.0, 1e6, self.duration))
        if all(getattr(self, name) == (1.0, 1.0) for name in FACTORS):
            raise ValueError(
                f"changes={shown(asdict(self))} (of the car in mid-episode) has no effect in this scenario: no factor "
                f"is other than 1; allowed: None, or a factor of {', '.join(FACTORS)}"
            )


#: What may change and what it takes to matter, in the order of the kernel's factors.
_CHANGING = {
    "mass": TYRES,
    "friction": FRICTION,
    "front_cornering_stiffness": TYRES,
    "rear_cornering_stiffness": TYRES,
    "steering_lag": LAG,
}
FACTORS = tuple(_CHANGING)


def _record(record: type, name: str, value: Any) -> Any:
    if value is None or isinstance(value, record):
        return value
    if not isinstance(value, Mapping):
        expected = ", ".join(f.name for f in fields(record))
        raise ValueError(f"{name}={shown(value)} must be None or a mapping of {expected}")
    return from_mapping(record, value, name)


#: How the fields of a scenario are read.
READERS = {
    "bank": lambda value: bounds_from("bank", "rad", -0.2, 0.2, value),
    "crosswind": lambda value: bounds_from("crosswind", "m/s", -40.0, 40.0, value),
    "patches": lambda value: _record(Patches, "patches", value),
    "changes": lambda value: _record(Changes, "changes", value),
}


def _slips(scenario: Any) -> bool:
    return bool(scenario.model.slips)


#: What they take to have an effect.
NEEDS = (
    *(
        Need(name, what, "the car rolls without slip, no side force moves it", _slips)
        for name, what in (
            ("bank", "roll angle of the road"),
            ("crosswind", "wind from the side"),
            ("gusts", "of the wind from the side"),
            ("gust_time", "for how long a gust lasts"),
        )
    ),
    Need("gust_time", "for how long a gust lasts", "gusts=0 has none", lambda s: s.gusts > 0.0),
    Need("patches", "places of other friction", *NEEDED[FRICTION]),
    *(Need(f"changes.{name}", "factor in mid-episode", *NEEDED[needs]) for name, needs in _CHANGING.items()),
)


def check(scenario: Any) -> None:
    """Raise ValueError for numbers that are not allowed, or side forces that tyres cannot bear beside the road's."""
    require("gusts", scenario.gusts, "m/s", at_least=0.0, at_most=20.0)
    require("gust_time", scenario.gust_time, "s", at_least=1e-3, at_most=1e4)
    seconds = scenario.episode_steps * scenario.control_step
    if scenario.changes is not None and scenario.changes.time[0] >= seconds:
        raise ValueError(
            f"changes.time={shown(scenario.changes.time)} has no effect in this scenario: its episodes last "
            f"{seconds:g} s (episode_steps={scenario.episode_steps}); allowed: a time before"
        )
    if not (scenario.pushed and scenario.model.saturates and scenario.sets_speed and scenario.speed.lateral_limit):
        return
    grip = scenario.friction * scenario.occurring.friction[0] * lowest_patch(scenario) * GRAVITY
    turns = min(scenario.speed.lateral_limit * scenario.randomisation.speed[1] ** 2, FRICTION_SHARE * grip)
    if scenario.model.transfers_load:
        grip = largest_across(scenario.vehicle, grip, scenario.occurring.mass[1])
    bank = math.sin(max(map(abs, scenario.bank))) * GRAVITY
    area, _ = scenario.vehicle.wind
    across = max(map(abs, scenario.crosswind)) + _WORST_GUST * scenario.gusts
    mass = scenario.vehicle.mass * scenario.occurring.mass[0]
    wind = 0.5 * AIR_DENSITY * area * math.hypot(scenario.fastest, across) * across / mass
    if turns + bank + wind > grip:
        raise ValueError(
            f"bank={scenario.bank!r} with crosswind={scenario.crosswind!r} and gusts={scenario.gusts!r} is not "
            f"allowed: beside up to {turns:.3g} m/s² of the road's turns they take {bank:.3g} and {wind:.3g} m/s², and "
            f"the least friction gives {grip:.3g} m/s² in all"
        )


def lowest_patch(scenario: Any) -> float:
    """Factor of the friction on the most slippery patch, 1 off any."""
    return 1.0 if scenario.patches is None else min(1.0, scenario.patches.friction[0])


def grippiest_patch(scenario: Any) -> float:
    """Factor of the friction on the least slippery patch, 1 off any."""
    return 1.0 if scenario.patches is None else max(1.0, scenario.patches.friction[1])


def widened(drawn: Randomisation, changes: Changes | None) -> Randomisation:
    """Return bounds of all cars that occur: those that episodes draw, and those that these become."""
    if changes is None:
        return drawn
    all_of_them = copy(drawn)
    for name in FACTORS:
        (low, high), (least, most) = getattr(drawn, name), getattr(changes, name)
        object.__setattr__(all_of_them, name, (low * min(1.0, least), high * max(1.0, most)))
    return all_of_them


def numbers(scenario: Any) -> dict[int, Any]:
    """The kernel's settings by row of `layout`."""
    steering, step = scenario.vehicle.steering, scenario.control_step
    area, lever = scenario.vehicle.wind
    blows = scenario.crosswind != (0.0, 0.0) or scenario.gusts > 0.0
    found: dict[int, Any] = {
        at.STEERING_OFFSET: steering.offset,
        at.BANK_LOW: scenario.bank,
        at.CROSSWIND_LOW: scenario.crosswind,
        at.GUSTS: scenario.gusts,
        at.GUST_KEPT: math.exp(-step / scenario.gust_time),
        at.SIDE_AREA: 0.5 * AIR_DENSITY * area if blows else 0.0,
        at.NOMINAL_LEVER: lever,
        at.CHANGE_FROM: (-1.0, -1.0),
    }
    if scenario.patches is not None:
        found[at.PATCH_EVERY] = scenario.patches.every, scenario.patches.length, *scenario.patches.friction
    changes = scenario.changes
    if changes is not None:
        lasts = changes.duration
        found[at.CHANGE_FROM] = [bound / step for bound in changes.time]
        found[at.CHANGE_SHORTEST] = [_FOR_GOOD] * 2 if lasts is None else [bound / step for bound in lasts]
        found[at.CHANGES] = [bound for name in FACTORS for bound in getattr(changes, name)]
    return found


def channels(scenario: Any) -> list[Channel]:
    """What the full observation shows of that which disturbs the car."""
    friction = scenario.model.saturates and (scenario.patches is not None or scenario.changes is not None)
    slips, faults = scenario.model.slips, scenario.steering_errs
    rows = (
        (
            slips and scenario.bank != (0.0, 0.0),
            "bank",
            "rad",
            0.2,
            "roll angle of the road, left side up positive",
            at.BANK,
        ),
        (
            slips and (scenario.crosswind != (0.0, 0.0) or scenario.gusts > 0.0),
            "crosswind",
            "m/s",
            100.0,
            "with its gust, to the left positive",
            at.CROSSWIND,
        ),
        (friction, "friction", "", 20.0, "largest force of the front axle over its load", at.FRICTION_HERE),
        (faults, "steering_offset", "rad", 1.0, "of this episode", at.STEER_OFFSET),
        (faults, "steering_gain", "", 400.0, "of this episode", at.STEER_FACTOR),
    )
    return [Channel(name, unit, -most, most, what, row) for here, name, unit, most, what, row in rows if here]
