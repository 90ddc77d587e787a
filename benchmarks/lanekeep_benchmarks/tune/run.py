"""A run of `lanekeep tune` in its folder: every trial is on disk when it is done, and a killed run goes on."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lanekeep_agents.training.evaluation import Drives
from lanekeep_benchmarks.statistics import Interval, means
from lanekeep_benchmarks.tune.drives import Course, Failed, Trials, paired_gains, score_of
from lanekeep_benchmarks.tune.search import Values, seed_of, suggest
from lanekeep_benchmarks.tune.settings import JUDGED, MOST, SETTINGS, TuneSettings
from lanekeep_benchmarks.tune.space import is_learned, space_of
from lanekeep_env.checks import require, shown, shown_path
from lanekeep_env.files import locked, read_bounded, require_ordinary, write_atomic
from lanekeep_env.plain import parse_json

TRIALS, SECONDS, BEST, PICTURE = "trials.jsonl", "cpu_seconds.json", "best.json", "trials.png"
LARGEST = 1 << 26

#: Called with trials done and a line of words.
Report = Callable[[int, str], None]


class Trial(NamedTuple):
    """What was tried and what came of it.

    Attributes:
        values: by name.
        score: `score_of` its returns, None where the policy cannot be made or drives out of all bounds.
        returns: mean, a set each.
        failed: share of episodes, a set each.
        steps: of the environment, those of a training included.
    """

    values: Values
    score: float | None
    returns: list[float]
    failed: list[float]
    steps: int

    def line(self, number: int) -> str:
        """As the folder keeps it."""
        return json.dumps({"trial": number, **self._asdict()}) + "\n"


class Outcome(NamedTuple):
    """The best trial of a run, judged on episodes of its own.

    Attributes:
        number: of the trial, 0 where nothing beat the shipped values.
        best: that trial.
        gain: over the shipped values on other episodes, a share of their return.
        shipped, tuned: drives there, a set each.
        cpu_seconds: of all trials.
        steps: of all trials.
    """

    number: int
    best: Trial
    gain: Interval
    shipped: list[Drives]
    tuned: list[Drives]
    cpu_seconds: float
    steps: int


class Tuning:
    """A run in its folder.

    Args:
        settings: of the run.
        folder: made if it is missing.
        resume: go on with that very run.

    Raises:
        ValueError: the folder holds a run and ``resume`` is not set, or another one.
    """

    def __init__(self, settings: TuneSettings, folder: Path, resume: bool = False) -> None:
        self.settings, self.folder = settings, folder
        self.space = space_of(settings.policy, settings.env_id)
        if folder.exists() and not folder.is_dir():
            raise ValueError(f"--out {folder} is a file; allowed: a folder, which is made if it is missing")
        files = [folder / name for name in (SETTINGS, TRIALS, SECONDS, BEST, PICTURE)]
        require_ordinary(*files)
        if resume and not files[0].exists():
            raise ValueError(f"--out {folder} holds no run to resume ({SETTINGS} is missing)")
        if not resume and any(file.exists() for file in files):
            raise ValueError(f"--out {folder} already holds a run; name another folder, or go on with it: --resume")
        if resume and read_bounded(files[0], LARGEST).decode(errors="replace") != settings.text():
            raise ValueError(f"--out {folder} holds another run, or one of another version; name another folder")
        self.trials: list[Trial] = self._read() if resume else []

    def run(self, report: Report | None = None) -> Outcome:
        """Do the trials that are left, judge the best one on other episodes and return it."""
        told = report or (lambda done, words: None)
        made, course = Trials(self.settings, self.folder), Course(self.settings, "search")
        if not is_learned(self.settings.policy):
            course.check(self.settings.policy)
        self.folder.mkdir(parents=True, exist_ok=True)
        with locked(self.folder):
            write_atomic(self.folder / SETTINGS, self.settings.text())
            seconds = self._seconds()
            while len(self.trials) < self.settings.trials:
                began = time.process_time()
                self._try(made, course, told)
                seconds = [*seconds[: len(self.trials) - 1], round(time.process_time() - began, 3)]
                write_atomic(self.folder / SECONDS, json.dumps(seconds) + "\n")
                text = "".join(one.line(number) for number, one in enumerate(self.trials))
                write_atomic(self.folder / TRIALS, text)
                told(len(self.trials), f"best {self.trials[self.best].score:+.2%}")
            return self._judged(made, sum(seconds), told)

    @property
    def best(self) -> int:
        """Number of the trial with the highest score, the first of equal ones."""
        return max(range(len(self.trials)), key=lambda i: (_order(self.trials[i]), -i))

    def _try(self, made: Trials, course: Course, told: Report) -> None:
        number = len(self.trials)
        values = self._asked(number)
        steps = self.settings.steps or 0
        try:
            policy = made.make(number, values, lambda line: told(number, f"trial {number}: {line}"))
            drives = course.drive(policy)
        except Failed:
            if number == 0:  # the shipped values: an error of the user's
                raise
            self.trials.append(Trial(values, None, [], [], steps))
            return
        returns = [float(one.returns.mean()) for one in drives]
        failed = [float(1.0 - one.succeeds.mean()) for one in drives]
        steps += sum(int(one.steps.sum()) for one in drives)
        shipped = self.trials[0].returns if number else returns
        self.trials.append(Trial(values, score_of(returns, shipped), returns, failed, steps))

    def _asked(self, number: int) -> Values:
        history = [(one.values, one.score) for one in self.trials[:number]]
        return suggest(self.space, history, self.settings.seed)

    def _judged(self, made: Trials, seconds: float, told: Report) -> Outcome:
        told(self.settings.trials, "on other episodes")
        number, course = self.best, Course(self.settings, "judge", JUDGED)
        shipped = course.drive(made.make(0, self.trials[0].values, lambda line: None))
        tuned = course.drive(made.make(number, self.trials[number].values, lambda line: None)) if number else shipped
        generator = np.random.default_rng(seed_of("resamples", self.settings.seed))
        gain = means(paired_gains(tuned, shipped)[:, None], generator)[0]
        steps = sum(one.steps for one in self.trials)
        return Outcome(number, self.trials[number], gain, shipped, tuned, round(seconds, 1), steps)

    def _seconds(self) -> list[float]:
        """CPU time of each trial; of those that an interrupted write has lost 0."""
        try:
            found = parse_json(read_bounded(self.folder / SECONDS, LARGEST))
        except FileNotFoundError:
            found = []
        except ValueError as error:
            raise ValueError(f"{shown_path(self.folder / SECONDS)}: {error}") from None
        if not isinstance(found, list) or len(found) > MOST:
            raise ValueError(f"{shown_path(self.folder / SECONDS)} is not a list of seconds")
        for one in found:
            require(str(self.folder / SECONDS), one, "s", at_least=0.0)
        return [*found, *[0.0] * len(self.trials)][: len(self.trials)]

    def _read(self) -> list[Trial]:
        """Return the trials so far; a line that this run has not written is refused."""
        file = self.folder / TRIALS
        try:
            lines = read_bounded(file, LARGEST).decode().splitlines()
        except FileNotFoundError:
            return []
        except ValueError as error:
            raise ValueError(f"{shown_path(file)}: {error}") from None
        if not 1 <= len(lines) <= self.settings.trials:
            raise ValueError(
                f"{shown_path(file)} has {len(lines)} trials; it must have 1 to {self.settings.trials}, or be missing"
            )
        self.trials = []
        for number, line in enumerate(lines):
            try:
                self.trials.append(self._trial(number, parse_json(line)))
            except (ValueError, TypeError, AttributeError, KeyError) as error:
                raise ValueError(
                    f"{shown_path(file)}, line {number + 1} is not of this run: {shown(str(error))}"
                ) from None
        return self.trials

    def _trial(self, number: int, found: Any) -> Trial:
        """Check a line: the search asks for these values, and the score is that of the returns."""
        if set(found) != {"trial", *Trial._fields} or found["trial"] != number:
            raise ValueError(f"it must be trial {number} with {', '.join(Trial._fields)}")
        trial = Trial(**{name: found[name] for name in Trial._fields})
        if trial.values != self._asked(number):
            raise ValueError(f"the search asks for other values than {trial.values}")
        require("steps", trial.steps, "", at_least=0, whole=True)
        sets = len(self.settings.drills)
        if trial.score is None and number and trial.returns == trial.failed == []:
            return trial
        for name, numbers in (("returns", trial.returns), ("failed", trial.failed)):
            if len(numbers) != sets:
                raise ValueError(f"{name} must be {sets} numbers")
            for one in numbers:
                require(name, one, "")
        shipped = self.trials[0].returns if number else trial.returns
        if trial.score != score_of(trial.returns, shipped):
            raise ValueError(f"score={trial.score} is not that of the returns")
        return trial


def _order(trial: Trial) -> float:
    return -np.inf if trial.score is None else trial.score
