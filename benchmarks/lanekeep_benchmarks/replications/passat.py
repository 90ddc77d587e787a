"""Drives of the full-size car, recorded: many cars at once, each with what its controller saw."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
import lanekeep_env  # noqa: F401
from lanekeep_baselines.policy import Policy
from lanekeep_env.roads import Road
from lanekeep_env.roads.generators import RoadRecord

Floats = NDArray[np.float64]

#: Of every drive here, s, unless it says otherwise.
STEP = 0.02


@dataclass(frozen=True)
class Drive:
    """Drives of n cars, a value a control step: the state in which a command was given, (steps, n).

    time s, (steps,); seen: every channel of the observation by name, true values; station m; action as given.
    """

    scenario: Any
    roads: tuple[Road, ...]
    time: Floats
    seen: Mapping[str, Floats]
    station: Floats
    action: Floats

    def __getitem__(self, name: str) -> Floats:
        """Return a channel, (steps, n)."""
        return self.seen[name]

    def world(self, car: int = 0, road: int = 0) -> Floats:
        """Return the course of a car's reference point, m, (steps, 2)."""
        return self.roads[road].position(self.station[:, car], self["lateral_error"][:, car])


def drive(
    env_id: str,
    policy: str | type[Policy] | float,
    seconds: float,
    start: Mapping[str, Any] | None = None,
    cars: int = 1,
    believed: Mapping[str, Any] | None = None,
    **keywords: Any,
) -> Drive:
    """Drive ``cars`` cars.

    Args:
        env_id: without name space.
        policy: its name, its class, or a constant action.
        seconds: how long.
        start: options of the reset.
        cars: how many.
        believed: keywords of the scenario that the policy believes in, where that is another one.
        keywords: of the scenario.
    """
    step = keywords.setdefault("control_step", STEP)
    steps = math.ceil(seconds / step - 1e-9) + 1
    keywords = {"departure": "off", "start_lateral_error": 0.0, "start_course_error": 0.0, **keywords}
    keywords |= {"observation": "full", "episode_steps": steps}
    env: Any = gym.make_vec(
        f"lanekeep/{env_id}",
        num_envs=cars,
        vectorization_mode="vector_entry_point",
        max_episode_steps=steps,
        autoreset_mode="disabled",
        **keywords,
    ).unwrapped
    scenario = env.scenario
    knows = scenario if believed is None else type(scenario).from_keywords(**{**keywords, **believed})
    controller: Any = None
    if isinstance(policy, str):
        controller = lanekeep_baselines.make(policy, knows)
    elif isinstance(policy, type):
        controller = policy(knows)  # type: ignore[call-arg]
    names = [channel.name for channel in scenario.channels]
    observation, info = env.reset(seed=0, options=dict(start or {}))
    state, seen, station, actions = None, [], [], []
    for _ in range(steps):
        if controller is None:
            action = np.full((cars, 1), policy, dtype=np.float32)
        else:
            action, state = controller.predict(observation, state)
        seen.append(observation)
        station.append(np.array(info["arc_length"], dtype=np.float64))
        actions.append(action)
        observation, _, _, _, info = env.step(action)
    roads = tuple(road for road, _ in env.road_set())
    env.close()
    table = np.array(seen, dtype=np.float64)
    channels = {name: table[:, :, k] for k, name in enumerate(names)}
    time: Floats = step * np.arange(steps, dtype=np.float64)
    return Drive(scenario, roads, time, channels, np.array(station), np.array(actions, dtype=np.float64))


def back_within(time: Floats, error: Floats, band: float) -> float:
    """Return when an error is within ``band`` for good, s; inf where it is not within it by the end."""
    outside = np.flatnonzero(~(np.abs(error) < band))
    if not len(outside):
        return float(time[0])
    return float(time[outside[-1] + 1]) if outside[-1] + 1 < len(time) else math.inf


@dataclass(frozen=True)
class ReverseBends(RoadRecord):
    """Figure 9's path as it was checked: a bend to either side near the turning circle, short clothoids between.

    Attributes:
        radius: of the bends, m.
        transition: length of a clothoid between straight and bend, m; half of that between the bends.
        arc: of a bend, m.
    """

    kind: ClassVar[str] = "reverse-bends"
    from_start: ClassVar[bool] = True
    radius: float = 5.0
    transition: float = 0.5
    arc: float = 2.5

    def build(self) -> tuple[Road, ...]:
        """One path; it is driven from its end."""
        bend, ramp = 1.0 / self.radius, self.transition
        lengths = np.array([6.0, ramp, self.arc, 2.0 * ramp, self.arc, ramp, 1.0])
        first = np.array([0.0, 0.0, -bend, -bend, bend, bend, 0.0])
        last = np.array([0.0, -bend, -bend, bend, bend, 0.0, 0.0])
        return (Road(self.kind, lengths, first, last),)


@dataclass(frozen=True)
class CurvatureSteps(RoadRecord):
    """Straights that go over into arcs without a clothoid, one road a curvature.

    Attributes:
        curvatures: of the arcs, 1/m.
        before: straight before, m.
    """

    kind: ClassVar[str] = "curvature-steps"
    from_start: ClassVar[bool] = True
    curvatures: tuple[float, ...] = (0.01,)
    before: float = 10.0

    def build(self) -> tuple[Road, ...]:
        """One road a curvature."""
        return tuple(
            Road(f"{self.kind}-{k}", np.array([self.before, 200.0]), np.array([0.0, bend]), np.array([0.0, bend]))
            for k, bend in enumerate(self.curvatures)
        )
