"""Notebooks: they are Python that runs, the site shows all of them, and their links lead to pages."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))
try:
    import build_site
    import run_notebooks
finally:
    sys.path.remove(str(DOCS))

NAMES = list(run_notebooks.SOURCES)


def source(name):
    return run_notebooks.SOURCES[name].read_text(encoding="utf-8")


def test_there_are_those_that_were_promised():
    assert {"own-controller", "own-road-and-car", "ppo-and-distillation", "safe-rl", "identification"} <= {*NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_it_compiles_and_begins_with_a_heading(name):
    compile(source(name), name, "exec")
    assert source(name).startswith("# %% [markdown]\n# # ")
    assert run_notebooks.title(name)[0].isupper()


@pytest.mark.parametrize("name", NAMES)
def test_its_text_states_no_result(name):
    """Numbers with a decimal point in what is not code would have been typed by hand."""
    cells = re.findall(r"^# %% \[markdown\]\n((?:#.*\n)*)", source(name), re.MULTILINE)
    assert cells
    text = re.sub(r"`[^`]*`", "", "".join(cells))
    assert not re.findall(r"\d\.\d", text)


def test_the_site_lists_all(tmp_path):
    (notebooks,) = (part["Notebooks"] for part in build_site.configuration(tmp_path)["nav"] if "Notebooks" in part)
    assert notebooks == [{run_notebooks.title(name): f"notebooks/{name}.md"} for name in NAMES]


def test_their_links_lead_to_pages_of_the_site():
    there = {*build_site.places().values()}
    for name in NAMES:
        for target in re.findall(r"\]\(([^)\s]+)\)", source(name)):
            assert os.path.normpath(f"notebooks/{target}") in there, target


def test_it_is_run_anew_where_it_or_the_packages_have_changed(tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(run_notebooks, "run", lambda *given: ran.append(given))
    name, file = NAMES[0], tmp_path / f"{NAMES[0]}.ipynb"
    newest = max(run_notebooks.changed(), run_notebooks.SOURCES[name].stat().st_mtime)
    run_notebooks.executed(name, tmp_path)
    file.touch()
    for seconds in (-1.0, 1.0):
        os.utime(file, 2 * (newest + seconds,))
        run_notebooks.executed(name, tmp_path)
    assert ran == 2 * [(name, tmp_path)]  # missing, older; the newer one is kept


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_it_runs(name, tmp_path):
    """As a script, without the extra "docs"; with output they are run where the site is built (test_site)."""
    command = [sys.executable, "-W", "ignore:FigureCanvasAgg", run_notebooks.SOURCES[name]]
    packages = os.pathsep.join(filter(None, sys.path))
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONPATH": packages}
    subprocess.run(command, cwd=tmp_path, check=True, timeout=900, env=environment)
