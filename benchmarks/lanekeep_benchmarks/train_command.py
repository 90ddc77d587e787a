"""`lanekeep train`: a learned policy from one command."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from lanekeep_benchmarks.console import watched
from lanekeep_benchmarks.endings import disk_errors, input_errors, interruptible
from lanekeep_env.checks import shown

if TYPE_CHECKING:
    from lanekeep_agents.policy_record import Training
    from lanekeep_agents.training.settings import TrainingSettings


# Many lines, for half of them declare and describe options.
def train(
    algorithm: Annotated[str | None, typer.Argument(metavar="ALGO", help="ppo, sac or td3.")] = None,
    env_id: Annotated[str | None, typer.Argument(metavar="ENV", help="A registered id.")] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Of the run; default: 0. Another gives another policy.")
    ] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Environment steps; default: the YAML file's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default: results/train-ALGO-TASK-seedSEED.")] = None,
    base: Annotated[str | None, typer.Option(help="Classical controller to correct (residual learning).")] = None,
    bound: Annotated[float | None, typer.Option(help="Largest correction, a share of the largest action.")] = None,
    imitate: Annotated[str | None, typer.Option(help="Classical controller that is imitated first.")] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="A hyper-parameter: --set env.friction=0.6; may be repeated."),
    ] = None,
    callback: Annotated[
        str | None,
        typer.Option(
            metavar="MODULE:FACTORY",
            help="Of Stable-Baselines3, called as well: wandb.integration.sb3:WandbCallback, or my.py:make.",
        ),
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Of torch; small networks are quickest with one.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out from its checkpoint.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the run in --out.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """Train a policy with Stable-Baselines3; it is tried on held-out seeds, and the best one is kept.

    Example: lanekeep train ppo LaneKeep-v0 --seed 3 --out results/mine

    The folder gets the policy (a .json and a .safetensors file, for bench --policies), the evaluations, TensorBoard's
    events and a checkpoint. A killed run goes on where it stopped: lanekeep train --resume --out results/mine
    """
    with input_errors():
        try:
            from lanekeep_agents.training.folder import policy_name
            from lanekeep_agents.training.run import run
        except ModuleNotFoundError as error:
            raise ImportError(f'{error.name} is missing: pip install "lanekeep[agents]"') from error
        given = {
            "seed": seed,
            "steps": steps,
            "base": base,
            "bound": bound,
            "imitate": imitate,
            "changes": changes or None,
        }
        if resume and algorithm is None:
            settings = _settings_as_they_were(out, given)
        elif algorithm is None or env_id is None:
            raise ValueError("ALGO and ENV are missing, e.g. lanekeep train ppo LaneKeep-v0")
        else:
            settings = _settings(algorithm, env_id, given)
        called = None if callback is None else _callback(callback)
        name = policy_name(settings)
        folder = out or Path("results") / f"train-{name}"
    how = f"; to go on: lanekeep train --resume --out {shlex.quote(str(folder))}"
    with interruptible(how), input_errors(), disk_errors(how), _progress() as progress:
        task = progress.add_task(name, total=settings.steps, told="")

        def show(done: int, line: str) -> None:
            progress.update(task, completed=done, told=line)

        policy = run(
            settings, folder, resume=resume, overwrite=overwrite, threads=threads, report=show, callback=called
        )
    file = folder / f"{name}.json"
    if as_json:
        print(json.dumps({"folder": str(folder), "policy": str(file), **policy.record.training.scores}))
    else:
        print(f"{name}: {_in_words(policy.record.training)}\nPolicy: {file}")


def _callback(text: str) -> Any:
    """Make the callback that a person named on the command line."""
    from stable_baselines3.common.callbacks import BaseCallback

    from lanekeep_benchmarks.own_code import FORMS, is_code, load_factory

    if not is_code(text):
        raise ValueError(f"--callback {shown(text)} is not allowed: it must be {FORMS}")
    try:
        made = load_factory(text, "takes nothing and returns a callback of Stable-Baselines3")()
    except (TypeError, ValueError) as error:
        raise ValueError(f"--callback: {str(error).removeprefix('policy ')}") from error
    if not isinstance(made, BaseCallback):
        raise ValueError(f"--callback: {text} made a {type(made).__name__}; it must be a callback of Stable-Baselines3")
    return made


def _settings(algorithm: str, env_id: str, given: dict[str, Any]) -> TrainingSettings:
    """Return those of a new run; ``given`` are the options that change them, None for none."""
    from lanekeep_agents.training.settings import changes_from, settings_for

    asked = {name: given[name] for name in ("base", "bound", "imitate")}
    changes = changes_from(given["changes"] or ())
    try:
        return settings_for(algorithm, env_id, given["seed"] or 0, given["steps"], **changes, **asked)
    except TypeError as error:
        raise ValueError(error) from error


def _settings_as_they_were(out: Path | None, given: dict[str, Any]) -> TrainingSettings:
    """Return those of the run in ``out``; options that would change them are refused."""
    from lanekeep_agents.training.folder import settings_in

    if out is None:
        raise ValueError("--resume needs --out, the folder of the run")
    if any(value is not None for value in given.values()):
        raise ValueError("--resume without ALGO and ENV goes on with the run in --out as it is: no other settings")
    return settings_in(out)


def _in_words(training: Training) -> str:
    """How good the policy is and what it took."""
    scores = training.scores
    return (
        f"return {scores['mean_return']:.4g}, {scores['failure_rate']:.1%} failed, RMS lateral error "
        f"{scores['rms_lateral_error']:.3f} m over {scores['episodes']} held-out episodes; {training.steps:,} steps in "
        f"{training.seconds:.0f} s, {scores['environment_share']:.0%} of it in the environment"
    )


def _progress() -> Progress:
    there = watched()
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    further = (TimeRemainingColumn(), TextColumn("{task.fields[told]}"))
    return Progress(*columns, *further, console=there, transient=True, disable=there.quiet)
