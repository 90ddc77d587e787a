"""`lanekeep envs`: what is registered, and one environment with its channels and keywords."""

from __future__ import annotations

import inspect
import json
import re
from dataclasses import MISSING, fields
from itertools import groupby
from typing import Annotated, Any

import gymnasium as gym
import typer
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

import lanekeep_env
from lanekeep_benchmarks.console import console
from lanekeep_benchmarks.endings import input_errors
from lanekeep_env.checks import choose, shown


def envs(
    env_id: Annotated[str | None, typer.Argument(metavar="[ID]", help="All of this one; default: a list.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")] = False,
) -> None:
    """List the registered environments, or show one with its channels and keywords.

    Example: lanekeep envs LaneKeep-v0

    Example: lanekeep envs --json
    """
    with input_errors():
        if env_id is not None:
            env_id = env_id if "/" in env_id else f"lanekeep/{env_id}"
            choose("ID", env_id, lanekeep_env.ENVIRONMENTS)
        found = [described(one) for one in sorted(lanekeep_env.ENVIRONMENTS) if env_id in (None, one)]
    if as_json:
        print(json.dumps(found))
    elif env_id is None:
        _print_list(found)
    else:
        _print_one(found[0])


def described(env_id: str) -> dict[str, Any]:
    """All that there is to know of an environment's interface, JSON-able."""
    env = gym.make(env_id)
    inner: Any = env.unwrapped
    scenario = inner.scenario
    page = inspect.cleandoc(type(inner).__doc__ or "")
    meanings = field_meanings(type(scenario))
    env.close()
    return {
        "id": env_id,
        "description": _first_paragraph(page),
        "max_episode_steps": scenario.episode_steps,
        "action_space": str(env.action_space),
        "observation_space": str(env.observation_space.shape),
        "channels": [
            {name: getattr(channel, name) for name in ("name", "unit", "low", "high", "description")}
            for channel in scenario.channels
        ],
        "keywords": [
            {"name": field.name, "default": _default(field), "meaning": meanings.get(field.name, "")}
            for field in fields(scenario)
        ],
    }


def field_meanings(record: type) -> dict[str, str]:
    """What the docstrings of a scenario's class and its bases say of each field."""
    found: dict[str, str] = {}
    for base in reversed(record.__mro__):
        _, _, attributes = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")
        # A field begins at four spaces, and what it says goes on further in.
        for names, text in re.findall(r"^    (\w+(?:, \w+)*): (.*(?:\n {5,}.*)*)", attributes, re.MULTILINE):
            found |= dict.fromkeys(names.split(", "), " ".join(text.split()))
    return found


def _first_paragraph(page: str) -> str:
    text = page.partition("## Description")[2] or page
    return " ".join(text.strip().partition("\n\n")[0].split())


def _default(field: Any) -> str:
    if field.default_factory is not MISSING:
        return shown(field.default_factory())
    return shown(field.default)


def _print_list(found: list[dict[str, Any]]) -> None:
    there = console()
    for entry in found:
        actions = re.search(r"\((\d+),\)", entry["action_space"])
        count = actions[1] if actions else "?"
        told = f": {count} action(s), {len(entry['channels'])} channels, {entry['max_episode_steps']} steps"
        there.print(Text.assemble((entry["id"], "bold"), told))
        what = re.split(r"(?<=\w)[.:] ", entry["description"])[0].rstrip(".")
        there.print(Padding(Text(what), (0, 0, 0, 4)))
    there.print("All of one, with its channels and keywords: lanekeep envs ID", highlight=False)


def _runs(channels: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Channels for people: of numbered ones in a row (a scan) the first and the last."""
    found: list[dict[str, Any]] = []
    for _, run in groupby(channels, lambda channel: re.sub(r"\d+$", "", channel["name"])):
        rows = list(run)
        gap = {**dict.fromkeys(("name", "unit", "description"), "..."), "low": rows[0]["low"], "high": rows[0]["high"]}
        found += rows if len(rows) < 4 else [rows[0], gap, rows[-1]]
    return found


def _print_one(entry: dict[str, Any]) -> None:
    there = console()
    there.print(Text(entry["id"], style="bold"))
    there.print(Text(entry["description"]))
    there.print(f"Action {entry['action_space']}, {entry['max_episode_steps']} steps an episode", highlight=False)
    channels = Table(title="Observation", title_justify="left")
    for heading in ("channel", "unit", "low", "high", "meaning"):
        channels.add_column(heading, justify="right" if heading in ("low", "high") else "left", overflow="fold")
    for channel in _runs(entry["channels"]):
        bounds = (f"{channel[bound]:.4g}" for bound in ("low", "high"))
        texts = (channel["name"], channel["unit"], *bounds, channel["description"])
        channels.add_row(*map(Text, texts))
    there.print(channels)
    keywords = Table(title="Keywords of gym.make", title_justify="left")
    for heading in ("keyword", "default", "meaning"):
        keywords.add_column(heading, overflow="fold")
    for keyword in entry["keywords"]:
        keywords.add_row(*(Text(keyword[part]) for part in ("name", "default", "meaning")))
    there.print(keywords)
