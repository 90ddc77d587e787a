"""The page of a run: its numbers are the result lines', names stay text, and Chromium shows it without a word."""

import base64
import gzip
import hashlib
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files
from itertools import accumulate

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import lanekeep_benchmarks
from lanekeep_benchmarks.evaluate import episode_seed, make_cars
from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.policies import entry_of
from lanekeep_benchmarks.suites import SUITES
from lanekeep_benchmarks.web import LIBRARY, page
from lanekeep_benchmarks.web import data as web_data
from lanekeep_benchmarks.web.data import _packed
from lanekeep_benchmarks.web.drives import FAILURES, chosen, recorded

SUITE = replace(SUITES["classical"], name="small", scenarios=SUITES["classical"].scenarios[:2])
POLICIES = ["stanley", "pd"]
HOSTILE = "</script><script>document.title='taken'</script><img src=x onerror=\"document.title='taken'\">[[library]]"
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "run"
    lanekeep_benchmarks.benchmark(SUITE, POLICIES, episodes=12, out=out)
    return out


class Parts(HTMLParser):
    """Scripts by their type, and every attribute that loads or runs something."""

    def __init__(self, text):
        super().__init__()
        self.scripts, self.loads, self._kind = [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self._kind = dict(attributes).get("type", "") if tag == "script" else None
        if tag == "script":
            self.scripts.append([self._kind, ""])
        self.loads += [(tag, *pair) for pair in attributes if pair[0] in ("src", "href") or pair[0].startswith("on")]

    def handle_data(self, text):
        if self._kind is not None:
            self.scripts[-1][1] += text

    def handle_endtag(self, tag):
        self._kind = None


def data_of(text):
    (packed,) = (script for kind, script in Parts(text).scripts if kind)
    return json.loads(gzip.decompress(base64.b64decode(packed)))


def shown_by_chromium(file, tmp_path):
    """The page after its script has run, and what the browser's console said."""
    quiet = ["--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"]
    once = [f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=30000", "--dump-dom", file]
    command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", *quiet, *once]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return run.stdout, [line for line in run.stderr.splitlines() if "CONSOLE" in line]


def test_its_numbers_are_the_result_lines(folder):
    data = data_of((folder / "report.html").read_text())
    lines = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    assert data["summary"] == json.loads((folder / "summary.json").read_text())
    assert sum(len(of["episode"]) for table in data["lines"].values() for of in table.values()) == len(lines)
    for line in lines:
        of = data["lines"][line["scenario"]][line["policy"]]
        place = of["episode"].index(line["episode"])
        assert {key: of[key][place] for key in ("episode_seed", "steps", "failed")} == {
            key: line[key] for key in ("episode_seed", "steps", "failed")
        }
        assert {key: values[place] for key, values in of["metrics"].items()} == line["metrics"]


def test_failures_have_a_course_to_look_at(folder):
    data = data_of((folder / "report.html").read_text())
    for scenario, table in data["lines"].items():
        failed = [n for n, bad in zip(table["pd"]["episode"], table["pd"]["failed"], strict=True) if bad]
        shown = {int(n) for n in data["drives"][scenario]["of"]["pd"]}
        assert failed and set(failed[:FAILURES]) <= shown
        assert set(failed[:FAILURES]) <= {int(n) for n in data["drives"][scenario]["of"]["stanley"]}
        for n, course in data["drives"][scenario]["of"]["pd"].items():
            place = table["pd"]["episode"].index(int(n))
            assert course["steps"] == table["pd"]["steps"][place]
            peak = max(abs(value) for value in unpacked(course["signals"]["lateral_error"]))
            assert peak >= 0.9 * table["pd"]["metrics"]["peak_lateral_error"][place]


def test_a_large_page_has_fewer_points_and_the_same_numbers(monkeypatch, folder, tmp_path):
    whole = data_of((folder / "report.html").read_text())
    empty = len(page("", {}))
    monkeypatch.setattr(web_data, "LARGEST_PAGE", empty + (len((folder / "report.html").read_text()) - empty) // 2)
    lanekeep_benchmarks.benchmark(SUITE, POLICIES, episodes=12, out=tmp_path / "run")
    text = (tmp_path / "run" / "report.html").read_text()
    small = data_of(text)
    assert len(text) <= web_data.LARGEST_PAGE
    assert (small["summary"], small["lines"]) == (whole["summary"], whole["lines"])
    for name, of in whole["drives"].items():
        assert small["drives"][name]["of"].keys() == of["of"].keys()


def unpacked(packed):
    step, *differences = packed
    return [step * multiple for multiple in accumulate(differences)]


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20), st.floats(1e-4, 10.0))
def test_packed_numbers_come_back(values, step):
    assert np.abs(np.array(unpacked(_packed(values, step))) - values).max() <= 0.51 * step + 1e-9


def test_a_course_is_as_long_as_its_speed_says():
    """What is between its points is what the speed drives in a step; they lie on the road of that episode."""
    scenario = SUITE.scenarios[0]
    env = make_cars(scenario, 1)
    policy, step = entry_of("stanley").make(env.unwrapped.scenario), env.unwrapped.scenario.control_step
    env.close()
    for one in recorded(scenario, policy, [episode_seed("small", scenario.name, n, 0) for n in range(3)]):
        way = np.hypot(np.diff(one["x"]), np.diff(one["y"]))
        assert way == pytest.approx(step * one["speed"][1:], rel=0.01)


def test_failures_quantiles_and_what_all_can_be_compared_on():
    def line(policy, episode, error, failed=False):
        metrics = {"rms_lateral_error": error}
        return EpisodeResult("s", "x", "0" * 16, policy, episode, 0, episode, failed, 10, metrics, "0.1.0")

    lines = {
        "a": [line("a", n, float(n)) for n in range(101)],
        "b": [line("b", n, float(-n), failed=n % 10 == 3) for n in range(101)],
    }
    found = chosen(lines, more_is_better=False)
    assert {0, 25, 50, 75, 100} <= set(found["a"]) & set(found["b"])
    assert {3, 13, 23, 33, 43} <= set(found["a"]) & set(found["b"])
    assert set(found["b"]) <= set(found["a"]) and 53 not in found["a"]
    assert 100 in found["b"]  # the best of those that did not fail


def test_names_from_files_stay_text(folder):
    data = data_of((folder / "report.html").read_text())
    text = page(HOSTILE, {**data, "caption": HOSTILE})
    assert "<script>document" not in text and "<img" not in text
    parts = Parts(text)
    assert [kind for kind, _ in parts.scripts] == ["application/octet-stream", "", ""]
    assert {(tag, name) for tag, name, _ in parts.loads} == {("a", "href"), ("link", "href")}
    policy = re.search(r'Content-Security-Policy" content="(.*?)"', text)[1]
    hashes = [
        base64.b64encode(hashlib.sha256(code.encode()).digest()).decode() for kind, code in parts.scripts if not kind
    ]
    assert re.findall(r"sha256-(\S+)'", policy) == hashes
    assert policy.startswith("default-src 'none'; ") and "http" not in policy
    script = files("lanekeep_benchmarks.web").joinpath("page.js").read_text()
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|Function\(", script)


def test_the_library_is_the_published_one():
    """plotly.js-basic-dist-min 4.1.1 of npm."""
    content = files("lanekeep_benchmarks.web").joinpath(LIBRARY).read_bytes()
    assert hashlib.sha256(content).hexdigest() == "99784e3abfb07b142a15e521a439e6d9addceadb3f79553fd24c72774f0649ba"


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_chromium_shows_it_without_a_word(folder, tmp_path):
    lines = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    name = SUITE.scenarios[1].name
    place = f"#scenario={name}&policy=pd&episode={next(x['episode'] for x in lines if x['failed'])}"
    shown, console = shown_by_chromium((folder / "report.html").as_uri() + place, tmp_path)
    assert console == []
    for policy in POLICIES:
        mean = np.mean([x["metrics"]["return"] for x in lines if (x["policy"], x["scenario"]) == (policy, name)])
        assert f">{mean:.1f}" in shown
    assert "Unpacking" not in shown and f"pd on {name}, episode" in shown
    assert shown.count('class="main-svg"') >= 3  # means, course and signals are drawn


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
def test_a_hostile_name_runs_nothing_in_chromium(folder, tmp_path):
    text = json.dumps(data_of((folder / "report.html").read_text()))
    data = json.loads(text.replace('"pd"', json.dumps(HOSTILE)))
    (tmp_path / "hostile.html").write_text(page("title", data))
    shown, console = shown_by_chromium((tmp_path / "hostile.html").as_uri(), tmp_path)
    assert console == [] and "<title>title</title>" in shown
    assert "<img src" not in shown and "&lt;/script&gt;" in shown
