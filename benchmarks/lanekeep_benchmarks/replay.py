"""A result line driven again: the same environment, episode and policy, so the same steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym

from lanekeep_benchmarks.lines import EpisodeResult
from lanekeep_benchmarks.made import make_definitions
from lanekeep_benchmarks.policies import Entry, entry_of, handed_over
from lanekeep_benchmarks.results import EPISODES, LARGEST_LINES, read_lines
from lanekeep_benchmarks.run_record import RUN, AnotherRun, RunRecord
from lanekeep_benchmarks.suites import Suite, SuiteScenario, find_suite, road_suite
from lanekeep_env.checks import choose, shown, shown_path
from lanekeep_env.files import read_bounded


class Replay(NamedTuple):
    """What a result line was driven in and by."""

    line: EpisodeResult
    scenario: SuiteScenario
    policy: Entry

    def make(self, render_mode: str | None) -> gym.Env:
        """Return the environment with one car."""
        keywords = dict(self.scenario.keywords)
        if self.scenario.max_episode_steps is not None:
            keywords["max_episode_steps"] = self.scenario.max_episode_steps
        return gym.make(self.scenario.env_id, render_mode=render_mode, **keywords)

    def policys_scenario(self, definition: Any) -> Any:
        """Return what the policy is made for."""
        return self.scenario.policies_scenario(definition)


def find_line(folder: Path, episode: int, scenario: str | None, policy: str | None) -> Replay:
    """Find a result line and what it takes to drive it again.

    Args:
        folder: of the run.
        episode: its number.
        scenario: None where the run has one.
        policy: as the run names it, None where the run has one; code is imported because it is named here.

    Raises:
        ValueError, OSError: there is no such line, or the run was made by another version or with other files.
    """
    record = record_in(folder, "--run ")
    suite = suite_of(record)
    scenarios = {one.name: one for one in suite.scenarios}
    name = _only("--scenario", scenario, list(scenarios))
    label = _only("--policy", policy, list(record.policies))
    content = read_bounded(folder / EPISODES, LARGEST_LINES)
    for _, line in read_lines(content):
        if (line.scenario, line.policy, line.episode) == (name, label, episode):
            break
    else:
        raise ValueError(
            f"--episode {episode} is not in {shown_path(folder)}: no line of {name}, {shown(label)} with that number; "
            f"a complete run has 0 to {record.episodes - 1}, this one may have been stopped"
        )
    where = f"suite {shown_path(record.suite_file or record.suite)}"
    now = scenarios[name].hash(make_definitions(suite, where)[name].definition.hash)
    if now != line.scenario_hash:
        raise ValueError(
            f"scenario {name} is not the one of the run: its hash is {now}, the line says {shown(line.scenario_hash)}; "
            "restore the file of its suite, road or world as it was when the run began"
        )
    if label in record.policy_sha256 and handed_over(label, record.policy_sha256.get(label)):
        raise ValueError(
            f"policy {shown(label)} was handed over in Python, so that no command can make it again; "
            "name it in the run as module:factory or path/to/file.py:factory"
        )
    entry = entry_of(label, code=policy is not None)
    if record.policy_sha256.get(label) != entry.sha256:
        raise ValueError(f"policy {shown(label)} is not the one of the run: its file has changed")
    return Replay(line, scenarios[name], entry)


def record_in(folder: Path, option: str = "") -> RunRecord:
    """Return the record of a run that is to be driven again; errors begin with the ``option`` that names its folder.

    Raises:
        ValueError: there is none, or it was made by another version or other sources.
    """
    try:
        record = RunRecord.read(folder)
    except AnotherRun as other:
        raise ValueError(
            f"{option}{shown_path(folder)} cannot be driven again as it was: {other.differences}; {other.advice}"
        ) from None
    if record is None:
        raise ValueError(f"{option}{shown_path(folder)} holds no run: {RUN} is missing")
    return record


def suite_of(record: RunRecord) -> Suite:
    """Return the suite of a run; ValueError or OSError where its file or its road's is missing or damaged."""
    if record.road is not None:
        return road_suite(Path(record.road), record.smoothing)
    return find_suite(record.suite_file or record.suite)


def _only(option: str, given: str | None, allowed: list[str]) -> str:
    """The value given, or the only one that there is."""
    if given is None and len(allowed) > 1:
        raise ValueError(f"{option} is missing; the run has {', '.join(allowed)}")
    value = allowed[0] if given is None else given
    choose(option, value, allowed)
    return value
