"""From a TOML file to a suite: bounded, every field checked, errors of one line that name file and field."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lanekeep_benchmarks.metrics import METRICS
from lanekeep_benchmarks.suites.records import Suite, SuiteScenario
from lanekeep_env import ENVIRONMENTS
from lanekeep_env.adapters import full_ids
from lanekeep_env.checks import LONGEST_ECHO, choose, nearest, require, shown, shown_path
from lanekeep_env.files import read_bounded

#: How the path of a suite's file ends.
ENDING = ".toml"
#: Bytes, and characters of a line, beyond which it is not read; the package's own have some 3000 and 120.
LARGEST_FILE, LONGEST_LINE = 1 << 16, 1000
#: Levels of lists and tables in each other that a keyword may have.
DEEPEST = 8
#: Episodes of each scenario that a suite may ask for.
MOST_EPISODES = 1_000_000
#: Names become parts of the names of files.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")

_COMMON: dict[str, type] = {
    "env_id": str,
    "keywords": dict,
    "options": dict,
    "told": dict,
    "max_episode_steps": int,
    "metrics": list,
}
_SCENARIO: dict[str, type] = {"name": str, "title": str, **_COMMON}
_SUITE: dict[str, type] = {
    "name": str,
    "description": str,
    "episodes": int,
    "policies": list,
    "learned": bool,
    "reference": str,
    "per_environment": bool,
    "common": dict,
    "scenario": list,
}
_KINDS = {str: "a text", int: "a whole number", bool: "true or false", list: "a list", dict: "a table"}


def read_suite(path: str | Path) -> Suite:
    """Read the suite in a file.

    Its ``common`` table has fields of all scenarios; a scenario's own come before them, keyword by keyword.

    Raises:
        ValueError: it is missing, or is not a suite: one line with the file, the field, its value and what is allowed.
    """
    try:
        return _suite(_parse(read_bounded(path, LARGEST_FILE)))
    except ValueError as error:
        raise ValueError(f"suite {shown_path(path)}: {error}") from None
    except OSError as error:
        raise ValueError(f"suite {shown_path(path)}: {error.strerror}; allowed: the path of a {ENDING} file") from None


def _parse(content: bytes) -> dict[str, Any]:
    """Read TOML; ValueError, one line with the line's number, where it is none."""
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        number = content.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {number} is not UTF-8") from None
    for number, line in enumerate(text.split("\n"), start=1):
        if len(line) > LONGEST_LINE:  # a key of thousands of parts would take a minute
            raise ValueError(f"line {number} has {len(line)} characters, allowed are {LONGEST_LINE}")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, _, place = str(error).rpartition(" (at ")
        raise ValueError(f"it is not TOML: {_cut(what)} (at {place}") from None
    except RecursionError:
        raise ValueError(f"it is nested deeper than {DEEPEST} levels") from None


def _suite(table: dict[str, Any]) -> Suite:
    _check_fields("", table, _SUITE, needed=("name", "description", "episodes", "scenario"))
    _check_name("name", table["name"])
    _check_line("description", table["description"])
    require("episodes", table["episodes"], "", at_least=1, at_most=MOST_EPISODES)
    common = table.pop("common", {})
    _check_fields("common.", common, _COMMON)
    tables = table.pop("scenario")
    if not tables:
        raise ValueError("scenario=[] is not allowed: it must have one or more tables [[scenario]]")
    scenarios = tuple(_scenario(f"scenario {number}: ", one, common) for number, one in enumerate(tables, start=1))
    _check_distinct("the names of scenarios", [scenario.name for scenario in scenarios])
    policies = table.pop("policies", None)
    if policies is not None:
        _check_policies(policies)
    return Suite(scenarios=scenarios, policies=tuple(policies or ()), **table)


def _scenario(where: str, table: Any, common: Mapping[str, Any]) -> SuiteScenario:
    if not isinstance(table, dict):
        raise ValueError(f"{where}{shown(table)} is not allowed: it must be a table [[scenario]]")
    _check_fields(where, table, _SCENARIO, needed=("name", "title"))
    _check_name(f"{where}name", table["name"])
    _check_line(f"{where}title", table["title"])
    fields = {**common, **table}
    for part in ("keywords", "options", "told"):
        fields[part] = {**common.get(part, {}), **table.get(part, {})}
    fields["metrics"] = tuple(fields.get("metrics", ()))
    return SuiteScenario(**fields)


def _check_fields(where: str, table: Mapping[str, Any], kinds: Mapping[str, type], needed: Sequence[str] = ()) -> None:
    """Raise ValueError for the first field that is unknown, of another kind or missing."""
    for key, value in table.items():
        if key not in kinds:
            raise ValueError(f"{where}{shown(key)} is no field{nearest(key, kinds)}; allowed: {', '.join(kinds)}")
        if type(value) is not kinds[key]:
            raise ValueError(f"{where}{key}={shown(value)} is not allowed: it must be {_KINDS[kinds[key]]}")
        if isinstance(value, dict):
            _check_plain(where + key, value)
    for key in needed:
        if key not in table:
            raise ValueError(f"{where}{key} is missing; it must be {_KINDS[kinds[key]]}")
    if "env_id" in table:
        choose(f"{where}env_id", table["env_id"], (*ENVIRONMENTS, *full_ids()))
    for metric in table.get("metrics", ()):
        choose(f"{where}metrics", metric, METRICS)
    _check_distinct(f"{where}metrics", table.get("metrics", ()))
    require(
        f"{where}max_episode_steps", table.get("max_episode_steps"), "", at_least=1, at_most=10_000_000, optional=True
    )


def _check_plain(where: str, value: Any, depth: int = 0) -> None:
    """Raise ValueError unless ``value`` is made of lists, tables, texts, truth values and numbers as JSON has them."""
    if isinstance(value, dict | list):
        if depth > DEEPEST:
            raise ValueError(f"{_cut(where)} is nested deeper than {DEEPEST} levels")
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            _check_plain(f"{where}.{key}", one, depth + 1)
    elif isinstance(value, int | float):
        if not (abs(value) < 2**63 if isinstance(value, int) else math.isfinite(value)):
            raise ValueError(f"{_cut(where)}={shown(value)} is not allowed: numbers are finite, whole ones of 64 bits")
    elif not isinstance(value, str):
        raise ValueError(f"{_cut(where)}={shown(value)} is not allowed: dates and times mean nothing here")


def _check_name(field: str, value: str) -> None:
    if not _NAME.fullmatch(value):
        raise ValueError(
            f"{field}={shown(value)} is not allowed: it must be 1 to 64 letters, digits, '-', '_' or '.', "
            "the first a letter or a digit"
        )


def _check_line(field: str, value: str) -> None:
    if not (value.strip() and value.isprintable() and len(value) <= 200):
        raise ValueError(f"{field}={shown(value)} is not allowed: it must be one line of 1 to 200 characters")


def _check_policies(values: Sequence[Any]) -> None:
    if not values or not all(isinstance(value, str) for value in values):
        raise ValueError(f"policies={shown(values)} is not allowed: it must be a list of one or more names")
    _check_distinct("policies", values)


def _check_distinct(what: str, names: Sequence[str]) -> None:
    """Raise ValueError where two names are one; upper and lower case are one on many disks."""
    plain = [name.casefold() for name in names]
    for place, name in enumerate(plain):
        if name in plain[:place]:
            raise ValueError(f"{what} must differ: {shown(names[place])} appears twice")


def _cut(text: str) -> str:
    """Text of somebody's file as an error repeats it."""
    text = text if text.isprintable() else shown(text)
    return text if len(text) <= LONGEST_ECHO else f"{text[: LONGEST_ECHO - 3]}..."
