"""Random vehicles and scenarios, fields right, at their bounds, or wrong by a unit: refused in one line, or driven.

    python tests/fuzz/scenarios.py --count 10000 --seed 0

Exit status 1, and the keywords of each case, where a refusal is no single line, a number is not finite or outside its
bounds, an exception is another one, or a step takes more than a second.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import re
import signal
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
from with_effect import scenario_class, with_effect

import lanekeep_env
from lanekeep_env.tasks.termination import Termination

#: What a number may be wrong by: orders of magnitude, degrees and radians, km/h, pounds and feet, sign, nothing at all.
FACTORS = (1e-3, 1e3, math.degrees(1.0), math.radians(1.0), 3.6, 1 / 3.6, 0.4536, 0.3048, -1.0, 0.0)
NASTY = (math.nan, math.inf, 1e300, 1e-300, None, "1.0", True, 10**400)
#: Choices that are no numbers; each is tried with all environments that have the field.
WORDS: dict[str, list[Any]] = {
    "vehicle": [*lanekeep_env.VEHICLES],
    "dynamics": ["dynamic", "kinematic"],
    "tyre": ["linear", "magic_formula", "load_sensitive"],
    "cornering_drag": [True],
    "action": ["steering_angle", "steering_rate"],
    "effort": ["road_wheel", "motor"],
    "departure": ["terminate", "cost", "off"],
    "contact": ["terminate", "cost", "off"],
    "observation": ["measured", "full"],
    "randomisation": [
        "nominal",
        "mismatch",
        "stress",
        {"steering_offset": [-0.02, 0.02], "steering_gain": [0.7, 1.4], "mass": [0.8, 1.3]},
        {"steering_delay": [0.0, 0.07], "steering_lag": [0.5, 2.0], "cg_shift": [-0.02, 0.02], "speed": [0.8, 1.1]},
    ],
    "bank": [0.03, [-0.1, 0.1], 0.2],
    "crosswind": [8.0, [-15.0, 15.0], 40.0],
    "gusts": [2.0, 20.0],
    "gust_time": [0.02, 5.0],
    "patches": [{"friction": 0.5, "every": 30.0}, {"friction": [0.1, 3.0], "length": 7.0, "every": 7.0}],
    "changes": [
        {"mass": [0.5, 1.5], "friction": 0.6, "steering_lag": 2.0, "time": [0.0, 2.0], "duration": [0.0, 1.0]},
        {"front_cornering_stiffness": [0.3, 3.0], "rear_cornering_stiffness": [0.3, 3.0], "time": 0.5},
    ],
    "sensors": [None, "production", "poor"],
    "scan": ["none", "perfect", "kinect", {"beams": 9, "noise": 0.02, "jump_errors": 0.5, "period": 0.09}],
    "control_step": [0.01, 0.02, 0.05, 0.5, 1.0],
    "speed": [
        *(0.0, 0.2, 1.0, 15.0, 60.0),
        {"lateral_acceleration": 3.0, "maximum": 40.0, "friction_ellipse": True},
        {"lateral_acceleration": 3.0, "maximum": 20.0, "minimum": 5.0, "acceleration": 2.0},
        {"minimum": 0.5, "maximum": 3.0, "hold": 1.0, "standstill": 0.2},
        {"minimum": -2.0, "maximum": 2.0, "hold": 1.0},
    ],
    "friction": [0.01, 0.3, 1.0],
    "preview": [0, 5],
    "road": [
        *("straight", "circle", "slalom", "sine", "yin", "evasive", "parking", "roadworks", "yard", "turn-off"),
        "bypass",
        {"kind": "points", "points": [[0.0, 0.0], [30.0, 1.0], [70.0, -2.0], [200.0, 10.0], [400.0, 0.0]]},
        {"kind": "clothoids", "segments": [[50.0, 0.0, 0.0], [30.0, 0.0, 0.02], [600.0, 0.02, 0.02]]},
    ],
    "world": [
        *("corridor", "ell", "slalom", "circuit", "obstacle-circuit", "random-obstacle-circuits", "parking-row"),
        "random-parking-rows",
        {"kind": "random-circuits", "count": 3, "glass_share": 0.3},
    ],
    "camera": [{"edge": "left"}, {"look_ahead": 2.0, "field_of_view": 1.2}],
    "plan": [0, 4],
    "plan_errors": [{"offset": 0.5, "radius": [-0.1, 0.1]}, {"angle": -0.05, "recognised": [2.0, 5.0]}],
    "set_points": [1.2, {"minimum": 1.0, "maximum": 2.0, "hold": 2.0}],
    "servo": [{"left": 0.35, "right": 0.3, "ticks": 50}, {"angles": [-0.35, -0.2, 0.03, 0.1, 0.3]}],
    "side_sensor": [0.14],
    "encoder_ticks": [40],
    "encoder_direction": [False],
    "laps": [2],
    "powertrain": [{"gears": [3.5, 2.0, 1.2], "pedal_lag": 0.0}, {"creep": 0.0, "brake": 6.0}],
    "friction_circle": [False],
    "slope": [0.05, [-0.1, 0.02]],
    "wind": [-8.0, [0.0, 10.0]],
    "traffic": [
        [[0, "speed", 8], [0.2, "lead", 12, 5.0], [0.5, "lead_gone"], [0.6, "stop", 20.0], [0.9, "stop_gone"]],
        {"count": 4, "largest_speed": 30.0, "hazards": 1.0},
    ],
    "driver": ["attentive", {"lapse_rate": 0.2, "longest_lapse": 2.0}],
    "lanes": [2, 4],
    "flow": ["braking_lead", "cut_in", {"situation": "merging", "cars": 8, "spacing": 60.0, "speeds": [15.0, 20.0]}],
    "set_speed": [20.0, [15.0, 35.0]],
    "modes": ["roundtrip", "park", [[0.0, "roundtrip"], [0.9, "obstacles"]], [[0.0, "roundtrip"], [0.9, "park"]]],
}
#: A bound in an error.
_BOUND = re.compile(r"[<>]=? (-?[0-9.]*[0-9](?:e[-+]?[0-9]+)?)")
#: Numbers of records that are off by default and so stand in no scenario.
STEERING = {"lag": 0.1, "rate_limit": 0.4, "angle_limit": 0.5, "delay": 0.05, "backlash": 0.02}
STEERING |= {"gain": 0.8, "offset": 0.02}
SECONDS_A_STEP, SECONDS_TO_BUILD = 1.0, 60.0
#: Cases that share their choices, and so what is compiled for them.
ALIKE = 20


@dataclasses.dataclass(frozen=True)
class Case:
    """An environment to be made: its id and keywords."""

    env_id: str
    keywords: dict[str, Any]


def random_case(rng: np.random.Generator, choosing: np.random.Generator | None = None) -> Case:
    """Draw an id, some choices that are no numbers (by ``choosing``, if given), and up to four numbers that are wrong.

    Choices decide what has to be compiled, numbers do not.
    """
    choosing = choosing or rng
    env_id = str(choosing.choice(sorted(lanekeep_env.ENVIRONMENTS)))
    record = scenario_class(env_id)
    fields = record.from_keywords().to_dict()
    chosen: dict[str, Any] = {}
    for name in sorted(set(WORDS) & set(fields)):
        if choosing.random() < 0.35:
            chosen[name] = WORDS[name][int(choosing.integers(len(WORDS[name])))]
    chosen = with_effect(env_id, chosen)
    if choosing.random() < 0.1:
        return Case(env_id, chosen)  # choices that exclude each other are tried as they are
    while True:
        try:
            full = record.from_keywords(**chosen).to_dict()
        except ValueError:
            del chosen[sorted(chosen)[int(choosing.integers(len(chosen)))]]
            chosen = with_effect(env_id, chosen)
        else:
            break
    if choosing.random() < 0.5:
        steering = full["vehicle"]["steering"]
        for name in STEERING:
            steering[name] = STEERING[name] if choosing.random() < 0.3 else steering[name]
        if steering["backlash"] and choosing.random() < 0.5:
            steering["feedback"] = "motor"
        chosen["vehicle"] = full["vehicle"]
    return Case(env_id, {**chosen, **_wrong(record, full, rng)})


def _wrong(record: Any, fields: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Change up to four numbers of a scenario; return the top fields that they are part of."""
    places = list(_numbers(fields, ()))
    changed: dict[str, Any] = {}
    for _ in range(int(rng.integers(5))):
        # A field first, then a number of it: a vehicle's are many.
        top = str(rng.choice(sorted({path[0] for path in places})))
        inside = [path for path in places if path[0] == top]
        path = places.pop(places.index(inside[int(rng.integers(len(inside)))]))
        holder = fields
        for step in path[:-1]:
            holder = holder[step]
        value = holder[path[-1]]
        kind = rng.random()
        if kind < 0.1:
            holder[path[-1]] = NASTY[int(rng.integers(len(NASTY)))]
        elif kind < 0.4:
            edges = _edges(record, fields, holder, path[-1])
            holder[path[-1]] = edges[int(rng.integers(len(edges)))] if edges else value
        else:
            factor = FACTORS[int(rng.integers(len(FACTORS)))]
            holder[path[-1]] = type(value)(value * factor) if math.isfinite(value) and abs(value) < 1e15 else value
        changed[top] = fields[top]
    return changed


def _edges(record: Any, fields: dict[str, Any], holder: Any, key: Any) -> list[float]:
    """Least and most that a number may be beside the others, as the refusals of what is beyond that tell."""
    found: set[str] = set()
    for beyond in (-1e300, 1e300):
        holder[key] = beyond
        try:
            record.from_keywords(**fields)
        except (ValueError, TypeError) as error:
            found |= set(_BOUND.findall(str(error)))
    return [int(float(text)) if float(text).is_integer() else float(text) for text in sorted(found)]


def _numbers(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
    """Paths of all numbers below ``value``; tuples become lists, so that they can be changed."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in list(entries):
        if isinstance(entry, tuple):
            entry = value[key] = list(entry)
        if isinstance(entry, dict | list):
            yield from _numbers(entry, (*path, key))
        elif isinstance(entry, int | float) and not isinstance(entry, bool):
            yield (*path, key)


def outcome_of(case: Case, steps: int = 100, vector: bool = True) -> tuple[str, str]:
    """Make and drive an environment; return ("refused" or "driven" or "violation", what happened).

    ``vector``: drive two cars in single precision as well.
    """
    try:
        with _limited(SECONDS_TO_BUILD):
            many = gym.make_vec(
                case.env_id, num_envs=2, vectorization_mode="vector_entry_point", dtype="float32", **case.keywords
            )
            env = gym.make(case.env_id, **case.keywords)
    except (ValueError, TypeError) as error:
        message = str(error)
        if "\n" in message or not 10 < len(message) < 1500:
            return "violation", f"refused by {message!r}"
        if not any(field.name in message for field in dataclasses.fields(scenario_class(case.env_id))):
            return "violation", f"refused without a field's name: {message}"
        return "refused", message
    except BaseException as error:
        return "violation", f"{type(error).__name__} when made: {error}"
    try:
        rng = np.random.default_rng(1)
        bad = _drive_one(env, rng, steps) or (_drive_many(many, rng, steps // 4) if vector else None)
        return bad or ("driven", "")
    except BaseException as error:
        return "violation", f"{type(error).__name__} when driven: {error}"


def _drive_one(env: Any, rng: np.random.Generator, steps: int) -> tuple[str, str] | None:
    env.reset(seed=int(rng.integers(1000)))
    bad = None
    for step in range(steps):
        began = time.process_time()
        with _limited(SECONDS_TO_BUILD):  # the first step compiles
            observation, reward, terminated, truncated, info = env.step(env.action_space.sample() * rng.choice([1, 5]))
        seconds = time.process_time() - began
        if seconds > SECONDS_A_STEP and step > 0:
            bad = f"step {step} took {seconds:.1f} s"
        if not env.observation_space.contains(observation):
            bad = f"step {step}: observation {observation} is outside its bounds"
        wrong = [key for key, value in info.items() if not np.isfinite(value)]
        if wrong or not math.isfinite(reward):
            bad = f"step {step}: reward {reward}, info {wrong} not finite"
        if info["termination"] == Termination.DIVERGED:
            bad = f"step {step}: the state diverged"
        if bad is not None:
            return "violation", bad
        if terminated or truncated:
            env.reset()
    return None


def _drive_many(envs: Any, rng: np.random.Generator, steps: int) -> tuple[str, str] | None:
    envs.reset(seed=int(rng.integers(1000)))
    for step in range(steps):
        began = time.process_time()
        with _limited(SECONDS_TO_BUILD):
            observation, reward, _, _, info = envs.step(rng.uniform(-1.5, 1.5, envs.action_space.shape))
        seconds = time.process_time() - began
        if seconds > SECONDS_A_STEP and step > 0:
            return "violation", f"float32, step {step} took {seconds:.1f} s"
        if not envs.observation_space.contains(observation) or not np.isfinite(reward).all():
            return "violation", f"float32, step {step}: observation {observation}, reward {reward}"
        if any(not np.isfinite(np.asarray(value, dtype=np.float64)).all() for value in info.values()):
            return "violation", f"float32, step {step}: info {info}"
        if (info["termination"] == Termination.DIVERGED).any():
            return "violation", f"float32, step {step}: the state diverged"
    return None


@contextlib.contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """End what takes longer of the processor's time, as far as Python gets to see the signal.

    A kernel that hangs shows as no progress.
    """

    def late(*_: object) -> None:
        raise TimeoutError(f"more than {seconds} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def main() -> int:
    """Drive the cases; return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first case (to repeat one: --count 1)")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    found: Counter[str] = Counter()
    for number in range(arguments.first, arguments.first + arguments.count):
        alike = np.random.default_rng([arguments.seed, number // ALIKE, ALIKE])
        case = random_case(np.random.default_rng([arguments.seed, number]), alike)
        # Single precision is compiled by itself: for every other kind of car.
        kind, message = outcome_of(case, vector=number // ALIKE % 2 == 0)
        found[kind] += 1
        if kind == "violation":
            print(f"case {number}: {case.env_id} {case.keywords}\n  {message}", flush=True)
        if sys.stderr.isatty() or number % 500 == 499:
            print(f"\r{number + 1} cases: {dict(found)}", end="", file=sys.stderr, flush=True)
    print(f"\n{sum(found.values())} cases: {found['refused']} refused, {found['driven']} driven, "
          f"{found['violation']} violations")  # fmt: skip
    return 1 if found["violation"] else 0


if __name__ == "__main__":
    sys.exit(main())
