"""What a kernel is compiled from, as a hash: its code, and the code and constants that it reaches by name.

Taken from the loaded functions, not from their files: comments, docstrings, formatting and everything that no kernel
reads change nothing, and a constant counts by its value, wherever it was written.
"""

from __future__ import annotations

import enum
import hashlib
import inspect
import sys
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

#: Attribute of a Python function with the options that numba compiles it with where compiled code calls it.
COMPILED_WITH = "compiled_with"

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(...))


def fingerprint(compiled: Dispatcher) -> str:
    """Return the hash of what numba reads to compile a function, options included, 64 hexadecimal digits."""
    reached = _Reached({"lanekeep_env", compiled.__module__.partition(".")[0]})
    reached.add((numba.__version__, np.__version__, sys.version_info[:2]))
    reached.add(compiled)
    return reached.digest.hexdigest()


class _Reached:
    """Hash of values and of all that they reach in the packages ``ours``."""

    def __init__(self, ours: set[str]) -> None:
        self.digest = hashlib.sha256()
        self._ours = ours
        # Place and value by identity; values are kept, so that no identity is given twice.
        self._seen: dict[int, tuple[int, Any]] = {}

    def add(self, value: Any, names: tuple[str, ...] = ()) -> None:
        """Add a value; of a module only what is called one of ``names``."""
        if isinstance(value, _PLAIN):
            self._write(type(value).__name__, repr(value))
        elif isinstance(value, tuple | list):
            if all(type(entry) in _PLAIN for entry in value):
                self._write(type(value).__name__, repr(value))
                return
            self._write(type(value).__name__, len(value))
            for entry in value:
                self.add(entry)
        elif isinstance(value, set | frozenset):
            self._write(type(value).__name__, sorted(map(repr, value)))
        elif isinstance(value, np.ndarray | np.generic):
            self._write(value.dtype, value.shape)
            self.digest.update(value.tobytes())
        elif isinstance(value, enum.Enum):
            self._write(type(value).__qualname__, value.name)
            self.add(value.value)
        elif isinstance(value, ModuleType):
            self._write("module", value.__name__)
            if self._own(value.__name__):
                for name in names:
                    if name in vars(value):
                        self.add(vars(value)[name], names)
        else:
            self._add_once(value)

    def _add_once(self, value: Any) -> None:
        """Add a function, code, a class or what else has an identity; the second time its place alone."""
        if id(value) in self._seen:
            self._write("again", self._seen[id(value)][0])
            return
        self._seen[id(value)] = len(self._seen), value
        if isinstance(value, Dispatcher):
            self.add(sorted(value.targetoptions.items()))
            self._add_function(value.py_func)
        elif isinstance(value, CodeType):
            self._add_code(value)
        elif isinstance(value, FunctionType) and self._own(value.__module__):
            self._add_function(value)
            if hasattr(value, COMPILED_WITH):
                self.add(sorted(getattr(value, COMPILED_WITH).items()))
            else:
                self._add_whole_module(value.__module__)
        else:
            kind = value if hasattr(value, "__qualname__") else type(value)
            self._write(kind.__module__, kind.__qualname__)
            if self._own(str(kind.__module__)):
                self._add_whole_module(kind.__module__)

    def _add_function(self, function: FunctionType) -> None:
        self._write(function.__module__, function.__qualname__)
        self.add((function.__code__, function.__defaults__, function.__kwdefaults__))
        for cell in function.__closure__ or ():
            self.add(cell.cell_contents)
        names = tuple(dict.fromkeys(_names(function.__code__)))
        for name in names:
            if name in function.__globals__:
                self.add(function.__globals__[name], names)

    def _add_code(self, code: CodeType) -> None:
        constants = code.co_consts
        if _has_docstring(code):
            constants = (None, *constants[1:])
        self._write(code.co_argcount, code.co_kwonlyargcount, code.co_flags & _CALL_FLAGS)
        self.add((code.co_code, code.co_names, constants))

    def _add_whole_module(self, name: str) -> None:
        """Add the functions of a module: a stub or a type tag stands for code that numba was told of beside it."""
        for value in vars(sys.modules[name]).values():
            if isinstance(value, FunctionType | Dispatcher) and value.__module__ == name:
                self._add_once(value)

    def _own(self, module: str) -> bool:
        return module.partition(".")[0] in self._ours

    def _write(self, *texts: Any) -> None:
        self.digest.update("\0".join(map(str, texts)).encode() + b"\0\0")


_CALL_FLAGS = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS
_CO_HAS_DOCSTRING = getattr(inspect, "CO_HAS_DOCSTRING", None)  # Python 3.13


def _has_docstring(code: CodeType) -> bool:
    """Whether the first constant is a docstring; before Python 3.13 a function without one has None in that place."""
    if _CO_HAS_DOCSTRING is not None:
        return bool(code.co_flags & _CO_HAS_DOCSTRING)
    return bool(code.co_consts) and isinstance(code.co_consts[0], str) and not code.co_name.startswith("<")


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names of globals and attributes that code uses, with that of functions inside."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
