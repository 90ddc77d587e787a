"""Settings of training runs: the YAML files, what the command line refuses, and what the seed fixes."""

from __future__ import annotations

import functools
import json
import math
import shlex

import pytest

pytest.importorskip("stable_baselines3")
from stable_baselines3 import PPO, SAC, TD3
from typer.testing import CliRunner

import lanekeep_env
from lanekeep_agents.training.run import command
from lanekeep_agents.training.settings import ALGORITHMS, TrainingSettings, changes_from, settings_for
from lanekeep_agents.vec_env import CarVecEnv
from lanekeep_benchmarks.cli import app
from lanekeep_env import layout

IDS = sorted(lanekeep_env.ENVIRONMENTS)
RUNNER = CliRunner()


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_every_entry_of_the_yaml_files_builds(algorithm, env_id):
    settings = settings_for(algorithm, env_id)
    assert TrainingSettings.from_dict(json.loads(json.dumps(settings.to_dict())), "settings") == settings
    envs = CarVecEnv(env_id, 32, **settings.env)
    kind = {"ppo": PPO, "sac": SAC, "td3": TD3}[algorithm]
    parameters = {**settings.parameters, **({} if algorithm == "ppo" else {"buffer_size": 10})}
    model = kind("MlpPolicy", envs, gamma=settings.gamma, device="cpu", **parameters)
    for name, value in parameters.items():
        found = getattr(model, name)
        assert (found.frequency if name == "train_freq" else found) == value
    envs.close()


def test_an_entry_overrides_the_default_and_mappings_are_merged(tmp_path, monkeypatch):
    monkeypatch.setattr("lanekeep_agents.training.settings.HYPERPARAMETERS", tmp_path)
    (tmp_path / "ppo.yaml").write_text(
        "default: {steps: 10, num_envs: 2, hidden: [4], critic: [4], gamma: 0.9, learning_rate: 0.1,"
        " parameters: {n_steps: 3}}\n"
        "residual: {log_std: -3.0, gamma: 0.8}\n"
        "lanekeep/Drive-v0: {gamma: 0.7, env: {slope: 0.1}, parameters: {n_epochs: 2}}\n"
    )
    plain = settings_for("ppo", "LaneKeep-v0")
    assert (plain.steps, plain.gamma, plain.parameters, plain.env) == (10, 0.9, {"n_steps": 3}, {})
    drive = settings_for("ppo", "Drive-v0", env={"wind": 1.0}, parameters={"n_steps": 5}, log_std=-1.0)
    assert (drive.gamma, drive.log_std, drive.env) == (0.7, -1.0, {"slope": 0.1, "wind": 1.0})
    assert drive.parameters == {"n_steps": 5, "n_epochs": 2}
    residual = settings_for("ppo", "Drive-v0", base="pd", bound=0.1)
    assert (residual.gamma, residual.log_std) == (0.8, -3.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("dqn LaneKeep-v0", ["ALGO='dqn'", "ppo, sac, td3"]),
        ("pop LaneKeep-v0", ["ALGO='pop'", "did you mean 'ppo'"]),
        ("ppo LaneKep-v0", ["ENV='lanekeep/LaneKep-v0'", "did you mean 'lanekeep/LaneKeep-v0'"]),
        ("ppo", ["ALGO and ENV are missing"]),
        ("ppo LaneKeep-v0 --set learning_rte=1", ["unknown setting 'learning_rte'", "'learning_rate'"]),
        ("ppo LaneKeep-v0 --set learning_rate=fast", ["learning_rate='fast'", "> 0.0"]),
        ("ppo LaneKeep-v0 --set learning_rate=null", ["learning_rate=None", "> 0.0"]),
        ("ppo LaneKeep-v0 --set gamma=1", ["gamma=1 ", "<= 0.9999"]),
        ("ppo LaneKeep-v0 --set gamma=nan", ["gamma='nan'", "a finite number"]),
        ("ppo LaneKeep-v0 --set num_envs=2.5", ["num_envs=2.5", "a whole number >= 1"]),
        ("ppo LaneKeep-v0 --set hidden=32", ["hidden=32 ", "a list"]),
        ("ppo LaneKeep-v0 --set hidden=[true]", ["hidden=True", ">= 2"]),
        ("ppo LaneKeep-v0 --set critic=[1]", ["critic=1 ", ">= 2"]),
        ("ppo LaneKeep-v0 --set activation=gelu", ["activation='gelu'", "relu, tanh"]),
        ("ppo LaneKeep-v0 --set env=5", ["env=5 ", "a mapping"]),
        ("ppo LaneKeep-v0 --set env.num_envs=3", ["env.num_envs", "training sets it itself"]),
        ("ppo LaneKeep-v0 --set env.previw=3", ["env: got an unexpected keyword argument 'previw'", "'preview'"]),
        ("ppo LaneKeep-v0 --set env.road=2026-01-01", ["env={", "date", "JSON"]),
        ('ppo LaneKeep-v0 --set env.road={"kind":1}', ["road=1", "sine"]),
        ('ppo LaneKeep-v0 --set env.vehicle={"mas":1}', ["vehicle has no field 'mas'", "'mass'"]),
        ("ppo LaneKeep-v0 --set env.preview=-1", ["preview=-1", ">= 0"]),
        ("ppo Circuit-v0 --set env.preview=3", ["env: got an unexpected keyword argument 'preview'"]),
        ("ppo LaneKeep-v0 --set parameters.n_stepps=3", ["parameters='n_stepps'", "'n_steps'"]),
        ("ppo LaneKeep-v0 --set parameters.buffer_size=3", ["parameters='buffer_size'", "n_steps"]),
        ("ppo LaneKeep-v0 --set parameters.n_epochs=-1", ["parameters.n_epochs=-1", ">= 1"]),
        ("ppo LaneKeep-v0 --set parameters.gae_lambda=null", ["parameters.gae_lambda=None", "<= 1.0"]),
        ("sac LaneKeep-v0 --set parameters.train_freq=0", ["parameters.train_freq=0", ">= 1"]),
        ("ppo LaneKeep-v0 --set gamma=1" + 400 * "0", ["gamma=<an integer of 400 digits>", "a finite number"]),
        ("sac LaneKeep-v0 --set parameters.ent_coef=auto_..", ["parameters.ent_coef='auto_..'", 'or "auto"']),
        ("sac LaneKeep-v0 --set parameters.ent_coef=x", ["parameters.ent_coef='x'", 'or "auto"']),
        ("td3 LaneKeep-v0 --set parameters.ent_coef=auto", ["parameters='ent_coef'", "policy_delay"]),
        ("ppo LaneKeep-v0 --set gamma", ["--set 'gamma'", "NAME=VALUE"]),
        ("ppo LaneKeep-v0 --set =3", ["--set '=3'", "NAME=VALUE"]),
        ("ppo LaneKeep-v0 --set env.=3", ["--set 'env.=3'", "NAME=VALUE"]),
        ("ppo LaneKeep-v0 --set gamma=[[", ["--set 'gamma=[['"]),
        ("ppo LaneKeep-v0 --set env=3 --set env.preview=3", ["--set 'env.preview=3'", "env=3 is not a mapping"]),
        ("ppo LaneKeep-v0 --set seed=3", ["--set 'seed=3'", "--seed"]),
        ("ppo LaneKeep-v0 --set base=pd", ["--set 'base=pd'", "--base"]),
        ("ppo LaneKeep-v0 --base pd", ["base='pd' and bound=None", "both"]),
        ("ppo LaneKeep-v0 --bound 0.1", ["base=None and bound=0.1", "both"]),
        ("ppo LaneKeep-v0 --base pd --bound 3", ["bound=3.0", "<= 2.0"]),
        ("ppo LaneKeep-v0 --base pdd --bound 0.1", ["'pdd' is unknown", "pd"]),
        ("ppo LaneKeep-v0 --base pd --bound 0.1 --imitate pd", ["base and imitate exclude each other"]),
        ("ppo LaneKeep-v0 --imitate werling-drive", ["'werling-drive'", "2 number(s)"]),
        ("--resume", ["--resume needs --out"]),
        ("--resume --seed 3", ["--resume needs --out"]),
        ("ppo LaneKeep-v0 --resume --overwrite", ["resume and overwrite exclude each other"]),
    ],
)
def test_what_is_not_allowed_is_one_line_that_names_it_and_touches_nothing(arguments, words, tmp_path):
    if "needs --out" not in words[0]:
        arguments += f" --out {tmp_path / 'run'}"
    result = RUNNER.invoke(app, ["train", *arguments.split()])
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and result.stdout == ""
    for word in words:
        assert word in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_changes_are_json_or_yaml():
    texts = ["gamma=1e-5", "env.action=steering_rate", "env.road={kind: sine}", "hidden=[8, 8]", "log_std=-2"]
    assert changes_from(texts) == {
        "gamma": 1e-5,
        "env": {"action": "steering_rate", "road": {"kind": "sine"}},
        "hidden": [8, 8],
        "log_std": -2,
    }


@pytest.mark.parametrize(
    "value",
    [
        *("!!int", "!!int ''", "!!float x", "!!timestamp x", "!!bool x", "!!binary é", "!!omap [a]", "!!null {"),
        *("!!python/name:os.system", "!!python/object/apply:os.system [ls]", "!x", "&a [*a]", "[&a x, *a]"),
        *("[" * 5000, "{a: " * 2000, "- " * 3000, "9" * 5000, "NaN" * 6000, '{"a": 1, "a": 2}', "\0", "? ? ?", "%x"),
        "{a: &a [x, x], b: &b [*a, *a], c: [*b, *b]}",
    ],
    ids=lambda value: value[:20],
)
def test_values_that_are_neither_json_nor_plain_yaml_are_one_line(value):
    with pytest.raises(ValueError) as error:
        changes_from([f"env.x={value}"])
    text = str(error.value)
    assert text.startswith("--set ") and text.isprintable() and len(text) < 300


@pytest.mark.parametrize("value", [[1e999], {"a": math.nan}, functools.reduce(lambda deep, _: [deep], range(500), 1)])
def test_an_env_that_no_record_can_hold_is_refused(value):
    with pytest.raises(ValueError, match="a record must hold it as JSON"):
        settings_for("ppo", "LaneKeep-v0", env={"road": value})


def test_whole_numbers_may_be_written_as_floats():
    settings = settings_for("sac", "LaneKeep-v0", parameters={"buffer_size": 1e4, "ent_coef": "auto_0.1"})
    assert isinstance(settings.parameters["buffer_size"], int) and settings.parameters["ent_coef"] == "auto_0.1"


def test_the_recorded_command_trains_the_same_policy():
    wanted = settings_for("ppo", "TurnOff-v0", 7, 500, imitate="traechtler-blind", gamma=0.9, env={"speed": 3.0})
    read: dict[str, list[str]] = {"--set": []}
    words = shlex.split(command(wanted))
    for name, value in zip(words[4::2], words[5::2], strict=True):
        read.setdefault(name, []).append(value)
    found = settings_for(
        *words[2:4],
        int(read["--seed"][0]),
        int(read["--steps"][0]),
        imitate=read["--imitate"][0],
        **changes_from(read["--set"]),
    )
    assert found == wanted


def test_no_two_seeds_share_a_lane():
    """The keys from which cars draw everything random, of runs with neighbouring seeds and of their evaluations."""
    seen: dict[int, tuple[int, str]] = {}
    for seed in range(20):
        settings = settings_for("ppo", "LaneKeep-v0", seed)
        for purpose in ("training", "evaluation"):
            cars = CarVecEnv("lanekeep/LaneKeep-v0", 128)
            cars.seed(settings.seed_of(purpose))
            cars.reset()
            for key in cars.env.unwrapped.get_state()["counters"][layout.KEY].tolist():
                assert key not in seen, (seen.get(key), seed, purpose)
                seen[key] = seed, purpose
    assert len(seen) == 20 * 2 * 128
