"""One benchmark run from its options to its result lines: plan, folder, drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lanekeep_benchmarks.engines import Engine, Work, check_travels, drive_all
from lanekeep_benchmarks.evaluate import batches
from lanekeep_benchmarks.own_code import is_code
from lanekeep_benchmarks.plan import Plan, make_plan
from lanekeep_benchmarks.policies import FILE
from lanekeep_benchmarks.results import ResultFolder, default_folder, written
from lanekeep_benchmarks.run_record import RunRecord
from lanekeep_benchmarks.suites import Suite


@dataclass(frozen=True)
class Options:
    """What a person asks for; None where it is left out, and then the suite's, or that of the run to complete.

    Those of `lanekeep_benchmarks.benchmark`, and ``road``, the file of a centre line to drive instead of a suite, whose
    points scatter by ``smoothing``, m.
    """

    suite: str | Suite | None = None
    policies: Sequence[Any] | None = None
    road: Path | None = None
    smoothing: float | None = None
    episodes: int | None = None
    seed: int | None = None
    out: Path | None = None
    overwrite: bool = False
    resume: bool = False
    trace: bool = False
    engine: Engine = field(default_factory=Engine)


def open_run(options: Options) -> tuple[Plan, ResultFolder]:
    """Read the options and open the folder; what a resumed run has driven already is in the plan's results.

    Raises:
        ValueError, OSError: options that are not allowed, or a folder that holds results which must stay.
    """
    resume, out = options.resume, options.out
    if resume and out is None:
        raise ValueError("--resume needs --out, the folder of the run to complete")
    if resume and options.overwrite:
        raise ValueError("--resume and --overwrite exclude each other; the one keeps results, the other removes them")
    if resume and out is not None and (found := RunRecord.read(out)) is not None:
        options = _of_the_run(options, found)
    elif resume and options.suite is None and options.road is None and options.policies is None:
        raise ValueError(
            f"--out {out} holds no run to resume; name its folder, or a SUITE or --road to start one there"
        )
    seed = 0 if options.seed is None else options.seed
    plan = make_plan(options.suite, options.policies, options.road, options.episodes, seed, options.smoothing)
    plan.trace, plan.engine = options.trace, options.engine
    check_travels(plan.engine, {name: entry.given for name, entry in plan.entries.items()})
    folder = ResultFolder(out or default_folder(plan.suite.name), plan.record, options.overwrite, resume)
    plan.results += folder.earlier
    return plan, folder


def _of_the_run(options: Options, found: RunRecord) -> Options:
    """The options with what is left out as it is in the run to complete."""
    if options.suite is None and options.road is None:
        road = None if found.road is None else Path(found.road)
        suite = (found.suite_file or found.suite) if road is None else None
        smoothing = found.smoothing if options.smoothing is None else options.smoothing
        options = replace(options, suite=suite, road=road, smoothing=smoothing)
    return replace(
        options,
        policies=_named_in(found) if options.policies is None else options.policies,
        episodes=found.episodes if options.episodes is None else options.episodes,
        seed=found.seed if options.seed is None else options.seed,
        trace=options.trace or found.trace,
    )


def _named_in(record: RunRecord) -> tuple[str, ...]:
    """The policies of a run to complete; what it calls code is not run because a file says so."""
    code = [name for name in record.policies if is_code(name) and not name.endswith(FILE)]
    if code:
        raise ValueError(
            f"{', '.join(code)} of that run is code of your own, which is run only where you name it: "
            f"--policies {','.join(record.policies)}"
        )
    return tuple(record.policies)


def drive(plan: Plan, folder: ResultFolder) -> Iterator[tuple[str, int]]:
    """Drive what has no result yet; yield (what was driven, how many) when it is on disk."""
    done = {result.place for result in plan.results}
    work = Work(
        plan.suite.name,
        plan.seed,
        "all" if plan.trace else "failed",
        {name: entry.given for name, entry in plan.entries.items()},
        plan.policy_sha256,
    )
    missing = batches(plan.suite, plan.drivers, plan.episodes, done)
    for lines in written(folder, drive_all(plan.engine, work, missing, plan.policy)):
        plan.results += lines
        yield f"{lines[0].scenario}: {lines[0].policy}", len(lines)
