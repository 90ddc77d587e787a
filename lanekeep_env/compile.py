"""How the simulator's functions are compiled; where the compiled code is kept is `kernel_cache`'s matter."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import types
from numba.core.typing.templates import infer_global

from lanekeep_env.fingerprint import COMPILED_WITH
from lanekeep_env.interrupts import uninterrupted
from lanekeep_env.kernel_cache import KernelCache
from lanekeep_env.linking import PartCompiler

F = TypeVar("F", bound=Callable[..., Any])

# No reassociation: a car's result must not depend on where in a block it is computed. Contraction
# (fused multiply-add) keeps that.
# Nothing is allocated inside, so reference counting (_nrt) is off: it costs time to compile and to run.
_OPTIONS: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy", "_nrt": False}

# Functions that Python never calls need no entry from Python, and no machine code of their own.
_INTERNAL: dict[str, Any] = {
    **_OPTIONS,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": PartCompiler,
}


# Where results follow another program's operation by operation, each is rounded as there.
_AS_WRITTEN: dict[str, Any] = {"fastmath": False}


def inline(function: F, *, as_written: bool = False) -> F:
    """Compile a scalar function of the SIMD loops; always inlined, or the loop around it stays scalar.

    It stays a Python function, which Python can call with floats. Not by numba's `register_jitable`, which compiles it
    again for each set of options of its callers.
    """
    options = {"forceinline": True, **_INTERNAL, **(_AS_WRITTEN if as_written else {})}
    setattr(function, COMPILED_WITH, options)
    if not numba.config.DISABLE_JIT:
        compiled = numba.njit(**options)(function)
        setattr(function, "_compiled", compiled)  # noqa: B010 - a type keeps no function alive
        infer_global(function, types.Dispatcher(compiled))
    return function


def helper(function: F, *, as_written: bool = False) -> F:
    """Compile a function that other compiled functions call; inlined where LLVM thinks it pays.

    It is kept as kernels are: another kernel that calls it (another car, other sensors) compiles in half the time.
    """
    if numba.config.DISABLE_JIT:
        return function
    compiled = numba.njit(**{**_INTERNAL, **(_AS_WRITTEN if as_written else {})})(function)
    compiled._cache = KernelCache(compiled)
    return compiled


def kernel(*, parallel: bool = False) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile a function that Python calls, and keep the compiled code between processes.

    A cache folder that cannot be used costs the compilation at each start, and no more. With ``NUMBA_DISABLE_JIT=1``
    Python runs the function as it is written, slowly, for a debugger.
    """

    def compile_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        if numba.config.DISABLE_JIT:
            return _quiet(function)
        compiled = numba.njit(nogil=True, no_cfunc_wrapper=True, parallel=parallel, **_OPTIONS)(function)
        compiled._cache = KernelCache(compiled)
        compiled.compile = uninterrupted(_uncollected()(compiled.compile))
        return compiled

    return compile_kernel


@contextmanager
def _uncollected() -> Iterator[None]:
    """Collect no garbage meanwhile: the compiler makes so many objects that it costs a tenth of its time."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


inline_as_written = functools.partial(inline, as_written=True)
helper_as_written = functools.partial(helper, as_written=True)


def _quiet(function: F) -> F:
    """Let NumPy's numbers overflow and divide by zero without a warning, as compiled ones do."""

    @functools.wraps(function)
    def run(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*arguments)

    return run  # type: ignore[return-value]
