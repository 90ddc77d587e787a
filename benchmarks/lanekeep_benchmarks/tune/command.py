"""`lanekeep tune`: values of a controller, or of a learning algorithm, found by a search on training roads."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lanekeep_benchmarks.console import progress
from lanekeep_benchmarks.endings import disk_errors, input_errors, interruptible

if TYPE_CHECKING:
    from lanekeep_benchmarks.tune.settings import TuneSettings


def tune(
    policy: Annotated[
        str | None, typer.Argument(metavar="POLICY", help="A classical controller, or ppo, sac or td3.")
    ] = None,
    env_id: Annotated[str | None, typer.Argument(metavar="ID", help="A registered id; default: LaneKeep-v0.")] = None,
    trials: Annotated[
        int | None, typer.Option(min=1, help="The budget; the shipped values are the first. Default: 50.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default: results/tune-POLICY-ID.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of search, episodes and trainings; default: 0.")] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="Environment steps of each training; default: the YAML file's.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out.")] = False,
) -> None:
    """Tune a controller's weights or a learning algorithm's hyper-parameters, with a budget that the record states.

    Optuna's TPE asks for values; each trial drives the same held-out episodes on training roads, of cars that differ:
    those that students learn from (lanekeep distil) where the id has such a mix. The score is the gain in return over
    the shipped values, in shares of theirs, all sets alike. The best trial is judged on episodes of its own.

    Example: lanekeep tune lq-preview-offset-free LaneKeep-v0 --trials 50 --out results/tuned

    Then: lanekeep bench learned --policies lq-preview-offset-free,results/tuned/best.json

    The same seed gives the same trials. A killed run goes on: lanekeep tune --resume --out results/tuned
    """
    with input_errors():
        from lanekeep_benchmarks.tune.run import BEST, PICTURE, Tuning
        from lanekeep_benchmarks.tune.settings import settings_in

        if resume and policy is None:
            if out is None:
                raise ValueError("--resume needs --out, the folder of the run")
            if any(given is not None for given in (trials, seed, steps)):
                raise ValueError("--resume without POLICY goes on with the run in --out as it is: no other options")
            settings = settings_in(out)
        else:
            settings = _settings(policy, env_id, trials, seed, steps)
        folder = out or Path("results") / f"tune-{settings.policy}-{settings.env_id.rpartition('/')[2]}"
        run = Tuning(settings, folder, resume)
    how = f"; to go on: lanekeep tune --resume --out {shlex.quote(str(folder))}"
    with interruptible(how), input_errors(), disk_errors(how), progress("trials") as bar:
        task = bar.add_task(settings.policy, total=settings.trials, completed=len(run.trials))
        outcome = run.run(lambda done, words: bar.update(task, completed=done, description=words))
        from lanekeep_benchmarks.tune.picture import plot_trials
        from lanekeep_benchmarks.tune.record import best_text, chance, command, in_words
        from lanekeep_env.files import write_atomic

        write_atomic(folder / PICTURE, plot_trials(command(settings), run.space, run.trials))
        if not (folder / BEST).exists():  # a run that has driven with it goes by its bytes
            write_atomic(folder / BEST, best_text(settings, outcome, folder))
    print("\n".join(in_words(settings, outcome, folder)))
    if warning := chance(outcome):
        print(f"lanekeep: {warning}", file=sys.stderr)


def _settings(
    policy: str | None, env_id: str | None, trials: int | None, seed: int | None, steps: int | None
) -> TuneSettings:
    from lanekeep_benchmarks.tune.settings import settings_for

    if policy is None:
        raise ValueError("POLICY is missing, e.g. lanekeep tune lq-preview-offset-free --trials 50")
    return settings_for(policy, env_id or "LaneKeep-v0", 50 if trials is None else trials, seed or 0, steps)
