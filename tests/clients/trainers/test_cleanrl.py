"""CleanRL's ppo_continuous_action.py and sac_continuous_action.py, as published.

`cleanrl/` holds both unchanged: version 2.0.0b1, commit fe8d8a0 of 20 April 2026 (MIT). CleanRL pins Gymnasium 0.29.1,
whose `SyncVectorEnv` and `TransformObservation` have changed since then; `CHANGES` is what each script needs on any
environment of Gymnasium 1.1 or newer, and nothing in it is about lanekeep's.
"""

from __future__ import annotations

import runpy
import sys
import types
from pathlib import Path

import gymnasium as gym
import pytest
from gymnasium.envs.registration import EnvSpec

pytest.importorskip("tyro")
from stable_baselines3.common import buffers

PUBLISHED = Path(__file__).parent / "cleanrl"
SAME_STEP = "autoreset_mode=gym.vector.AutoresetMode.SAME_STEP"
CHANGES = {
    "ppo": {"np.clip(obs, -10, 10))": "np.clip(obs, -10, 10), env.observation_space)"},
    "sac": {
        "for i in range(args.num_envs)]\n": f"for i in range(args.num_envs)], {SAME_STEP}\n",
        'infos["final_observation"]': 'infos["final_obs"]',
        # Infos are one mapping of arrays now, no longer one mapping an environment: the log alone reads them.
        'if "final_info" in infos:': "if False:",
    },
}
SMALL = {
    "ppo": "--total-timesteps 256 --num-steps 64 --num-envs 2",
    "sac": "--total-timesteps 260 --learning-starts 240 --buffer-size 1000 --batch-size 32",
}


@pytest.fixture
def script(tmp_path, monkeypatch):
    """Run a script of CleanRL's with changes to its text; return its variables."""
    named = types.ModuleType("cleanrl_utils")
    monkeypatch.setitem(sys.modules, "cleanrl_utils", named)
    monkeypatch.setitem(sys.modules, "cleanrl_utils.buffers", buffers)  # theirs is a copy of it

    def run(algorithm, env_id, changes):
        file = f"{algorithm}_continuous_action.py"
        text = (PUBLISHED / file).read_text()
        for old, new in changes.items():
            assert text.count(old) == 1
            text = text.replace(old, new)
        (tmp_path / file).write_text(text)
        monkeypatch.setattr("sys.argv", [file, "--env-id", env_id, "--no-cuda", *SMALL[algorithm].split()])
        return runpy.run_path(str(tmp_path / file), run_name="__main__")

    return run


@pytest.fixture
def short(monkeypatch):
    """An id of one's own, as the scripts take no other options: episodes that are truncated after 20 steps."""

    def make(env_id):
        spec = EnvSpec("Short-v0", gym.spec(env_id).entry_point, kwargs={"episode_steps": 20})
        monkeypatch.setitem(gym.registry, "Short-v0", spec)
        return "Short-v0"

    return make


@pytest.mark.parametrize("named", ["lanekeep_env:{}", "short"])
@pytest.mark.parametrize("algorithm", CHANGES)
def test_a_script_trains(env_id, algorithm, named, script, short, tmp_path):
    left = script(algorithm, short(env_id) if named == "short" else named.format(env_id), CHANGES[algorithm])
    assert left["global_step"] >= 256
    assert len(list((tmp_path / "runs").rglob("events*"))) == 1
