"""What is tried next: Optuna's tree-structured Parzen estimator, as a function of what was tried before.

A fresh sampler for every trial, seeded with the run's seed and the trial's number: a run that was killed goes on as if
it had not been. Optuna's own storages are not used, for some of them unpickle what they read.

Source: J. Bergstra, R. Bardenet, Y. Bengio and B. Kégl, Algorithms for hyper-parameter optimization, NeurIPS 2011.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from lanekeep_benchmarks.tune.space import Space

Values = dict[str, float]


def suggest(space: Space, history: Sequence[tuple[Mapping[str, float], float | None]], seed: int) -> Values:
    """Return what to try after ``history``: values and score, of which more is better, None for one that failed.

    The first trial is the space's start.

    Raises:
        ImportError: Optuna is not installed; names the extra that brings it.
    """
    optuna = _optuna()
    if not history:
        return dict(space.start)
    floats, choices = optuna.distributions.FloatDistribution, optuna.distributions.CategoricalDistribution
    asked = {
        name: choices(one.choices) if one.choices else floats(one.low, one.high, log=one.log)
        for name, one in space.ranges.items()
    }
    sampler = optuna.samplers.TPESampler(seed=seed_of("trial", len(history), seed), multivariate=True)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    states = optuna.trial.TrialState
    for values, score in history:
        state = states.FAIL if score is None else states.COMPLETE
        study.add_trial(optuna.trial.create_trial(state=state, value=score, params=dict(values), distributions=asked))
    return dict(study.ask(asked).params)


def seed_of(*what: object) -> int:
    """A seed for one purpose: 31 bits of a hash, so that episodes of two purposes are others."""
    text = json.dumps(["tune", *what])
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") >> 33


def version() -> str:
    """Return the version of Optuna, on which the trials hang."""
    return str(_optuna().__version__)


def _optuna() -> Any:
    try:
        import optuna
    except ModuleNotFoundError as error:
        raise ImportError(f'{error.name} is missing: pip install "lanekeep[tune]"') from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna
