"""What a trial costs and gives: a policy with its values, driven through held-out episodes on training roads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.distil.rounds import told
from lanekeep_agents.training.evaluation import Drives, HeldOut
from lanekeep_benchmarks.tune.search import seed_of
from lanekeep_benchmarks.tune.settings import TuneSettings
from lanekeep_benchmarks.tune.space import is_learned, nested

Floats = NDArray[np.float64]
#: Takes a scenario, gives the policy.
Factory = Callable[[Any], Any]


class Failed(ValueError):
    """Values with which a policy cannot be made, or drives out of all bounds: the search goes on without them."""


class Course:
    """Sets of episodes, the same ones for every policy and every trial.

    Args:
        settings: of the run.
        purpose: "search" or "judge": their episodes are others.
        times: so many episodes of each set as a trial has.
    """

    def __init__(self, settings: TuneSettings, purpose: str, times: int = 1) -> None:
        self._sets = [
            (
                HeldOut(
                    lessons.env_id,
                    {"dtype": "float32", **lessons.with_noise(noise)},
                    times * settings.episodes,
                    seed_of(purpose, settings.env_id, settings.seed, i),
                ),
                noise,
            )
            for i, (lessons, noise) in enumerate(settings.drills)
        ]

    def check(self, policy: str) -> None:
        """Raise ValueError, one line, unless the controller can drive all sets."""
        for held_out, _ in self._sets:
            if lacking := lanekeep_baselines.policy_class(policy).lacking(held_out.scenario):
                raise ValueError(lacking)

    def drive(self, policy: Factory) -> list[Drives]:
        """Drive a policy, designed for each set, through it.

        Raises:
            Failed: it cannot be designed, or a return is no number.
        """
        try:
            made = [policy(told(held_out.scenario, noise)) for held_out, noise in self._sets]
        except (ValueError, np.linalg.LinAlgError) as error:
            raise Failed(str(error)) from error
        found = [held_out.drive(one) for (held_out, _), one in zip(self._sets, made, strict=True)]
        if not all(np.isfinite(one.returns).all() for one in found):
            raise Failed("a return is not finite")
        return found


def score_of(returns: Sequence[float], shipped: Sequence[float]) -> float:
    """Gain of mean returns over those of the shipped values, a set each: in shares of theirs, all sets alike.

    The return charges what is left of an episode after a departure, as the environment does.
    """
    ours, theirs = np.array(returns), np.array(shipped)
    return float(np.mean((ours - theirs) / _scale(theirs)))


def paired_gains(ours: Sequence[Drives], shipped: Sequence[Drives]) -> Floats:
    """The same episode by episode, (episodes,): one of each set together, which are other roads and cars."""
    theirs = np.array([one.returns for one in shipped])
    difference = np.array([one.returns for one in ours]) - theirs
    gains: Floats = (difference / _scale(theirs.mean(axis=1))[:, None]).mean(axis=0)
    return gains


def _scale(returns: Floats) -> Floats:
    return np.where(returns == 0.0, 1.0, np.abs(returns))


class Trials:
    """How the policy of a trial is made.

    Args:
        settings: of the run.
        folder: that trainings go to, one each.
    """

    def __init__(self, settings: TuneSettings, folder: Path) -> None:
        self._settings, self._folder = settings, folder

    def make(self, number: int, values: Mapping[str, float], report: Callable[[str], None]) -> Factory:
        """Return the policy of a trial; a learned one is trained, or what is left of it.

        Raises:
            Failed: the training came to nothing. ValueError: the folder of the trial holds another training.
        """
        if is_learned(self._settings.policy):
            path = self._trained(number, values, report)
            return lambda scenario: lanekeep_agents.load(path, scenario)
        name = self._settings.policy
        return lambda scenario: lanekeep_baselines.make(name, scenario, **values)

    def policy_file(self, number: int) -> Path:
        """Of a learned policy's trial."""
        settings = self._settings
        from lanekeep_agents.training.folder import policy_name
        from lanekeep_agents.training.settings import settings_for

        name = policy_name(settings_for(settings.policy, settings.env_id, settings.seed))
        return self._folder / f"trial-{number}" / f"{name}.json"

    def _trained(self, number: int, values: Mapping[str, float], report: Callable[[str], None]) -> Path:
        from lanekeep_agents.training.folder import SETTINGS, check
        from lanekeep_agents.training.run import run
        from lanekeep_agents.training.settings import settings_for

        file, settings = self.policy_file(number), self._settings
        if not file.exists():
            training = settings_for(settings.policy, settings.env_id, settings.seed, settings.steps, **nested(values))
            begun = (file.parent / SETTINGS).exists()
            check(training, file.parent, begun, False)
            try:
                run(training, file.parent, resume=begun, report=lambda done, line: report(f"{done:,} steps, {line}"))
            except ValueError as error:  # weights that are no numbers any more
                raise Failed(str(error)) from error
        return file
