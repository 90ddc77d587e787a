"""A policy of somebody's own code in a process of its own: observations go there, actions come back, nothing else.

Cars, truth and metrics stay with who verifies: what the code changes in its own process changes none of them. What
comes back is bytes of numbers and of texts; nothing of it is unpickled.
"""

from __future__ import annotations

import json
import multiprocessing
import os
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_benchmarks.own_code import Checked, OwnCodeError, files_of, load_factory, sha256_of_files
from lanekeep_env.checks import shown

#: Bytes of an answer: actions of thousands of cars fit.
_LARGEST = 1 << 20
#: What an answer begins with.
_ACTIONS, _DONE, _REFUSED, _FAILED = b"a", b"d", b"r", b"f"


class Apart:
    """The process of a policy, begun when it is first asked; ``name`` is as a person names code.

    Raises:
        OwnCodeError: in every method, where the code fails, answers something else than actions, or ends.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._process: Any = None
        self._connection: Connection | None = None
        self._files: list[Path] = []
        #: How often it was ended: what was made then is gone.
        self.ended = 0

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, there = context.Pipe()
        self._process = context.Process(target=_serve, args=(there, self.name), daemon=True)
        self._process.start()
        there.close()
        try:
            self._files = [Path(file) for file in json.loads(self._answer())]
        except OwnCodeError:
            self.close()
            raise
        except (TypeError, ValueError) as error:
            raise self._ended() from error

    def close(self) -> None:
        """End the process; whatever is asked next begins another."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            assert self._connection is not None
            self._connection.close()
            self._process = self._connection = None
            self.ended += 1

    def sha256(self) -> str | None:
        """Hash of its files, as a run keeps it."""
        if self._connection is None:
            self._begin()
        return sha256_of_files(self._files)

    def make(self, scenario: Any) -> Elsewhere:
        """Return the policy made for a scenario, there."""
        return Elsewhere(self, scenario)

    def ask(self, *question: Any) -> bytes:
        """Send a question; return what follows the first byte of the answer."""
        if self._connection is None:
            self._begin()
        assert self._connection is not None
        try:
            self._connection.send(question)
        except OSError as error:
            raise self._ended() from error
        return self._answer()

    def _answer(self) -> bytes:
        assert self._connection is not None
        try:
            answer = self._connection.recv_bytes(_LARGEST)
        except (EOFError, OSError) as error:
            raise self._ended() from error
        kind, content = answer[:1], answer[1:]
        if kind in (_ACTIONS, _DONE):
            return content
        text = content.decode(errors="replace")
        if kind == _REFUSED:
            raise OwnCodeError(text) from ValueError(text)
        raise OwnCodeError(text)

    def _ended(self) -> OwnCodeError:
        self.close()
        return OwnCodeError(f"policy {shown(self.name)}: its process has ended, or what it answers is too long")


class Elsewhere:
    """A policy whose actions another process computes, where its memory is, too."""

    def __init__(self, apart: Apart, scenario: Any) -> None:
        self._apart, self._scenario = apart, scenario
        self._actions = getattr(scenario, "num_actions", 1)
        self._make()

    def _make(self) -> None:
        self._number = self._apart.ask("make", self._scenario)
        self._before = self._apart.ended

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], int]:
        """Return the actions; the state says that there is one, elsewhere."""
        if self._apart.ended != self._before:
            self._make()
        content = self._apart.ask("predict", self._number, observation, state is None, episode_start)
        wanted = (len(observation), self._actions)
        if len(content) != 4 * wanted[0] * wanted[1]:
            raise OwnCodeError(f"policy {shown(self._apart.name)}: {len(content)} bytes are no {wanted} actions")
        return np.frombuffer(content, dtype=np.float32).reshape(wanted), 1


def _serve(connection: Connection, name: str) -> None:
    """What the other process does until nobody asks any more; what it prints is not shown."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    made: dict[bytes, list[Any]] = {}  # policies, each with its memory
    question: tuple[Any, ...] = ("load",)
    factory: Any = None
    while True:
        try:
            if question[0] == "load":
                factory = load_factory(name)
                answer = _DONE + json.dumps([str(file.resolve()) for file in files_of(factory)]).encode()
            elif question[0] == "make":
                number = str(len(made)).encode()
                made[number] = [Checked(name, factory, question[1]), None]
                answer = _DONE + number
            else:
                _, number, observation, first, episode_start = question
                policy, state = made[number]
                action, made[number][1] = policy.predict(observation, None if first else state, episode_start)
                answer = _ACTIONS + np.ascontiguousarray(action, dtype=np.float32).tobytes()
        except OwnCodeError as error:
            answer = (_REFUSED if isinstance(error.__cause__, ValueError) else _FAILED) + str(error).encode()
        except Exception as error:
            answer = _FAILED + f"{type(error).__name__}: {error}".encode()
        connection.send_bytes(answer)
        try:
            question = connection.recv()
        except EOFError:
            return
