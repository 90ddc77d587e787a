"""Ctrl-C while something is compiled: it waits for the end of that.

An exception in the midst of LLVM's work is lost in one of its callbacks, or leaves the compiler broken, or memory freed
twice.
"""

from __future__ import annotations

import functools
import signal
import threading
from collections.abc import Callable
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


class _Keeper:
    """In the place of what Ctrl-C usually calls: keeps the first one; a second one acts at once."""

    def __init__(self, usual: Callable[..., Any]) -> None:
        self.usual = usual
        self.came = False

    def __call__(self, number: int, frame: Any) -> None:
        again, self.came = self.came, not self.came
        if again:
            self.usual(number, frame)


def uninterrupted(function: F) -> F:
    """Let a first Ctrl-C wait until ``function`` has returned; other threads than the main one never see any."""

    @functools.wraps(function)
    def run(*arguments: Any) -> Any:
        usual: Any = signal.getsignal(signal.SIGINT)
        within = isinstance(usual, _Keeper)  # one compilation in another
        if within or not callable(usual) or threading.current_thread() is not threading.main_thread():
            return function(*arguments)
        keeper = _Keeper(usual)
        signal.signal(signal.SIGINT, keeper)
        try:
            return function(*arguments)
        finally:
            signal.signal(signal.SIGINT, usual)
            if keeper.came:
                usual(signal.SIGINT, None)

    return run  # type: ignore[return-value]
