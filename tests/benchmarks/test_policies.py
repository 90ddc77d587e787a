"""Learned policies in the benchmark: found by name or file, shown by training seeds, refused before anything is driven.

What stands for a learned policy here is a file that holds a gain and the channels that it needs.
"""

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lanekeep_agents
import lanekeep_baselines
from lanekeep_benchmarks import cli, policies
from lanekeep_benchmarks.__main__ import main
from lanekeep_benchmarks.suites import SUITES, Suite, SuiteScenario
from lanekeep_env import LaneKeepScenario

_SHORT: dict = {"departure": "cost", "preview": 2}
SUITE = Suite(
    "short",
    "two short scenarios",
    (
        SuiteScenario("slalom", "A slalom", {"road": "slalom", **_SHORT}, max_episode_steps=20),
        SuiteScenario(
            "noise",
            "Noise that policies are told half of",
            {"road": "slalom", "sensors": {"lateral_error": {"noise": 0.2}}, **_SHORT},
            max_episode_steps=20,
            told={"sensors": {"lateral_error": {"noise": 0.1}}},
        ),
    ),
    episodes=4,
    learned=True,
)


class Gain:
    """Steers against the lateral error."""

    def __init__(self, gain):
        self.gain = gain

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return -self.gain * np.asarray(observation)[..., :1], state


@pytest.fixture
def zoo(tmp_path, monkeypatch):
    """Five training seeds, and one policy that looks further ahead than the suite does."""
    folder = tmp_path / "zoo"
    folder.mkdir()
    for seed in range(5):
        record = {"gain": 0.1 + 0.01 * seed, "preview": 2}
        (folder / f"ppo-lane-keep-seed{seed}.json").write_text(json.dumps(record))
    (folder / "sac-ahead.json").write_text(json.dumps({"gain": 0.1, "preview": 20}))

    def fits(file, scenario):
        return json.loads(file.read_text())["preview"] <= scenario.preview

    def names(scenario=None):
        return tuple(f.stem for f in sorted(folder.glob("*.json")) if scenario is None or fits(f, scenario))

    def load(name_or_path, scenario=None):
        file = Path(name_or_path) if name_or_path.endswith(".json") else folder / f"{name_or_path}.json"
        if not fits(file, scenario):
            raise ValueError(f"policy {file.stem!r} needs the channel 'curvature_preview_19'")
        return Gain(json.loads(file.read_text())["gain"])

    monkeypatch.setattr(lanekeep_agents, "names", names)
    monkeypatch.setattr(lanekeep_agents, "load", load)
    monkeypatch.setattr(policies, "ZOO", folder)
    monkeypatch.setitem(SUITES, "short", SUITE)
    return folder


SEEDS = ",".join(f"ppo-lane-keep-seed{seed}" for seed in range(5))


def bench(out, *arguments):
    return main(["bench", *arguments, "--out", str(out)])


def test_training_seeds_are_one_row_and_every_line_stays(zoo, tmp_path, capsys):
    out = tmp_path / "out"
    assert bench(out, "short", "--policies", f"pd,{SEEDS}") == 0
    assert "ppo-lane-keep (5 seeds)" in capsys.readouterr().out
    lines = [json.loads(line) for line in (out / "episodes.jsonl").read_text().splitlines()]
    assert len(lines) == 2 * 6 * 4
    for scenario in json.loads((out / "summary.json").read_text())["scenarios"]:
        first, second = scenario["policies"]
        assert (first["policy"], second["policy"]) == ("pd", "ppo-lane-keep (5 seeds)")
        errors = [
            line["metrics"]["rms_lateral_error"]
            for line in lines
            if line["scenario"] == scenario["scenario"] and line["policy"].startswith("ppo")
        ]
        assert len(errors) == 20
        assert second["metrics"]["rms_lateral_error"]["value"] == pytest.approx(np.mean(errors))


def test_zoo_and_files_are_told_apart_and_remembered(zoo, tmp_path):
    mine = tmp_path / "mine.json"
    mine.write_text(json.dumps({"gain": 0.3, "preview": 0}))
    out = tmp_path / "out"
    assert bench(out, "short", "--policies", f"pd,ppo-lane-keep-seed3,{mine}") == 0
    recorded = json.loads((out / "run.json").read_text())["policy_sha256"]
    files = {"ppo-lane-keep-seed3": zoo / "ppo-lane-keep-seed3.json", str(mine): mine}
    assert recorded == {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()}


@pytest.mark.parametrize("changed", ["mine.json", "zoo/ppo-lane-keep-seed0.json"])
def test_a_changed_policy_is_not_resumed(zoo, tmp_path, changed, capsys):
    (tmp_path / "mine.json").write_text(json.dumps({"gain": 0.3, "preview": 0}))
    out = tmp_path / "out"
    assert bench(out, "short", "--policies", f"ppo-lane-keep-seed0,{tmp_path / 'mine.json'}") == 0
    assert bench(out, "--resume") == 0
    (tmp_path / changed).write_text(json.dumps({"gain": 0.31, "preview": 0}))
    capsys.readouterr()
    assert bench(out, "--resume") == 2
    error = capsys.readouterr().err
    assert "policy_sha256 of " in error and "restore the policy's file" in error and error.count("\n") == 1


def test_the_default_is_all_that_can_drive(zoo, tmp_path):
    """Classical controllers first, so that the reference is one; of the zoo what needs no more than the suite shows."""
    out = tmp_path / "out"
    assert bench(out, "short", "--episodes", "1") == 0
    driven = json.loads((out / "run.json").read_text())["policies"]
    classical = [name for name in driven if name in lanekeep_baselines.names()]
    assert "yin-lqr-feedforward" in classical and "traechtler-pd" not in classical
    assert driven == [*classical, *SEEDS.split(",")]


def test_other_suites_leave_the_zoo_out_unless_asked(zoo):
    scenario = LaneKeepScenario(preview=20)
    assert not set(policies.default_policies([scenario])) & set(lanekeep_agents.names())
    assert set(policies.default_policies([scenario], learned=True)) >= set(lanekeep_agents.names())


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("ppo-lane-kep-seed0", ["did you mean 'ppo-lane-keep-seed0'", "stanley", "lanekeep zoo", ".json"]),
        ("stanly", ["did you mean 'stanley'"]),
        ("nowhere.json", ["'nowhere.json'", "no such file"]),
        ("pd,sac-ahead", ["sac-ahead cannot drive slalom of short", "curvature_preview_19"]),
        ("pd,traechtler-pd", ["traechtler-pd cannot drive slalom of short"]),
    ],
)
def test_what_cannot_drive_is_refused_before_anything_is_driven(zoo, tmp_path, given, words, capsys):
    out = tmp_path / "out"
    assert bench(out, "short", "--policies", given) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and all(word in error for word in words)
    assert not out.exists()


def test_policies_are_told_what_the_suite_says(zoo, tmp_path, monkeypatch):
    """Made for half of the noise that is driven, in the episodes and in the pictures."""
    told = []
    make = policies.make_policy
    monkeypatch.setattr(
        "lanekeep_benchmarks.policies.make_policy",
        lambda name, scenario: told.append(dict(scenario.sensors)) or make(name, scenario),
    )
    assert bench(tmp_path / "out", "short", "--policies", "pd", "--episodes", "1") == 0
    assert [sensors["lateral_error"].noise for sensors in told if sensors] == [0.1]


@pytest.mark.parametrize("name", ["ppo-lane-keep-seed0", "zoo/ppo-lane-keep-seed0.json"])
def test_play_drives_learned_policies(zoo, tmp_path, monkeypatch, name, capsys):
    pytest.importorskip("pygame")
    monkeypatch.chdir(tmp_path)
    assert cli.run(["play", "--seconds", "0.5", "--policy", name]) == 0
    assert "drove 0.5 s" in capsys.readouterr().out
    assert [file.name for file in (tmp_path / "results").iterdir()] == ["LaneKeep-v0-ppo-lane-keep-seed0-seed0.gif"]


def test_a_residual_policy_that_corrects_nothing_drives_as_its_base(tmp_path, monkeypatch):
    """A real file, all the way: every metric of every episode is that of the controller below."""
    pytest.importorskip("safetensors")
    from lanekeep_agents import policy_file
    from lanekeep_agents import policy_record as records

    monkeypatch.setitem(SUITES, "short", SUITE)
    scenario = LaneKeepScenario(preview=1)
    record = records.PolicyRecord(
        name="residual",
        algorithm="PPO",
        env_id="lanekeep/LaneKeep-v0",
        scenario=scenario.to_dict(),
        scenario_hash=scenario.hash,
        channels=[records.InputChannel(c.name, c.unit, c.description) for c in scenario.channels],
        actions=1,
        action=scenario.action,
        max_steering_angle=scenario.max_steering_angle,
        max_steering_rate=scenario.max_steering_rate,
        control_step=scenario.control_step,
        network=records.Network((4,), "tanh", False),
        normalisation=records.Normalisation(),
        base="stanley",
        bound=0.2,
        training=records.Training("none", {}, 0, 0, 0.0, {}, {}),
    )
    tensors = {name: np.zeros(shape, dtype=np.float32) for name, shape in record.shapes.items()}
    tensors["variance"] += 1.0
    policy_file.write_policy(tmp_path / "residual.json", record, tensors)
    out = tmp_path / "out"
    assert bench(out, "short", "--policies", f"stanley,{tmp_path / 'residual.json'}") == 0
    lines = [json.loads(line) for line in (out / "episodes.jsonl").read_text().splitlines()]
    stanley, residual = (
        {(line["scenario"], line["episode"]): line["metrics"] for line in lines if line["policy"].endswith(name)}
        for name in ("stanley", "residual.json")
    )
    assert len(stanley) == 8 and residual == stanley


def test_the_classical_benchmark_starts_without_trainers_and_matplotlib():
    code = (
        "import sys, lanekeep_benchmarks.runs as b, lanekeep_benchmarks.cli;"
        "b.make_plan('classical', ('pd', 'stanley'), None, 1, 0);"
        "print(sorted({'torch', 'stable_baselines3', 'safetensors', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
