"""One run of distillation: teachers, rounds, scores, the policy's files; every step is on disk when it is done."""

from __future__ import annotations

import hashlib
import io
import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
import lanekeep_env
from lanekeep_agents.distil.features import products
from lanekeep_agents.distil.lessons import Shown, arrays_in, read_shown, shown_by_teacher, write_shown
from lanekeep_agents.distil.mix import Lessons, Mix, read_mix
from lanekeep_agents.distil.rounds import KEPT, Drill, Sums, held_out, tensors_of
from lanekeep_agents.policy_file import read_policy, write_policy
from lanekeep_agents.policy_record import InputChannel, Network, Normalisation, PolicyRecord, Training
from lanekeep_agents.student import StudentPolicy
from lanekeep_agents.student_record import Student
from lanekeep_agents.teacher import Floats
from lanekeep_env.checks import shown
from lanekeep_env.files import locked, read_bounded, write_atomic
from lanekeep_env.plain import parse_json

SETTINGS, SCORES = "settings.json", "scores.json"
LARGEST_RECORD = 1 << 20
#: Episodes of each drill that a round is scored on, and how bad one of them may be there.
HELD_OUT, WORST = 32, -20.0
#: Mixes that come with the package, a file an id.
MIXES = Path(__file__).parent

Report = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Settings:
    """What fixes a run to the last bit."""

    env_id: str
    seed: int
    mix: Mix

    @property
    def name(self) -> str:
        """Of the policy."""
        task = self.env_id.rpartition("/")[2].partition("-")[0]
        words = "".join(f"-{letter.lower()}" if letter.isupper() else letter for letter in task)
        return f"distilled{words}-seed{self.seed}"

    def text(self) -> str:
        """As the folder keeps it."""
        values = {"version": lanekeep_env.__version__, **asdict(self)}
        return json.dumps(values, indent=1, sort_keys=True) + "\n"


def settings_for(env_id: str, seed: int = 0, mix: str | Path | None = None) -> Settings:
    """Return the settings of a run; without a ``mix`` those that come with the package.

    Raises:
        ValueError: a mix that is none, or an id without one.
    """
    env_id = env_id if "/" in env_id else f"lanekeep/{env_id}"
    file = MIXES / f"{env_id.rpartition('/')[2]}.toml" if mix is None else Path(mix)
    if mix is None and not file.is_file():
        known = ", ".join(sorted(one.stem for one in MIXES.glob("*.toml")))
        raise ValueError(
            f"id {shown(env_id)} has no mix to learn from; allowed: {known}, or one of your own with --mix"
        )
    return Settings(env_id, seed, read_mix(file))


class Distillation:
    """A run in its folder.

    Args:
        settings: of the run.
        folder: made if it is missing.
        resume: go on with that very run; overwrite: replace another one.

    Raises:
        ValueError: the folder holds a run and neither is set, or another one.
    """

    def __init__(self, settings: Settings, folder: Path, resume: bool = False, overwrite: bool = False) -> None:
        self.settings, self.folder = settings, folder
        file = folder / SETTINGS
        if folder.exists() and not folder.is_dir():
            raise ValueError(f"--out {folder} is a file; allowed: a folder, which is made if it is missing")
        if resume and overwrite:
            raise ValueError("--resume and --overwrite exclude each other; the one keeps a run, the other replaces it")
        if file.exists() and not overwrite:
            if not resume:
                raise ValueError(f"--out {folder} already holds a run; name another folder, or --resume or --overwrite")
            if read_bounded(file, LARGEST_RECORD).decode(errors="replace") != settings.text():
                raise ValueError(f"--out {folder} holds another run; restore its options and mix, or use --overwrite")
        elif resume:
            raise ValueError(f"--out {folder} holds no run to resume ({SETTINGS} is missing)")
        self._anew = not resume

    def run(self, report: Report | None = None) -> StudentPolicy:
        """Do what is left of the run; return the policy of the round with the best held-out score.

        ``report`` is called with steps done, steps in all and a line of words.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        with locked(self.folder):
            if self._anew:
                for old in (*self.folder.glob("teacher-*.npz"), *self.folder.glob("round-*.npz")):
                    old.unlink()
            write_atomic(self.folder / SETTINGS, self.settings.text())
            return self._run(report or (lambda done, total, words: None))

    def _run(self, report: Report) -> StudentPolicy:
        mix, began = self.settings.mix, time.monotonic()
        drills = sum(len(lessons.noise) for lessons in mix.sets)
        total, done = len(mix.sets) + mix.rounds * drills, 0
        taught: list[Shown] = []
        for i, lessons in enumerate(mix.sets):
            taught.append(self._taught(i, lessons))
            done += 1
            report(done, total, f"teacher: {lessons.name}")
        record = self.record()
        size = sum(int(np.prod(shape)) for shape in record.shapes.values())
        sums, weights, rounds = Sums.none(size), np.zeros(size), []
        base = self.score(lambda scenario: lanekeep_baselines.make(mix.base, scenario))
        for number in range(mix.rounds):
            file = self.folder / f"round-{number}.npz"
            if not file.exists():
                sums = Sums(KEPT * sums.squares, KEPT * sums.products)
                for i, drill in enumerate(self._drills(taught)):
                    found, _ = drill.learn(
                        record, tensors_of(record, weights), number == 0, self._seed("drill", number, i)
                    )
                    sums = sums.plus(found, drill.lessons.weight)
                    report(done + i + 1, total, f"round {number + 1}: {drill.lessons.name}")
                weights = sums.solved()
                tensors = tensors_of(record, weights)
                score = self.score(partial(StudentPolicy, record, tensors))
                _write_round(file, sums, weights, score)
            sums, weights, score = _read_round(file, size)
            done += drills
            rounds.append((float(np.mean(score / base)), weights))
            report(done, total, f"round {number + 1}: {100 * rounds[-1][0]:.1f} % of the base's cost")
        ratio, weights = min(rounds, key=lambda one: one[0])
        return self._finished(weights, ratio, [one for one, _ in rounds], time.monotonic() - began)

    def _taught(self, number: int, lessons: Lessons) -> Shown:
        file = self.folder / f"teacher-{lessons.name}.npz"
        if not file.exists():
            seeds = self._seeds("lessons", number, lessons.episodes)
            write_shown(file, shown_by_teacher(lessons, seeds, (self.settings.mix.base, *self.settings.mix.beside)))
        return read_shown(file)

    def _drills(self, taught: list[Shown]) -> Iterator[Drill]:
        for lessons, shown_ in zip(self.settings.mix.sets, taught, strict=True):
            for noise in lessons.noise:
                yield Drill(lessons, shown_, noise)

    def score(self, policy: Callable[[Any], Any]) -> Floats:
        """Mean held-out returns, a number a drill."""
        return np.array(
            [
                held_out(lessons, noise, self._seeds("held out", number, HELD_OUT), policy, WORST)
                for number, lessons in enumerate(self.settings.mix.sets)
                for noise in lessons.noise
            ]
        )

    def _seeds(self, what: str, number: int, count: int) -> NDArray[np.int64]:
        return self._seed(what, number, 0) + np.arange(count)

    def _seed(self, *what: object) -> int:
        text = json.dumps([self.settings.seed, *what])
        return int.from_bytes(hashlib.sha256(text.encode()).digest()[:6], "big")

    def record(self, seconds: float = 0.0, scores: Mapping[str, Any] | None = None) -> PolicyRecord:
        """Return the policy's record, with how long it took and how well it did where that is known."""
        settings, mix = self.settings, self.settings.mix
        # Trained on the first set of the environment, by whose channels everything is named.
        keywords = next(one.keywords for one in mix.sets if one.env_id == settings.env_id)
        scenario: Any = gym.make(settings.env_id, **keywords).unwrapped.scenario  # type: ignore[attr-defined]
        channels, memory = scenario.channels, getattr(lanekeep_baselines.make(mix.base, scenario), "memory", 0)
        slips = getattr(scenario, "dynamics", "kinematic") != "kinematic"
        known = products([one.name for one in channels], memory, 1 + len(mix.beside), slips)
        steps = sum(one.episodes * len(one.noise) for one in mix.sets) * mix.rounds * scenario.episode_steps
        return PolicyRecord(
            name=settings.name,
            algorithm="distillation",
            env_id=settings.env_id,
            scenario=scenario.to_dict(),
            scenario_hash=scenario.hash,
            channels=tuple(InputChannel(c.name, c.unit, c.description, c.low, c.high) for c in channels),
            actions=1,
            action=scenario.action,
            max_steering_angle=scenario.max_steering_angle,
            max_steering_rate=scenario.max_steering_rate,
            control_step=scenario.control_step,
            network=Network((), "relu", False),
            normalisation=Normalisation(),
            training=Training(
                command=f"lanekeep distil {settings.env_id.rpartition('/')[2]} --seed {settings.seed}",
                hyperparameters={"env": dict(keywords), "mix": json.loads(json.dumps(asdict(mix)))},
                seed=settings.seed,
                steps=steps,
                seconds=round(seconds, 1),
                versions={"lanekeep": lanekeep_env.__version__, "numpy": np.__version__},
                scores=scores or {},
            ),
            base=mix.base,
            bound=mix.bound,
            student=Student(mix.beside, mix.fade, known),
        )

    def _finished(self, weights: Floats, ratio: float, rounds: list[float], seconds: float) -> StudentPolicy:
        scores = {"held_out_cost_over_base": ratio, "rounds": rounds}
        record = self.record(seconds, scores)
        path = self.folder / f"{self.settings.name}.json"
        write_policy(path, record, tensors_of(record, weights), overwrite=True)
        write_atomic(self.folder / SCORES, json.dumps(scores, indent=1) + "\n")
        return StudentPolicy(*read_policy(path))


def settings_in(folder: Path) -> Settings:
    """Return the settings of the run in a folder; ValueError where there is none."""
    file = folder / SETTINGS
    try:
        values = parse_json(read_bounded(file, LARGEST_RECORD))
        mix = values["mix"]
        sets = tuple(Lessons(**one) for one in mix.pop("sets"))
        return Settings(values["env_id"], values["seed"], Mix(**mix, sets=sets))
    except FileNotFoundError:
        raise ValueError(f"--out {folder} holds no run to resume ({SETTINGS} is missing)") from None
    except (OSError, TypeError, KeyError, ValueError, AttributeError) as error:
        raise ValueError(f"{file} is not the record of a run ({error})") from None


def _write_round(file: Path, sums: Sums, weights: Floats, score: Floats) -> None:
    content = io.BytesIO()
    np.savez(content, squares=sums.squares, products=sums.products, weights=weights, score=score)
    write_atomic(file, content.getvalue())


def _read_round(file: Path, size: int) -> tuple[Sums, Floats, Floats]:
    found = arrays_in(file, ("squares", "products", "weights", "score"))
    if [found[name].shape for name in ("squares", "products", "weights")] != [(size, size), (size,), (size,)]:
        raise ValueError(f"{file} is not a round of this run; use --overwrite")
    return Sums(found["squares"], found["products"]), found["weights"], found["score"]
