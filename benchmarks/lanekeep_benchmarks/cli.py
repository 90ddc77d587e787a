"""The `lanekeep` command: environments, benchmark, play, speed."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

import lanekeep_env
from lanekeep_benchmarks.check import commands as check
from lanekeep_benchmarks.endings import Interrupted, disk_errors, input_errors, interruptible, one_line, short
from lanekeep_benchmarks.policies import FILE, check_policy
from lanekeep_benchmarks.replications import WORKS
from lanekeep_benchmarks.suites import ENDING, SUITES
from lanekeep_benchmarks.train_command import train
from lanekeep_benchmarks.zoo import zoo
from lanekeep_env.checks import choose
from lanekeep_env.roads import road_from
from lanekeep_env.walls import world_from

app = typer.Typer(
    name="lanekeep",
    help="Vehicle lateral control: environments, reference controllers, paired benchmark.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.command()(train)
app.command()(zoo)
for name, group in (("road", check.road), ("map", check.map_), ("vehicle", check.vehicle)):
    app.add_typer(group, name=name)

Json = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code. Wrong usage and Ctrl-C are one line on stderr."""
    advice = ""
    try:
        code = app(args=arguments, prog_name="lanekeep", standalone_mode=False)
    except Interrupted as interrupted:
        code, advice = 130, str(interrupted)
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


def _console(stderr: bool = False) -> Console:
    """A console; tables keep a readable width where the output is a file or a pipe."""
    console = Console(stderr=stderr)
    return console if console.is_terminal else Console(stderr=stderr, width=160)


@app.command()
def envs(as_json: Json = False) -> None:
    """List the registered environments with their spaces and channels.

    Example: lanekeep envs --json
    """
    found: list[dict[str, Any]] = []
    for env_id in sorted(lanekeep_env.ENVIRONMENTS):
        env = gym.make(env_id)
        found.append(
            {
                "id": env_id,
                "max_episode_steps": env.unwrapped.scenario.episode_steps,  # type: ignore[attr-defined]
                "action_space": str(env.action_space),
                "observation_space": str(env.observation_space.shape),
                "channels": [
                    {name: getattr(channel, name) for name in ("name", "unit", "low", "high", "description")}
                    for channel in env.unwrapped.scenario.channels  # type: ignore[attr-defined]
                ],
            }
        )
        env.close()
    if as_json:
        print(json.dumps(found))
        return
    console = _console()
    for entry in found:
        title = f"{entry['id']}: action {entry['action_space']}, {entry['max_episode_steps']} steps"
        table = Table(title=title, title_justify="left", title_style="bold")
        for heading in ("channel", "unit", "low", "high", "meaning"):
            table.add_column(heading, justify="right" if heading in ("low", "high") else "left")
        for channel in entry["channels"]:
            bounds = [f"{channel[bound]:.4g}" for bound in ("low", "high")]
            table.add_row(channel["name"], channel["unit"], *bounds, channel["description"])
        console.print(table)


@app.command()
def bench(
    suite: Annotated[
        str | None, typer.Argument(help=f"{', '.join(SUITES)}, or a {ENDING} file of your own; default: classical.")
    ] = None,
    policies: Annotated[
        str | None, typer.Option(help="Names or .json files of policies, comma-separated; the first is the reference.")
    ] = None,
    road: Annotated[Path | None, typer.Option(help="CSV centre line (x, y in m) to drive instead of a suite.")] = None,
    episodes: Annotated[int | None, typer.Option(help="Episodes for each scenario; default: the suite's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Another seed, other episodes; default: 0.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results; default: results/SUITE-TIME.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace results in --out.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Complete the run in --out; options left out are those of that run.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Compare policies on identical episodes: table, result lines, plots.

    Example: lanekeep bench --policies pd,yin-lqr-observer --road my_track.csv --out results/my_track

    A killed run goes on where it stopped: lanekeep bench --resume --out results/my_track
    """
    from lanekeep_benchmarks import benchmark
    from lanekeep_benchmarks.report import caption, terminal_table

    with input_errors():
        plan, folder = benchmark.open_run(
            suite, policies, road, episodes, seed, out=out, overwrite=overwrite, resume=resume
        )
    how = f"; to complete the run: lanekeep bench --resume --out {shlex.quote(str(folder.path))}"
    if resume:
        torn = ", a torn last line was dropped" if folder.torn else ""
        print(f"lanekeep: {len(plan.results)} of {plan.total} episodes are in {folder.path}{torn}", file=sys.stderr)
    with interruptible(how), disk_errors(how), folder, _progress() as progress:
        task = progress.add_task("driving", total=plan.total, completed=len(plan.results))
        for name, count in benchmark.drive(plan, folder):
            progress.update(task, advance=count, description=name)
        progress.update(task, description="tables and plots")
        summary = benchmark.write_report(plan, folder)
    if as_json:
        print(json.dumps({"folder": str(folder.path), **summary}))
        return
    console = _console()
    for entry in summary["scenarios"]:
        console.print(terminal_table(entry, summary["reference"]))
    console.print(caption(summary), highlight=False)
    console.print(f"Results, tables and plots: {folder.path}", highlight=False, soft_wrap=True)


def _progress(unit: str = "episodes") -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit))
    console = _console(stderr=True)
    # Where nobody watches, it would leave an empty line; rich before 14.3 does so even where it is disabled.
    console.quiet = not console.is_terminal
    return Progress(*columns, TimeElapsedColumn(), console=console, transient=True, disable=console.quiet)


@app.command(name="play")
def play_command(
    env_id: Annotated[str, typer.Argument(metavar="ENV", help="A registered id.")] = "lanekeep/LaneKeep-v0",
    policy: Annotated[
        str | None, typer.Option(help="Name of a policy or its .json file; default: one that suits ENV.")
    ] = None,
    gif: Annotated[Path | None, typer.Option(help="File for the pictures; by default one in results/.")] = None,
    human: Annotated[bool, typer.Option("--human", help="Show a window instead of writing a GIF.")] = False,
    road: Annotated[str | None, typer.Option(help="Name of a road or a CSV file.")] = None,
    world: Annotated[str | None, typer.Option(help="Name of a walled world or a map's YAML file.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the episode.")] = 0,
    seconds: Annotated[float, typer.Option(min=0.1, max=120.0, help="Length at the most.")] = 15.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write over an existing GIF.")] = False,
) -> None:
    """Play one episode with a controller, as a GIF or in a window.

    Example: lanekeep play lanekeep/RoadWorks-v0 --policy stanley --gif works.gif
    """
    from lanekeep_benchmarks import play as playing

    with interruptible(""), input_errors():
        if human and gif is not None:
            raise ValueError("--human and --gif exclude each other")
        if "/" not in env_id:
            env_id = f"lanekeep/{env_id}"
        choose("ENV", env_id, lanekeep_env.ENVIRONMENTS)
        if policy is not None:
            check_policy(policy)
        where = playing.place_of(env_id)
        for option, given in (("road", road), ("world", world)):
            if given is not None and option != where:
                raise ValueError(f"--{option} is not for {env_id}; allowed: --{where}")
        keywords: dict[str, Any] = {} if road is None else {"road": road_from(road)}
        if world is not None:
            keywords["world"] = world_from(world)
        policy = policy or playing.preferred(env_id, **keywords)
        place = "".join(f"-{Path(given).stem}" for given in (road, world) if given is not None)
        file = (
            gif
            or Path("results")
            / f"{env_id.rpartition('/')[2]}{place}-{Path(policy).name.removesuffix(FILE)}-seed{seed}.gif"
        )
        if file.suffix.lower() != ".gif":
            raise ValueError(f"--gif {file} must end in .gif")
        if not human and file.exists() and not overwrite:
            raise ValueError(f"{file} exists; give another --gif or --overwrite")
        frames: list[Any] = []
        episode = playing.play(env_id, policy, seed, seconds, None if human else frames.append, **keywords)
        if not human:
            file.parent.mkdir(parents=True, exist_ok=True)
            playing.write_gif(file, frames, episode.seconds)
    left, kept = ("left its lane", "stayed in its lane") if where == "road" else ("touched a wall", "touched none")
    end = left if episode.departed else kept
    if episode.lap_time > 0.0:
        end += f", lap time {episode.lap_time:.2f} s"
    print(
        f"{policy} drove {episode.seconds:.1f} s, RMS lateral error {episode.rms_lateral_error:.3f} m, "
        f"peak {episode.peak_lateral_error:.3f} m, and {end}" + ("" if human else f"; pictures: {file}")
    )


@app.command()
def replicate(
    work: Annotated[str, typer.Argument(help="; ".join(f"{name}: {what}" for name, (_, what) in WORKS.items()))],
    out: Annotated[
        Path | None, typer.Option(help="Folder for tables and figures; default: results/replicate-WORK.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a replication in --out.")] = False,
    as_json: Json = False,
) -> None:
    """Drive a published work again: its figures, and its numbers beside those that come out here.

    Example: lanekeep replicate traechtler --out results/van
    """
    from lanekeep_benchmarks.replications import NOTE, Replication, steps_of
    from lanekeep_env.files import write_atomic

    with interruptible(""), input_errors():
        steps = list(steps_of(work))
        folder = out or Path("results") / f"replicate-{work}"
        if folder.exists() and not folder.is_dir():
            raise ValueError(f"--out {folder} is a file; allowed: a folder, which is made if it is missing")
        if folder.exists() and any(folder.iterdir()) and not overwrite:
            raise ValueError(f"--out {folder} is not empty; name another folder, or pass --overwrite")
        folder.mkdir(parents=True, exist_ok=True)
        found = Replication(WORKS[work][1])
        with _progress("steps") as progress:
            task = progress.add_task("driving", total=len(steps))
            for name, run_step in steps:
                progress.update(task, description=name)
                run_step(found)
                progress.update(task, advance=1)
        for name, picture in found.pictures.items():
            write_atomic(folder / name, picture)
        write_atomic(folder / "replication.json", json.dumps(found.to_dict(), indent=1) + "\n")
        write_atomic(folder / "replication.md", found.markdown())
    if as_json:
        print(json.dumps({"folder": str(folder), **found.to_dict()}))
        return
    console = _console()
    table = Table(title=found.title, title_justify="left")
    for heading in ("quantity", "source", "published", "reproduced", "unit"):
        table.add_column(heading, justify="right" if heading in ("published", "reproduced") else "left")
    for row in found.rows:
        numbers = (f"{number:.{row.digits}f}" for number in (row.published, row.reproduced))
        table.add_row(row.quantity, row.source, *numbers, row.unit)
    console.print(table)
    console.print(NOTE, highlight=False)
    for further in found.tables:
        table = Table(title=Text(further.title), title_justify="left")
        for place, heading in enumerate(further.headings):
            table.add_column(Text(heading), justify="right" if place else "left")
        for cells in further.rows:
            table.add_row(*(Text(cell) for cell in cells))
        console.print(table)
    console.print(f"Tables and figures: {folder}", highlight=False, soft_wrap=True)


@app.command()
def speed(
    quick: Annotated[bool, typer.Option("--quick", help="Fewer and shorter rounds.")] = False,
    as_json: Json = False,
) -> None:
    """Measure env-steps/s beside CartPole and highway-env, and the start-up times.

    Example: lanekeep speed --quick --json
    """
    from lanekeep_benchmarks.speed import measure_rates, measure_start_up, to_json

    with _console(stderr=True).status("measuring") as status:
        speeds = measure_rates(quick, status.update)
        speeds.start_up = measure_start_up(status.update)
    if as_json:
        print(to_json(speeds))
        return
    console = _console()
    rivals = [name for name in speeds.rates if not name.startswith("lanekeep")]
    table = Table(title="Env-steps per second, and times as fast (median of paired ratios)", title_justify="left")
    for heading in ("environment", "env-steps/s", *(f"÷ {rival}" for rival in rivals)):
        table.add_column(heading, justify="left" if heading == "environment" else "right")
    for name, rate in speeds.rates.items():
        ratios = speeds.ratios.get(name, {})
        table.add_row(name, f"{rate:,.0f}", *(f"{ratios[rival]:.2f}" if rival in ratios else "" for rival in rivals))
    console.print(table)
    times = Table(title="Start-up in a fresh process", title_justify="left")
    times.add_column("what")
    times.add_column("seconds", justify="right")
    for name, seconds in speeds.start_up.items():
        times.add_row(name, f"{seconds:.2f}")
    console.print(times)
    for note in speeds.notes:
        console.print(note, highlight=False)
