"""What is measured: groups of contenders, ours beside the others that they are compared with."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import gymnasium as gym

#: Cars of a vector environment, the most of one, and those among traffic.
CARS, MANY, AMONG = 1024, 65_536, 256
#: What `lanekeep/Traffic-v0` shares with `highway-v0` as that is by default.
NEIGHBOURS: dict[str, Any] = {"flow": {"cars": 50}, "lanes": 4}
#: What has more to do than a circuit.
COURSES = ("lanekeep/ObstacleCircuit-v0", "lanekeep/ParallelPark-v0")
#: A shipped policy, whose actions are counted beside the steps of its own cars.
POLICY = "ppo-lane-keep-seed0"
LANE_KEEP, CIRCUIT, TRAFFIC = "lanekeep/LaneKeep-v0", "lanekeep/Circuit-v0", "lanekeep/Traffic-v0"


@dataclass(frozen=True)
class Contender:
    """Something whose steps are counted.

    Attributes:
        name: what is told of it.
        run: makes so many calls and returns the env-steps made.
        rival: whether others are compared with it.
    """

    name: str
    run: Callable[[int], int]
    rival: bool = False


Groups = dict[str, list[Contender]]


def groups(ids: Sequence[str], notes: list[str]) -> Groups:
    """Return what is compared of these environments, by title; what is left out for want of a package is noted."""
    found = {"Single environments": singles(ids, notes), f"{CARS} cars": vectors(ids, notes)}
    for one in COURSES:
        if one in ids:
            found |= _course(one)
    if TRAFFIC in ids and _installed("highway_env", "highway", notes):
        found[f"Among {NEIGHBOURS['flow']['cars']} others"] = traffic()
    if LANE_KEEP in ids:
        found[f"{CARS} cars and what drives them"] = policies(notes)
        found["The benchmark, 256 cars"] = evaluation()
    return found


def singles(ids: Sequence[str], notes: list[str]) -> list[Contender]:
    """`gym.make` as it is, resets included."""
    found = [Contender(one, single(one)) for one in ids]
    found += [Contender(one, single(one), rival=True) for one in ("CartPole-v1", "Pendulum-v1")]
    if _installed("highway_env", "highway", notes):
        found.append(Contender("highway-env's lane-keeping-v0", single("lane-keeping-v0"), rival=True))
    return found


def vectors(ids: Sequence[str], notes: list[str]) -> list[Contender]:
    """The vector environments, autoreset included, of each precision and with one thread; of lanes more."""
    found = [Contender(f"{one}, {dtype}", vector(one, dtype=dtype)) for one in ids for dtype in ("float64", "float32")]
    if LANE_KEEP in ids:
        saturating = vector(LANE_KEEP, dtype="float32", tyre="magic_formula")
        found.append(Contender(f"{LANE_KEEP}, float32, saturating tyres", saturating))
        found.append(Contender(f"{LANE_KEEP}, float32, {MANY} cars", vector(LANE_KEEP, MANY, dtype="float32")))
        if (os.cpu_count() or 1) > 1:
            found.append(
                Contender(f"{LANE_KEEP}, float32, 2 threads", vector(LANE_KEEP, dtype="float32", num_threads=2))
            )
    found.append(Contender("CartPole-v1", vector("CartPole-v1"), rival=True))
    if importlib.util.find_spec("gymnax") is None:
        notes.append("gymnax is not installed, so it is left out; pip install gymnax")
    else:
        found.append(Contender("gymnax's CartPole-v1", gymnax_cartpole(), rival=True))
    return found


def _course(one: str) -> Groups:
    """An environment with more to do beside a circuit with the same scan."""
    found = {}
    kinds: tuple[tuple[str, Callable[..., Callable[[int], int]], dict[str, Any]], ...] = (
        ("single", single, {}),
        (f"{CARS} cars", vector, {"dtype": "float32"}),
    )
    for kind, make, given in kinds:
        found[f"{one}, {kind}"] = [
            Contender(one, make(one, scan="perfect", **given)),
            Contender("a circuit with the same scan", make(CIRCUIT, scan="perfect", **given), rival=True),
        ]
    return found


def traffic() -> list[Contender]:
    """One car and `AMONG` among as many neighbours as `highway-v0` has, and that as it is."""
    return [
        Contender(TRAFFIC, single(TRAFFIC, **NEIGHBOURS)),
        Contender(f"{TRAFFIC}, {AMONG} cars", vector(TRAFFIC, AMONG, **NEIGHBOURS)),
        Contender("highway-env's highway-v0", single("highway-v0"), rival=True),
    ]


def policies(notes: list[str]) -> list[Contender]:
    """What the actions of a learned policy and of controllers cost beside a step of its own cars."""
    import lanekeep_baselines

    given: dict[str, Any] = {"preview": 20, "dtype": "float32"}
    env: Any = gym.make_vec(LANE_KEEP, CARS, "vector_entry_point", **given)
    observation, _ = env.reset(seed=0)
    scenario = env.scenario
    drivers: dict[str, Any] = {name: lanekeep_baselines.make(name, scenario) for name in ("stanley", "lq-preview")}
    if _installed("safetensors", "agents", notes):
        import lanekeep_agents

        drivers[POLICY] = lanekeep_agents.load(POLICY, scenario)
    found = [Contender(name, _predicting(driver, observation)) for name, driver in drivers.items()]
    return [*found, Contender("a step, 20 previews, float32", vector(LANE_KEEP, **given), rival=True)]


def evaluation() -> list[Contender]:
    """`lanekeep bench` without its files: a controller's episodes, all metrics of them; and the steps alone."""
    import lanekeep_baselines
    from lanekeep_benchmarks.evaluate import evaluate
    from lanekeep_benchmarks.suites import Suite, SuiteScenario

    suite = Suite("speed", "for its speed", (SuiteScenario("lane-keep", "", {}),), episodes=256)

    def run(calls: int) -> int:
        steps = 0
        for _ in range(calls):
            for lines in evaluate(suite, ["stanley"], lanekeep_baselines.make, episodes=suite.episodes, seed=0):
                steps += sum(line.steps for line in lines)
        return steps

    return [
        Contender("episodes of stanley", run),
        Contender("steps alone", vector(LANE_KEEP, suite.episodes), rival=True),
    ]


def single(env_id: str, **keywords: Any) -> Callable[[int], int]:
    """Steps of `gym.make` with ``keywords``, random actions drawn beforehand, resets included."""
    env = gym.make(env_id, **keywords)
    actions = _actions(env.action_space, 4096)
    env.reset(seed=0)

    def run(calls: int) -> int:
        step, reset = env.step, env.reset
        for _, action in zip(range(calls), actions, strict=False):
            _, _, terminated, truncated, _ = step(action)
            if terminated or truncated:
                reset()
        return calls

    return run


def vector(env_id: str, cars: int = CARS, **keywords: Any) -> Callable[[int], int]:
    """Steps of the environment's own vector entry point, random actions drawn beforehand, autoreset included."""
    env = gym.make_vec(env_id, num_envs=cars, vectorization_mode="vector_entry_point", **keywords)
    actions = _actions(env.action_space, 64)
    env.reset(seed=0)

    def run(calls: int) -> int:
        for _, action in zip(range(calls), actions, strict=False):
            env.step(action)
        return calls * cars

    return run


def gymnax_cartpole() -> Callable[[int], int]:
    """Compiled steps of gymnax's CartPole, one call a step as a training loop in Python makes them."""
    import gymnax
    import jax

    env, parameters = gymnax.make("CartPole-v1")
    keys = jax.random.split(jax.random.key(0), CARS)
    reset = jax.jit(jax.vmap(env.reset, in_axes=(0, None)))
    step = jax.jit(jax.vmap(env.step, in_axes=(0, 0, 0, None)))
    draw = jax.jit(jax.vmap(env.action_space(parameters).sample))
    state = reset(keys, parameters)[1]
    action = draw(keys)

    def run(calls: int) -> int:
        nonlocal state
        for _ in range(calls):
            observation, state, *_ = step(keys, state, action, parameters)
            jax.block_until_ready((observation, state))
        return calls * CARS

    return run


def _predicting(policy: Any, observation: Any) -> Callable[[int], int]:
    """Actions of a policy that remembers, for as many cars."""
    state = policy.predict(observation)[1]

    def run(calls: int) -> int:
        nonlocal state
        for _ in range(calls):
            _, state = policy.predict(observation, state)
        return calls * len(observation)

    return run


def _actions(space: gym.Space[Any], count: int) -> Iterator[Any]:
    space.seed(0)
    return cycle([space.sample() for _ in range(count)])


def _installed(package: str, extra: str, notes: list[str]) -> bool:
    """Whether a package is there; highway-env's tasks are registered then."""
    if importlib.util.find_spec(package) is None:
        note = f'{package.replace("_", "-")} is not installed, so it is left out; pip install "lanekeep[{extra}]"'
        if note not in notes:
            notes.append(note)
        return False
    if package == "highway_env":
        import highway_env

        gym.register_envs(highway_env)
    return True
