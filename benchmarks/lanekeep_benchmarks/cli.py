"""The `lanekeep` command: its commands, in the order in which one meets them, and how it ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

import lanekeep_env
from lanekeep_benchmarks.bench_command import bench
from lanekeep_benchmarks.bound_command import bound
from lanekeep_benchmarks.check import commands as check
from lanekeep_benchmarks.distil_command import distil
from lanekeep_benchmarks.endings import (
    ClosedOutput,
    Interrupted,
    one_line,
    open_output,
    plain_warnings,
    short,
)
from lanekeep_benchmarks.envs_command import envs
from lanekeep_benchmarks.export_command import export
from lanekeep_benchmarks.margins_command import margins_command
from lanekeep_benchmarks.new_command import new
from lanekeep_benchmarks.play_command import play_command
from lanekeep_benchmarks.replicate_command import replicate
from lanekeep_benchmarks.speed.command import speed
from lanekeep_benchmarks.train_command import train
from lanekeep_benchmarks.tune.command import tune
from lanekeep_benchmarks.verify.command import verify
from lanekeep_benchmarks.warmup_command import warmup
from lanekeep_benchmarks.zoo import zoo

app = typer.Typer(
    name="lanekeep",
    help="Vehicle lateral control: environments, reference controllers, paired benchmark.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        print(f"lanekeep {lanekeep_env.__version__}")
        raise typer.Exit()


@app.callback()
def _everything(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """What comes before a command."""


app.command()(bench)
app.command()(envs)
app.command(name="play")(play_command)
app.command()(export)
app.command()(verify)
app.command()(replicate)
app.command(name="margins")(margins_command)
app.command()(train)
app.command()(distil)
app.command()(tune)
app.command()(zoo)
app.command()(bound)
app.command()(speed)
app.command()(warmup)
for name, group in (("new", new), ("road", check.road), ("map", check.map_), ("vehicle", check.vehicle)):
    app.add_typer(group, name=name)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code. Wrong usage and Ctrl-C are one line on stderr."""
    advice = ""
    try:
        with plain_warnings(), open_output():
            code = app(args=arguments, prog_name="lanekeep", standalone_mode=False)
    except Interrupted as interrupted:
        code, advice = 130, str(interrupted)
    except ClosedOutput as closed:
        print(f"lanekeep: {closed}", file=sys.stderr)
        return 1
    except typer.Abort:
        code = 130
    except Exception as error:
        # typer's usage errors: which class they are differs between its versions, what they can do does not.
        if not hasattr(error, "format_message"):
            raise
        message = short(one_line(error.format_message()))
        if message:  # a bare `lanekeep` has printed its help instead
            print(f"lanekeep: {message} (see lanekeep --help)", file=sys.stderr)
        return 2
    if code == 130:  # typer's own code for Ctrl-C, too
        print(f"lanekeep: interrupted{advice}", file=sys.stderr)
    return code if isinstance(code, int) else 0
