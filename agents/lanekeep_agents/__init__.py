"""Learning agents on the lanekeep environments.

`load` gives a trained policy with the interface of the classical ones, run by numpy alone; `names` lists those that
are shipped; `train` trains one. `sb3_vec_env` gives Stable-Baselines3 the compiled vector environment without a Python
loop over cars; `save` writes the policy of a model that was trained on it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lanekeep_env.checks import nearest, shown

if TYPE_CHECKING:
    from lanekeep_agents.learned import LearnedPolicy
    from lanekeep_agents.policy_record import PolicyRecord
    from lanekeep_agents.student import StudentPolicy
    from lanekeep_agents.vec_env import CarVecEnv
    from lanekeep_env.scenario.car import CarScenario

__all__ = ["CarVecEnv", "LearnedPolicy", "PolicyRecord", "load", "names", "save", "sb3_vec_env", "train"]


def names(scenario: CarScenario | None = None) -> tuple[str, ...]:
    """Return the names of the policies that are shipped, or those of them that can drive ``scenario``."""
    shipped = tuple(sorted(file.stem for file in _zoo().glob("*.json")))
    if scenario is None:
        return shipped
    return tuple(name for name in shipped if _drives(name, scenario))


def _drives(name: str, scenario: CarScenario) -> bool:
    from lanekeep_agents.binding import Binding
    from lanekeep_agents.policy_file import read_record

    record = read_record(_zoo() / f"{name}.json")
    try:
        return Binding(record, scenario).has_base()
    except ValueError:
        return False


def load(
    name_or_path: str | Path, scenario: CarScenario | None = None, *, allow_files: bool = False
) -> LearnedPolicy | StudentPolicy:
    """Load a learned policy; nothing in its files is executed, and no other file is read.

    Args:
        name_or_path: one of `names`, or the path of a policy's .json or .safetensors file.
        scenario: to drive, ``env.unwrapped.scenario``; by default the one that the policy was trained on.
        allow_files: where that one is on a road or in a world from a file, read this file, wherever it is. For
            policies of people that you trust; not needed with ``scenario``.

    Raises:
        ValueError: an unknown name (the nearest one is named), files that are not those of a policy, a scenario that
            lacks a channel, or means something else by it, or has another control step or number of actions, or one
            trained on that names a file which is not allowed.
        ImportError: safetensors is not installed; names the extra that brings it.
    """
    from lanekeep_agents.foreign import named
    from lanekeep_agents.learned import LearnedPolicy
    from lanekeep_agents.policy_file import read_policy
    from lanekeep_agents.student import StudentPolicy

    path = Path(name_or_path)
    if path.suffix not in (".json", ".safetensors"):
        shipped = names()
        if str(name_or_path) not in shipped:
            raise ValueError(
                f"policy={shown(str(name_or_path))} is unknown{nearest(str(name_or_path), shipped)}; allowed: "
                f"{', '.join((*shipped, 'the path of a .json or .safetensors file'))}"
            )
        path = _zoo() / f"{name_or_path}.json"
    record, tensors = read_policy(path)
    try:
        made = LearnedPolicy if record.student is None else StudentPolicy
        return made(record, tensors, scenario, allow_files=allow_files)
    except ValueError as error:
        if path == name_or_path or str(path) == name_or_path:  # a file of somebody's own, not a name
            raise ValueError(f"{named(path)}: {error}") from None
        raise


def _zoo() -> Path:
    """The folder of the policies that are shipped."""
    return Path(__file__).with_name("zoo")


def sb3_vec_env(env_id: str, num_envs: int, **keywords: Any) -> CarVecEnv:
    """Make ``env_id`` as a Stable-Baselines3 ``VecEnv`` of ``num_envs`` cars.

    Args:
        env_id: a registered id, e.g. "lanekeep/LaneKeep-v0".
        num_envs: number of cars.
        keywords: those of ``gym.make_vec`` for this id (scenario fields, dtype, num_threads).

    Raises:
        ImportError: Stable-Baselines3 is not installed; names the extra that brings it.
    """
    with _extra():
        from lanekeep_agents.vec_env import CarVecEnv
    return CarVecEnv(env_id, num_envs, **keywords)


def save(path: str | Path, model: Any, overwrite: bool = False) -> PolicyRecord:
    """Write the policy of a Stable-Baselines3 model as a pair of files that `load` reads; return its record.

    Args:
        path: of the .json or the .safetensors file; its stem is the policy's name.
        model: PPO, SAC or TD3 with "MlpPolicy", which acts deterministically here, trained on `sb3_vec_env`, or on
            ``make_vec_env``, ``DummyVecEnv`` or ``SubprocVecEnv`` of lanekeep's ids, behind ``VecNormalize``,
            ``VecMonitor`` and ``VecFrameStack`` or none of them.
        overwrite: replace what is there.

    Raises:
        ValueError: one of the files exists and ``overwrite`` is not set, or a model that no policy file can hold.
        ImportError: Stable-Baselines3 is not installed; names the extra that brings it.
    """
    with _extra():
        from lanekeep_agents.export import save_sb3
    return save_sb3(path, model, overwrite)


# Eleven parameters, for each is a keyword of users' own: a record of settings would be one more name to learn.
def train(
    algorithm: str,
    env_id: str,
    out: str | Path,
    *,
    seed: int = 0,
    steps: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    threads: int = 1,
    report: Callable[[int, str], None] | None = None,
    callback: Any = None,
    **changes: Any,
) -> LearnedPolicy:
    """Train a policy with the hyper-parameters of ``hyperparameters/ALGORITHM.yaml`` and return it.

        >>> policy = train("ppo", "lanekeep/LaneKeep-v0", "runs/mine", seed=3)  # doctest: +SKIP
        >>> action, state = policy.predict(observation)  # doctest: +SKIP

    Args:
        algorithm: "ppo", "sac" or "td3".
        env_id: a registered id; "lanekeep/" may be left out.
        out: folder for the policy file, the checkpoint, the evaluations and TensorBoard's events.
        seed: of the run.
        steps: environment steps over all cars; None takes those of the hyper-parameters.
        resume: go on from the checkpoint in ``out``; overwrite: replace another run there.
        threads: of torch.
        report: called between rollouts with the steps done and a line that tells how good the policy is.
        callback: of Stable-Baselines3, one or a list, called as well: ``WandbCallback()`` of Weights & Biases, or your
            own. What it logs goes to the run's logger (``self.logger``), whose formats it may add to.
        changes: of the hyper-parameters, fields of `TrainingSettings`, e.g. ``env={"cost_weight": 0.5}``, or
            ``base="yin-lqr-observer", bound=0.2`` for a correction of that controller, ``imitate="stanley"``.

    Raises:
        ValueError, TypeError: a setting that is not allowed, or ``out`` holds another run.
        ImportError: Stable-Baselines3 or torch is not installed; names the extra that brings it.
    """
    with _extra():
        from lanekeep_agents.training.run import run
        from lanekeep_agents.training.settings import settings_for
    settings = settings_for(algorithm, env_id, seed, steps, **changes)
    return run(
        settings, Path(out), resume=resume, overwrite=overwrite, threads=threads, report=report, callback=callback
    )


#: Classes that are imported when somebody asks for them: they take Stable-Baselines3, or safetensors.
_CLASSES = {"CarVecEnv": "vec_env", "LearnedPolicy": "learned", "PolicyRecord": "policy_record"}


def __getattr__(name: str) -> Any:
    if name not in _CLASSES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with _extra():
        return getattr(import_module(f"lanekeep_agents.{_CLASSES[name]}"), name)


@contextmanager
def _extra() -> Iterator[None]:
    """Name the extra that brings a package which is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("stable_baselines3", "torch", "tensorboard", "yaml"):
            raise
        raise ImportError(f'{error.name} is missing: pip install "lanekeep[agents]"') from error
