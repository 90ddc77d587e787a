"""README and pages: code runs, commands exist, links lead somewhere, and measured tables hold what is measured."""

import json
import re
import shlex
import sys
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from typer.main import get_command

import lanekeep_baselines
import lanekeep_env
from lanekeep_benchmarks.cli import app
from lanekeep_benchmarks.evaluate import evaluate
from lanekeep_benchmarks.plan import make_plan
from lanekeep_benchmarks.policies import entry_of
from lanekeep_benchmarks.suites import SUITES, find_suite

ROOT = Path(__file__).parents[2]
OWN_TESTS = {"control-engineers.md", "highway-env.md"}
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINKED = [*PAGES, *ROOT.glob("*/README.md"), *(ROOT / name for name in ("ARCHITECTURE.md", "CONTRIBUTING.md"))]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def load(name):
    spec = spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    module = sys.modules[name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


tables = load("tables")


def blocks(page):
    return re.findall(r"^```(\w*)\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.fixture
def files(tmp_path, monkeypatch):
    """What a reader of the pages has: a track, a car, a map of a circuit, and the line through it."""
    monkeypatch.chdir(tmp_path)
    turn = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    np.savetxt("my_track.csv", 200.0 * np.column_stack([np.cos(turn), np.sin(turn)]), delimiter=",")
    Path("my_car.yaml").write_text("mass: 1.7 t\n")
    cells = np.full((120, 160), 254, np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = cells[40:80, 40:120] = 0
    Path("my_map.pgm").write_bytes(b"P5\n160 120\n255\n" + cells.tobytes())
    settings = {"image": "my_map.pgm", "resolution": 0.05, "origin": [-1.0, -1.0, 0.0], "negate": 0}
    settings |= {"occupied_thresh": 0.65, "free_thresh": 0.196}
    Path("my_map.yaml").write_text("\n".join(f"{key}: {json.dumps(one)}" for key, one in settings.items()))
    middle = np.column_stack([3.0 + 3.3 * np.cos(turn), 2.0 + 2.3 * np.sin(turn)])
    np.savetxt("line.csv", middle, delimiter=",")


@pytest.mark.parametrize("page", [page for page in PAGES if page.name not in OWN_TESTS], ids=lambda page: page.stem)
def test_python_runs_from_top_to_bottom(page, files):
    scope = {}
    for language, text in blocks(page):
        if language == "python":
            exec(compile(text, page.name, "exec"), scope)


def suites():
    for page in [*PAGES, *ROOT.glob("*/README.md")]:
        for language, text in blocks(page):
            if language == "toml" and "[[scenario]]" in text:
                yield pytest.param(text, id=f"{page.parent.name}/{page.name}")


@pytest.mark.parametrize("text", [*suites()])
def test_a_suite_is_read_and_its_policies_can_drive_it(text, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    listed = find_suite(str(file)).policies or ("stanley",)  # all that are shipped would take seconds
    assert make_plan(str(file), listed, None, None, 0).total > 0


def commands():
    for page in [*PAGES, *ROOT.glob("*/README.md")]:
        for language, text in blocks(page):
            for line in text.splitlines():
                if language in ("", "console") and line.startswith("lanekeep "):
                    yield pytest.param(line, id=f"{page.parent.name}/{page.name}: {line[:40]}")


@pytest.mark.parametrize("line", [*commands()])
def test_commands_exist_with_their_options(line):
    """Parsed as the command line is, and not run: trainings take minutes."""
    _, *words = shlex.split(line, comments=True)
    command = get_command(app)
    while hasattr(command, "commands"):
        command, words = command.commands[words[0]], words[1:]
    command.make_context(command.name, words)


def anchors(page):
    """As GitHub makes them of headings."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", LINKED, ids=lambda page: f"{page.parent.name}/{page.name}")
def test_links_lead_to_something(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        there = (page.parent / file).resolve() if file else page
        assert there.exists(), target
        assert not anchor or anchor in anchors(there), target


def test_the_readme_is_a_screen_and_a_half():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 90


def alone(suite, scenario):
    (one,) = (one for one in SUITES[suite].scenarios if one.name == scenario)
    return replace(SUITES[suite], scenarios=(one,))


def driven_anew(suite, policies):
    """The numbers of each policy's episodes."""

    def make(name, definition):
        return entry_of(name).make(definition)

    found = {}
    for lines in evaluate(suite, policies, make, episodes=suite.episodes, seed=0):
        numbers = [{"failure_rate": 100.0 * line.failed, **line.metrics} for line in lines]
        found.setdefault(lines[0].policy, []).extend(numbers)
    return found


def check_tables(choose):
    """Every mean in the rows of the policies that ``choose`` takes from a table's is the one that comes out now."""
    marked = [(page, *found) for page in PAGES for found in tables.MARKED.findall(page.read_text(encoding="utf-8"))]
    assert {page.name for page, *_ in marked} == {"README.md", "benchmark.md"}
    suite = alone("classical", "random-roads")
    everyone = make_plan(suite, None, None, 1, 0).policies
    policies = choose(everyone)
    driven = driven_anew(suite, policies)
    for _, *place, keys, text in marked:
        assert place == ["classical", "random-roads"]
        rows = dict(re.findall(r"^\| (\S+) \| (.*) \|$", text, re.MULTILINE))
        assert list(rows)[1:] == everyone
        for policy in policies:
            for key, cell in zip(keys.split(), rows[policy].split(" | "), strict=True):
                digits = len(cell.split()[0].partition(".")[2])
                mean = np.mean([numbers[key] for numbers in driven[policy]])
                assert cell.split()[0] == f"{mean:.{digits}f}", (policy, key)
        assert re.search(r"measured at [0-9a-f]{7,} on \d{4}-\d\d-\d\d by `make tables`", text)


def test_no_number_of_a_measured_table_is_written_by_hand():
    check_tables(lambda policies: [policies[1], policies[3], policies[-4]])


@pytest.mark.slow
def test_no_number_of_any_row_is_written_by_hand():
    check_tables(list)


def test_what_is_measured_is_written_between_the_markers(tmp_path, monkeypatch):
    """A table with other numbers is replaced, and nothing around it."""
    interval = {"value": 0.5, "low": 0.25, "high": 1.0}
    row = {"policy": "pd", "failure_rate": interval, "metrics": {"return": interval}}
    summary = {"scenarios": [{"policies": [row]}], "episodes": 3, "seed": 0}
    monkeypatch.setattr(tables, "measured", lambda *_: summary)
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- measured: s x failure_rate return -->\n| pd | 1 |\n<!-- end -->\nafter\n")
    tables.main([page])
    text = page.read_text()
    assert text.startswith(
        "before\n<!-- measured: s x failure_rate return -->\n| policy | failure rate [%] | return |\n"
    )
    assert "| pd | 50.0 (25.0…100.0) | 0.5 (0.2…1.0) |" in text and "| pd | 1 |" not in text
    assert text.endswith("<!-- end -->\nafter\n")


@pytest.mark.parametrize("name", [*lanekeep_env.ENVIRONMENTS, *lanekeep_baselines.names()])
def test_the_changelog_names_it(name):
    assert f"`{name}`" in CHANGELOG
