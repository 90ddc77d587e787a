"""A checkout at work in a process of its own, asked over pipes."""

from __future__ import annotations

import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[2]
FOLDERS = (".", "baselines", "agents", "benchmarks")
_SERVE = """
import importlib, sys
sys.path.append({tests!r})
from side_by_side.checkouts import serve
serve(importlib.import_module({module!r}).answer)
"""


def fresh_cache(checkout: Path) -> Path:
    """Folder of a checkout's compiled kernels, named after all sources of the environments.

    The package itself hashes the files that it believes to reach a kernel; a change that moves code beyond them must
    not meet old kernels here. Folders of the checkout's former sources are removed.
    """
    root = Path(os.environ.get("LANEKEEP_CACHE_DIR", tempfile.gettempdir())) / "side_by_side"
    digest = hashlib.sha256()
    for file in sorted((checkout / "lanekeep_env").rglob("*.py")):
        digest.update(file.relative_to(checkout).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    own = root / hashlib.sha256(str(checkout).encode()).hexdigest()[:8]
    cache = own / digest.hexdigest()[:16]
    for former in own.glob("*"):
        if former != cache:
            shutil.rmtree(former, ignore_errors=True)
    cache.mkdir(parents=True, exist_ok=True)
    return cache


def environment(checkout: Path) -> dict[str, str]:
    """Variables under which Python imports ``checkout`` and keeps its kernels apart from others'."""
    paths = [str(checkout / folder) for folder in FOLDERS]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "LANEKEEP_CACHE_DIR": str(fresh_cache(checkout))}


def checked(path: str) -> Path:
    """The folder of a checkout; ValueError if it holds none."""
    checkout = Path(path).resolve()
    if not (checkout / "lanekeep_env" / "__init__.py").is_file():
        raise ValueError(f"OLD_CHECKOUT={path!r} holds no lanekeep_env; it must be a checkout of this repository")
    return checkout


class Worker:
    """A process that answers with ``answer`` of ``module`` (below tests), importing the packages of ``checkout``."""

    def __init__(self, checkout: Path, module: str) -> None:
        self.checkout = checkout
        code = _SERVE.format(tests=str(HERE / "tests"), module=module)
        self._process = subprocess.Popen(
            [sys.executable, "-c", code],
            cwd=checkout,
            env=environment(checkout),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        found = self.ask("where")
        if checkout not in Path(found).parents:
            raise RuntimeError(f"{checkout}: its process imported {found}")

    def send(self, question: Any) -> None:
        """Ask without waiting; `receive` brings the answer."""
        assert self._process.stdin is not None
        pickle.dump(question, self._process.stdin)
        self._process.stdin.flush()

    def receive(self) -> Any:
        """Wait for the answer; RuntimeError if the process has died."""
        assert self._process.stdout is not None
        try:
            return pickle.load(self._process.stdout)
        except EOFError:
            raise RuntimeError(f"{self.checkout}: its process ended with {self._process.wait()}") from None

    def ask(self, question: Any) -> Any:
        """Send and receive."""
        self.send(question)
        return self.receive()

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def both(old: Worker, new: Worker, question: Any) -> tuple[Any, Any]:
    """The answers of two checkouts, which work at the same time."""
    old.send(question)
    new.send(question)
    return old.receive(), new.receive()


def serve(answer: Callable[[Any], Any]) -> None:
    """Answer questions from standard input until it ends; what is printed goes to standard error."""
    import lanekeep_env

    channel = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while True:
        try:
            question = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        pickle.dump(lanekeep_env.__file__ if question == "where" else answer(question), channel, protocol=5)
        channel.flush()
