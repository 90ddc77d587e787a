"""A training run: from settings to a policy file, with checkpoints from which a killed run goes on."""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import VecNormalize

import lanekeep_baselines
from lanekeep_agents.export import ACTIVATIONS, export_sb3, scenario_fields, versions
from lanekeep_agents.learned import LearnedPolicy
from lanekeep_agents.policy_file import read_policy, write_policy
from lanekeep_agents.policy_record import PolicyRecord, Training
from lanekeep_agents.training.checkpoint import read_checkpoint, write_checkpoint
from lanekeep_agents.training.checkpoint_checks import Arrays
from lanekeep_agents.training.evaluation import HeldOut, Score, number
from lanekeep_agents.training.folder import CHECKPOINT, EVALUATIONS, SETTINGS, check, claim, policy_name
from lanekeep_agents.training.imitation import imitate
from lanekeep_agents.training.lean_ppo import LeanPPO
from lanekeep_agents.training.normalisation import Normalised
from lanekeep_agents.training.residual import Corrections
from lanekeep_agents.training.rewards import LearnersRewards
from lanekeep_agents.training.settings import TrainingSettings, settings_for
from lanekeep_agents.vec_env import CarVecEnv
from lanekeep_env.checks import require, shown
from lanekeep_env.files import locked, write_atomic

__all__ = ["CHECKPOINT", "EVALUATIONS", "SETTINGS", "command", "run"]

#: Steps done and what to say about it.
Report = Callable[[int, str], None]

_ALGORITHMS: dict[str, type[PPO] | type[SAC] | type[TD3]] = {"ppo": LeanPPO, "sac": SAC, "td3": TD3}
_ABSENT = object()
_ACTIVATIONS = {name: layer for layer, name in ACTIVATIONS.items()}


def run(
    settings: TrainingSettings,
    folder: Path,
    *,
    resume: bool = False,
    overwrite: bool = False,
    threads: int = 1,
    checkpoint_seconds: float = 30.0,
    report: Report | None = None,
    callback: Any = None,
) -> LearnedPolicy:
    """Train a policy; return the best one that held-out evaluations found, which is in the folder's policy file.

    Args:
        settings: what to train.
        folder: for the policy file, `settings.json`, `evaluations.csv`, the checkpoint and TensorBoard's events.
        resume: go on from the folder's checkpoint.
        overwrite: replace another run in the folder.
        threads: of torch; the same number gives the same policy to the last bit.
        checkpoint_seconds: time between checkpoints.
        report: called with the steps done and a line to show.
        callback: of Stable-Baselines3, one or a list, called after the run's own.

    Raises:
        ValueError: the folder holds a run and neither ``resume`` nor ``overwrite`` is set, or holds another run
            (``resume``); a setting that does not fit the environment.
    """
    require("threads", threads, "", at_least=1, at_most=1024, whole=True)
    check(settings, folder, resume, overwrite)
    torch.set_num_threads(threads)
    started = time.perf_counter()
    keywords = {"dtype": "float32", **settings.env}
    scenario, rewards = _learners_cars(settings, keywords)
    env = Normalised(rewards)
    model = _model(settings, env)
    held_out = HeldOut(settings.env_id, keywords, settings.evaluation_episodes, settings.seed_of("evaluation"))
    teacher = None if settings.imitate is None else lanekeep_baselines.make(settings.imitate, scenario)
    sitting = _Sitting(started, checkpoint_seconds, report)
    course = _Course(settings, folder, env, rewards, held_out, scenario, sitting)
    # Only now: what does not fit the environment is known before another run is replaced.
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder):
        record = check(settings, folder, resume, overwrite)
        if not resume:
            claim(folder, record, policy_name(settings))
        if (folder / CHECKPOINT).exists():
            course.take_up(model)
            teacher = None  # it has been imitated
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
        if teacher is not None:
            imitate(model, env, teacher, settings.gamma, settings.seed_of("imitation"))
        if model.num_timesteps < settings.steps:
            # Counts start at zero anyway; cars that a checkpoint has set must not be reset.
            several = callback if isinstance(callback, list) else [] if callback is None else [callback]
            course.called = [type(one).__name__ for one in several]
            model.learn(
                settings.steps - model.num_timesteps, [course, *several], reset_num_timesteps=False, log_interval=10
            )
        return course.finish(model)


def _learners_cars(settings: TrainingSettings, keywords: dict[str, Any]) -> tuple[Any, LearnersRewards]:
    """Return the scenario, and the cars as the learner meets them: corrected actions, bounded rewards."""
    try:
        cars = CarVecEnv(settings.env_id, settings.num_envs, **keywords)
    except TypeError as error:
        raise ValueError(f"env: {error}") from error
    scenario = cars.env.unwrapped.scenario  # type: ignore[attr-defined]
    inner = cars if settings.base is None else Corrections(cars, scenario, settings.base, settings.bound or 0.0)
    largest = settings.largest_cost * scenario.largest_cost * scenario.control_step
    return scenario, LearnersRewards(inner, largest, settings.gamma, settings.reward_scale)


def network_of(settings: TrainingSettings) -> dict[str, Any]:
    """The networks as Stable-Baselines3's ``policy_kwargs`` name them."""
    value = "vf" if settings.algorithm == "ppo" else "qf"
    network: dict[str, Any] = {
        "net_arch": {"pi": list(settings.hidden), value: list(settings.critic)},
        "activation_fn": _ACTIVATIONS[settings.activation],
    }
    return {**network, "log_std_init": settings.log_std} if settings.algorithm == "ppo" else network


def _model(settings: TrainingSettings, env: VecNormalize) -> BaseAlgorithm:
    """A fresh algorithm on ``env``."""
    rate, last = settings.learning_rate, settings.final_learning_rate
    further = dict(settings.parameters)
    if settings.algorithm == "td3":
        shape = env.action_space.shape or ()
        further["action_noise"] = NormalActionNoise(np.zeros(shape), np.full(shape, settings.action_noise))
    try:
        return _ALGORITHMS[settings.algorithm](
            "MlpPolicy",
            env,
            # The last rollout may end beyond the steps asked for, where less than nothing is left.
            learning_rate=lambda left: rate * (last + (1.0 - last) * max(left, 0.0)),
            gamma=settings.gamma,
            seed=settings.seed_of("training"),
            device="cpu",
            policy_kwargs={**network_of(settings), "optimizer_kwargs": {"fused": True}},
            **further,
        )
    except (TypeError, AssertionError) as error:
        raise ValueError(f"parameters={further!r} are not allowed: {error}") from error


class _Sitting(NamedTuple):
    """What is of this process alone, when a run goes on in several.

    Attributes:
        started: when, by `time.perf_counter`, s.
        checkpoint_seconds: time between checkpoints.
        report: called with the steps done and a line to show.
    """

    started: float
    checkpoint_seconds: float
    report: Report | None


class _Course(BaseCallback):
    """What happens between rollouts: evaluations at fixed steps, checkpoints now and then, reports."""

    def __init__(
        self,
        settings: TrainingSettings,
        folder: Path,
        env: VecNormalize,
        rewards: LearnersRewards,
        held_out: HeldOut,
        scenario: Any,
        sitting: _Sitting,
    ) -> None:
        super().__init__()
        self._settings, self._folder = settings, folder
        self._env, self._rewards = env, rewards
        self._held_out, self._scenario = held_out, scenario
        self._sitting, self._saved = sitting, sitting.started
        #: Classes of callbacks that were called besides.
        self.called: list[str] = []
        #: (steps, score) of each evaluation so far, the seconds of earlier sittings and the best policy's tensors.
        self._scores: list[tuple[int, Score]] = []
        self._earlier = {"total": 0.0, "environment": 0.0}
        self._best: Arrays = {}

    def take_up(self, model: BaseAlgorithm) -> None:
        """Go on from the folder's checkpoint."""
        file = self._folder / CHECKPOINT
        notes, self._best = read_checkpoint(file, model, self._env, self._settings.to_dict())
        try:
            self._scores = [(number(steps, int), Score.of(score)) for steps, score in notes["scores"]]
            self._earlier = {name: number(notes["seconds"][name], float) for name in self._earlier}
            if not self._scores:
                raise ValueError("there is no score")
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{file} is not a checkpoint of this run: notes: {shown(str(error))}") from None

    def finish(self, model: BaseAlgorithm) -> LearnedPolicy:
        """Evaluate the last policy, write the best one's file and return it."""
        self.model = model
        if not self._scores or self._scores[-1][0] < model.num_timesteps:
            self._evaluate()
            self._save()
        path = self._folder / f"{policy_name(self._settings)}.json"
        record = self._record()
        write_policy(path, record, self._best, overwrite=True)
        return LearnedPolicy(*read_policy(path), self._scenario)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        """Between two rollouts nothing is half done."""
        share = self._settings.steps / self._settings.evaluations
        if not self._scores or self.num_timesteps // share > self._scores[-1][0] // share:
            self._evaluate()
        if time.perf_counter() - self._saved >= self._sitting.checkpoint_seconds:
            self._save()
        if self._sitting.report is not None:
            self._sitting.report(self.num_timesteps, self._line())

    def _evaluate(self) -> None:
        network, normalisation, tensors = export_sb3(self.model, self._env)
        self._network, self._normalisation = network, normalisation
        policy = LearnedPolicy(self._record(), tensors, self._scenario)
        score = self._held_out.score(policy)
        if not self._scores or score.mean_return > self._top.mean_return:
            self._best = {name: tensor.copy() for name, tensor in tensors.items()}
        self._scores.append((self.num_timesteps, score))
        for name, value in asdict(score).items():
            self.logger.record(f"evaluation/{name}", value)
        self.logger.dump(self.num_timesteps)
        lines = ["steps,mean_return,failure_rate,rms_lateral_error"]
        lines += [f"{steps},{s.mean_return!r},{s.failure_rate!r},{s.rms_lateral_error!r}" for steps, s in self._scores]
        write_atomic(self._folder / EVALUATIONS, ("\n".join(lines) + "\n").encode())

    def _save(self) -> None:
        scores = [(steps, list(asdict(score).values())) for steps, score in self._scores]
        notes = {"settings": self._settings.to_dict(), "scores": scores, "seconds": self._seconds()}
        write_checkpoint(self._folder / CHECKPOINT, self.model, self._env, notes, self._best)
        self._saved = time.perf_counter()

    def _seconds(self) -> dict[str, float]:
        """Of the whole run, and of that in the environment."""
        return {
            "total": self._earlier["total"] + time.perf_counter() - self._sitting.started,
            "environment": self._earlier["environment"] + self._rewards.seconds,
        }

    @property
    def _top(self) -> Score:
        return max((score for _, score in self._scores), key=lambda score: score.mean_return)

    def _line(self) -> str:
        score = self._scores[-1][1]
        return f"return {score.mean_return:.3g}, failed {score.failure_rate:.1%}, {score.rms_lateral_error:.3f} m"

    def _record(self) -> PolicyRecord:
        """What the policy file says, of the best policy so far."""
        if not hasattr(self, "_network"):
            self._network, self._normalisation, _ = export_sb3(self.model, self._env)
        settings = self._settings
        seconds = self._seconds()
        scores: dict[str, Any] = {}
        if self._scores:
            scores = {**asdict(self._top), "episodes": settings.evaluation_episodes}
            scores["environment_share"] = seconds["environment"] / seconds["total"]
        return PolicyRecord(
            name=policy_name(settings),
            algorithm=settings.algorithm.upper(),
            env_id=settings.env_id,
            network=self._network,
            normalisation=self._normalisation,
            training=Training(
                command=command(settings),
                hyperparameters={**settings.to_dict(), **({"callback": self.called} if self.called else {})},
                seed=settings.seed,
                steps=min(settings.steps, self.model.num_timesteps),  # fewer where a callback has ended it
                seconds=round(seconds["total"], 1),
                versions=versions(),
                scores=scores,
            ),
            base=settings.base,
            bound=settings.bound,
            **scenario_fields(self._scenario),
        )


def command(settings: TrainingSettings) -> str:
    """The command line that trains this policy: what differs from the YAML file is written out."""
    words = ["lanekeep", "train", settings.algorithm, settings.env_id, "--seed", str(settings.seed)]
    own = {name: getattr(settings, name) for name in ("base", "bound", "imitate")}
    plain = settings_for(settings.algorithm, settings.env_id, settings.seed, **own).to_dict()
    asked = settings.to_dict()
    for name, value in own.items():
        words += [] if value is None else [f"--{name}", str(value)]
    for name, value in asked.items():
        changes = {f"{name}.{key}": one for key, one in value.items()} if isinstance(value, dict) else {name: value}
        usual = plain[name] if isinstance(value, dict) else plain
        for place, one in changes.items():
            if usual.get(place.rpartition(".")[2], _ABSENT) != one:
                words += ["--steps", str(one)] if place == "steps" else ["--set", f"{place}={json.dumps(one)}"]
    return shlex.join(words)
