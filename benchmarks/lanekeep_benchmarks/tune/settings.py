"""What fixes a run of `lanekeep tune` to the last bit, and which roads it drives."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import lanekeep_env
from lanekeep_agents.distil.mix import Lessons, read_mix
from lanekeep_agents.distil.run import MIXES
from lanekeep_benchmarks.tune.search import version
from lanekeep_benchmarks.tune.space import check_tunable, is_learned
from lanekeep_env.checks import choose, require, shown
from lanekeep_env.files import read_bounded
from lanekeep_env.plain import parse_json

SETTINGS, LARGEST = "settings.json", 1 << 20
#: Episodes of a set in each trial, where there are many sets and where there is one; judged on so many times as many.
EPISODES, ALONE, JUDGED = 32, 128, 4
#: Trials at the most: what is tried next takes longer with each.
MOST = 10_000


@dataclass(frozen=True)
class TuneSettings:
    """Attributes:
    policy: a classical controller, or a learning algorithm.
    env_id: registered.
    trials: in all, that of the shipped values included.
    seed: of the search, of its episodes and of trainings.
    steps: environment steps of a training, None for a controller.
    sets: of episodes, on training roads.
    versions: of what the result hangs on.
    """

    policy: str
    env_id: str
    trials: int
    seed: int
    steps: int | None
    sets: tuple[Lessons, ...]
    versions: dict[str, str]

    def __post_init__(self) -> None:
        check_tunable(self.policy)
        choose("ID", self.env_id, tuple(lanekeep_env.ENVIRONMENTS))
        require("--trials", self.trials, "", at_least=1, at_most=MOST, whole=True)
        require("--seed", self.seed, "", at_least=0, at_most=10**18, whole=True)
        if self.steps is not None and not is_learned(self.policy):
            raise ValueError(f"--steps {self.steps} is of trainings: policy {self.policy!r} is designed, not trained")

    @property
    def episodes(self) -> int:
        """Of each set in a trial."""
        return ALONE if len(self.drills) == 1 else EPISODES

    @property
    def drills(self) -> list[tuple[Lessons, float]]:
        """Each set with each of its factors of noise."""
        return [(one, noise) for one in self.sets for noise in one.noise]

    def text(self) -> str:
        """As the folder keeps it."""
        return json.dumps(asdict(self), indent=1, sort_keys=True) + "\n"


def settings_for(policy: str, env_id: str, trials: int, seed: int = 0, steps: int | None = None) -> TuneSettings:
    """Return the settings of a run.

    A controller drives the mix that students learn from (`lanekeep distil`) where the id has one, a learning algorithm
    the environment that it is trained in.

    Raises:
        ValueError: a policy without anything to tune, or another value that is not allowed.
    """
    check_tunable(policy)
    env_id = env_id if "/" in env_id else f"lanekeep/{env_id}"
    choose("ID", env_id, tuple(lanekeep_env.ENVIRONMENTS))
    versions = {"lanekeep": lanekeep_env.__version__, "optuna": version()}
    sets: tuple[Lessons, ...]
    mix = MIXES / f"{env_id.rpartition('/')[2]}.toml"
    if is_learned(policy):
        try:
            import stable_baselines3
            import torch

            from lanekeep_agents.training.settings import settings_for as training_for
        except ModuleNotFoundError as error:
            raise ImportError(f'{error.name} is missing: pip install "lanekeep[agents]"') from error
        training = training_for(policy, env_id, seed, steps)
        steps, sets = training.steps, (Lessons("as-trained", env_id, dict(training.env)),)
        versions |= {"stable_baselines3": stable_baselines3.__version__, "torch": torch.__version__}
    elif mix.is_file():
        sets = read_mix(mix).sets
    else:
        sets = (Lessons("as-registered", env_id),)
    return TuneSettings(policy, env_id, trials, seed, steps, sets, versions)


def settings_in(folder: Path) -> TuneSettings:
    """Return the settings of the run in a folder, as they are today; ValueError where there is none."""
    file = folder / SETTINGS
    try:
        values: Any = parse_json(read_bounded(file, LARGEST))
        if not isinstance(values, dict) or not isinstance(values.get("policy"), str):
            raise ValueError("it names no policy")
        named: list[Any] = [values.get(name) for name in ("policy", "env_id", "trials", "seed", "steps")]
        return settings_for(*named)
    except FileNotFoundError:
        raise ValueError(f"--out {folder} holds no run to resume ({SETTINGS} is missing)") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{file} is not the record of a run: {shown(str(error))}") from None
