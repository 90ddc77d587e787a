"""Augmented random search for a linear correction of a classical policy: from returns of whole episodes, no gradient.

Source: H. Mania, A. Guy, B. Recht, Simple random search of static linear policies is competitive for reinforcement
learning, NeurIPS 2018 (V2-t: inputs normalised, steps by the spread of the returns, the better half of the directions).
What takes seconds, such as a gap that is closed, is found by it where noise on the action of every step drowns it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
from lanekeep_agents.export import scenario_fields
from lanekeep_agents.policy_file import write_policy
from lanekeep_agents.policy_record import LARGEST_CLIP, Network, Normalisation, PolicyRecord, Training

Floats = NDArray[np.float64]
#: What a failed episode costs the search besides: what happens once in 500 episodes must not be worth its gain.
CHARGE = 1000.0
#: Of learning at first, in units of the search's width; and what seeds of episodes are drawn below.
RATE, LARGEST_SEED = 1.0, 1 << 31


def search(
    worlds: Sequence[Corrected], width: Floats, pairs: int, steps: int, rng: np.random.Generator
) -> tuple[Floats, int]:
    """Return the weights, (actions, inputs + 1), that returns in all worlds lead to, and the steps that it took.

    A candidate's return is the mean over all worlds: each by itself would ascend as far, whatever that costs in others.
    Steps follow a few episodes each, in which what seldom fails may not; so what is returned is the best of all weights
    on the way over many episodes, always the same.

    Args:
        worlds: of as many cars each, as many steps at least as were asked for; the first one's inputs normalise all.
        width: of the search, of each weight: (actions, inputs + 1), or what broadcasts to it.
        pairs: directions that are tried at once, each both ways.
        steps: of all cars; the rate falls with them from `RATE` to nothing.
        rng: draws episodes and directions.
    """
    first = worlds[0]
    first.normalise(rng.integers(LARGEST_SEED, size=first.cars))
    for world in worlds:
        world.mean, world.deviation = first.mean, first.deviation
    weights = np.zeros((first.scenario.num_actions, len(first.mean) + 1))
    many = rng.integers(LARGEST_SEED, size=(len(worlds), first.cars))
    best, most, driven = weights, float(_over_all(worlds, many, weights[None])[0]), 0
    # Candidates, and as many cars again, all with what came of them.
    each = 2 * sum(world.cars * world.scenario.episode_steps for world in worlds)
    while driven < steps:
        episodes = rng.integers(LARGEST_SEED, size=(len(worlds), first.cars // (2 * pairs)))
        returns = partial(_over_all, worlds, episodes)
        weights = ascend(weights, width, returns, pairs, RATE * (1.0 - driven / steps), rng)
        driven += each
        found = float(_over_all(worlds, many, weights[None])[0])
        if found > most:
            best, most = weights, found
    return best, driven


def _over_all(worlds: Sequence[Corrected], episodes: NDArray[np.int64], candidates: Floats) -> Floats:
    """Return each candidate's mean return over all worlds, (n,), each with its row of ``episodes``."""
    found: Floats = np.mean([w.returns(candidates, seeds) for w, seeds in zip(worlds, episodes, strict=True)], axis=0)
    return found


def ascend(
    weights: Floats,
    width: Floats,
    returns: Callable[[Floats], Floats],
    pairs: int,
    rate: float,
    rng: np.random.Generator,
) -> Floats:
    """Return weights after one step upwards.

    Args:
        weights: where the search is, any shape.
        width: of the search, of each weight, the same shape or one that broadcasts to it.
        returns: of candidates (2 ``pairs``, *shape): (2 ``pairs``,).
        pairs: directions that are tried, each both ways.
        rate: of learning, in units of ``width``.
        rng: draws them.
    """
    ways = width * rng.standard_normal((pairs, *weights.shape))
    found = returns(np.concatenate([weights + ways, weights - ways])).reshape(2, pairs)
    best = np.argsort(-found.max(axis=0), kind="stable")[: max(pairs // 2, 1)]
    gain = (found[0] - found[1])[best] / max(found[:, best].std(), 1e-9)
    step: Floats = rate * np.tensordot(gain, ways[best], axes=1) / len(best)
    return weights + step


class Corrected:
    """Cars that a classical policy drives, each candidate with a correction of its own.

    An action is that policy's plus ``bound`` times the correction, W x + b held within [-1, 1]: x are the channels that
    are read and behind them the policy's action, normalised. That is a residual policy of `LearnedPolicy` without a
    hidden layer.

    Args:
        env_id: of the environment.
        base: name of the classical policy.
        reads: names of the channels.
        bound: of the correction.
        cars: at once, of all candidates together.
        keywords: of `gym.make_vec`.
    """

    def __init__(
        self, env_id: str, base: str, reads: Sequence[str], bound: float, cars: int, keywords: Mapping[str, Any]
    ) -> None:
        self._env: Any = gym.make_vec(env_id, cars, "vector_entry_point", autoreset_mode="disabled", **keywords)
        #: That they drive in.
        self.scenario: Any = self._env.unwrapped.scenario  # type: ignore[attr-defined]
        self.cars = cars
        self._base, self._bound = lanekeep_baselines.make(base, self.scenario), bound
        self._env_id, self._reads = env_id, list(reads)
        self._columns = [self.scenario.column(name) for name in reads]
        inputs = len(self._columns) + self.scenario.num_actions
        #: Of the inputs, (inputs,) each.
        self.mean, self.deviation = np.zeros(inputs), np.ones(inputs)

    def normalise(self, seeds: Sequence[int] | NDArray[Any]) -> None:
        """Take mean and deviation of the inputs from episodes of the classical policy alone."""
        seen: list[Floats] = []
        self._drive(None, seeds, seen.append)
        rows = np.concatenate(seen)
        self.mean = rows.mean(axis=0)
        self.deviation = np.maximum(rows.std(axis=0), 0.01 * np.abs(self.mean) + 1e-3)

    def returns(self, candidates: Floats, seeds: Sequence[int] | NDArray[Any]) -> Floats:
        """Return each candidate's mean return over the same episodes, less `CHARGE` for a failed one, (n,).

        Args:
            candidates: W and in the last column b, (n, actions, inputs + 1).
            seeds: of the episodes, cars / n of them.
        """
        found = self._drive(candidates, np.tile(seeds, len(candidates)))
        means: Floats = found.reshape(len(candidates), -1).mean(axis=1)
        return means

    def save(self, path: str | Path, weights: Floats, training: Training, overwrite: bool = False) -> PolicyRecord:
        """Write the policy file of the correction with these weights, of the environment as it is by default.

        Args:
            path: ends in .json.
            weights: (actions, inputs + 1).
            training: how they came about.
            overwrite: a file that exists.
        """
        values = scenario_fields(gym.make(self._env_id).unwrapped.scenario)  # type: ignore[attr-defined]
        channels = {channel.name: channel for channel in values.pop("channels")}
        record = PolicyRecord(
            name=Path(path).stem,
            algorithm="ARS",
            env_id=self._env_id,
            channels=tuple(channels[name] for name in self._reads),
            network=Network((), "tanh", squash=False),
            normalisation=Normalisation(LARGEST_CLIP, 1e-12),
            training=training,
            base=self._base.name,
            bound=self._bound,
            **values,
        )
        tensors = {
            "mean": self.mean,
            "variance": self.deviation**2,
            "layers.0.weight": weights[:, :-1],
            "layers.0.bias": weights[:, -1],
        }
        narrow = {name: np.ascontiguousarray(tensor, dtype=np.float32) for name, tensor in tensors.items()}
        return write_policy(path, record, narrow, overwrite)

    def _drive(
        self, candidates: Floats | None, seeds: Sequence[int] | NDArray[Any], see: Callable[[Floats], Any] | None = None
    ) -> Floats:
        """Return the return of each car, (cars,)."""
        observation, _ = self._env.reset(seed=[int(seed) for seed in seeds])
        memory, start = None, np.ones(self.cars, dtype=bool)
        total, alive = np.zeros(self.cars), np.ones(self.cars, dtype=bool)
        while alive.any():
            action, memory = self._base.predict(observation, memory, start)
            start = np.zeros(self.cars, dtype=bool)
            action = np.clip(action, -1.0, 1.0)
            inputs = np.concatenate([observation[:, self._columns], action], axis=1, dtype=np.float64)
            if see is not None:
                see(inputs[alive])
            if candidates is not None:
                x = ((inputs - self.mean) / self.deviation).reshape(len(candidates), -1, inputs.shape[1])
                correction = x @ candidates[:, :, :-1].transpose(0, 2, 1) + candidates[:, None, :, -1]
                correction = correction.clip(-1.0, 1.0).reshape(action.shape)
                action = np.clip(action + self._bound * correction, -1.0, 1.0).astype(np.float32)
            observation, reward, terminated, truncated, _ = self._env.step(action)
            total += np.where(alive, reward - CHARGE * terminated, 0.0)
            alive &= ~(terminated | truncated)
        return total
