"""Paired evaluation of policies: suites, statistics, report, plots and the `lanekeep` command.

>>> import lanekeep_benchmarks
>>> summary = lanekeep_benchmarks.benchmark("classical", ["stanley", my_factory], episodes=16)  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lanekeep_benchmarks.reading import read
from lanekeep_env.checks import shown

if TYPE_CHECKING:
    from lanekeep_benchmarks.engines import Engine
    from lanekeep_benchmarks.suites import Suite

__all__ = ["Engine", "benchmark", "read"]


def __getattr__(name: str) -> Any:
    # Learned when it is asked for: it brings every environment with it.
    if name == "Engine":
        from lanekeep_benchmarks.engines import Engine

        return Engine
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


# Nine parameters, for each is a keyword of users' own, as the options of `lanekeep bench` are.
def benchmark(
    suite: str | Suite = "classical",
    policies: Sequence[Any] | None = None,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    trace: bool = False,
    engine: str | Engine = "serial",
) -> dict[str, Any]:
    """Compare policies on identical episodes, as `lanekeep bench` does: the same folder, tables and plots.

    Args:
        suite: a name, the path of a TOML file, or a `Suite`.
        policies: names, paths of learned policies, ``"module:factory"``, ``"file.py:factory"``, factories (which take a
            scenario and return a policy) and policies (objects with ``predict``); the first is the reference. None for
            those of the suite.
        episodes: of each scenario; None for the suite's number.
        seed: another one gives other episodes; None for 0, or for that of the run to complete.
        out: folder of the results; None for one below ``results/``.
        overwrite: replace results in ``out``.
        resume: complete the run in ``out``. What has no source to tell by whether it is the same cannot be resumed.
        engine: "serial", "processes" or "ray", or an `Engine` that says more; result lines are the same. Scripts that
            use another than the first run under ``if __name__ == "__main__":``.
        trace: keep every step of every episode, not only of those that failed; `read` returns them.

    Returns:
        What `summary.json` holds, and ``folder``.

    Raises:
        ValueError, OSError: something is not allowed or unknown; one line that names it. Nothing is driven then.
        lanekeep_benchmarks.own_code.OwnCodeError: a ValueError, where one of the policies failed while it drove.
    """
    from lanekeep_benchmarks.engines import Engine
    from lanekeep_benchmarks.reporting import write_report
    from lanekeep_benchmarks.runs import Options, drive, open_run

    if policies is not None and (isinstance(policies, str) or not isinstance(policies, Sequence)):
        raise ValueError(f"policies={shown(policies)} is not allowed: it must be a list, e.g. ['stanley', 'pd']")
    options = Options(
        suite=suite,
        policies=None if policies is None else tuple(policies),
        episodes=episodes,
        seed=seed,
        out=None if out is None else Path(out),
        overwrite=overwrite,
        resume=resume,
        trace=trace,
        engine=Engine(engine) if isinstance(engine, str) else engine,
    )
    plan, folder = open_run(options)
    with folder:
        for _ in drive(plan, folder):
            pass
        return {"folder": str(folder.path), **write_report(plan, folder)}
