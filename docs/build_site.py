"""Write what the site is built from: python docs/build_site.py build/docs; then mkdocs build -f build/docs/mkdocs.yml

The pages of the repository with their links set to the site's, and those that `reference` makes from declarations.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import reference
import run_notebooks

import lanekeep_baselines
import lanekeep_env
from lanekeep_benchmarks import benchmark
from lanekeep_benchmarks.envs_command import described
from lanekeep_benchmarks.replications import BESIDE, WORKS

ROOT = Path(__file__).resolve().parents[1]
#: Pages of the repository beside docs/, and what they are called on the site.
OTHERS = {
    "README.md": "index.md",
    "baselines/README.md": "baselines.md",
    "agents/README.md": "agents.md",
    "benchmarks/README.md": "benchmarks.md",
    "ARCHITECTURE.md": "architecture.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
SHIM = "iframe-worker.js"
#: The run whose report the site shows: the benchmark's default suite, so many episodes a policy and scenario.
RUN, EPISODES = "results", 32
RESULTS = f"""---
hide: [toc]
---
# Results to explore

`lanekeep bench --episodes {EPISODES}`, and the report that every run writes: sort and filter policies, choose a
scenario and a metric, look at an episode's course and play it. [The report on a page of its own]({RUN}/report.html).

<iframe src="{RUN}/report.html" title="Report of a run" style="width: 100%; height: 85vh; border: 0"></iframe>
"""
_GUIDES = (
    "control-engineers", "scenario-options", "own-road-car-map", "own-suite", "rl-researchers", "train",
    "tuning", "learned-policies", "agents", "cluster", "driver-support", "camera", "walls", "driving", "highway-env",
    "f1tenth-gym", "matlab",
)  # fmt: skip


def sources() -> dict[Path, str]:
    """Every page of the repository that the site shows, and its place there."""
    pages = {ROOT / file: there for file, there in OTHERS.items()}
    return pages | {page: page.name for page in sorted((ROOT / "docs").glob("*.md"))}


def places() -> dict[Path, str]:
    """Where on the site a file of the repository is shown."""
    return sources() | {file: f"notebooks/{name}.md" for name, file in run_notebooks.SOURCES.items()}


def linked(page: Path, places: Mapping[Path, str], pictures: set[Path]) -> str:
    """The text of a page with its links set to the site's; what is not there is no link any more."""

    def link(found: re.Match[str]) -> str:
        mark, text, target = found.groups()
        file, hash_, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        if "://" in target or there == page:
            return found[0]
        if there in places:
            return f"{mark}[{text}]({places[there]}{hash_}{anchor})"
        if there.suffix in (".png", ".gif"):
            pictures.add(there)
            return f"{mark}[{text}](pictures/{there.name})"
        return text

    text = re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", link, page.read_text(encoding="utf-8"))
    return re.sub(r"^```(\w+) (\S+)$", r'```\1 title="\2"', text, flags=re.MULTILINE)


def configuration(folder: Path) -> dict[str, Any]:
    """What mkdocs is told: nothing is fetched when a page is read, and fonts are the reader's."""
    env_pages = [{reference.short(one): f"environments/{reference.short(one)}.md"} for one in lanekeep_env.ENVIRONMENTS]
    policies = [{name: f"controllers/{name}.md"} for name in sorted(lanekeep_baselines.names())]
    packages = [str(ROOT), *(str(ROOT / one) for one in ("baselines", "agents", "benchmarks"))]
    python = {
        "paths": packages,
        "options": {
            "show_source": False,
            "show_root_heading": True,
            "docstring_options": {"warnings": False},
            "members_order": "source",
        },
    }
    scheme = {"toggle": {"icon": "material/theme-light-dark", "name": "Light or dark"}}
    return {
        "site_name": "lanekeep",
        "docs_dir": str(folder / "pages"),
        "site_dir": str(folder.parent / "site"),
        "use_directory_urls": False,
        "theme": {
            "name": "material",
            "font": False,
            "features": ["navigation.tabs", "navigation.indexes", "content.code.copy"],
            "palette": [
                {"media": "(prefers-color-scheme: light)", "scheme": "default", **scheme},
                {"media": "(prefers-color-scheme: dark)", "scheme": "slate", **scheme},
            ],
        },
        "plugins": ["search", "offline", {"mkdocstrings": {"handlers": {"python": python}}}],
        "markdown_extensions": ["tables", "toc", "pymdownx.highlight", "pymdownx.superfences"],
        # What the search takes on pages from disk; the plugin would have it fetched.
        "extra": {"generator": False, "polyfills": [SHIM]},
        "nav": [
            {
                "Start": [
                    "index.md",
                    {"Install, first drive": "start.md"},
                    {"The benchmark": "benchmark.md"},
                    {"Results to explore": "results.md"},
                    "frozen-suite.md",
                ]
            },
            {"How to": [f"{name}.md" for name in _GUIDES]},
            {"Notebooks": [{run_notebooks.title(name): f"notebooks/{name}.md"} for name in run_notebooks.SOURCES]},
            {"Environments": ["environments/index.md", *env_pages]},
            {"Controllers": ["controllers/index.md", {"All of them, explained": "baselines.md"}, *policies]},
            {"Works": [f"works/{name}.md" for name in WORKS | BESIDE]},
            {
                "Reference": [
                    "suites.md",
                    {"Files, suites, statistics": "benchmarks.md"},
                    "conventions.md",
                    "explanations.md",
                    "single-track-error.md",
                    "glossary.md",
                    *(f"reference/{name}.md" for name in reference.interfaces()),
                ]
            },
            {"Project": ["architecture.md", "contributing.md", "changelog.md"]},
        ],
    }


def made() -> dict[str, str]:
    """The pages that are made from declarations, by their place."""
    ids, names = list(lanekeep_env.ENVIRONMENTS), sorted(lanekeep_baselines.names())
    pages = {f"environments/{reference.short(one)}.md": reference.environment(one) for one in ids}
    pages |= {f"controllers/{name}.md": reference.controller(name) for name in names}
    pages |= {f"works/{name}.md": reference.work(name) for name in WORKS | BESIDE}
    pages |= {f"reference/{name}.md": text for name, text in reference.interfaces().items()}
    rows = [(one, f"{reference.short(one)}.md", reference.first_sentence(described(one)["description"])) for one in ids]
    pages["environments/index.md"] = reference.index("Environments", rows)
    said = [(name, f"{name}.md", _said(name)) for name in names]
    pages["controllers/index.md"] = reference.index("Controllers", said)
    return pages | {"suites.md": reference.suites(), "glossary.md": reference.glossary(), "results.md": RESULTS}


def _said(name: str) -> str:
    text = (lanekeep_baselines.policy_class(name).__doc__ or "").strip()
    return reference.first_sentence(re.sub(rf"^`{name}`[:,]? *", "", text))


def write_notebooks(pages: Path, executed: Path) -> None:
    """Write the notebooks with their output, which is kept in the folder ``executed``."""
    run_notebooks.all_of(run_notebooks.executed, executed)
    for name in run_notebooks.SOURCES:
        text, pictures = run_notebooks.page(name, executed)
        for file, content in {f"{name}.md": text.encode(), **pictures}.items():
            (pages / "notebooks" / file).parent.mkdir(parents=True, exist_ok=True)
            (pages / "notebooks" / file).write_bytes(content)


def write_results(pages: Path) -> None:
    """Drive the run whose report is shown; its own pages of text stay out of the site's."""
    benchmark(episodes=EPISODES, out=pages / RUN, engine="processes")
    for file in (pages / RUN).glob("*.md"):
        file.unlink()


def write(folder: Path, with_drives: bool = True) -> None:
    """Write pages, pictures and the configuration into ``folder``, anew; ``with_drives``: what has to be driven, too.

    Notebooks with their output are kept in ``notebooks`` beside the folder, where `make notebooks` writes them.
    """
    pages, pictures = folder / "pages", set[Path]()
    shutil.rmtree(folder, ignore_errors=True)
    texts = {there: linked(page, places(), pictures) for page, there in sources().items()} | made()
    for name, text in texts.items():
        (pages / name).parent.mkdir(parents=True, exist_ok=True)
        (pages / name).write_text(text, encoding="utf-8")
    shutil.copy(ROOT / "docs" / SHIM, pages)
    (pages / "pictures").mkdir()
    for file in pictures:
        shutil.copy(file, pages / "pictures")
    if with_drives:
        write_notebooks(pages, folder.parent / "notebooks")
        write_results(pages)
    for env_id in lanekeep_env.ENVIRONMENTS if with_drives else ():
        (pages / "pictures" / f"{reference.short(env_id)}.png").write_bytes(reference.picture(env_id))
    (folder / "mkdocs.yml").write_text(json.dumps(configuration(folder.resolve()), indent=1))


if __name__ == "__main__":
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    write(Path(sys.argv[1]))
