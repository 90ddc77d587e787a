"""How long it takes to begin, each time in a fresh process: with nothing compiled, and with everything."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from statistics import median

#: Processes of which a warm start is the median.
WARM = 3
_IMPORT = "import time; t = time.perf_counter(); import lanekeep_env; print(time.perf_counter() - t)"
_FIRST_STEP = """
import time; t = time.perf_counter()
import gymnasium as gym, lanekeep_env
env = {make}
env.reset(seed=0)
env.step(env.action_space.sample())
print(time.perf_counter() - t)
"""
MAKERS = {
    "single": "gym.make({env_id!r})",
    "8 cars": "gym.make_vec({env_id!r}, 8, 'vector_entry_point')",
}


def start_up(
    ids: Sequence[str], kinds: Sequence[str] = tuple(MAKERS), report: Callable[[str], None] = lambda text: None
) -> dict[str, float]:
    """Return seconds of the import, and from the start to the first step of each environment, by what was done."""
    with tempfile.TemporaryDirectory() as cache:
        report("import")
        found = {"import": median(_seconds(_IMPORT, cache) for _ in range(WARM))}
    for env_id in ids:
        for kind in kinds:
            report(f"first step of {env_id}, {kind}")
            code = _FIRST_STEP.format(make=MAKERS[kind].format(env_id=env_id))
            with tempfile.TemporaryDirectory() as cache:
                found[f"{env_id}, {kind}, nothing compiled"] = _seconds(code, cache)
                found[f"{env_id}, {kind}, compiled before"] = median(_seconds(code, cache) for _ in range(WARM))
    return found


def _seconds(code: str, cache: str) -> float:
    """Run code that prints seconds in a fresh interpreter with that compile cache."""
    environment = os.environ | {"LANEKEEP_CACHE_DIR": cache}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout.split()[-1])
