"""What a run leaves in its folder, and what it refuses to go on from; nothing in a checkpoint is unpickled."""

from __future__ import annotations

import io
import json
import math
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

import lanekeep_agents
from lanekeep_agents.training.evaluation import HeldOut
from lanekeep_agents.training.run import CHECKPOINT, EVALUATIONS, SETTINGS, run
from lanekeep_agents.training.settings import TrainingSettings, settings_for

TINY = dict(
    steps=400,
    num_envs=4,
    hidden=[8],
    critic=[8],
    evaluations=2,
    evaluation_episodes=2,
    env={"max_episode_steps": 100, "preview": 2},
)
PARAMETERS = {
    "ppo": {"n_steps": 25, "batch_size": 50},
    "sac": {"buffer_size": 1000, "batch_size": 16, "learning_starts": 40},
}


def tiny(algorithm="ppo", seed=0, **changes):
    return settings_for(algorithm, "LaneKeep-v0", seed, **{**TINY, "parameters": PARAMETERS[algorithm], **changes})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folders of finished runs, one an algorithm and seed."""
    root = tmp_path_factory.mktemp("training")
    folders = {}
    for algorithm, seed in (("ppo", 0), ("ppo", 1), ("sac", 0)):
        folders[algorithm, seed] = root / f"{algorithm}{seed}"
        run(tiny(algorithm, seed), folders[algorithm, seed], checkpoint_seconds=0.0)
    return folders


@pytest.fixture
def folder(finished, tmp_path):
    """A copy of the run of PPO with seed 0, with its settings and its checkpoint alone."""
    for name in (SETTINGS, CHECKPOINT):
        (tmp_path / name).write_bytes((finished["ppo", 0] / name).read_bytes())
    return tmp_path


def test_a_run_leaves_what_it_says(finished):
    for (algorithm, seed), folder in finished.items():
        name = f"{algorithm}-lane-keep-seed{seed}"
        files = {file.name for file in folder.iterdir()}
        assert files == {SETTINGS, CHECKPOINT, EVALUATIONS, "tensorboard", f"{name}.json", f"{name}.safetensors"}
        record = lanekeep_agents.load(folder / f"{name}.json").record
        rows = np.genfromtxt(folder / EVALUATIONS, delimiter=",", names=True)
        assert rows["steps"].tolist() == sorted(set(rows["steps"])) and rows["steps"][-1] == 400
        assert record.training.scores["mean_return"] == rows["mean_return"].max()  # the best one is kept
        assert TrainingSettings.from_dict(dict(record.training.hyperparameters), "record") == tiny(algorithm, seed)


def test_the_policy_file_scores_what_the_record_says(finished):
    settings = tiny()
    policy = lanekeep_agents.load(finished["ppo", 0] / "ppo-lane-keep-seed0.json")
    keywords = {"dtype": "float32", **settings.env}
    score = HeldOut(settings.env_id, keywords, settings.evaluation_episodes, settings.seed_of("evaluation"))
    assert score.score(policy).mean_return == policy.record.training.scores["mean_return"]


def test_a_folder_is_not_taken_by_mistake(finished, folder):
    with pytest.raises(ValueError, match="already holds a run"):
        run(tiny(), folder)
    with pytest.raises(ValueError, match=r"holds another run: seed is 0 there, 2 wanted"):
        run(tiny(seed=2), folder, resume=True)
    with pytest.raises(ValueError, match="holds no run to resume"):
        run(tiny(), folder / "elsewhere", resume=True)
    (folder / "tensorboard").mkdir()
    old = folder / "tensorboard" / "events.out.tfevents.1.old"
    old.write_bytes(b"")
    policy = folder / "ppo-lane-keep-seed0.json"
    policy.write_text("{}")
    assert run(tiny(seed=1), folder, overwrite=True).name == "ppo-lane-keep-seed1"
    assert not old.exists() and not policy.exists() and '"seed": 1' in (folder / SETTINGS).read_text()


def weights(folder):
    return next(folder.glob("*.safetensors")).read_bytes()


def refused(folder):
    """Refuse to go on, in one short line, and leave the folder as it is."""
    before = {file: file.read_bytes() for file in folder.iterdir()}
    with pytest.raises(ValueError) as error:
        run(tiny(), folder, resume=True)
    assert str(folder / CHECKPOINT) in str(error.value)
    assert "\n" not in str(error.value) and len(str(error.value)) < 1000
    assert {file: file.read_bytes() for file in folder.iterdir()} == before
    return str(error.value)


def test_a_whole_checkpoint_is_taken_and_holds_plain_arrays_only(folder, finished):
    with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
        assert {file[name].dtype.kind for name in file.files} <= set("biufU")
    run(tiny(), folder, resume=True)
    assert weights(folder) == weights(finished["ppo", 0])


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_a_truncated_checkpoint_is_refused(share, folder):
    content = (folder / CHECKPOINT).read_bytes()
    (folder / CHECKPOINT).write_bytes(content[: int(share * len(content))])
    refused(folder)


def test_a_checkpoint_with_other_bytes_is_refused_or_means_the_same(folder, finished):
    content = (folder / CHECKPOINT).read_bytes()
    rng = np.random.default_rng(0)
    refusals = 0
    for _ in range(30):
        bad = bytearray(content)
        bad[rng.integers(len(bad))] ^= 1 << rng.integers(8)
        (folder / CHECKPOINT).write_bytes(bad)
        try:
            run(tiny(), folder, resume=True)
        except ValueError as error:
            assert str(folder / CHECKPOINT) in str(error)
            refusals += 1
        else:
            assert weights(folder) == weights(finished["ppo", 0])
    assert refusals > 15


def changed(folder, **arrays):
    """Write the checkpoint with other arrays in it; None leaves one out."""
    with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
        kept = {name: file[name] for name in file.files}
    kept = {name: value for name, value in {**kept, **arrays}.items() if value is not None}
    np.savez(folder / CHECKPOINT, **kept)


@pytest.mark.parametrize("name", ["numbers", "normalisation.mean", "random.torch", "cars.counters"])
def test_a_checkpoint_that_lacks_something_is_refused(name, folder):
    changed(folder, **{name: None})
    refused(folder)


@pytest.mark.parametrize(
    "other", [np.zeros(3), np.zeros(()), np.array(["a"]), np.array("not JSON"), np.array("[]")], ids=str
)
@pytest.mark.parametrize("name", ["numbers", "normalisation.mean", "random.numpy", "cars.counters"])
def test_a_checkpoint_with_something_else_in_it_is_refused(name, other, folder):
    changed(folder, **{name: other})
    refused(folder)


def renumbered(folder, *path, value):
    """Write the checkpoint with another value at a place in its numbers."""
    with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
        numbers = json.loads(str(file["numbers"]))
    place = numbers
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    changed(folder, numbers=np.array(json.dumps(numbers)))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("counts", "num_timesteps"), -1),
        (("counts", "num_timesteps"), 1.5),
        (("counts", "num_timesteps"), 10**400),
        (("counts", "_current_progress_remaining"), "1"),
        (("numpy", 0), "PCG64"),
        (("numpy", 1), 10**6),
        (("numpy", 1), -1),
        (("numpy", 3), math.nan),
        (("action_space", "state", "inc"), 10**400),
        (("policy", "pairs", 1, 1, "tensor"), "torch.policy.log_std"),
        (("policy", "pairs", 0), []),
        (("policy.optimizer", "pairs", 0, 1, "pairs", 0, 1, "pairs", 1, 1, "tensor"), "torch.policy.action_net.weight"),
        (("policy.optimizer", "pairs", 1, 1, "list", 0, "pairs", 1, 1, "list", 0), "0.9"),
        (("policy.optimizer", "pairs", 1, 1, "list", 0, "pairs", 0, 1), -1.0),
        (("notes", "scores"), []),
        (("notes", "scores", 0), 3),
        (("notes", "scores", 0, 1, 0), "x"),
        (("notes", "seconds"), {}),
        (("notes", "seconds", "total"), 10**400),
    ],
    ids=str,
)
def test_numbers_that_no_run_has_are_refused(path, value, folder):
    renumbered(folder, *path, value=value)
    refused(folder)


def test_a_checkpoint_of_the_slower_ppo_is_refused_and_says_why(folder):
    """Up to November 2026 Adam's step was not fused, and the critic's errors not bounded."""
    with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
        group = json.loads(str(file["numbers"]))["policy.optimizer"]["pairs"][1][1]["list"][0]["pairs"]
    place = [key for key, _ in group].index("fused")
    renumbered(folder, "policy.optimizer", "pairs", 1, 1, "list", 0, "pairs", place, 1, value=None)
    assert "has other settings (fused): another version has trained it" in refused(folder)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("normalisation.variance", -1.0, "normalisation.variance holds -1.0"),
        ("normalisation.mean", np.nan, "normalisation.mean holds nan"),
        ("torch.policy.action_net.weight", np.inf, "torch.policy.action_net.weight holds inf"),
        ("torch.policy.optimizer.state.1.exp_avg_sq", -1.0, "policy.optimizer.exp_avg_sq holds -1.0"),
        ("best.layers.0.weight", np.nan, "best.layers.0.weight holds nan"),
        ("seen._last_obs", np.nan, "seen._last_obs holds nan"),
        ("rewards.returns", np.inf, "rewards.returns holds inf"),
        ("cars.cars", 1e30, "state: along 1e+30 is not allowed"),
        ("cars.counters", 2**62, "state: segment 4611686018427387904 does not exist"),
    ],
)
def test_arrays_that_no_run_has_are_refused(name, value, words, folder):
    with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
        array = file[name]
    changed(folder, **{name: np.full_like(array, value)})
    assert words in refused(folder).replace("'", "")
    changed(folder, **{name: array.astype("f2")})
    refused(folder)
    changed(folder, **{name: array, "x" * 1000: array})
    assert "is unknown" in refused(folder)


def test_a_bomb_is_refused(folder):
    with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
        kept = {name: file[name] for name in file.files}
    np.savez_compressed(folder / CHECKPOINT, **kept, bomb=np.zeros(3 << 20))
    assert (folder / CHECKPOINT).stat().st_size < 1 << 20
    assert "its arrays have" in refused(folder)


@pytest.mark.parametrize("name", [SETTINGS, CHECKPOINT, EVALUATIONS, "ppo-lane-keep-seed0.json"])
def test_what_is_no_file_is_refused_at_once(name, folder):
    (folder / name).unlink(missing_ok=True)
    for make in (os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)):
        make(folder / name)
        for how in ({"resume": True}, {"overwrite": True}):
            with pytest.raises(ValueError, match="not an ordinary file"):
                run(tiny(), folder, **how)
        assert (folder / CHECKPOINT).exists() or name == CHECKPOINT
        os.rename(folder / name, folder.parent / f"{name}-{make}")


def test_two_runs_never_share_a_folder(tmp_path):
    """While one is under way, another that goes on with it or replaces it is refused, and spoils nothing."""
    pytest.importorskip("fcntl")
    refusals = []

    def intrude(steps, line):
        for how in ({"resume": True}, {"overwrite": True}):
            with pytest.raises(ValueError, match="another process is writing there") as error:
                run(tiny(), tmp_path / "shared", **how)
            refusals.append(str(error.value))

    run(tiny(), tmp_path / "shared", report=lambda steps, line: None if refusals else intrude(steps, line))
    assert len(refusals) == 2
    run(tiny(), tmp_path / "shared", resume=True)


@pytest.mark.parametrize("other", [("ppo", 1), ("sac", 0)], ids=str)
def test_the_checkpoint_of_another_run_is_refused(other, folder, finished):
    (folder / CHECKPOINT).write_bytes((finished[other] / CHECKPOINT).read_bytes())
    refused(folder)


class Harm:
    """Creates a file where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self):
        return Path.touch, (self._path,)


def test_harm_would_be_done_by_unpickling(tmp_path):
    pickle.loads(pickle.dumps(Harm(tmp_path / "harm")))
    assert (tmp_path / "harm").exists()


def harmful(kind, folder):
    """Bytes that do harm to who unpickles them."""
    harm, content = Harm(folder / "harm"), io.BytesIO()
    if kind == "pickle":
        pickle.dump(harm, content)
    elif kind == "torch":
        torch.save({"numbers": harm}, content)
    elif kind == "npy":
        np.save(content, np.array([harm], dtype=object), allow_pickle=True)
    elif kind == "npz":
        np.savez(content, numbers=np.array([harm], dtype=object))
    else:
        with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
            kept = {name: file[name] for name in file.files}
        np.savez(content, **{**kept, "random.torch": np.array([harm], dtype=object)})
    return content.getvalue()


@pytest.mark.parametrize("kind", ["pickle", "torch", "npy", "npz", "one array"])
def test_nothing_is_unpickled(kind, folder):
    (folder / CHECKPOINT).write_bytes(harmful(kind, folder))
    refused(folder)
    assert not (folder / "harm").exists()
