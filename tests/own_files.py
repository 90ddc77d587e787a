"""A trial of other people's road files and maps: whether each loads, is driven to its end, or is refused and why.

    python tests/own_files.py FOLDER [--policies stanley,lq-preview-offset-free] [--keywords JSON]

JSON are keywords of gym.make for roads, such as {"vehicle": "my_car.yaml"}. Roads are driven once, a loop one lap, in
LaneKeep-v0; maps (YAML) a lap in Circuit-v0 by `knightriders-circuit`. What is refused is so in one line; anything else
is an error. Exit status 1 if there is one.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import lanekeep_baselines
import lanekeep_env  # noqa: F401 (registers the environments)
from lanekeep_env.roads.readers import READERS

MAPS = (".yaml", ".yml")


def driven(env_id: str, policy: str, **keywords: Any) -> str:
    """Drive one episode; how it ended."""
    env = gym.make(env_id, episode_steps="lap", **keywords)
    scenario = env.unwrapped.scenario
    law = lanekeep_baselines.make(policy, scenario)
    state, starts = np.zeros((1, law.memory)), np.ones(1, dtype=bool)
    observation, _ = env.reset(seed=0)
    steps, over, worst, errors = 0, False, 0.0, []
    while not over:
        action, state = law.predict(observation[None], state, starts)
        starts[:] = False
        observation, _, terminated, truncated, info = env.step(np.clip(action[0], -1.0, 1.0))
        errors.append(abs(info["lateral_error"]))
        steps, over, worst = steps + 1, terminated or truncated, max(errors)
    env.close()
    end = f"after {steps * scenario.control_step:.0f} s"
    if env_id.endswith("Circuit-v0"):
        return f"{'contact' if info['cost'] > 0.0 else 'lap' if terminated else 'no lap'} {end}"
    rms = float(np.sqrt(np.mean(np.square(errors))))
    return f"{'left the lane' if terminated else 'driven'} {end}, RMS {rms:.3f} m, most {worst:.2f} m"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--policies", default="stanley,lq-preview-offset-free")
    parser.add_argument("--keywords", default="{}", help="of gym.make, for roads")
    given = parser.parse_args()
    failed = False
    for path in sorted(given.folder.rglob("*")):
        suffix, begin = path.suffix.lower(), time.process_time()
        if suffix in MAPS:
            trials = [("lanekeep/Circuit-v0", "knightriders-circuit", {"world": {"map": str(path)}})]
        elif suffix in READERS:
            keywords = {"road": str(path), "preview": 20, **json.loads(given.keywords)}
            trials = [("lanekeep/LaneKeep-v0", policy, keywords) for policy in given.policies.split(",")]
        else:
            continue
        for env_id, policy, keywords in trials:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    told = driven(env_id, policy, **keywords)
                except ValueError as error:
                    told = f"refused: {error}"
                    failed |= "\n" in told
                except Exception as error:
                    told, failed = f"ERROR {type(error).__name__}: {error}", True
            print(
                f"{path.relative_to(given.folder)} | {policy} | {told} | {time.process_time() - begin:.1f} s",
                flush=True,
            )
            if told.startswith("refused"):
                break
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
