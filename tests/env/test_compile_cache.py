"""The compile cache: used by the next process, blind to nothing, and never mixed up."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lanekeep_env import compile as compiling

RUN = """
import sys, numba, gymnasium as gym, numpy as np, lanekeep_env
out = []
for model in sys.argv[1:]:
    env = gym.make("lanekeep/LaneKeep-v0", vehicle={"steering": {"lag": 0.0}}, **eval(model))
    env.reset(seed=0)
    for _ in range(5):
        info = env.step(np.array([0.3], np.float32))[4]
    out.append(info["lateral_error"])
hits = sum(sum(f.stats.cache_hits.values()) for f in [env.unwrapped._core.step])
print(hits, *out)
"""
MODELS = ['{"dynamics": "kinematic"}', '{"tyre": "linear"}', '{"tyre": "magic_formula"}']


def run(cache, *models):
    environment = {**os.environ, "LANEKEEP_CACHE_DIR": str(cache)}
    out = subprocess.run(
        [sys.executable, "-c", RUN, *models], env=environment, capture_output=True, text=True, check=True, timeout=120
    )
    hits, *results = out.stdout.split()
    return int(hits), results


def test_kernels_cached_by_different_processes_stay_apart(tmp_path):
    """Each model compiled in a process of its own; then one process loads all three from the cache."""
    alone = [run(tmp_path, model) for model in MODELS]
    assert [hits for hits, _ in alone] == [0, 0, 0]
    hits, together = run(tmp_path, *MODELS)
    assert hits == 1
    assert together == [result for _, (result,) in alone]
    assert len(set(together)) == 3


@pytest.mark.parametrize("edited", ["physics/tyres.py", "envs/road_start.py", "compile.py", "layout.py"])
def test_an_edit_of_any_kernel_source_opens_a_new_cache(tmp_path, edited):
    package = tmp_path / "lanekeep_env"
    shutil.copytree(Path(compiling.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    before = compiling.source_hash(package)
    assert before == compiling.source_hash(Path(compiling.__file__).parent)
    with (package / edited).open("a", encoding="utf-8") as file:
        file.write("\n# an edit\n")
    assert compiling.source_hash(package) != before


def test_every_compiled_module_counts_for_the_hash():
    """No module that imports the compiler's decorators is outside the hashed sources."""
    package = Path(compiling.__file__).parent
    hashed = {
        file
        for name in compiling.KERNEL_SOURCES
        for file in ((package / name).rglob("*.py") if (package / name).is_dir() else [package / name])
    }
    compiled = {file for file in package.rglob("*.py") if "lanekeep_env.compile import" in file.read_text("utf-8")}
    assert compiled and compiled <= hashed


def test_an_unwritable_cache_costs_only_time(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    assert len(run(blocked, MODELS[0])[1]) == 1
