"""Pages of the site that are made from declarations: environments, controllers, works, suites, glossary, interfaces."""

from __future__ import annotations

import importlib
import inspect
import io
import json
import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium as gym

import lanekeep_agents
import lanekeep_baselines
import lanekeep_benchmarks
import lanekeep_env
from lanekeep_benchmarks.envs_command import described
from lanekeep_benchmarks.metrics import METRICS
from lanekeep_benchmarks.play import make, preferred
from lanekeep_benchmarks.policies import entry_of
from lanekeep_benchmarks.replications import BESIDE, WORKS, steps_of
from lanekeep_benchmarks.replications.differences import DIFFERENCES
from lanekeep_benchmarks.suites import SUITES
from lanekeep_benchmarks.summary import RATE

#: Steps that are driven before an environment's picture is taken.
_STEPS = 60
#: What `scores` has measured.
SCORES = json.loads(Path(__file__).with_name("scores.json").read_text(encoding="utf-8"))


def short(env_id: str) -> str:
    """The name of an environment's page."""
    return env_id.partition("/")[2]


def table(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Rows as Markdown; what is in a cell stays text."""
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    return "\n".join(lines + [f"| {' | '.join(map(_cell, row))} |" for row in rows]) + "\n"


def _cell(value: Any) -> str:
    return str(value).replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;").replace("\n", " ")


def _code(text: str) -> str:
    return f"`{text}`" if text else ""


def _page_of(thing: Any) -> str:
    return inspect.cleandoc(inspect.getdoc(thing) or "")


@cache
def _scenario(env_id: str) -> Any:
    """As controllers meet it: where roads can be shown ahead, they are."""
    env = make(env_id, None)
    scenario = env.unwrapped.scenario
    env.close()
    return scenario


def drivers(env_id: str) -> tuple[str, ...]:
    """The controllers that can drive an environment, with the road shown ahead."""
    return lanekeep_baselines.names(_scenario(env_id))


def _links(names: Iterable[str], folder: str) -> str:
    return ", ".join(f"[{name}]({folder}/{name.removeprefix('lanekeep/')}.md)" for name in names) or "none"


def environment(env_id: str) -> str:
    """The page of an environment: its own, then channels, options, endings and controllers as they are declared."""
    told = described(env_id)
    env = gym.make(env_id)
    page = _page_of(type(env.unwrapped)).replace("## Description\n", "", 1)
    page = re.sub(r"`lanekeep/(\w+-v\d+)`", r"[lanekeep/\1](\1.md)", page)
    env.close()
    channels = [
        (_code(one["name"]), one["unit"], f"{one['low']:.6g}", f"{one['high']:.6g}", one["description"])
        for one in told["channels"]
    ]
    options = [(_code(one["name"]), _code(one["default"]), one["meaning"]) for one in told["keywords"]]
    parts = [
        f"# {env_id}",
        f"![{env_id}](../pictures/{short(env_id)}.png)",
        page,
        "## Every channel, as it is without options",
        f"Action `{told['action_space']}`; an episode has {told['max_episode_steps']} control steps.",
        table(("channel", "unit", "low", "high", "meaning"), channels),
        "## Every option",
        table(("keyword of gym.make", "default", "meaning"), options),
        '## `info["termination"]`',
        table(("code", "name"), ((int(code), code.name) for code in lanekeep_env.Termination)),
        "## Who drives it",
        f"Controllers, with the road shown ahead where it can be: {_links(drivers(env_id), '../controllers')}.",
        f"Learned policies that are shipped: {', '.join(lanekeep_agents.names(_scenario(env_id))) or 'none'}.",
        f"Suites: {', '.join(_suites(env_id)) or 'none'} (`lanekeep bench SUITE`; [all suites](../suites.md)).",
        "## How well",
        scores(env_id),
    ]
    return "\n\n".join(parts) + "\n"


def scores(env_id: str) -> str:
    """The table of an environment's scores, the largest return first, and where they are from."""
    if env_id not in SCORES["environments"]:
        return f"Not measured: no scenario of `{SCORES['suite']}` is of this environment."
    measured = SCORES["environments"][env_id]
    policies = measured["policies"]
    keys = list(next(iter(policies.values())))
    heads = ["failed [%]" if key == RATE else f"{METRICS[key].label} [{METRICS[key].unit}]" for key in keys]
    rows = [(_policy(name), *(_interval(key, row[key]) for key in keys)) for name, row in policies.items()]
    source = (
        f"{measured['title']}: scenario {measured['scenario']} of `lanekeep bench {SCORES['suite']}`, "
        f"{SCORES['episodes']} episodes a policy, seed {SCORES['seed']}; mean and 95 % interval; {SCORES['measured']}."
    )
    return f"{table(['policy', *(head.removesuffix(' []') for head in heads)], rows)}\n{source}"


def _policy(name: str) -> str:
    return f"[{name}](../controllers/{name}.md)" if name in lanekeep_baselines.names() else name


def _interval(key: str, numbers: Sequence[float]) -> str:
    factor, digits = (100.0, 1) if key == RATE else (1.0, METRICS[key].digits)
    mean, low, high = (f"{factor * number:.{digits}f}" for number in numbers)
    return f"{mean} ({low} to {high})"


def _suites(env_id: str) -> list[str]:
    return [name for name, suite in SUITES.items() if any(one.env_id == env_id for one in suite.scenarios)]


def picture(env_id: str) -> bytes:
    """A moment of an episode, as PNG."""
    from PIL import Image

    env = make(env_id, "rgb_array")
    policy, state = entry_of(preferred(env_id)).make(env.unwrapped.scenario), None
    observation, _ = env.reset(seed=0)
    for _ in range(_STEPS):
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
        frame = env.render()
    env.close()
    buffer = io.BytesIO()
    Image.fromarray(frame).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def controller(name: str) -> str:
    """The page of a controller: what its class and its module say, what it declares, and what it drives."""
    policy = lanekeep_baselines.policy_class(name)
    module = importlib.import_module(policy.__module__)
    driven = [env_id for env_id in lanekeep_env.ENVIRONMENTS if name in drivers(env_id)]
    rows = [
        ("reads", ", ".join(map(_code, policy.reads)) or "nothing"),
        ("uses where they are there", ", ".join(map(_code, policy.uses))),
        ("needs besides", "; ".join(need.what for need in policy.needs)),
        ("packages of its design", ", ".join(policy.packages)),
        ("numbers of an action", policy.actions),
        ("switches", ", ".join(map(_code, policy.options()))),
        ("options of the scenario that it goes by", ", ".join(map(_code, policy.fields()))),
    ]
    parts = [
        f"# {name}",
        _page_of(policy),
        f"## Of `{policy.__module__}`",
        _page_of(module),
        "## What it declares",
        table(("what", "which"), (row for row in rows if row[1] != "")),
        f"Drives {_links(driven, '../environments')}.",
        f"Suites that name it: {', '.join(n for n, s in SUITES.items() if name in s.policies) or 'none'}.",
        f"```\nlanekeep play {driven[0] if driven else ''} --policy {name}\n```" if driven else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def work(name: str) -> str:
    """The page of a published work: what is driven again, and why figures differ."""
    module = importlib.import_module(f"lanekeep_benchmarks.replications.{name}")
    steps = [f"- {what}" for what, _ in steps_of(name)]
    differences = DIFFERENCES.get(name, {})
    parts = [
        f"# {(WORKS | BESIDE)[name]}",
        _page_of(module),
        f"```\nlanekeep replicate {name}\n```",
        "It drives, and writes figures and a table of numbers beside those of the work:",
        "\n".join(steps),
        "## Where numbers differ" if differences else "",
        table(("what", "why"), differences.items()) if differences else "",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def suites() -> str:
    """The page of all suites."""
    parts = ["# Suites", "`lanekeep bench SUITE`; a TOML file of your own is one, too."]
    for name, suite in SUITES.items():
        policies = ", ".join(suite.policies) or "all that can drive it"
        rows = [(one.name, one.title, short(one.env_id)) for one in suite.scenarios]
        parts += [f"## {name}", f"{suite.description}; {suite.episodes} episodes a scenario. Policies: {policies}."]
        parts += [table(("scenario", "what", "environment"), rows)]
    return "\n\n".join(parts) + "\n"


def glossary() -> str:
    """Every quantity that environments show and that the benchmark measures."""
    found: dict[str, tuple[str, str]] = {}
    for env_id in lanekeep_env.ENVIRONMENTS:
        for one in described(env_id)["channels"]:
            name = re.sub(r"_\d+$", "_n", one["name"])
            found.setdefault(name, (one["unit"], one["description"]))
    channels = [(_code(name), *told) for name, told in sorted(found.items())]
    metrics = [
        (_code(key), one.label, one.unit, "more" if one.more_is_better else "less") for key, one in METRICS.items()
    ]
    parts = [
        "# Glossary",
        "SI units, ISO 8855 signs: x forward, y left, angles positive to the left ([conventions](conventions.md)).",
        "## What environments show",
        table(("channel", "unit", "meaning"), channels),
        "## What the benchmark measures",
        table(("key", "metric", "unit", "better is"), metrics),
    ]
    return "\n\n".join(parts) + "\n"


def index(title: str, rows: Iterable[tuple[str, str, str]]) -> str:
    """A page that lists pages: name, file and what it is."""
    return f"# {title}\n\n" + table(("name", "what it is"), ((f"[{name}]({file})", what) for name, file, what in rows))


def first_sentence(text: str) -> str:
    """Up to the first full stop of a paragraph."""
    return re.split(r"(?<=[\w)`])[.:] ", " ".join(text.partition("\n\n")[0].split()))[0].rstrip(".")


def interfaces() -> dict[str, str]:
    """A page for each package: what it makes public."""
    pages = {}
    for package in (lanekeep_env, lanekeep_baselines, lanekeep_agents, lanekeep_benchmarks):
        names = [name for name in package.__all__ if not name.startswith("_") and not name.isupper()]
        blocks = "\n\n".join(f"::: {_home(package, name)}" for name in names)
        pages[package.__name__] = f"# {package.__name__}\n\n{_page_of(package)}\n\n{blocks}\n"
    return pages


def _home(package: Any, name: str) -> str:
    """Where a public name is defined, for readers that follow no imports."""
    there = getattr(package, name)
    module = getattr(there, "__module__", package.__name__)
    return (
        f"{module}.{name}"
        if isinstance(module, str) and module.startswith("lanekeep")
        else f"{package.__name__}.{name}"
    )
