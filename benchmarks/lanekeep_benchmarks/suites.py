"""Suites: what is driven. A suite is a tuple of frozen records, so a new one is data, not code."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lanekeep_env import SENSOR_SETS, LaneKeepScenario
from lanekeep_env.checks import nearest, shown
from lanekeep_env.roads import LimitedSpeed, Road, build_roads
from lanekeep_env.scenario.base import ScenarioRecord

Scenario = TypeVar("Scenario", bound=ScenarioRecord)


@dataclass(frozen=True)
class SuiteScenario:
    """One environment with everything that fixes its episodes.

    Attributes:
        name: short, for files and tables.
        title: one line, for headings.
        keywords: of `gym.make_vec`, JSON-able.
        env_id: a registered environment.
        options: of `reset`, the same for every episode.
        max_episode_steps: length of an episode; None keeps the registered one.
        told: what policies are told instead of the truth: fields of the scenario that they are made for where it is
            not the one they drive. What ``randomisation`` changes needs no word here, they do not know of it anyway.
    """

    name: str
    title: str
    keywords: Mapping[str, Any] = field(default_factory=dict)
    env_id: str = "lanekeep/LaneKeep-v0"
    options: Mapping[str, Any] = field(default_factory=dict)
    max_episode_steps: int | None = None
    told: Mapping[str, Any] = field(default_factory=dict)

    def policies_scenario(self, definition: Scenario) -> Scenario:
        """Return the scenario that policies are made for, where ``definition`` is driven."""
        return replace(definition, **self.told) if self.told else definition

    def hash(self, definition_hash: str) -> str:
        """16 hexadecimal digits that change with anything that changes the episodes, or what policies are told."""
        parts: list[Any] = [self.env_id, definition_hash, dict(self.options), self.max_episode_steps]
        parts += [dict(self.told)] if self.told else []
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Suite:
    """Scenarios that are evaluated and reported together.

    ``episodes`` is the default number for each scenario; ``family`` what the names of the classical policies begin with
    that drive it by default, empty for all that can; ``learned`` adds the shipped learned ones whose channels fit;
    ``reference`` is the one of them that the others are compared with, empty for the first.
    """

    name: str
    description: str
    scenarios: tuple[SuiteScenario, ...]
    episodes: int
    family: str = ""
    learned: bool = False
    reference: str = ""


# 1.1 s of curvature ahead, for every policy, so that all see the same observation (some read it, Yin's own do not).
# A departure is charged and counted but ends nothing: errors of all policies then cover the same 30 s of road.
_COMMON: dict[str, Any] = {"preview": 12, "departure": "cost"}
# Not the default set, on which policies are tuned and trained.
_ROADS: dict[str, Any] = {"kind": "random", "seed": 1}
# 2 s of curvature ahead, for policies that weigh what comes.
_LEARNED: dict[str, Any] = {"road": _ROADS, "preview": 20, "departure": "cost"}
_PRODUCTION_TWICE_AS_NOISY = {
    channel: {**asdict(sensor), "noise": 2 * sensor.noise} for channel, sensor in SENSOR_SETS["production"].items()
}


def _slippery(friction: float) -> dict[str, Any]:
    """A road of that friction, driven with the share of it that the nominal profile uses of friction 1."""
    profile = {"lateral_acceleration": LimitedSpeed().lateral_acceleration * friction}
    return {"tyre": "magic_formula", "randomisation": {"friction": friction}, "speed": profile}


_YARD: dict[str, Any] = {"kind": "yard", "seed": 1}
_CAMERA: dict[str, Any] = {"departure": "cost"}
_DRIVE: dict[str, Any] = {
    "departure": "cost",
    "road": {"kind": "random", "seed": 1, "peak_curvature": 0.004, "design_speed": 25.0},
    "traffic": {"seed": 1},
}
# Wall following with the true heading in sight, which some of the published controllers need.
_WALL: dict[str, Any] = {
    "contact": "cost",
    "observation": "full",
    "world": {"kind": "corridor", "length": 80.0, "width": 3.0},
}
_OFFSET = (math.radians(3.0), math.radians(3.0))

SUITES: dict[str, Suite] = {
    suite.name: suite
    for suite in (
        Suite(
            name="classical",
            description="the published lane-keeping controllers on generated roads, Yin's car, 0.4 g speed profile",
            episodes=256,
            scenarios=(
                SuiteScenario(
                    "random-roads", "Random clothoid roads, peak curvature 0.0109 1/m", {"road": _ROADS, **_COMMON}
                ),
                SuiteScenario(
                    "yin-b",
                    "Yin's scenario (b): curvature of both signs, start within 1 m",
                    {"road": "yin", "start_lateral_error": 1.0, **_COMMON},
                ),
                SuiteScenario(
                    "sine-400",
                    "Sine road of 400 m wavelength, 68.3 km/h",
                    {"road": {"kind": "sine", "wavelength": 400.0}, "speed": 18.97, **_COMMON},
                ),
                SuiteScenario(
                    "sine-1600",
                    "Sine road of 1600 m wavelength, 68.3 km/h",
                    {"road": {"kind": "sine", "wavelength": 1600.0}, "speed": 18.97, **_COMMON},
                ),
                SuiteScenario(
                    "saturating-tyre",
                    "Random clothoid roads, saturating tyre on friction 0.6",
                    {"road": _ROADS, "tyre": "magic_formula", "friction": 0.6, **_COMMON},
                ),
            ),
        ),
        Suite(
            name="robustness",
            description="cars that differ from the nominal one, sensors with faults, road works",
            episodes=256,
            scenarios=(
                SuiteScenario(
                    "mismatch",
                    "Random roads, saturating tyres, cars of the set 'mismatch'",
                    {"road": _ROADS, "tyre": "magic_formula", "randomisation": "mismatch", **_COMMON},
                ),
                SuiteScenario(
                    "sensors",
                    "Random roads, production sensors",
                    {"road": _ROADS, "sensors": "production", **_COMMON},
                ),
                SuiteScenario(
                    "stress",
                    "Random roads, saturating tyres, cars of the set 'stress', poor sensors",
                    {
                        "road": _ROADS,
                        "tyre": "magic_formula",
                        "randomisation": "stress",
                        "sensors": "poor",
                        **_COMMON,
                    },
                ),
                SuiteScenario(
                    "road-works",
                    "Road works: a lane of 2.75 m that shifts sideways, 80 km/h",
                    {"road": {"kind": "roadworks", "seed": 1}, **_COMMON},
                    env_id="lanekeep/RoadWorks-v0",
                ),
            ),
        ),
        Suite(
            name="learned",
            description="learned and classical policies that know the nominal car, on it and on cars that differ",
            episodes=256,
            learned=True,
            reference="lq-preview-offset-free",
            scenarios=(
                SuiteScenario("nominal", "Random roads, the nominal car", _LEARNED),
                SuiteScenario(
                    "friction-0.7",
                    "Saturating tyres on friction 0.7 instead of 1, 0.28 g speed profile",
                    {**_LEARNED, **_slippery(0.7)},
                ),
                SuiteScenario(
                    "friction-0.45",
                    "Saturating tyres on friction 0.45 instead of 1, 0.18 g speed profile",
                    {**_LEARNED, **_slippery(0.45)},
                ),
                SuiteScenario("mass", "20 % more mass and yaw inertia", {**_LEARNED, "randomisation": {"mass": 1.2}}),
                SuiteScenario(
                    "stiffness",
                    "20 % less cornering stiffness, front and rear",
                    {
                        **_LEARNED,
                        "randomisation": {"front_cornering_stiffness": 0.8, "rear_cornering_stiffness": 0.8},
                    },
                ),
                SuiteScenario("lag", "Twice the actuator's lag", {**_LEARNED, "randomisation": {"steering_lag": 2.0}}),
                SuiteScenario("delay", "50 ms more delay", {**_LEARNED, "randomisation": {"steering_delay": 0.05}}),
                SuiteScenario(
                    "noise",
                    "Production sensors with twice the noise that policies are told",
                    {**_LEARNED, "sensors": _PRODUCTION_TWICE_AS_NOISY},
                    told={"sensors": "production"},
                ),
                SuiteScenario(
                    "together",
                    "Saturating tyres, cars of the set 'mismatch': all of it but the noise, milder",
                    {**_LEARNED, "tyre": "magic_formula", "randomisation": "mismatch"},
                ),
                SuiteScenario(
                    "road-works",
                    "Road works: a lane of 2.75 m that shifts sideways, 80 km/h",
                    {**_LEARNED, "road": {"kind": "roadworks", "seed": 1}},
                    env_id="lanekeep/RoadWorks-v0",
                ),
            ),
        ),
        Suite(
            name="walls",
            description="a 1:10 car at 1 m from the wall on its right, start within 0.3 m and 20 degrees",
            episodes=256,
            learned=True,
            reference="knightriders-cascade-kalman",
            family="knightriders",
            scenarios=(
                SuiteScenario(
                    "perfect",
                    "Perfect sensors, 0.3 to 2 m/s, no steering offset",
                    {"steering_offset": 0.0, **_WALL},
                    env_id="lanekeep/WallFollow-v0",
                ),
                SuiteScenario(
                    "offset",
                    "The same with a steering offset of 3 degrees",
                    {"steering_offset": _OFFSET, **_WALL},
                    env_id="lanekeep/WallFollow-v0",
                ),
                SuiteScenario(
                    "sensors",
                    "The same with noisy ultrasonics, a biased gyroscope and an encoder of 40 ticks",
                    {"steering_offset": _OFFSET, "sensors": "production", "encoder_ticks": 40, **_WALL},
                    env_id="lanekeep/WallFollow-v0",
                ),
                SuiteScenario(
                    "dynamic",
                    "The same on a car with tyres and a servo that lags by 50 ms",
                    {
                        "steering_offset": _OFFSET,
                        "sensors": "production",
                        "encoder_ticks": 40,
                        "dynamics": "dynamic",
                        "vehicle": {
                            "base": "knightriders",
                            "steering": {"lag": 0.05, "angle_limit": math.radians(22.0)},
                        },
                        **_WALL,
                    },
                    env_id="lanekeep/WallFollow-v0",
                ),
            ),
        ),
        Suite(
            name="circuit",
            description="a lap of random rectangular circuits, corridors of 1.2 to 3 m, at up to 2 m/s",
            episodes=100,
            learned=True,
            scenarios=(
                SuiteScenario(
                    "perfect",
                    "Perfect sensors, 64 beams",
                    {"world": {"kind": "random-circuits", "seed": 1, "count": 100}},
                    env_id="lanekeep/Circuit-v0",
                ),
                SuiteScenario(
                    "sensors",
                    "Noisy ultrasonics, a biased gyroscope, an encoder of 40 ticks, the Kinect's faults",
                    {
                        "world": {"kind": "random-circuits", "seed": 1, "count": 100},
                        "sensors": "production",
                        "encoder_ticks": 40,
                        "scan": "kinect",
                    },
                    env_id="lanekeep/Circuit-v0",
                ),
            ),
        ),
        Suite(
            name="manoeuvres",
            description="a full-size car: evasive paths at 55 km/h, tight paths backwards",
            episodes=128,
            learned=True,
            reference="lq-preview-offset-free",
            scenarios=(
                SuiteScenario(
                    "evasive",
                    "Lane change of 3.5 m over 36.7 m, start within 0.8 m of the path",
                    {"departure": "cost"},
                    env_id="lanekeep/Evasive-v0",
                ),
                SuiteScenario(
                    "evasive-mismatch",
                    "The same with cars of the set 'mismatch'",
                    {"departure": "cost", "randomisation": "mismatch"},
                    env_id="lanekeep/Evasive-v0",
                ),
                SuiteScenario(
                    "evasive-slippery",
                    "The same on friction 0.45, which the policies know",
                    {"departure": "cost", "friction": 0.45},
                    env_id="lanekeep/Evasive-v0",
                ),
            ),
        ),
        Suite(
            name="reverse",
            description="backwards at walking speed along bends of 5 to 12 m radius",
            episodes=128,
            learned=True,
            scenarios=(
                SuiteScenario(
                    "parking",
                    "Start within 0.2 m and 3 degrees",
                    {"departure": "cost", "road": {"kind": "parking", "seed": 1}},
                    env_id="lanekeep/ReversePath-v0",
                ),
                SuiteScenario(
                    "parking-mismatch",
                    "The same with cars of the set 'mismatch'",
                    {"departure": "cost", "road": {"kind": "parking", "seed": 1}, "randomisation": "mismatch"},
                    env_id="lanekeep/ReversePath-v0",
                ),
            ),
            family="werling",
        ),
        Suite(
            name="drive",
            description="steering, throttle and brake among random set speeds, slower cars and stop points",
            episodes=128,
            learned=True,
            scenarios=(
                SuiteScenario(
                    "traffic",
                    "Random timelines, slopes and wind",
                    _DRIVE,
                    env_id="lanekeep/Drive-v0",
                ),
                SuiteScenario(
                    "traffic-mismatch",
                    "The same with cars of the set 'mismatch'",
                    {"randomisation": "mismatch", **_DRIVE},
                    env_id="lanekeep/Drive-v0",
                ),
            ),
            family="werling",
        ),
        Suite(
            name="camera",
            description="a van guided by a camera, at 0 to 6 m/s, with backlash in its steering",
            episodes=256,
            learned=True,
            reference="traechtler-inverse",
            scenarios=(
                SuiteScenario(
                    "yard",
                    "Yard roads, bends of 5 to 100 m radius, 5 m without an edge every 60 m",
                    {"road": _YARD, **_CAMERA},
                    env_id="lanekeep/CameraLane-v0",
                ),
                SuiteScenario(
                    "yard-lost-twice",
                    "The same roads, the edge lost twice as long",
                    {"road": {**_YARD, "gap_length": 10.0}, **_CAMERA},
                    env_id="lanekeep/CameraLane-v0",
                ),
                SuiteScenario(
                    "yard-sensors",
                    "The same roads, a noisy, slow and late camera",
                    {"road": _YARD, "sensors": "production", **_CAMERA},
                    env_id="lanekeep/CameraLane-v0",
                ),
                SuiteScenario(
                    "turn-off",
                    "Turning off blind by 90 degrees, radius 9.5 to 21.5 m, 2 to 6 m/s",
                    {"road": {"kind": "turn-off", "seed": 1}, **_CAMERA},
                    env_id="lanekeep/TurnOff-v0",
                ),
                SuiteScenario(
                    "turn-off-lost-twice",
                    "The same turns, the edge lost twice as long",
                    {"road": {"kind": "turn-off", "seed": 1, "lost": 2.0}, **_CAMERA},
                    env_id="lanekeep/TurnOff-v0",
                ),
            ),
        ),
    )
}


def suite_named(name: str) -> Suite:
    """Return the suite of that name; ValueError names the nearest one."""
    if name not in SUITES:
        raise ValueError(f"suite {shown(name)} is unknown{nearest(name, SUITES)}; allowed: {', '.join(SUITES)}")
    return SUITES[name]


#: How the names of suites of one's own roads begin.
OWN_ROAD = "road-"


def lap_time(road: Road, speed: np.ndarray) -> float:
    """Seconds for one pass of ``road`` at the node speeds (n + 1,) in m/s, v² linear in between."""
    return float(np.sum(2 * np.asarray(road.lengths) / (speed[:-1] + speed[1:])))


def road_suite(file: Path) -> Suite:
    """Suite of one scenario: a whole pass of the centre line in ``file``, from its first point, small start errors.

    Raises:
        ValueError, OSError: the file is missing or is not a drivable road; the message says why.
    """
    name = str(file) if str(file).isprintable() and len(str(file)) < 1000 else shown(str(file))
    try:
        found = file.is_file()
    except OSError as error:
        raise ValueError(f"--road {name} cannot be read: {error.strerror}") from None
    if not found:
        raise ValueError(f"--road {name}: no such file; allowed: a CSV file with the columns x, y in m")
    keywords: dict[str, Any] = {"road": {"kind": "file", "path": str(file)}, **_COMMON}
    definition = LaneKeepScenario.from_keywords(**keywords)
    ((road, speed),) = build_roads(definition.road, definition.speed)
    # Hairpins need more steering than a country road: half as much again as the tightest curve asks for.
    tightest = math.atan(definition.vehicle.wheelbase * road.peak_curvature)
    keywords["max_steering_angle"] = round(max(definition.max_steering_angle, min(1.5 * tightest, 1.2)), 3)
    seconds = lap_time(road, speed)
    # A car outside its lane's centre in curves needs longer; on a closed road it gets the time to finish its lap.
    margin = 1.03 if road.closed else 1.0
    steps = math.ceil(margin * seconds / definition.control_step)
    keywords["episode_steps"] = steps
    scenario = SuiteScenario(
        file.stem,
        f"{file.stem}: {road.length:.0f} m, {seconds:.0f} s, road fitted to {100 * road.fit_error:.1f} cm",
        keywords,
        options={"arc_length": 0.0},
        max_episode_steps=steps,
    )
    return Suite(
        name=f"{OWN_ROAD}{file.stem}", description=f"one pass of {file.name}", scenarios=(scenario,), episodes=16
    )
