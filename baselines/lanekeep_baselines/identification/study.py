"""How good the identification is: many noisy runs of a known car, and controllers designed on what they gave.

``python -m lanekeep_baselines.identification.study 100`` prints the whole study (a minute).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
from lanekeep_baselines.identification.fit import identify
from lanekeep_baselines.identification.noise import SensorNoise
from lanekeep_baselines.identification.record import excited_drive
from lanekeep_baselines.identification.result import PARAMETERS, Identification
from lanekeep_baselines.identification.vehicle import redesign
from lanekeep_baselines.policy import Floats, Policy
from lanekeep_baselines.yin_design import YinModel
from lanekeep_env.physics.vehicles import vehicle_from


@dataclass(frozen=True, eq=False)
class Study:
    """Identifications of one car from many runs; arrays are (runs, 7) in the order of `PARAMETERS`.

    Attributes:
        truth: of the car, (7,).
        errors: relative, of the values.
        covered: whether the 95 % interval holds the truth.
        found: the identifications.
    """

    truth: Floats
    errors: Floats
    covered: NDArray[np.bool_]
    found: tuple[Identification, ...]

    def __str__(self) -> str:
        lines = [f"{len(self.errors)} runs   truth   RMS error   largest   runs covered"]
        for i, name in enumerate(PARAMETERS):
            error = 100.0 * np.abs(self.errors[:, i])
            size = np.sqrt(np.mean(error**2))
            lines.append(
                f"{name:4} {self.truth[i]:12.4g} {size:10.2f} % {error.max():8.2f} % {self.covered[:, i].sum():8d}"
            )
        return "\n".join(lines)


def coverage(
    runs: int = 100, *, vehicle: Any = "yin", seed: int = 0, noise: SensorNoise | None = None, **drive: Any
) -> Study:
    """Identify ``runs`` noisy `excited_drive`s, each with its own excitation and noise (seeds from ``seed`` on).

    Args:
        runs: number of drives.
        vehicle: as `gym.make` takes it; with an actuator lag.
        seed: of the first drive.
        noise: None for the default `SensorNoise`.
        drive: further keywords of `excited_drive`.
    """
    car = vehicle_from(vehicle)
    model = YinModel.of(car)
    truth = np.array([model.a11, model.a12, model.a21, model.a22, model.b1, model.b2, car.steering.lag])
    found = tuple(identify(excited_drive(seed + k, vehicle=car, noise=noise, **drive)) for k in range(runs))
    values = np.array([[one.values[name] for name in PARAMETERS] for one in found])
    intervals = np.array([[one.intervals[name] for name in PARAMETERS] for one in found])
    covered = (intervals[..., 0] <= truth) & (truth <= intervals[..., 1])
    return Study(truth, values / truth - 1.0, covered, found)


def rms_lateral_error(env: Any, policy: Policy, seed: int = 0) -> float:
    """Return the RMS lateral error, m, over one episode of every car of a vector environment."""
    observation, _ = env.reset(seed=seed)
    state, start, squares = None, np.ones(env.num_envs, dtype=bool), []
    for _ in range(env.unwrapped.scenario.episode_steps - 1):
        action, state = policy.predict(observation, state, start)
        observation, _, _, _, info = env.step(action)
        squares.append(np.asarray(info["lateral_error"]) ** 2)
        start = np.zeros(env.num_envs, dtype=bool)
    return float(np.sqrt(np.mean(squares)))


def design_loss(
    found: Sequence[Identification], name: str, *, cars: int = 16, seed: int = 0, **keywords: Any
) -> Floats:
    """Return by how much the RMS lateral error grows when ``name`` is designed on each identification, (found,).

    Relative to the design on the true car, on the same episodes of `LaneKeep-v0`; below 0 where it shrinks.

    Args:
        found: identifications of the scenario's car.
        name: of the policy.
        cars: episodes.
        seed: of the first episode.
        keywords: of `gym.make_vec`.
    """
    settings = {"departure": "cost", "preview": 1, **keywords}
    env = gym.make_vec("lanekeep_env:lanekeep/LaneKeep-v0", num_envs=cars, **settings)
    scenario = env.unwrapped.scenario  # type: ignore[attr-defined]
    true = rms_lateral_error(env, lanekeep_baselines.make(name, scenario), seed)
    losses = [rms_lateral_error(env, redesign(name, scenario, one), seed) / true - 1.0 for one in found]
    env.close()
    return np.array(losses)


def main() -> None:
    """Print the study of Yin's car."""
    parser = argparse.ArgumentParser(
        description="Identify Yin's car from many noisy 60 s runs; redesign on the first 20."
    )
    parser.add_argument("runs", type=int, nargs="?", default=100)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    study = coverage(arguments.runs, seed=arguments.seed)
    print(study)
    for name in ("yin-lqr", "yin-lqr-observer", "yin-lqr-feedforward", "stanley", "pure-pursuit-understeer"):
        loss = 100.0 * design_loss(study.found[:20], name, road="yin")
        print(f"{name}: RMS lateral error on Yin's road {loss.mean():+.2f} %, at worst {loss.max():+.2f} %")


if __name__ == "__main__":
    main()
