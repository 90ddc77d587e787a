"""How fast the environments step, beside CartPole and highway-env, measured in turns in one run.

Machines are noisy and shared: absolute rates drift by tens of percent within a minute. So every contender runs in
every round, in alternating order, and what is reported is the median over rounds of the ratios within a round.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import gymnasium as gym

import lanekeep_agents

ENV_ID = "lanekeep/LaneKeep-v0"
CARS = 1024
#: A shipped policy, whose actions are counted beside the steps of its own cars.
POLICY = "ppo-lane-keep-seed0"
#: Rows of the environment among traffic, and what it shares with `highway-v0` as that is by default.
ROWS, NEIGHBOURS = 256, {"flow": {"cars": 50}, "lanes": 4}
#: Calls of `step` in one quick round; a full round has four times as many.
STEPS = {"single": 10_000, "highway": 100, "vector": 100, "traffic": 4}
#: Further environments as a single one: task, what is special in words and in keywords.
OTHERS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("TurnOff", "", {}),
    ("WallFollow", "", {}),
    ("Circuit", ", 1080 beams", {"scan": {"beams": 1080, "field_of_view": 4.7, "nearest": 0.0}}),
)
#: What has more to do than a circuit at the same scan, and pairs of runs of both.
COURSES, PAIRS = ("ObstacleCircuit", "ParallelPark"), 15


@dataclass(frozen=True)
class Contender:
    """Something whose steps are counted: ``run`` makes ``steps`` calls and returns the env-steps made."""

    name: str
    run: Callable[[], int]


@dataclass
class Speeds:
    """Rates in env-steps/s, paired ratios by name, those of courses to a circuit, start-up times in s."""

    rates: dict[str, float] = field(default_factory=dict)
    ratios: dict[str, dict[str, float]] = field(default_factory=dict)
    courses: dict[str, float] = field(default_factory=dict)
    start_up: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def _single(env_id: str, steps: int, **keywords: Any) -> Callable[[], int]:
    """`gym.make` with ``keywords``, random actions drawn beforehand, resets included."""
    env = gym.make(env_id, **keywords)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(min(steps, 4096))]
    env.reset(seed=0)

    def run() -> int:
        step, reset, count = env.step, env.reset, len(actions)
        for i in range(steps):
            _, _, terminated, truncated, _ = step(actions[i % count])
            if terminated or truncated:
                reset()
        return steps

    return run


def _vector(env_id: str, steps: int, cars: int = CARS, **keywords: Any) -> Callable[[], int]:
    """Cars of the environment's own vector entry point, random actions drawn beforehand, autoreset included."""
    env = gym.make_vec(env_id, num_envs=cars, vectorization_mode="vector_entry_point", **keywords)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(64)]
    env.reset(seed=0)

    def run() -> int:
        for i in range(steps):
            env.step(actions[i % 64])
        return steps * cars

    return run


def _policy(name: str, steps: int) -> tuple[Callable[[], int], dict[str, Any]]:
    """Actions of a learned policy for as many cars, and the keywords of its environment."""
    policy = lanekeep_agents.load(name)
    keywords = {**policy.record.training.hyperparameters["env"], "dtype": "float32"}
    env = gym.make_vec(ENV_ID, num_envs=CARS, vectorization_mode="vector_entry_point", **keywords)
    observation, _ = env.reset(seed=0)

    def run() -> int:
        for _ in range(steps):
            policy.predict(observation)
        return steps * CARS

    return run, keywords


def contenders(quick: bool, notes: list[str]) -> list[Contender]:
    """All that is compared; highway-env only where it is installed."""
    scale = 1 if quick else 4
    found = [
        Contender("lanekeep", _single(ENV_ID, STEPS["single"] * scale)),
        Contender("CartPole-v1", _single("CartPole-v1", STEPS["single"] * scale)),
        *(
            Contender(f"lanekeep {task}{tail}", _single(f"lanekeep/{task}-v0", STEPS["single"] * scale, **keywords))
            for task, tail, keywords in OTHERS
        ),
    ]
    if importlib.util.find_spec("highway_env") is None:
        notes.append('highway-env is not installed, so it is left out; pip install "lanekeep[highway]"')
    else:
        import highway_env

        gym.register_envs(highway_env)
        found.append(Contender("highway-env lane-keeping-v0", _single("lane-keeping-v0", STEPS["highway"] * scale)))
        found += traffic_contenders(scale)
    threads = [count for count in (1, 2) if count <= (os.cpu_count() or 1)]
    for dtype in ("float64", "float32"):
        for count in threads:
            run = _vector(ENV_ID, STEPS["vector"] * scale, dtype=dtype, num_threads=count)
            found.append(Contender(f"lanekeep {CARS} cars, {dtype}, {count} thread{'s' * (count > 1)}", run))
    circuits = _vector("lanekeep/Circuit-v0", STEPS["vector"] * scale, dtype="float32")
    found.append(Contender(f"lanekeep Circuit {CARS} cars, 64 beams, float32, 1 thread", circuits))
    if importlib.util.find_spec("safetensors") is None:
        notes.append('safetensors is not installed, so the learned policy is left out; pip install "lanekeep[agents]"')
    else:
        run, keywords = _policy(POLICY, STEPS["vector"] * scale)
        cars = _vector(ENV_ID, STEPS["vector"] * scale, **keywords)
        found.append(Contender(f"lanekeep {CARS} cars, 20 previews, float32, 1 thread", cars))
        found.append(Contender(f"{POLICY} for {CARS} cars", run))
    found.append(Contender(f"CartPole-v1 {CARS} cars", _vector("CartPole-v1", STEPS["vector"] * scale)))
    return found


def traffic_contenders(scale: int = 1) -> list[Contender]:
    """One car and `ROWS` among as many neighbours as `highway-v0` has, and that as it is."""
    steps = STEPS["traffic"] * scale
    return [
        Contender("highway-env highway-v0, 50 others", _single("highway-v0", steps)),
        Contender("lanekeep Traffic, 50 others", _single("lanekeep/Traffic-v0", 500 * steps, **NEIGHBOURS)),
        Contender(
            f"lanekeep Traffic {ROWS} cars, 50 others each",
            _vector("lanekeep/Traffic-v0", 5 * steps, ROWS, **NEIGHBOURS),
        ),
    ]


def measure_rates(quick: bool = False, report: Callable[[str], None] = lambda text: None) -> Speeds:
    """Rates and ratios over rounds in alternating order, after one unmeasured round (compilation, caches)."""
    speeds = Speeds()
    field_of_contenders = contenders(quick, speeds.notes)
    for contender in field_of_contenders:
        report(f"warming up {contender.name}")
        contender.run()
    rounds: list[dict[str, float]] = []
    for number in range(3 if quick else 7):
        report(f"round {number + 1}")
        order = field_of_contenders if number % 2 == 0 else field_of_contenders[::-1]
        found = {}
        for contender in order:
            start = time.perf_counter()
            steps = contender.run()
            found[contender.name] = steps / (time.perf_counter() - start)
        rounds.append(found)
    compare(speeds, [contender.name for contender in field_of_contenders], rounds)
    return speeds


def compare(speeds: Speeds, names: list[str], rounds: list[dict[str, float]]) -> None:
    """Fill in medians of the rates and of the ratios within a round; traffic is compared with traffic."""
    speeds.rates = {name: median(found[name] for found in rounds) for name in names}
    single = [name for name in names if "cars" not in name]
    for name in names:
        if name.startswith("lanekeep"):
            others = [other for other in names if not other.startswith("lanekeep")]
            others = [other for other in others if ("highway-v0" in other) == ("Traffic" in name)]
            rivals = [other for other in others if (other in single) == (name in single) or "highway" in other]
            speeds.ratios[name] = {other: median(found[name] / found[other] for found in rounds) for other in rivals}


def measure_courses(quick: bool = False, report: Callable[[str], None] = lambda text: None) -> dict[str, float]:
    """Env-steps per second of CPU of circuits with more to do, over those of Circuit at the same 64 beams.

    The median over pairs, in alternating order; single environments and 1,024 cars, float32, one thread.
    """
    kinds = {
        "single": (_single, STEPS["single"] // (4 if quick else 2), {}),
        f"{CARS} cars": (_vector, STEPS["vector"] // (4 if quick else 2) or 1, {"dtype": "float32"}),
    }
    found = {}
    for kind, (make, steps, keywords) in kinds.items():
        circuit = make("lanekeep/Circuit-v0", steps, scan="perfect", **keywords)
        for task in COURSES:
            report(f"{task}, {kind}")
            course = make(f"lanekeep/{task}-v0", steps, scan="perfect", **keywords)
            ratios = []
            for number in range(-1, 3 if quick else PAIRS):
                pair = (circuit, course) if number % 2 == 0 else (course, circuit)
                times = {run: _cpu(run) for run in pair}
                ratios.append(times[circuit] / times[course])
            found[f"{task} / Circuit, {kind}"] = median(ratios[1:])
    return found


def _cpu(run: Callable[[], int]) -> float:
    """Seconds of CPU of a run."""
    start = time.process_time()
    run()
    return time.process_time() - start


_IMPORT = "import time; t = time.perf_counter(); import lanekeep_env; print(time.perf_counter() - t)"
_FIRST_STEP = """
import time, gymnasium as gym, numpy as np, lanekeep_env
t = time.perf_counter()
env = {make}
env.reset(seed=0)
env.step(np.zeros(env.action_space.shape, np.float32))
print(time.perf_counter() - t)
"""
MAKERS = {
    "single": f"gym.make({ENV_ID!r})",
    "vector": f"gym.make_vec({ENV_ID!r}, num_envs=8, vectorization_mode='vector_entry_point')",
}


def _seconds(code: str, cache: str) -> float:
    """Run code that prints seconds in a fresh interpreter with that compile cache."""
    environment = os.environ | {"LANEKEEP_CACHE_DIR": cache}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout.split()[-1])


def measure_start_up(report: Callable[[str], None] = lambda text: None) -> dict[str, float]:
    """Seconds of the first import, and of making, resetting and stepping once: compile cache empty, then filled."""
    found: dict[str, float] = {}
    with _empty_folder() as cache:
        report("first import")
        found["import"] = median(_seconds(_IMPORT, cache) for _ in range(3))
    for kind, make in MAKERS.items():
        with _empty_folder() as cache:
            for state in ("cold", "warm"):
                report(f"first step, {kind}, {state}")
                found[f"first step, {kind}, {state}"] = _seconds(_FIRST_STEP.format(make=make), cache)
    return found


@contextmanager
def _empty_folder() -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        yield folder


def to_json(speeds: Speeds) -> str:
    """The result as one JSON object."""
    return json.dumps(
        {
            "rates_env_steps_per_s": speeds.rates,
            "ratios": speeds.ratios,
            "course_ratios": speeds.courses,
            "start_up_s": speeds.start_up,
            "notes": speeds.notes,
        }
    )
