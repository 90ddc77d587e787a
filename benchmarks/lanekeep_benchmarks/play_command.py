"""`lanekeep play`: an episode to look at, a fresh one or one of a run."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

import lanekeep_env
from lanekeep_benchmarks.endings import check_picture, input_errors, interruptible
from lanekeep_benchmarks.policies import FILE, Entry, entry_of
from lanekeep_env.checks import choose, shown
from lanekeep_env.roads import road_from
from lanekeep_env.walls import world_from

POLICY = "Name of a policy, a learned one's .json file, or your own code: module:factory, file.py:factory"

#: How an episode ends that failed, and one that did not, by `play.place_of`.
_ENDS = {"road": ("left its lane", "stayed in its lane"), "world": ("touched a wall", "touched none")}


def play_command(
    env_id: Annotated[
        str | None, typer.Argument(metavar="ENV", help="A registered id; default: lanekeep/LaneKeep-v0.")
    ] = None,
    policy: Annotated[str | None, typer.Option(help=f"{POLICY}; default: one that suits ENV.")] = None,
    gif: Annotated[Path | None, typer.Option(help="File for the pictures; by default one in results/.")] = None,
    human: Annotated[bool, typer.Option("--human", help="Show a window instead of writing a GIF.")] = False,
    road: Annotated[str | None, typer.Option(help="Name of a road or a CSV file.")] = None,
    world: Annotated[str | None, typer.Option(help="Name of a walled world or a map's YAML file.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the episode; default: 0.")] = None,
    seconds: Annotated[float | None, typer.Option(help="Length at the most; default: 15.")] = None,
    run: Annotated[Path | None, typer.Option(help="Results folder, of which one episode is driven again.")] = None,
    episode: Annotated[int | None, typer.Option(min=0, help="Its number in the run.")] = None,
    scenario: Annotated[str | None, typer.Option(help="Its scenario, where the run has several.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write over an existing GIF.")] = False,
) -> None:
    """Play one episode with a controller, as a GIF or in a window.

    Example: lanekeep play lanekeep/RoadWorks-v0 --policy stanley --gif works.gif

    Example: lanekeep play --run results/my_run --scenario nominal --policy stanley --episode 17
    """
    from lanekeep_benchmarks import play as playing

    with interruptible(""), input_errors():
        if human and gif is not None:
            raise ValueError("--human and --gif exclude each other")
        if human:
            _check_display()
        if (run is None) != (episode is None):
            raise ValueError("--run and --episode go together: a results folder, and the number of an episode in it")
        drive, name = (
            _fresh(env_id, policy, road, world, seed, scenario)
            if run is None or episode is None
            else _again(
                run, episode, scenario, policy, {"ENV": env_id, "--road": road, "--world": world, "--seed": seed}
            )
        )
        file = gif or Path("results") / f"{name}.gif"
        if not human:
            if gif is None:
                file.parent.mkdir(exist_ok=True)
            check_picture(file, overwrite, "--gif", ".gif")
        film = playing.Film()
        driven = playing.play(drive, seconds, None if human else film.see)
        if not human:
            playing.write_gif(file, film.frames, driven.seconds)
    failed, kept = _ENDS.get(playing.place_of(drive.env_id), ("failed", "did not fail"))
    end = driven.mishap or (failed if driven.departed else kept)
    if driven.lap_time > 0.0:
        end += f", {'parked after' if driven.parked else 'lap time'} {driven.lap_time:.2f} s"
    print(
        f"{drive.policy.name} drove {driven.seconds:.1f} s, RMS lateral error {driven.rms_lateral_error:.3f} m, "
        f"peak {driven.peak_lateral_error:.3f} m, and {end}" + ("" if human else f"; pictures: {file}")
    )


def _again(run: Path, episode: int, scenario: str | None, policy: str | None, fresh: dict[str, Any]) -> tuple[Any, str]:
    """Return the drive of an episode of a results folder, and its name; ``fresh`` are options of others, by name."""
    from lanekeep_benchmarks import play as playing
    from lanekeep_benchmarks.replay import find_line

    if idle := [name for name, given in fresh.items() if given is not None]:
        raise ValueError(f"--run drives an episode of that run as it was; leave {' and '.join(idle)} out")
    found = find_line(run, episode, scenario, policy)
    return playing.Drive.of_line(found), f"{found.line.scenario}-{_in_a_path(found.policy.name)}-episode{episode}"


def _fresh(
    env_id: str | None, policy: str | None, road: str | None, world: str | None, seed: int | None, scenario: str | None
) -> tuple[Any, str]:
    """Return the drive of an episode of an environment, on a road or in a world of the user's choice, and its name."""
    from lanekeep_benchmarks import play as playing

    if scenario is not None:
        raise ValueError(f"--scenario {shown(scenario)} has no effect without --run")
    env_id, seed = env_id or "LaneKeep-v0", seed or 0
    if "/" not in env_id:
        env_id = f"lanekeep/{env_id}"
    choose("ENV", env_id, lanekeep_env.ENVIRONMENTS)
    entry: Entry | None = None if policy is None else entry_of(policy)
    where = playing.place_of(env_id)
    for option, given in (("road", road), ("world", world)):
        if given is not None and option != where:
            raise ValueError(f"--{option} is not for {env_id}; allowed: --{where}")
    keywords: dict[str, Any] = {} if road is None else {"road": road_from(road)}
    if world is not None:
        keywords["world"] = world_from(world)
    drive = playing.Drive.fresh(env_id, entry or entry_of(playing.preferred(env_id, **keywords)), seed, keywords)
    place = "".join(f"-{Path(given).stem}" for given in (road, world) if given is not None)
    return drive, f"{drive.env_id.rpartition('/')[2]}{place}-{_in_a_path(drive.policy.name)}-seed{seed}"


def _check_display() -> None:
    """Raise ValueError where no window can be seen, unless SDL_VIDEODRIVER says that none shall be."""
    import pygame

    try:
        pygame.display.init()
        seen = "SDL_VIDEODRIVER" in os.environ or pygame.display.get_driver() not in ("dummy", "offscreen")
    except pygame.error:
        seen = False
    if not seen:
        raise ValueError("--human needs a display, and there is none; leave it out for a GIF")


def _in_a_path(policy: str) -> str:
    """A policy's name as part of that of a file."""
    return Path(policy).name.removesuffix(FILE).replace(":", "-")
