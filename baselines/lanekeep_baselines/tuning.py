"""How the free weights of the LQ controllers were found: a seeded search on training roads, by the return alone.

    python -m lanekeep_baselines.tuning lqg --budget 2000000

prints every improvement and the weights found, which `lq` holds as constants. The budget counts environment steps, and
by default is that of the learned policies. `lq-preview` is tuned on the nominal car with perfect sensors, the others,
which are made for cars that differ, on saturating tyres with ``randomisation="mismatch"``, half of the episodes with
production sensors: with perfect ones alone the search ends at filters that trust every sensor blindly. The benchmark's
roads are of another seed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np

import lanekeep_env  # noqa: F401  (registers the environments)
from lanekeep_baselines.lq import LinearQuadratic, LinearQuadraticGaussian, LqPreview, LqPreviewOffsetFree
from lanekeep_baselines.lq_design import Weights
from lanekeep_baselines.policy import Policy

_NOMINAL: dict[str, Any] = {"preview": 20}
_MISMATCH: dict[str, Any] = {"preview": 20, "tyre": "magic_formula", "randomisation": "mismatch"}
_MISMATCHES = (_MISMATCH, {**_MISMATCH, "sensors": "production"})


@dataclass(frozen=True)
class Task:
    """What is tuned and where.

    Attributes:
        policy: its class.
        scenarios: keywords of the environments, which share the episodes.
        episodes: that every candidate drives, a multiple of the scenarios.
        start: where the search starts.
        free: the weights that it moves.
    """

    policy: type[LinearQuadratic]
    scenarios: tuple[dict[str, Any], ...]
    episodes: int
    start: Weights
    free: tuple[str, ...]


_START = Weights(rate=1.0, slip=1e-3, steer=1e-3, drift=1e-2, bend=0.3, lag=0.03)
_FREE = ("rate", "slip", "drift", "bend", "lag")
TASKS = {
    "lq-preview": Task(LqPreview, (_NOMINAL,), 64, replace(_START, drift=0.0, lag=0.0), ("rate",)),
    "lq-preview-offset-free": Task(LqPreviewOffsetFree, _MISMATCHES, 64, _START, _FREE),
    # Departures are rare and decide: found on fewer episodes, its weights depart on others.
    "lqg": Task(LinearQuadraticGaussian, _MISMATCHES, 128, _START, _FREE),
}
#: First step of the search: standard deviation of the weights' logarithms.
STEP = 0.7


def mean_return(envs: Any, policy: Policy, seed: int) -> float:
    """Drive one episode in every car of ``envs``, car i with seed + i; return the mean of their returns."""
    observation, _ = envs.reset(seed=seed)
    state, total, driving = None, 0.0, np.ones(envs.num_envs, dtype=bool)
    for _ in range(envs.unwrapped.scenario.episode_steps):
        action, state = policy.predict(observation, state)
        observation, reward, terminated, _, _ = envs.step(np.clip(action, -1.0, 1.0))
        # A departure has charged the rest of its episode.
        total += float((driving * reward).mean())
        driving &= ~terminated
    return total


def tune(name: str, budget: int = 2_000_000, seed: int = 0) -> tuple[Weights, float]:
    """Search the weights of policy ``name``; return the best and their mean return.

    A (1+1) evolution strategy on the weights' logarithms: a normal step from the best, longer after a success and
    shorter after a failure, until another candidate would exceed ``budget``. All meet the same episodes.

    Raises:
        ValueError: a budget for less than one candidate.
    """
    task = TASKS[name]
    envs = [_envs(task.episodes // len(task.scenarios), scenario) for scenario in task.scenarios]
    least = task.episodes * envs[0].unwrapped.scenario.episode_steps
    if budget < least:
        raise ValueError(f"budget={budget!r} steps is not allowed: at least {least}, one candidate")

    def score(weights: Weights) -> float:
        returns = [mean_return(env, task.policy(env.unwrapped.scenario, weights), seed) for env in envs]
        return float(np.mean(returns))

    random = np.random.default_rng(seed)
    best = task.start
    highest = score(best)
    print(f"   0  {highest:.4f}  {_short(best)}", flush=True)
    step = STEP
    for number in range(1, budget // least):
        factors = np.exp(step * random.normal(size=len(task.free)))
        moved = {one: getattr(best, one) * float(f) for one, f in zip(task.free, factors, strict=True)}
        candidate = replace(best, **moved)
        reached = score(candidate)
        if reached > highest:
            best, highest = candidate, reached
            print(f"{number:4d}  {highest:.4f}  {_short(best)}", flush=True)
        # One success in five keeps the step as it is.
        step *= np.exp(0.4) if candidate is best else np.exp(-0.1)
    for env in envs:
        env.close()
    return best, highest


def _envs(cars: int, scenario: dict[str, Any]) -> Any:
    return gym.make_vec(
        "lanekeep/LaneKeep-v0",
        num_envs=cars,
        vectorization_mode="vector_entry_point",
        dtype="float32",
        autoreset_mode="disabled",
        **scenario,
    )


def _short(weights: Weights) -> str:
    return f"Weights({', '.join(f'{name}={value:.3g}' for name, value in asdict(weights).items())})"


def main(arguments: Sequence[str] | None = None) -> None:
    """Tune one policy."""
    parser = argparse.ArgumentParser(prog="python -m lanekeep_baselines.tuning", description=__doc__)
    parser.add_argument("policy", choices=TASKS)
    parser.add_argument("--budget", type=int, default=2_000_000, help="environment steps in all (2 million)")
    parser.add_argument("--seed", type=int, default=0, help="of the search and of the episodes (0)")
    given = parser.parse_args(arguments)
    best, highest = tune(given.policy, given.budget, given.seed)
    print(f"{_short(best)}  mean return {highest:.4f}")


if __name__ == "__main__":
    main()
