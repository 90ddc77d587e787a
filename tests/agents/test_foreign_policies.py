"""Policy files of others: they open no other file, keep nobody waiting, and are refused on one short line."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("safetensors")
import gymnasium as gym
import policies
from harness import Watch

import lanekeep_agents
from lanekeep_agents.binding import Binding
from lanekeep_agents.learned import LearnedPolicy
from lanekeep_agents.policy_file import LARGEST_HEADER, LARGEST_INPUT, write_policy
from lanekeep_agents.policy_record import Network
from lanekeep_env import ENVIRONMENTS
from lanekeep_env.scenario import LaneKeepScenario, WallFollowScenario

Make = Callable[..., Any]


def refused(path: Path, *words: str) -> None:
    with pytest.raises(ValueError) as error:
        lanekeep_agents.load(path)
    message = str(error.value)
    assert message.isprintable() and len(message) < 1500
    for word in words:
        assert word in message


@pytest.fixture
def pair(tmp_path: Path, make_record: Make, make_tensors: Make) -> Path:
    record = make_record(LaneKeepScenario())
    write_policy(tmp_path / "policy.json", record, make_tensors(record))
    return tmp_path / "policy.json"


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    """A road and a world that can be read."""
    road, world, image = (tmp_path / name for name in ("road.csv", "world.yaml", "world.pgm"))
    road.write_text("".join(f"{10 * k},{5 * np.sin(k / 6)}\n" for k in range(200)))
    cells = np.full((40, 400), 254, dtype=np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = 0
    image.write_bytes(b"P5 400 40 255\n" + cells.tobytes())
    world.write_text(
        "image: world.pgm\nresolution: 0.05\norigin: [-1, -1, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    return {"road": str(road), "world": str(world)}


def test_damaged_policies_are_read_or_refused(tmp_path: Path) -> None:
    assert policies.violations(50, 1_000_000, tmp_path) == []


@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_no_value_of_a_scenario_makes_a_record_open_a_file(env_id: str, files: dict[str, str], make_record) -> None:
    scenario = ENVIRONMENTS[env_id].scenario()
    Binding(make_record(scenario, env_id=env_id))  # what is imported on the way is there
    naming = [*files.values(), *({"kind": kind, "path": file} for kind in ("file", "map") for file in files.values())]
    count = len(policies.places(scenario.to_dict()))
    assert count > 30
    for place in range(count):
        for value in naming:
            values = json.loads(json.dumps(scenario.to_dict()))
            inside, key = policies.places(values)[place]
            inside[key] = value
            record = replace(make_record(scenario, env_id=env_id), scenario=values)
            with Watch() as watch:
                try:
                    Binding(record)
                except ValueError as error:
                    assert str(error).isprintable() and len(str(error)) < 1500
            watch.require_only()


@pytest.mark.parametrize(
    ("field", "env_id", "scenario"),
    [("road", "lanekeep/LaneKeep-v0", LaneKeepScenario), ("world", "lanekeep/WallFollow-v0", WallFollowScenario)],
)
def test_a_file_is_read_where_it_is_allowed(
    field: str, env_id: str, scenario: Any, files: dict[str, str], tmp_path: Path, make_record, make_tensors
) -> None:
    driven = scenario(**{field: files[field]})
    record = make_record(driven, env_id=env_id)
    path = tmp_path / "policy.json"
    write_policy(path, record, make_tensors(record))
    refused(path, f"scenario.{field}", files[field][:20], "allow_files=True", "pass the scenario")
    rows = np.random.default_rng(0).normal(size=(20, len(driven.channels))).astype(np.float32)
    wanted, _ = lanekeep_agents.load(path, driven).predict(rows)
    np.testing.assert_array_equal(lanekeep_agents.load(path, allow_files=True).predict(rows)[0], wanted)
    Path(files[field]).unlink()
    with Watch() as watch:  # with one's own scenario, the record's is not built
        np.testing.assert_array_equal(lanekeep_agents.load(path, scenario()).predict(rows)[0], wanted)
    watch.require_only(path, path.with_suffix(".safetensors"))
    with pytest.raises(ValueError, match="cannot be read"):
        lanekeep_agents.load(path, allow_files=True)


def test_training_and_saving_on_the_road_of_a_file(files: dict[str, str], tmp_path: Path) -> None:
    stable_baselines3 = pytest.importorskip("stable_baselines3")
    few = {"num_envs": 2, "evaluation_episodes": 2, "evaluations": 1, "parameters": {"n_steps": 16, "batch_size": 16}}
    env = {"road": files["road"], "preview": 3, "episode_steps": 50}
    trained = lanekeep_agents.train("ppo", "LaneKeep-v0", tmp_path / "run", steps=32, env=env, **few)
    cars = lanekeep_agents.sb3_vec_env("lanekeep/LaneKeep-v0", 2, **env)
    saved = lanekeep_agents.save(tmp_path / "saved.json", stable_baselines3.PPO("MlpPolicy", cars, device="cpu"))
    for path, record, keywords in (
        (tmp_path / "run" / f"{trained.name}.json", trained.record, trained.record.training.hyperparameters["env"]),
        (tmp_path / "saved.json", saved, env),
    ):
        scenario = gym.make("lanekeep/LaneKeep-v0", **keywords).unwrapped.scenario
        assert record.scenario_hash == scenario.hash
        refused(path, "scenario.road")
        rows = np.random.default_rng(0).normal(size=(20, len(scenario.channels))).astype(np.float32)
        wanted, _ = lanekeep_agents.load(path, scenario).predict(rows)
        np.testing.assert_array_equal(lanekeep_agents.load(path, allow_files=True).predict(rows)[0], wanted)
        if record is trained.record:
            np.testing.assert_array_equal(trained.predict(rows)[0], wanted)


def test_what_a_file_of_an_allowed_size_can_hold_is_bounded(pair: Path) -> None:
    values, good = json.loads(pair.read_text()), pair.with_suffix(".safetensors").read_bytes()
    deep: Any = 1.0
    for _ in range(200):
        deep = {"base": [deep]}
    long = "x" * 500_000
    for change, words in (
        ({"scenario": {"vehicle": deep}}, ["scenario.vehicle.base", "nested too deeply"]),
        ({"scenario": {long: {str(k): k for k in range(30_000)}}}, ["scenario has no field 'xxx"]),
        ({"scenario": {**values["scenario"], "road": long}}, ["scenario.road", "allow_files=True"]),
        ({"name": long}, ["name='xxx", "200 of them at most"]),
        (
            {"channels": [{"name": f"c{k}", "unit": "", "description": "\n"} for k in range(10_000)]},
            ["mean", "(10000,)"],
        ),
        ({"channels": values["channels"] * 1000}, ["channels", "appears twice"]),
        ({"channels": [{**values["channels"][0], "unit": "\x1b[2J"}, *values["channels"][1:]]}, ["unit", "'\\x1b[2J'"]),
        ({"actions": 10**400}, ["actions", "<an integer of 400 digits>"]),
        ({"network": {"hidden": [10**400] * 8, "activation": "relu", "squash": False}}, ["network.hidden", "digits>"]),
        ({long: 1}, ["no field 'xxx"]),
    ):
        pair.write_text(json.dumps({**values, **change}))
        refused(pair, *words)
    empty = {"dtype": "F32", "shape": [0], "data_offsets": [0, 0]}
    header = json.dumps({f"tensor{k}": empty for k in range(20_000)}).encode()
    for claimed, words in (
        (len(header), ["header", str(LARGEST_HEADER)]),
        (2**64 - 1, ["header"]),
        (8, ["not a safe"]),
    ):
        weights = claimed.to_bytes(8, "little") + header
        pair.with_suffix(".safetensors").write_bytes(weights)
        pair.write_text(json.dumps({**values, "sha256": hashlib.sha256(weights).hexdigest()}))
        refused(pair, "policy.safetensors", *words)
    pair.with_suffix(".safetensors").write_bytes(good)
    pair.write_text(json.dumps(values))
    assert lanekeep_agents.load(pair).name == values["name"]


def test_nothing_is_written_that_would_not_be_read(tmp_path: Path, make_record: Make, make_tensors: Make) -> None:
    large = make_record(LaneKeepScenario(), hidden=(4096, 4096))
    wordy = make_record(LaneKeepScenario())
    wordy = replace(wordy, training=replace(wordy.training, command="x" * (1 << 20)))
    zeros = {name: np.zeros(shape, dtype=np.float32) for name, shape in large.shapes.items()}
    for record, tensors in ((large, zeros), (wordy, make_tensors(wordy))):
        with pytest.raises(ValueError, match=r"it would have \d+ bytes, allowed are \d+"):
            write_policy(tmp_path / "policy.json", record, tensors)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("activation", ["relu", "tanh"])
def test_a_network_that_is_read_stays_in_range(activation: str, make_record: Make, make_tensors: Make) -> None:
    """Of any observation within what is promised, with numbers of any size in its tensors."""
    scenario, rng = LaneKeepScenario(), np.random.default_rng(0)
    outcomes = []
    for seed in range(300):
        normalisation = {
            "clip": float(10.0 ** rng.uniform(0.0, 38.0)),
            "epsilon": float(10.0 ** rng.uniform(-90.0, 0.0)),
        }
        record = make_record(scenario, network=Network((8, 8), activation, False), normalisation=normalisation)
        tensors = make_tensors(record, seed)
        for name, tensor in tensors.items():
            tensors[name] = tensor * np.float32(10.0 ** rng.choice([-5.0, 0.0, 0.0, 18.0, 37.0]))
        try:
            policy = LearnedPolicy(record, tensors)
        except ValueError as error:
            assert "allowed are 1e+38" in str(error)
            outcomes.append(False)
            continue
        rows = rng.choice([-LARGEST_INPUT, 0.0, LARGEST_INPUT], size=(64, len(scenario.channels)))
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            actions, _ = policy.predict(rows)
        assert np.isfinite(actions).all()
        outcomes.append(True)
    assert 0.1 < np.mean(outcomes) < 0.9
