"""How the simulator's functions are compiled, and where the compiled code is kept.

numba's own cache looks at the file of the cached function only: an edit in a file that it imports
would go unseen. So the cache lives in a folder named after a hash of every source that can reach a
kernel; an edit anywhere opens a new folder.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

# No reassociation: a lane's result must not depend on where in a block it is computed. Contraction
# (fused multiply-add) keeps that.
# Nothing is allocated inside, so reference counting (_nrt) is off: it costs time to compile and to run.
_OPTIONS: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy", "_nrt": False}

# Functions that Python never calls need no entry from Python; that halves the time to compile.
_INTERNAL: dict[str, Any] = {**_OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

#: Folders (beside this file) and files whose content decides what a kernel does.
KERNEL_SOURCES = (
    "compile.py",
    "layout.py",
    "randomness.py",
    "physics",
    "sensing",
    "tasks",
    "envs",
    "walls/contact.py",
    "walls/raycast.py",
)


def source_hash(package: Path) -> str:
    """Hash of all kernel and physics sources below ``package``, 16 hexadecimal digits."""
    digest = hashlib.sha256(numba.__version__.encode())
    for name in KERNEL_SOURCES:
        path = package / name
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.relative_to(package).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Folder of the compiled kernels: ``LANEKEEP_CACHE_DIR``, else the user's cache folder, by source hash."""
    root = os.environ.get("LANEKEEP_CACHE_DIR")
    if root is None:
        home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
        root = str((Path(home) if home else Path.home() / ".cache") / "lanekeep")
    return Path(root) / source_hash(Path(__file__).parent)


def inline(function: F) -> F:
    """Compile a scalar function of the SIMD loops; always inlined, or the loop around it stays scalar."""
    return numba.njit(forceinline=True, **_INTERNAL)(function)


def helper(function: F) -> F:
    """Compile a function that other compiled functions call; inlined where LLVM thinks it pays."""
    return numba.njit(**_INTERNAL)(function)


def kernel(*, parallel: bool = False) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile a function that Python calls, and keep the compiled code between processes.

    A cache folder that cannot be written costs the compilation at each start, and no more.
    """

    def compile_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
        before = numba.config.CACHE_DIR
        try:
            folder = cache_folder()
            folder.mkdir(parents=True, exist_ok=True)
            numba.config.CACHE_DIR = str(folder)
            return numba.njit(cache=True, nogil=True, parallel=parallel, **_OPTIONS)(function)
        except (OSError, RuntimeError):
            return numba.njit(nogil=True, parallel=parallel, **_OPTIONS)(function)
        finally:
            numba.config.CACHE_DIR = before

    return compile_kernel
