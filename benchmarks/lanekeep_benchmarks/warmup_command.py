"""`lanekeep warmup`: what the first step of an environment would compile, compiled ahead of time."""

from __future__ import annotations

import json
import time
from typing import Annotated, Any

import gymnasium as gym
import typer

import lanekeep_env
from lanekeep_benchmarks.console import progress
from lanekeep_benchmarks.endings import input_errors, interruptible
from lanekeep_env.checks import choose
from lanekeep_env.envs.skin import PRECISIONS
from lanekeep_env.kernel_cache import cache_root


def warmup(
    ids: Annotated[list[str] | None, typer.Argument(metavar="[ID]...", help="Of these; default: of all.")] = None,
    dtype: Annotated[
        str, typer.Option(help="float64 (what single environments take), float32 (what training takes), or both.")
    ] = "both",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """Compile what the first step of each environment needs, and keep it: an image or a cluster's node starts at once.

    Example: lanekeep warmup

    Example: lanekeep warmup LaneKeep-v0 Drive-v0 --dtype float32
    """
    with input_errors():
        choose("--dtype", dtype, (*PRECISIONS, "both"))
        named = [one if "/" in one else f"lanekeep/{one}" for one in ids or sorted(lanekeep_env.ENVIRONMENTS)]
        for one in named:
            choose("ID", one, lanekeep_env.ENVIRONMENTS)
    precisions = PRECISIONS if dtype == "both" else (dtype,)
    work = [(one, precision) for one in dict.fromkeys(named) for precision in precisions]
    seconds: list[dict[str, Any]] = []
    with interruptible("; what is compiled is kept"), progress("kinds of car") as bar:
        task = bar.add_task("", total=len(work))
        for env_id, precision in work:
            bar.update(task, description=f"{env_id} {precision}")
            seconds.append({"id": env_id, "dtype": precision, "seconds": round(_first_step(env_id, precision), 2)})
            bar.advance(task)
    if as_json:
        print(json.dumps({"folder": str(cache_root()), "first_steps": seconds}))
    else:
        spent = sum(one["seconds"] for one in seconds)
        print(f"{len(work)} kinds of car are ready ({spent:.0f} s; kept in {cache_root()})")


def _first_step(env_id: str, precision: str) -> float:
    """Seconds to a first step; single environments and cars of a vector one run the same code."""
    begin = time.perf_counter()
    env = gym.make_vec(env_id, 1, "vector_entry_point", dtype=precision)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
    return time.perf_counter() - begin
