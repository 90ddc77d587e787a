"""Policy files: what is written is read again, and nothing else is, least of all executed."""

from __future__ import annotations

import hashlib
import json
import pickle
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("safetensors")
import safetensors.numpy

import lanekeep_agents
from lanekeep_agents.learned import LearnedPolicy
from lanekeep_agents.policy_file import read_policy, write_policy
from lanekeep_agents.policy_record import PolicyRecord
from lanekeep_env.scenario import LaneKeepScenario

SCENARIO = LaneKeepScenario(preview=3)


@pytest.fixture
def policy(tmp_path: Path, make_record, make_tensors) -> Path:
    record = make_record(SCENARIO)
    write_policy(tmp_path / "policy.json", record, make_tensors(record))
    return tmp_path / "policy.json"


def forge(path: Path, content: bytes) -> None:
    """Replace the weights, and the sum in the record with them, as somebody who means harm would."""
    path.with_suffix(".safetensors").write_bytes(content)
    values = json.loads(path.read_text())
    path.write_text(json.dumps({**values, "sha256": hashlib.sha256(content).hexdigest()}))


def refused(path: Path, *words: str) -> None:
    with pytest.raises(ValueError) as error:
        lanekeep_agents.load(path)
    message = str(error.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_what_is_written_is_read(policy: Path, make_record, make_tensors) -> None:
    record = make_record(SCENARIO)
    tensors = make_tensors(record)
    for path in (policy, policy.with_suffix(".safetensors")):
        found, values = read_policy(path)
        assert replace(found, sha256="") == record
        assert found.sha256 == hashlib.sha256(policy.with_suffix(".safetensors").read_bytes()).hexdigest()
        assert set(values) == set(tensors)
        for name in tensors:
            np.testing.assert_array_equal(values[name], tensors[name])
    assert sorted(file.name for file in policy.parent.iterdir()) == ["policy.json", "policy.safetensors"]


def test_an_existing_policy_stays_unless_told(policy: Path, make_record, make_tensors) -> None:
    record = make_record(SCENARIO, name="another")
    before = [file.read_bytes() for file in sorted(policy.parent.iterdir())]
    with pytest.raises(ValueError, match=r"policy.json exists"):
        write_policy(policy, record, make_tensors(record, 1))
    assert [file.read_bytes() for file in sorted(policy.parent.iterdir())] == before
    write_policy(policy, record, make_tensors(record, 1), overwrite=True)
    assert lanekeep_agents.load(policy).name == "another"


def test_a_pickle_is_refused_and_not_run(policy: Path, tmp_path: Path) -> None:
    touched = tmp_path / "touched"

    class Payload:
        def __reduce__(self):
            return Path.touch, (touched,)

    content = pickle.dumps(Payload())
    pickle.loads(content)
    assert touched.exists()  # the payload would work
    touched.unlink()
    policy.with_suffix(".safetensors").write_bytes(content)
    refused(policy, "policy.safetensors", "sha256", hashlib.sha256(content).hexdigest())
    forge(policy, content)
    refused(policy, "policy.safetensors", "not a safetensors file")
    policy.write_bytes(content)
    refused(policy, "policy.json")
    assert not touched.exists()


def test_truncated_and_tampered_weights_are_refused(policy: Path) -> None:
    weights = policy.with_suffix(".safetensors")
    content = weights.read_bytes()
    for damaged in (content[:-4], content[:20], b"", content[:-1] + bytes([content[-1] ^ 1])):
        weights.write_bytes(damaged)
        refused(policy, "policy.safetensors", "sha256", hashlib.sha256(content).hexdigest())
    for damaged in (content[:-4], content[:20], b"", b"\xff" * 8 + content[8:]):
        forge(policy, damaged)
        refused(policy, "policy.safetensors", "not a safetensors file")


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("mean", lambda a: a[:-1], ["mean", "(8,)", "(9,)"]),
        ("layers.1.weight", lambda a: a.T[:4].copy(), ["layers.1.weight", "(4, 8)", "(8, 8)"]),
        ("layers.0.bias", lambda a: a.astype(np.float64), ["layers.0.bias", "float64", "float32"]),
        ("layers.2.weight", lambda a: a * np.float32(np.nan), ["layers.2.weight", "nan", "finite"]),
        ("layers.2.bias", lambda a: a / np.float32(0.0), ["layers.2.bias", "inf", "finite"]),
        ("variance", lambda a: -a, ["variance", ">= 0"]),
        ("layers.2.bias", None, ["layers.2.bias"]),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_other_tensors_are_refused(policy: Path, make_record, make_tensors, name, change, words) -> None:
    record = make_record(SCENARIO)
    tensors = make_tensors(record)
    if change is None:
        del tensors[name]
    else:
        tensors[name] = change(tensors[name])
    forge(policy, safetensors.numpy.save(tensors))
    refused(policy, "policy.safetensors", *words)
    with pytest.raises(ValueError, match=words[0]):
        write_policy(policy.with_name("new.json"), record, tensors)
    assert not policy.with_name("new.json").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": 2}, ["format", "2", "1"]),
        ({"colour": "red"}, ["colour"]),
        ({"actions": 3}, ["actions", "3", "<= 2"]),
        ({"actions": True}, ["actions", "True"]),
        ({"action": "steering_rates"}, ["action", "steering_rates", "did you mean 'steering_rate'"]),
        ({"env_id": "lanekeep/LaneKept-v0"}, ["env_id", "lanekeep/LaneKeep-v0"]),
        ({"control_step": "0.05"}, ["control_step", "'0.05'"]),
        ({"max_steering_angle": 0.0}, ["max_steering_angle", "0.0", "> 0"]),
        ({"scenario_hash": "x" * 16}, ["scenario_hash", "hexadecimal"]),
        ({"sha256": ""}, ["sha256", "hexadecimal"]),
        ({"channels": []}, ["channels"]),
        ({"channels": [{"name": "speed", "unit": "m/s"}]}, ["channels[0]", "description"]),
        ({"bound": 0.2}, ["bound", "0.2"]),
        ({"base": "pd"}, ["bound", "None"]),
        ({"base": "pd", "bound": -1.0}, ["bound", "-1.0"]),
        ({"network": {"hidden": [8, 1], "activation": "relu", "squash": False}}, ["network.hidden", "1", ">= 2"]),
        ({"network": {"hidden": [8, 8], "activation": "swish", "squash": False}}, ["network.activation", "swish"]),
        ({"network": {"hidden": [8, 8], "activation": "relu", "squash": 1}}, ["network.squash", "1"]),
        ({"network": {"hidden": [8, 8], "activation": "relu"}}, ["network", "squash"]),
        ({"normalisation": {"clip": -1.0, "epsilon": 1e-8}}, ["normalisation.clip", "-1.0"]),
        ({"training": {}}, ["training", "command"]),
        ({"name": "../evil"}, ["name", "../evil"]),
    ],
    ids=str,
)
def test_other_records_are_refused(policy: Path, change, words) -> None:
    policy.write_text(json.dumps({**json.loads(policy.read_text()), **change}))
    refused(policy, "policy.json", *words)


def test_a_scenario_with_an_unknown_field_names_file_field_and_what_is_allowed(policy: Path) -> None:
    values = json.loads(policy.read_text())
    values["scenario"] |= {"lane_widht": 3.0}
    policy.write_text(json.dumps(values))
    names = [field.name for field in fields(SCENARIO)]
    refused(policy, "policy.json", "no field 'lane_widht' (did you mean 'lane_width'?)", *names)


#: All but what older files do not have.
NEEDED = ["format", *(field.name for field in fields(PolicyRecord) if field.name not in ("frames", "student"))]


@pytest.mark.parametrize("field", NEEDED)
def test_a_missing_field_is_refused(policy: Path, field: str) -> None:
    values = json.loads(policy.read_text())
    del values[field]
    policy.write_text(json.dumps(values))
    refused(policy, "policy.json", field)


@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_of_a_record_are_finite(policy: Path, word: str) -> None:
    content = policy.read_text()
    for before in ('"gamma": 0.98', '"control_step": 0.05', '"seconds": 1.5'):
        assert content.count(before) >= 1
        policy.write_text(content.replace(before, f"{before.split(':')[0]}: {word}"))
        refused(policy, "policy.json", "inf" if word == "1e999" else word)


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{", b"[" * 500_000, b'{"format": 1, "format": 1}', b"\xff\xfe", b" " * (1 << 21)]
)
def test_what_is_no_record_is_refused(policy: Path, content: bytes) -> None:
    policy.write_bytes(content)
    refused(policy, "policy.json")


def test_a_file_that_is_too_large_is_not_read(policy: Path) -> None:
    with policy.with_suffix(".safetensors").open("r+b") as file:
        file.truncate(1 << 40)  # a sparse file
    refused(policy, "policy.safetensors", str(1 << 40), str(1 << 26))


def test_a_missing_file_is_named(policy: Path) -> None:
    policy.with_suffix(".safetensors").unlink()
    refused(policy, "policy.safetensors is missing")
    refused(policy.with_name("other.json"), "other.json is missing")
    refused(policy.with_name("ppo-none"), "ppo-none")


def test_a_policy_for_other_channels_is_refused(policy: Path, make_record, make_tensors) -> None:
    def refuses(scenario, *words):
        with pytest.raises(ValueError) as error:
            lanekeep_agents.load(policy, scenario)
        for word in words:
            assert word in str(error.value)

    assert isinstance(lanekeep_agents.load(policy, SCENARIO), LearnedPolicy)
    refuses(replace(SCENARIO, preview=2), "'curvature_preview_2'", "0.2 s ahead")
    refuses(replace(SCENARIO, preview_interval=0.2), "'curvature_preview_1'", "0.1 s ahead", "0.2 s ahead")
    refuses(replace(SCENARIO, control_step=0.1), "control_step=0.1", "0.05")
    two = make_record(SCENARIO, actions=2)
    with pytest.raises(ValueError, match="actions=1; allowed: 2"):
        LearnedPolicy(two, make_tensors(two), SCENARIO)
    channels = [replace(c, unit="km/h") if c.name == "speed" else c for c in make_record(SCENARIO).channels]
    other = make_record(SCENARIO, channels=channels)
    with pytest.raises(ValueError, match=r"'speed' has the unit 'm/s', allowed: 'km/h'"):
        LearnedPolicy(other, make_tensors(other), SCENARIO)


def test_names_of_the_zoo_and_the_nearest(policy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in lanekeep_agents.names():
        assert lanekeep_agents.load(name).name == name
    monkeypatch.setattr(lanekeep_agents, "_zoo", lambda: policy.parent)
    assert lanekeep_agents.names() == ("policy",)
    assert lanekeep_agents.names(SCENARIO) == ("policy",)
    assert lanekeep_agents.names(LaneKeepScenario()) == ()
    assert lanekeep_agents.load("policy").name == lanekeep_agents.load(Path("policy")).name == "ppo-test"
    with pytest.raises(ValueError, match=r"'polcy' is unknown \(did you mean 'policy'\?\)"):
        lanekeep_agents.load("polcy")
