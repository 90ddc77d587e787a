"""The site has a page for everything that is declared, says what is declared, and fetches nothing."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import lanekeep_baselines
import lanekeep_env
from lanekeep_benchmarks.envs_command import described
from lanekeep_benchmarks.replications import BESIDE, WORKS
from lanekeep_benchmarks.suites import SUITES

pytest.importorskip("highway_env")  # one of the works
DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))
try:
    import build_site
    import reference
finally:
    sys.path.remove(str(DOCS))


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site") / "docs"
    build_site.write(folder, with_drives=False)
    return folder / "pages"


def text(pages, name):
    return (pages / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("env_id", lanekeep_env.ENVIRONMENTS)
def test_an_environment_has_all_that_it_declares(pages, env_id):
    page, told = text(pages, f"environments/{env_id.partition('/')[2]}.md"), described(env_id)
    for one in told["channels"]:
        assert f"| `{one['name']}` | {one['unit']} | {one['low']:.6g} | {one['high']:.6g} |" in page
    for one in told["keywords"]:
        assert f"| `{one['name']}` |" in page
    for code in lanekeep_env.Termination:
        assert f"| {int(code)} | {code.name} |" in page
    scenario = lanekeep_env.ENVIRONMENTS[env_id].scenario()
    for name in lanekeep_baselines.names(scenario):
        assert f"[{name}](../controllers/{name}.md)" in page
    for name in reference.SCORES["environments"].get(env_id, {"policies": ()})["policies"]:
        assert re.search(rf"^\| \[?{name}\b.* \| .* to .* \|$", page, re.MULTILINE)
    for heading in ("Action Space", "Rewards", "Starting State", "Episode End", "Version History"):
        assert re.search(rf"^## .*{heading}", page, re.MULTILINE)


def test_everything_has_a_page_and_a_line(pages):
    index = text(pages, "controllers/index.md")
    for name in lanekeep_baselines.names():
        assert f"[{name}]({name}.md)" in index
        assert text(pages, f"controllers/{name}.md").startswith(f"# {name}\n")
    for env_id in lanekeep_env.ENVIRONMENTS:
        assert f"[{env_id}](" in text(pages, "environments/index.md")
    for name in SUITES:
        assert f"\n## {name}\n" in text(pages, "suites.md")
    for name in WORKS | BESIDE:
        assert f"lanekeep replicate {name}\n" in text(pages, f"works/{name}.md")


def test_links_lead_to_pages(pages):
    found = 0
    for page in pages.rglob("*.md"):
        for target in re.findall(r"\]\(([^)\s]+?\.(?:md|png|gif))(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            picture = page.parent.name == "environments" and target.startswith("../pictures/")
            driven = picture or (target in build_site.places().values() and target.startswith("notebooks/"))
            assert "://" in target or driven or (page.parent / target).exists(), (page, target)
            found += 1
    assert found > 200


@pytest.mark.slow
def test_it_builds_without_a_warning_and_fetches_nothing(tmp_path):
    for name in ("ipykernel", "jupytext", "material", "mkdocstrings", "nbclient", "nbconvert"):  # the extra "docs"
        pytest.importorskip(name)
    build_site.write(tmp_path / "docs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-f", str(tmp_path / "docs" / "mkdocs.yml")]
    subprocess.run(command, check=True, timeout=180)
    built = list((tmp_path / "site").rglob("*.html"))
    assert len(built) > 80
    for page in built:
        loads = re.findall(r"<(?:script|link|img|iframe)\b[^>]*?(?:src|href)=\"?(https?://[^\s\">]+)", page.read_text())
        assert not loads, (page, loads)
