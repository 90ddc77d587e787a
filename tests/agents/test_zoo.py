"""What is shipped: policies, each with its command, and their page tells the truth about them."""

from __future__ import annotations

import json
import re
import shlex
from collections import defaultdict
from dataclasses import asdict
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from scipy import stats

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.distil.run import settings_for as distil_settings_for
from lanekeep_agents.policy_file import read_policy, read_record
from lanekeep_agents.training.run import command
from lanekeep_agents.training.settings import TrainingSettings, changes_from, settings_for
from lanekeep_benchmarks.summary import rows_of
from lanekeep_benchmarks.zoo import held_out_of
from lanekeep_env.adapters import ADAPTED
from lanekeep_env.scenario import DriveScenario, LaneKeepScenario, TurnOffScenario

ROOT = Path(__file__).parents[2]
ZOO = Path(lanekeep_agents.__path__[0], "zoo")
NAMES = lanekeep_agents.names()
DISTILLED = [name for name in NAMES if name.startswith("distilled-")]
NETWORKS = [name for name in NAMES if name not in DISTILLED]


def test_four_environments_have_policies_of_five_training_seeds():
    seeds = defaultdict(set)
    for name in NAMES:
        record = read_record(ZOO / f"{name}.json")
        seeds[record.env_id].add(record.training.seed)
    for task in ("LaneKeep", "Evasive", "WallFollow", "CameraLane"):
        assert seeds[f"lanekeep/{task}-v0"] >= {0, 1, 2, 3, 4}


@pytest.mark.parametrize("name", DISTILLED)
def test_the_command_of_a_distilled_one_learns_from_the_mix_that_it_was_distilled_from(name):
    record = read_record(ZOO / f"{name}.json")
    words = shlex.split(record.training.command)
    assert words[:2] == ["lanekeep", "distil"] and words[3] == "--seed" and len(words) == 5
    settings = distil_settings_for(words[2], int(words[4]))
    assert settings.name == name and settings.seed == record.training.seed
    assert json.loads(json.dumps(asdict(settings.mix))) == record.training.hyperparameters["mix"]


@pytest.mark.parametrize("name", NETWORKS)
def test_the_command_in_the_file_asks_for_the_settings_it_was_trained_with(name):
    """Otherwise nobody could train it again: the command is read as `lanekeep train` reads it."""
    record = read_record(ZOO / f"{name}.json")
    words = shlex.split(record.training.command)
    if words[0] == "python":  # an example, whose settings are in it
        options = set(re.findall(r'add_argument\("(--\w+)"', (ROOT / words[1]).read_text()))
        assert {word for word in words if word.startswith("--")} <= options
        assert int(words[words.index("--steps") + 1]) <= record.training.steps and words[-1] == f"{name}.json"
        return
    assert words[:2] == ["lanekeep", "train"]
    options = dict(zip(words[4::2], words[5::2], strict=True))
    sets = [words[i + 1] for i, word in enumerate(words) if word == "--set"]
    asked = changes_from(sets)
    asked |= {key: options.get(f"--{key}") for key in ("base", "imitate")}
    asked["bound"] = float(options["--bound"]) if "--bound" in options else None
    steps = int(options["--steps"]) if "--steps" in options else None
    settings = settings_for(words[2], words[3], int(options["--seed"]), steps, **asked)
    trained = TrainingSettings.from_dict(dict(record.training.hyperparameters), name)
    assert settings == trained and command(trained) == record.training.command


@pytest.mark.parametrize("name", NAMES)
def test_it_drives_better_than_doing_nothing(name):
    record = read_record(ZOO / f"{name}.json")
    if record.env_id in ADAPTED:
        pytest.importorskip("highway_env")
    policy, held_out = lanekeep_agents.load(name), held_out_of(record, 32, 7)

    class Nothing:
        def predict(self, observation, state=None, episode_start=None):
            return np.zeros((len(observation), record.actions), dtype=np.float32), None

    assert held_out.score(policy).mean_return > held_out.score(Nothing()).mean_return


@pytest.mark.parametrize("name", [name for name in DISTILLED if name.endswith("-seed0")])
def test_a_distilled_one_beats_the_controller_that_it_corrects(name):
    """The differences of the same episodes' returns, with 95 % of Student's distribution."""
    record = read_record(ZOO / f"{name}.json")
    keywords, differences = dict(record.training.hyperparameters["env"]), np.zeros(32)
    if isinstance(keywords.get("road"), dict):
        keywords["road"] = {**keywords["road"], "seed": 1}  # others than it learned from
    for sign, load in ((1.0, lanekeep_agents.load), (-1.0, lanekeep_baselines.make)):
        env = gym.make_vec(record.env_id, 32, vectorization_mode="vector_entry_point", **keywords)
        policy = load(name if sign > 0.0 else record.base, env.unwrapped.scenario)
        seen, _ = env.reset(seed=7)
        state = None
        for _ in range(env.unwrapped.scenario.episode_steps):
            action, state = policy.predict(seen, state)
            seen, reward, *_ = env.step(action)
            differences += sign * reward
    assert stats.ttest_1samp(differences, 0.0).confidence_interval(0.95).low > 0.0


@pytest.mark.parametrize("name", NETWORKS)
def test_nothing_that_hardly_varied_in_training_is_blown_up(name):
    """Of a channel with a mean, a per cent more is a standard deviation at the most."""
    _, tensors = read_policy(ZOO / f"{name}.json")
    assert (np.sqrt(tensors["variance"]) > 0.0099 * np.abs(tensors["mean"])).all()


def test_files_are_small_plain_and_come_in_pairs():
    files = sorted(file.name for file in ZOO.iterdir() if not file.name.startswith("."))
    assert files == sorted(f"{name}{end}" for name in NAMES for end in (".json", ".safetensors"))
    assert sum(file.stat().st_size for file in ZOO.iterdir()) < 2_000_000
    for name in NAMES:
        json.loads((ZOO / f"{name}.json").read_text())


def test_the_page_of_learned_policies_lists_them_all():
    text = (ROOT / "docs" / "learned-policies.md").read_text()
    listed = set(re.findall(r"^\| ((?:\S*?ppo|ars|distilled)-\S+(?: \(\d+ seeds\))?) \|", text, re.MULTILINE))
    assert listed == set(rows_of(NAMES))


@pytest.mark.parametrize(
    "scenario",
    [LaneKeepScenario(preview=20), LaneKeepScenario(), TurnOffScenario(), DriveScenario()],
    ids=lambda scenario: f"{type(scenario).__name__}-{getattr(scenario, 'preview', 0)}",
)
def test_names_are_those_that_load_and_nothing_is_designed_to_tell(scenario, monkeypatch):
    def load(name):
        try:
            return lanekeep_agents.load(name, scenario).name
        except ValueError:
            return None

    loaded = [name for name in NAMES if load(name)]
    monkeypatch.setattr(lanekeep_baselines, "make", None)
    assert list(lanekeep_agents.names(scenario)) == loaded
