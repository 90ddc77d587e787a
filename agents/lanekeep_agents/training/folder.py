"""The folder of a training run: whose it is, one process at a time, and which run's settings it holds."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path

import lanekeep_env
from lanekeep_agents.training.settings import TrainingSettings
from lanekeep_env.checks import shown
from lanekeep_env.files import read_bounded, require_ordinary, write_atomic
from lanekeep_env.plain import parse_json

SETTINGS, CHECKPOINT, EVALUATIONS = "settings.json", "checkpoint.npz", "evaluations.csv"
#: Bytes beyond which settings are not read.
LARGEST_SETTINGS = 1 << 20


def policy_name(settings: TrainingSettings) -> str:
    """Name of the policy that a run makes: algorithm, task and seed."""
    task = settings.env_id.rpartition("/")[2].partition("-")[0]
    words = "".join(f"-{letter.lower()}" if letter.isupper() else letter for letter in task)
    kind = f"{settings.algorithm}-residual" if settings.base else settings.algorithm
    return f"{kind}{words}-seed{settings.seed}"


def check(settings: TrainingSettings, folder: Path, resume: bool, overwrite: bool) -> str:
    """Return what the folder's record of this run says, after a look at what is there."""
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file; allowed: a folder, which is made if it is missing")
    if resume and overwrite:
        raise ValueError("resume and overwrite exclude each other: go on with the run in the folder, or replace it")
    ours = [f"{policy_name(settings)}{end}" for end in (".json", ".safetensors")]
    require_ordinary(*(folder / name for name in (SETTINGS, CHECKPOINT, EVALUATIONS, *ours)))
    record = json.dumps({"version": lanekeep_env.__version__, **settings.to_dict()}, indent=1) + "\n"
    if resume:
        found, wanted = settings_in(folder).to_dict(), json.loads(record)
        for name, value in found.items():
            if value != wanted[name]:
                raise ValueError(
                    f"--out {folder} holds another run: {name} is {shown(value)} there, {shown(wanted[name])} "
                    "wanted; leave the options out to go on with that one, or name another folder"
                )
    elif (folder / SETTINGS).exists() and not overwrite:
        raise ValueError(f"--out {folder} already holds a run; name another folder, or pass --resume or --overwrite")
    return record


def claim(folder: Path, record: str, name: str) -> None:
    """Make the folder this run's: what another one has left there goes."""
    names = {name}
    with suppress(ValueError):  # there was none, or what there was cannot be read
        names.add(policy_name(settings_in(folder)))
    policies = (f"{name}{end}" for name in names for end in (".json", ".safetensors"))
    old = [folder / file for file in (CHECKPOINT, EVALUATIONS, *policies)]
    old += (folder / "tensorboard").glob("events.out.tfevents.*")
    require_ordinary(*old)
    for file in old:
        file.unlink(missing_ok=True)
    write_atomic(folder / SETTINGS, record.encode())


def settings_in(folder: Path) -> TrainingSettings:
    """Return the settings of the run in a folder.

    Raises:
        ValueError: there is none, or it is of another version.
    """
    file = folder / SETTINGS
    if not os.path.lexists(file):
        raise ValueError(f"--out {folder} holds no run to resume ({SETTINGS} is missing)")
    try:
        values = parse_json(read_bounded(file, LARGEST_SETTINGS))
        if not isinstance(values, dict) or "version" not in values:
            raise ValueError("version is missing")
        version = values.pop("version")
        settings = TrainingSettings.from_dict(values, "it")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{file} is not the record of a training run: {error}") from None
    if version != lanekeep_env.__version__:
        raise ValueError(f"{file} is of version {shown(version)}, this is {lanekeep_env.__version__}: install that one")
    return settings
