"""Folders of others, damaged: `python tests/fuzz/results.py --count 3000 --seed 0`.

Result lines, `run.json`, a training run's settings, its checkpoint, a search's settings, trials and values and a
recording are read as the commands do, up to where driving would start. What is refused must leave the folder as it was,
and nothing but its files may be opened.
Prints a line for each kind and exits 1 on any violation, each with its seed.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from damages import Damage, damaged_json, damaged_lines, damaged_npz
from harness import Watch, drive, mutated, special_files

import lanekeep_baselines
from lanekeep_agents.distil.mix import Lessons
from lanekeep_agents.training.evaluation import HeldOut
from lanekeep_agents.training.folder import CHECKPOINT, SETTINGS, check, settings_in
from lanekeep_agents.training.normalisation import Normalised
from lanekeep_agents.training.rewards import LearnersRewards
from lanekeep_agents.training.run import _Course, _model, _Sitting, run
from lanekeep_agents.training.settings import TrainingSettings, settings_for
from lanekeep_agents.vec_env import CarVecEnv
from lanekeep_baselines.identification import DrivenRun
from lanekeep_benchmarks import runs
from lanekeep_benchmarks.results import EPISODES
from lanekeep_benchmarks.run_record import RUN
from lanekeep_benchmarks.suites import SUITES, Suite, SuiteScenario
from lanekeep_benchmarks.tune.record import best_text
from lanekeep_benchmarks.tune.run import BEST, TRIALS, Tuning
from lanekeep_benchmarks.tune.settings import settings_for as tune_settings_for
from lanekeep_benchmarks.tune.settings import settings_in as tune_settings_in
from lanekeep_env.scenario import LaneKeepScenario

Files = dict[str, bytes]

SUITE = Suite(
    "fuzzed",
    "two short scenarios",
    tuple(
        SuiteScenario(road, road, {"road": road, "departure": "cost", "preview": 1}, max_episode_steps=5)
        for road in ("slalom", "circle")
    ),
    episodes=3,
)
#: Of a search, in place of those that the id has.
SHORT = (Lessons("short", keywords={"episode_steps": 5}),)
TINY: dict[str, Any] = dict(
    steps=400,
    num_envs=4,
    hidden=[8],
    critic=[8],
    evaluations=2,
    evaluation_episodes=2,
    env={"max_episode_steps": 20, "preview": 2},
    parameters={"buffer_size": 150, "batch_size": 16, "learning_starts": 40},
)


def benchmark_run(folder: Path) -> Files:
    """The files of a run that is half done."""
    plan, opened = runs.open_run(runs.Options("fuzzed", ("pd", "yin-lqr"), out=folder))
    with opened:
        for _ in runs.drive(plan, opened):
            pass
    lines = (folder / EPISODES).read_bytes().splitlines(keepends=True)
    return {RUN: (folder / RUN).read_bytes(), EPISODES: b"".join(lines[:7]) + lines[7][:40]}


def training_run(folder: Path) -> Files:
    """The files of a training run, which has a replay buffer that ran over."""
    run(settings_for("sac", "LaneKeep-v0", 0, **TINY), folder, checkpoint_seconds=0.0)
    return {name: (folder / name).read_bytes() for name in (SETTINGS, CHECKPOINT)}


def search_run(folder: Path) -> Files:
    """A search that has ended."""
    settings = replace(tune_settings_for("pd", "LaneKeep-v0", 5), sets=SHORT)
    outcome = Tuning(settings, folder).run()
    (folder / BEST).write_text(best_text(settings, outcome, folder))
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def recording(folder: Path) -> Files:
    """A recording of 6 s."""
    time = np.arange(121) * 0.05
    run = DrivenRun(0.05, np.full(121, 20.0), np.sin(time), command=np.cos(time), x=time, y=time, heading=time)
    run.save(folder / "run.npz")
    return {"run.npz": (folder / "run.npz").read_bytes()}


_make_plan = cache(runs.make_plan)


def _planned(*options: Any) -> runs.Plan:
    """What the options plan; planned once, since that takes longer than all the rest."""
    return replace(_make_plan(*options), results=[])


def resume_benchmark(folder: Path) -> None:
    """What `lanekeep bench --resume` does before it drives; the run must have all of its lines then."""
    with mock.patch.object(runs, "make_plan", _planned):
        plan, opened = runs.open_run(runs.Options(out=folder, resume=True))
    with opened:
        lines = [json.loads(line) for line in (folder / EPISODES).read_bytes().split(b"\n") if line]
    assert len(lines) == len(plan.results) == len({result.place for result in plan.results}) <= plan.total
    for line in lines:
        assert set(line["metrics"]) == set(plan.metrics[line["scenario"]])
        assert np.isfinite(np.array(list(line["metrics"].values()), dtype=float)).all()


def _course(settings: TrainingSettings, folder: Path) -> tuple[Any, Any]:
    """A fresh model, and what takes up its checkpoint."""
    cars = CarVecEnv(settings.env_id, settings.num_envs, dtype="float32", **settings.env)
    rewards = LearnersRewards(cars, 1.0, settings.gamma, settings.reward_scale)
    env = Normalised(rewards)
    return _model(settings, env), _Course(settings, folder, env, rewards, _held_out(), None, _Sitting(0.0, 0.0, None))


@cache
def _held_out() -> HeldOut:
    return HeldOut("lanekeep/LaneKeep-v0", {}, 1, 0)


def resume_training(folder: Path) -> None:
    """What `lanekeep train --resume` does before it trains, and a few steps of the cars as they were left."""
    settings = settings_in(folder)
    check(settings, folder, True, False)
    if settings.to_dict() != settings_for("sac", "LaneKeep-v0", 0, **TINY).to_dict():
        return  # another run, with models and memory of its own
    model, course = _course(settings, folder)
    course.take_up(model)
    for _ in range(3):
        model.get_env().step(np.zeros((settings.num_envs, 1), dtype=np.float32))


def resume_search(folder: Path) -> None:
    """What `lanekeep tune --resume` does before it drives."""
    search = Tuning(replace(tune_settings_in(folder), sets=SHORT), folder, resume=True)
    assert all(one.score is None or np.isfinite([one.score, *one.returns]).all() for one in search.trials)


def load_tuned(folder: Path) -> None:
    """A controller that was tuned, and a step of it."""
    scenario = LaneKeepScenario()
    action, _ = lanekeep_baselines.load(folder / BEST, scenario).predict(scenario.channel_bounds().mean(axis=1))
    assert np.isfinite(action).all()


def load_recording(folder: Path) -> None:
    """What `DrivenRun.load` gives must be usable."""
    found = DrivenRun.load(folder / "run.npz")
    assert np.isfinite(found.speed).all() and found.seconds >= 5.0


#: How a kind's originals are made, which file of them is damaged, how, and what reads them.
KINDS: Mapping[str, tuple[Callable[[Path], Files], str, Damage, Callable[[Path], None]]] = {
    "result lines": (benchmark_run, EPISODES, damaged_lines, resume_benchmark),
    "run record": (benchmark_run, RUN, damaged_json, resume_benchmark),
    "training settings": (training_run, SETTINGS, damaged_json, resume_training),
    "checkpoint": (training_run, CHECKPOINT, damaged_npz, resume_training),
    "search's settings": (search_run, SETTINGS, damaged_json, resume_search),
    "search's trials": (search_run, TRIALS, damaged_lines, resume_search),
    "tuned values": (search_run, BEST, damaged_json, load_tuned),
    "recording": (recording, "run.npz", damaged_npz, load_recording),
}


def snapshot(folder: Path) -> dict[str, tuple[Any, ...]]:
    """Everything in a folder: kinds, times and the content of ordinary files."""
    found = {}
    for path in sorted(folder.rglob("*")):
        status = os.lstat(path)
        ordinary = path.is_file() and not path.is_symlink() and status.st_size < 1 << 20 and os.access(path, os.R_OK)
        content = path.read_bytes() if ordinary else None
        found[str(path)] = status.st_mode, status.st_ino, status.st_size, status.st_mtime_ns, content
    return found


def judged(read: Callable[[Path], None], folder: Path) -> None:
    """Read a folder under watch; refused or not, nothing outside it is opened, and refused it is as it was."""
    before = snapshot(folder)
    refused: Exception | None = None
    with Watch() as watch:
        try:
            read(folder)
        except (ValueError, OSError) as error:
            refused = error
    strange = [path for path in (*watch.read, *watch.written) if not Path(path).is_relative_to(folder.resolve())]
    assert not strange, f"opened {strange}"
    assert not watch.run, f"ran {watch.run}"
    if refused is not None:
        assert snapshot(folder) == before, f"changed the folder, and refused it: {refused}"
        raise refused


class Checks:
    """Damages what `KINDS` has and judges how it is read."""

    def __init__(self, root: Path) -> None:
        SUITES["fuzzed"] = SUITE
        self.root = root
        made: dict[Callable[[Path], Files], Files] = {}
        for make, *_ in KINDS.values():
            if make not in made:
                folder = root / make.__name__
                folder.mkdir()
                made[make] = make(folder)
        self.originals = made
        for kind in KINDS:  # what is whole is read; and nothing is left to import or to compile while somebody watches
            self.judge(kind, lambda content, _: content, 0)
            self.judge(kind, lambda content, _: content, 0)

    def judge(self, kind: str, damage: Damage, seed: int) -> None:
        """Read one damaged folder."""
        make, name, _, read = KINDS[kind]
        with tempfile.TemporaryDirectory(dir=self.root) as place:
            folder = Path(place)
            files = dict(self.originals[make])
            files[name] = damage(files[name], np.random.default_rng(seed))
            for file, content in files.items():
                (folder / file).write_bytes(content)
            judged(read, folder)

    def damaged(self, kind: str, count: int, seed: int) -> list[str]:
        """Judge ``count`` drawn damages, every third one of bytes; return the violations."""

        def judge(number: int) -> None:
            self.judge(kind, mutated if number % 3 == 0 else KINDS[kind][2], number)

        numbers = range(seed * 10_000_000, seed * 10_000_000 + count)
        cases = [(f"seed {number}", number) for number in numbers]
        return drive(judge, cases, name=kind, refusals=(ValueError, OSError))

    def special(self) -> list[str]:
        """Put what is no file in the place of each file; return the violations."""

        def judge(case: tuple[str, str]) -> None:
            kind, what = case
            make, name, _, read = KINDS[kind]
            with tempfile.TemporaryDirectory(dir=self.root) as place, tempfile.TemporaryDirectory() as other:
                for file, content in self.originals[make].items():
                    (Path(place) / file).write_bytes(content)
                (Path(place) / name).unlink()
                wanted = dict(special_files(Path(other)))[what]
                if not os.path.lexists(wanted):
                    return
                os.rename(wanted, Path(place) / name)
                judged(read, Path(place))
                assert (what, name) in (("an empty file", EPISODES), ("NULs", EPISODES)), "was read"

        with tempfile.TemporaryDirectory() as other:
            whats = [what for what, _ in special_files(Path(other))]
        cases = [(f"{what} as {kind}", (kind, what)) for kind in KINDS for what in whats]
        return drive(judge, cases, name="special files", refusals=(ValueError, OSError))


def main() -> int:
    """Run the checks that the command line asks for; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=3000, help="damages of each kind")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as root:
        checks = Checks(Path(root))
        found = checks.special()
        for kind in KINDS:
            found += checks.damaged(kind, options.count, options.seed)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
