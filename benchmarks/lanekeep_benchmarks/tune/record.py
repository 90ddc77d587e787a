"""What a run leaves beside its trials: `best.json`, with values, budget and scores, and in words."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from lanekeep_agents.training.evaluation import Drives
from lanekeep_baselines.tunable import tuned_text
from lanekeep_benchmarks.statistics import Interval
from lanekeep_benchmarks.tune.drives import Trials
from lanekeep_benchmarks.tune.run import Outcome
from lanekeep_benchmarks.tune.settings import TuneSettings
from lanekeep_benchmarks.tune.space import is_learned, nested
from lanekeep_env.plain import json_able


def command(settings: TuneSettings) -> str:
    """The command line of the run."""
    words = ["lanekeep", "tune", settings.policy, settings.env_id.rpartition("/")[2]]
    words += ["--trials", str(settings.trials), "--seed", str(settings.seed)]
    return shlex.join([*words, *(["--steps", str(settings.steps)] if settings.steps else [])])


def best_text(settings: TuneSettings, outcome: Outcome, folder: Path) -> str:
    """Return the text of `best.json`: of a controller `lanekeep_baselines.load` and the benchmark take it."""
    further: dict[str, Any] = {
        "env_id": settings.env_id,
        "trial": outcome.number,
        "command": command(settings),
        "budget": {
            "trials": settings.trials,
            "episodes": settings.episodes * len(settings.drills),
            "training_steps": settings.steps or 0,
            "environment_steps": outcome.steps,
            "cpu_seconds": outcome.cpu_seconds,
        },
        "gain": {
            "search": outcome.best.score,
            "other_episodes": asdict(outcome.gain),
            "episodes": sum(len(one.returns) for one in outcome.tuned),
        },
        "sets": [
            {
                "name": lessons.name,
                "env_id": lessons.env_id,
                "keywords": json_able(lessons.keywords),
                "noise": noise,
                "shipped": _scores(shipped),
                "tuned": _scores(tuned),
            }
            for (lessons, noise), shipped, tuned in zip(settings.drills, outcome.shipped, outcome.tuned, strict=True)
        ],
        "versions": settings.versions,
    }
    if not is_learned(settings.policy):
        return tuned_text(outcome.best.values, policy=settings.policy, **further)
    file = Trials(settings, folder).policy_file(outcome.number).relative_to(folder).as_posix()
    train = _training_command(settings, outcome)
    return tuned_text(outcome.best.values, algorithm=settings.policy, policy_file=file, train=train, **further)


def _training_command(settings: TuneSettings, outcome: Outcome) -> str:
    from lanekeep_agents.training.run import command as of_training
    from lanekeep_agents.training.settings import settings_for

    values = nested(outcome.best.values)
    return of_training(settings_for(settings.policy, settings.env_id, settings.seed, settings.steps, **values))


def _scores(drives: Drives) -> dict[str, float]:
    rms = float(np.sqrt(drives.squares.sum() / drives.steps.sum()))
    return {
        "mean_return": float(drives.returns.mean()),
        "failure_rate": float(1.0 - drives.succeeds.mean()),
        "rms_lateral_error": rms,
    }


def in_words(settings: TuneSettings, outcome: Outcome, folder: Path) -> list[str]:
    """Return what the command prints."""
    learned = is_learned(settings.policy)
    what = "one training and " if learned else ""
    lines = [
        f"{settings.policy} on {settings.env_id.rpartition('/')[2]}: {settings.trials} trials of {what}"
        f"{settings.episodes * len(settings.drills)} episodes, {outcome.steps:,} environment steps, "
        f"{outcome.cpu_seconds:.0f} s of CPU time"
    ]
    if not outcome.number:
        return [*lines, "No trial beat the shipped values."]
    lines += [
        f"Best is trial {outcome.number}, {outcome.best.score:+.2%} of the shipped values' return in the search; on "
        f"{_episodes(outcome.tuned):,} other episodes {percent(outcome.gain)}",
        f"Failed there: {_failures(outcome.shipped):.2%} as shipped, {_failures(outcome.tuned):.2%} tuned",
        ", ".join(f"{name} {value:.4g}" for name, value in outcome.best.values.items()),
    ]
    if learned:
        lines.append("One training each: the interval is that of episodes, and seeds of training differ by more.")
    path = Trials(settings, folder).policy_file(outcome.number) if learned else folder / "best.json"
    return [*lines, f"To use it: lanekeep bench SUITE --policies {shlex.quote(str(path))}"]


def chance(outcome: Outcome) -> str:
    """Return what to warn of where the gain on other episodes may be none, else ""."""
    if not outcome.number or outcome.gain.low > 0.0:
        return ""
    return f"the gain on other episodes, {percent(outcome.gain)}, may be none: keep the shipped values"


def percent(gain: Interval) -> str:
    """A gain with its interval."""
    return f"{gain.value:+.2%} (95 %: {gain.low:+.2%} to {gain.high:+.2%})"


def _episodes(drives: Sequence[Drives]) -> int:
    return sum(len(one.returns) for one in drives)


def _failures(drives: Sequence[Drives]) -> float:
    return 1.0 - float(np.concatenate([one.succeeds for one in drives]).mean())
