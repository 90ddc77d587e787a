"""`lanekeep distil`: a policy with memory from a teacher who knows the car, without a gradient."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated

import typer

from lanekeep_benchmarks.console import progress
from lanekeep_benchmarks.endings import disk_errors, input_errors, interruptible


def distil(
    env_id: Annotated[str | None, typer.Argument(metavar="ID", help="A registered id, e.g. LaneKeep-v0.")] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Of the run; default: 0. Another gives another policy.")
    ] = None,
    mix: Annotated[Path | None, typer.Option(help="A .toml file of sets to learn from; default: the id's own.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder; default: results/distilled-TASK-seedSEED.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the run in --out.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """Distil a policy with memory: a classical controller, corrected by what the drive tells of car and sensors.

    A teacher who knows the road to its end and the true car drives sets of cars that differ (the optimum of lanekeep
    bound, with its feedback). Then, round by round, the student drives, the teacher says at every step what it would
    have done and what the difference costs, and weighted least squares give the student's weights. After each round it
    is scored on episodes that nothing is learned from; the best round is kept.

    Example: lanekeep distil LaneKeep-v0 --seed 3 --out results/mine

    Then: lanekeep bench learned --policies lq-preview-offset-free,results/mine/distilled-lane-keep-seed3.json

    The same seed gives the same weights. A killed run goes on: lanekeep distil --resume --out results/mine. What is
    learned from is a file like lanekeep_agents/distil/LaneKeep-v0.toml: --mix my_mix.toml. RoadWorks-v0, Evasive-v0 and
    ReversePath-v0 have one as well.
    """
    from lanekeep_agents.distil.run import Distillation, settings_for, settings_in

    with input_errors():
        if resume and env_id is None:
            if out is None:
                raise ValueError("--resume needs --out, the folder of the run")
            if seed is not None or mix is not None:
                raise ValueError("--resume without ID goes on with the run in --out as it is: no other options")
            settings = settings_in(out)
        elif env_id is None:
            raise ValueError("ID is missing, e.g. lanekeep distil LaneKeep-v0")
        else:
            settings = settings_for(env_id, seed or 0, mix)
        folder = out or Path("results") / settings.name
        run = Distillation(settings, folder, resume, overwrite)
    how = f"; to go on: lanekeep distil --resume --out {shlex.quote(str(folder))}"
    with interruptible(how), input_errors(), disk_errors(how), progress("drives") as bar:
        task = bar.add_task(settings.name, total=None)
        policy = run.run(lambda done, total, words: bar.update(task, completed=done, total=total, description=words))
    scores, file = policy.record.training.scores, folder / f"{settings.name}.json"
    if as_json:
        print(json.dumps({"folder": str(folder), "policy": str(file), **scores}))
        return
    best, rounds = scores["held_out_cost_over_base"], ", ".join(f"{one:.1%}" for one in scores["rounds"])
    print(
        f"{settings.name}: {best:.1%} of {policy.record.base}'s cost on held-out episodes (rounds: {rounds}), "
        f"{policy.record.training.seconds:.0f} s\nPolicy: {file}"
    )
