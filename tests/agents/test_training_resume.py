"""Training that is really killed, at random moments, ends to the last bit where an unbroken run ends."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
from typer.testing import CliRunner

from lanekeep_agents.training.run import CHECKPOINT, EVALUATIONS, SETTINGS, run
from lanekeep_agents.training.settings import settings_for
from lanekeep_benchmarks.cli import app

pytestmark = [pytest.mark.long, pytest.mark.skipif(sys.platform == "win32", reason="signals")]

STEPS = 3200
# Episodes end at other times in every car, sensors draw noise, and the replay buffer runs over.
COMMON = dict(
    steps=STEPS,
    num_envs=16,
    hidden=[16, 16],
    critic=[16],
    evaluations=5,
    evaluation_episodes=4,
    env={"max_episode_steps": 70, "speed": 40.0, "sensors": {"yaw_rate": {"noise": 0.01}}},
)
OFF_POLICY = {"buffer_size": 1500, "batch_size": 32, "learning_starts": 320}
CASES = {
    "ppo": dict(log_std=-0.5, parameters={"n_steps": 20, "batch_size": 64, "n_epochs": 3}),
    "sac": dict(parameters=OFF_POLICY),
    "td3": dict(parameters=OFF_POLICY),
    "ppo residual": dict(base="yin-lqr-observer", bound=0.3, parameters={"n_steps": 20, "batch_size": 64}),
    "ppo imitating": dict(imitate="stanley", parameters={"n_steps": 20, "batch_size": 64}),
}
WORKER = f"""
import json, sys
from pathlib import Path
from lanekeep_agents.training.run import run
from lanekeep_agents.training.settings import TrainingSettings

folder, settings = Path(sys.argv[1]), TrainingSettings.from_dict(json.loads(sys.argv[2]), "settings")
resume = (folder / {SETTINGS!r}).exists()
run(settings, folder, resume=resume, checkpoint_seconds=0.1, report=lambda steps, line: print(steps, flush=True))
"""


def kill_beyond(steps, pause, folder, settings):
    """Train in a process of its own and kill it a while after it has done so many steps."""
    process = subprocess.Popen(
        [sys.executable, "-c", WORKER, str(folder), json.dumps(settings.to_dict())],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    for line in process.stdout:
        if int(line) >= steps:
            break
    time.sleep(pause)
    process.kill()
    _, error = process.communicate()
    assert process.returncode == -signal.SIGKILL, error


def state(folder):
    """Everything in a checkpoint but the time that it took."""
    with np.load(folder / CHECKPOINT, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    numbers = json.loads(str(arrays.pop("numbers")))
    del numbers["notes"]["seconds"]
    return numbers, arrays


@pytest.mark.parametrize("case", CASES)
def test_killed_training_ends_where_an_unbroken_run_ends(case, tmp_path):
    settings = settings_for(case.split()[0], "LaneKeep-v0", 4, **{**COMMON, **CASES[case]})
    unbroken, killed = tmp_path / "unbroken", tmp_path / "killed"
    run(settings, unbroken)
    rng = np.random.default_rng([2026, *case.encode()])
    for steps in sorted(rng.integers(0, STEPS // 2, size=2 if case == "ppo" else 1)):
        kill_beyond(steps, rng.uniform(0.0, 0.03), killed, settings)
        assert not list(killed.glob("*.safetensors"))
    result = CliRunner().invoke(app, ["train", "--resume", "--out", str(killed)])
    assert result.exit_code == 0, result.output

    weights = [next(folder.glob("*.safetensors")).read_bytes() for folder in (unbroken, killed)]
    assert weights[0] == weights[1]  # of the best policy, with its normalisation
    assert (killed / EVALUATIONS).read_bytes() == (unbroken / EVALUATIONS).read_bytes()
    assert (killed / EVALUATIONS).read_text().count("\n") > 5
    (numbers, arrays), (wanted, expected) = state(killed), state(unbroken)
    assert numbers == wanted and numbers["counts"]["num_timesteps"] == STEPS
    assert set(arrays) == set(expected)
    for name, array in expected.items():
        np.testing.assert_array_equal(arrays[name], array, err_msg=name)
