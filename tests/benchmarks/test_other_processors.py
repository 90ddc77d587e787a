"""Results of another processor are the same results: no fused multiply-add, vectors of another length, another BLAS."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy._core import _multiarray_umath

import lanekeep_agents
from lanekeep_agents.learned import LearnedPolicy
from lanekeep_agents.policy_file import read_policy
from lanekeep_benchmarks import cli

pytestmark = pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64"), reason="knows older ones of x86-64 alone"
)
#: How numba, numpy and OpenBLAS are told to compute as on a processor of 2008; no other machine is needed for it.
OLD = {
    "NUMBA_CPU_NAME": "x86-64",
    "NUMBA_CPU_FEATURES": "",
    "NPY_DISABLE_CPU_FEATURES": " ".join(_multiarray_umath.__cpu_dispatch__),
    "OPENBLAS_CORETYPE": "Nehalem",
}


def elsewhere(*command, cwd):
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    environment = {**os.environ, **OLD, "LANEKEEP_CACHE_DIR": str(cwd / "cache"), "PYTHONPATH": path}
    subprocess.run([sys.executable, "-W", "ignore", *command], check=True, cwd=cwd, timeout=900, env=environment)


def actions(file):
    """Write what each learned policy without a base answers to 1,000 observations such as it was trained on."""
    found = {}
    for path in sorted((Path(lanekeep_agents.__file__).parent / "zoo").glob("*.json")):
        record, tensors = read_policy(path)
        if record.student is None and record.base is None:
            drawn = np.random.default_rng(0).normal(size=(1000, record.inputs // record.frames))
            mean, variance = (tensors[name][-drawn.shape[1] :] for name in ("mean", "variance"))
            seen = mean + np.sqrt(variance + record.normalisation.epsilon) * drawn
            found[record.name] = LearnedPolicy(record, tensors).predict(seen.astype(np.float32))[0]
    beyond = [name for name in _multiarray_umath.__cpu_dispatch__ if _multiarray_umath.__cpu_features__[name]]
    np.savez(file, beyond=len(beyond), **found)


def test_learned_policies_answer_alike(tmp_path):
    actions(tmp_path / "here.npz")
    elsewhere("-c", "import test_other_processors as t; t.actions('there.npz')", cwd=tmp_path)
    with np.load(tmp_path / "here.npz") as here, np.load(tmp_path / "there.npz") as there:
        assert here.keys() == there.keys() and len(here) > 10 and there["beyond"] == 0
        equal = [np.mean(here[name] == there[name]) for name in here if name != "beyond"]
    # A number in the middle between two of float32 is rounded to either; of 25,000 none is expected to be one.
    assert np.mean(equal) > 0.9999


@pytest.mark.slow
def test_a_run_is_verified_on_another_processor(tmp_path, capsys):
    policies = "stanley,yin-lqr-observer,lq-preview-offset-free,distilled-lane-keep-seed0,ppo-road-works-seed0"
    run = ["-m", "lanekeep_benchmarks", "bench", "learned", "--policies", policies, "--episodes", "8", "--out", "run"]
    elsewhere(*run, cwd=tmp_path)
    assert cli.run(["verify", str(tmp_path / "run")]) == 0, capsys.readouterr().out
