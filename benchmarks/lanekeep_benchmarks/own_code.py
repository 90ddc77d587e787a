"""A user's own controllers: code that a person has named, as ``module:factory`` or ``path/to/file.py:factory``.

It is imported, and so run, for that person alone: neither a suite's file nor a result folder can name any.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import inspect
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from lanekeep_env.checks import nearest, shown, shown_path
from lanekeep_env.files import read_bounded

#: How the path of a Python file ends.
SOURCE = ".py"
#: Bytes beyond which a file of code is not read.
LARGEST_SOURCE = 1 << 22
FORMS = "module:factory or path/to/file.py:factory"
#: Files that a module of a user's imported from beside it, by its name.
_BESIDE: dict[str, list[Path]] = {}


class OwnCodeError(ValueError):
    """What went wrong in a user's own code, and where, in one line."""


def is_code(text: str) -> bool:
    """Return whether ``text`` names code: a module or a file, a colon, and a name in it."""
    where, colon, name = text.rpartition(":")
    return bool(colon and where) and name.isidentifier()


def load_factory(text: str, allowed: str = "takes a scenario and returns a policy") -> Callable[..., Any]:
    """Import what ``text`` names, a function or class that does what ``allowed`` says.

    Raises:
        ValueError: there is no such file, module or factory, or its code fails; one line that says where.
    """
    where, _, name = text.rpartition(":")
    module = _from_file(text, Path(where)) if where.endswith(SOURCE) else _from_module(text, where)
    factory = getattr(module, name, None)
    if not callable(factory):
        there = [key for key, value in vars(module).items() if callable(value) and not key.startswith("_")]
        raise ValueError(
            f"policy {shown(text)}: {shown_path(where)} has no function or class {name!r}{nearest(name, there)}; "
            f"allowed: one that {allowed}"
        )
    return factory


def _from_module(text: str, where: str) -> ModuleType:
    # As `python -m` does: a module in the folder in which the command runs.
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        before = set(sys.modules)
        module = importlib.import_module(where)
        _note_beside(module, before)
        return module
    except ModuleNotFoundError as error:
        if error.name is None or not f"{where}.".startswith(f"{error.name}."):
            raise _failed(text, error) from error
        raise ValueError(f"policy {shown(text)}: there is no module {error.name!r}; allowed: {FORMS}") from None
    except Exception as error:
        raise _failed(text, error) from error


def _from_file(text: str, path: Path) -> ModuleType:
    try:
        content = read_bounded(path, LARGEST_SOURCE)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise ValueError(f"policy {shown(text)}: {shown_path(path)}: {why}; allowed: {FORMS}") from None
    # A file that was edited is another module; one that was not is imported once.
    name = f"lanekeep_own_{hashlib.sha256(str(path.resolve()).encode() + content).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.append(folder)  # for what the file imports from beside it; last, so that it hides nothing
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    before = set(sys.modules)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
        _note_beside(module, before)
    except Exception as error:
        del sys.modules[name]
        raise _failed(text, error) from error
    return module


def _note_beside(module: ModuleType, before: set[str]) -> None:
    """Keep which files of its own folder a module has imported: they are part of the controller."""
    own = getattr(module, "__file__", None)
    if own is None:
        return
    folder = Path(own).resolve().parent
    others = (getattr(sys.modules[name], "__file__", None) for name in set(sys.modules) - before)
    files = {Path(file).resolve() for file in others if file is not None}
    _BESIDE[module.__name__] = sorted(
        file for file in files if file.is_relative_to(folder) and file != Path(own).resolve()
    )


def _failed(text: str, error: Exception) -> OwnCodeError:
    """The error that says what failed in a user's code, and the last line of theirs on the way there."""
    if isinstance(error, OwnCodeError):
        return error
    where = ""
    for frame in traceback.extract_tb(error.__traceback__):
        ours = frame.filename.startswith("<frozen") or frame.filename == __file__
        packages = f"{os.sep}site-packages{os.sep}" in frame.filename
        if not ours and not packages:
            where = f" ({frame.filename}, line {frame.lineno}, in {frame.name})"
    return OwnCodeError(f"policy {shown(text)}: {type(error).__name__}: {error}{where}")


def sha256_of(factory: Any) -> str | None:
    """SHA-256 of the code of a function, a class or an object's class; None where there is no file."""
    return sha256_of_files(files_of(factory))


def files_of(factory: Any) -> list[Path]:
    """The files of the code of a function, a class or an object's class, and of what it wraps; none where one has none.

    After each, where a person named it, what it imported from its own folder as it was imported itself.
    """
    files = [_files_of_one(thing) for thing in _wrapped(factory)]
    return list(dict.fromkeys(file for those in files for file in those)) if all(files) else []


def _wrapped(thing: Any) -> Iterator[Any]:
    """A function or object, and what it wraps, outermost first: ``__wrapped__`` as `functools.wraps` sets it."""
    while thing is not None:
        if isinstance(thing, functools.partial):
            thing = thing.func
        else:
            yield thing
            thing = getattr(thing, "__wrapped__", None)


def _files_of_one(thing: Any) -> list[Path]:
    try:
        thing = thing if hasattr(thing, "__code__") else inspect.unwrap(_class_of(thing))
        file = inspect.getsourcefile(thing)
    except (TypeError, OSError):  # OSError: a class of a notebook or a console
        return []
    return [] if file is None else [Path(file), *_BESIDE.get(thing.__module__, ())]


def sha256_of_files(files: Sequence[Path]) -> str | None:
    """SHA-256 of files of code together; None where there is none, or one cannot be read."""
    try:
        contents = [read_bounded(file, LARGEST_SOURCE) for file in files]
    except (OSError, ValueError):
        return None
    return hashlib.sha256(b"\0".join(contents)).hexdigest() if contents else None


def _class_of(thing: Any) -> Any:
    return thing if isinstance(thing, type) else type(thing)


class Checked:
    """A user's policy whose actions are what the scenario asks for, or an `OwnCodeError` says what they are.

    Raises:
        OwnCodeError: the factory fails, or returns something that has no ``predict``.
    """

    def __init__(self, name: str, factory: Callable[[Any], Any], scenario: Any) -> None:
        self.name = name
        self._actions = getattr(scenario, "num_actions", 1)
        try:
            self._policy = factory(scenario)
        except Exception as error:
            raise _failed(name, error) from error
        if not callable(getattr(self._policy, "predict", None)):
            raise OwnCodeError(
                f"policy {shown(name)}: the factory returned {shown(self._policy)}; it must be an object with "
                "predict(observation, state, episode_start, deterministic)"
            )

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return what the policy returns, its actions checked."""
        try:
            action, state = self._policy.predict(observation, state, episode_start, deterministic)
            action = np.asarray(action, dtype=np.float32)
        except Exception as error:
            raise _failed(self.name, error) from error
        wanted = (*np.shape(observation)[:-1], self._actions)
        if action.shape != wanted:
            raise OwnCodeError(
                f"policy {shown(self.name)}: its actions have the shape {action.shape}, allowed is {wanted}, "
                f"{self._actions} number(s) a row of the observations"
            )
        if not np.isfinite(action).all():
            row = int(np.argmin(np.isfinite(action).all(axis=-1)))
            raise OwnCodeError(
                f"policy {shown(self.name)}: the action of row {row} is {action[row] if wanted[:-1] else action}, "
                f"for the observation {shown(np.asarray(observation)[row] if wanted[:-1] else observation)}"
            )
        return action, state
