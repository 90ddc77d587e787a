"""Compiled kernels on disk: one file for each kernel and signature, believed only after it was checked.

numba's own cache keeps an index beside numbered files: two first starts at once can put one signature's code under the
number of the other, a file cut off fails at every start, and a folder that cannot be written moves the cache beside the
sources. Here a file is named after what was compiled and for what, carries that key and a checksum, and whatever goes
wrong means "not cached": one compilation in memory.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import sys
import time
import uuid
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.dispatcher import Dispatcher
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature

from lanekeep_env.files import read_bounded
from lanekeep_env.fingerprint import fingerprint
from lanekeep_env.linking import rebuild

#: Folders of kernels that were not used for so long (s) are removed when a new one is made.
KEPT = 30 * 86400.0
#: Uses less than this apart (s) are one use.
_USE = 86400.0
#: Largest file that is read, bytes; kernels have less than one megabyte.
_LARGEST = 1 << 26

#: Whether it was told that something is compiled.
_told = False
_MAGIC = b"lanekeep kernel 2\n"
_FOLDER = re.compile(r"[0-9a-f]{16}")
#: Files that this cache, or numba's in its place before, wrote, temporary ones included.
_FILE = re.compile(r".*\.(nbc|nbi)(\.tmp\.[0-9a-f]+)?")


def cache_root() -> Path:
    """Folder of all compiled kernels: ``LANEKEEP_CACHE_DIR``, else the user's cache folder."""
    root = os.environ.get("LANEKEEP_CACHE_DIR")
    if root:
        return Path(root)
    home = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(home) if home else Path.home() / ".cache") / "lanekeep"


class KernelCache:
    """The cache of one kernel, in the place of numba's own; its methods are those that numba's dispatcher calls."""

    def __init__(self, compiled: Dispatcher) -> None:
        self._compiled = compiled
        #: Key and file by signature of what was looked for and is being compiled.
        self._wanted: dict[Any, tuple[bytes, Path]] = {}

    @property
    def cache_path(self) -> str:
        """Folder of the kernel as it is now."""
        return str(self._folder(fingerprint(self._compiled)))

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled code for ``signature``, or None where none is kept that can be used."""
        found = self._kept(signature, target_context)
        if found is None and not self._compiled.targetoptions.get("no_cpython_wrapper"):
            with suppress(Exception):  # a stream of somebody's own, or no home
                _tell()  # of a kernel that is waited for; what it calls is part of that
        return found

    def _kept(self, signature: Any, target_context: Any) -> Any:
        # Whatever is wrong with a disk or a file: compiling is the answer to all of it.
        try:
            # All that compiled code needs to run. A refresh imports what compiling needs, SciPy included, which takes
            # as long as everything else up to the first step.
            rtsys.initialize(target_context)
            key, path = self._wanted[signature] = self._place(signature, target_context.codegen())
            payload = _payload(path, key)
            if payload is None:
                return None
            result = rebuild(target_context, pickle.loads(payload))
            if tuple(result.signature.args) != tuple(normalize_signature(signature)[0]):
                return None  # types that differ and are written alike
            del self._wanted[signature]
            _mark_used(path.parent)
            return result
        except Exception:
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep compiled code, if that can be."""
        try:
            if result.library.has_dynamic_globals or any(not lifted.can_cache for lifted in result.lifted):
                return
            key, path = (
                self._wanted.pop(signature) if signature in self._wanted else self._place(signature, result.codegen)
            )
            payload = dumps(result._replace(type_annotation="")._reduce())
            if not path.parent.is_dir():
                path.parent.mkdir(parents=True, exist_ok=True)
                _remove_unused(path.parent.parent)
            _write(path, _MAGIC + key + hashlib.sha256(key + payload).digest() + payload)
        except Exception:
            return

    def flush(self) -> None:
        """Forget this kernel as it is now."""
        try:
            for path in Path(self.cache_path).glob("*.nbc"):
                path.unlink()
        except Exception:
            return

    def _folder(self, hashed: str) -> Path:
        return cache_root() / hashed[:16]

    def _place(self, signature: Any, codegen: Any) -> tuple[bytes, Path]:
        """Return the key of what is compiled, for which types and which processor, and its file."""
        hashed = fingerprint(self._compiled)
        key = hashlib.sha256(
            "\0".join((str(_MAGIC), hashed, str(signature), *map(str, codegen.magic_tuple()))).encode()
        )
        name = re.sub(r"\W", "", self._compiled.py_func.__name__)
        return key.digest(), self._folder(hashed) / f"{name}-{key.hexdigest()[:16]}.nbc"


def _tell() -> None:
    """Tell whoever watches, once a process, why the first step takes so long."""
    global _told
    if not _told and sys.stderr is not None and sys.stderr.isatty():
        print(
            f"lanekeep: compiling, once for each kind of car (some 10 to 30 s; kept in {cache_root()}; "
            "`lanekeep warmup` does it ahead of time)",
            file=sys.stderr,
            flush=True,
        )
    _told = True


def _payload(path: Path, key: bytes) -> bytes | None:
    """Return what was kept under ``key``, or None if the file is another's, another key's or damaged.

    Raises:
        OSError, ValueError: there is no such file, or it is no ordinary one.
    """
    status = os.stat(path)
    # Unpickling runs what the file says: only what nobody but the user and root could have written.
    if os.name == "posix" and (status.st_uid not in (0, os.geteuid()) or status.st_mode & 0o022):
        return None
    content = read_bounded(path, _LARGEST)
    head, checksum, payload = content[: len(_MAGIC) + 32], content[len(_MAGIC) + 32 :][:32], content[len(_MAGIC) + 64 :]
    if head != _MAGIC + key or hashlib.sha256(key + payload).digest() != checksum:
        return None
    return payload


def _write(path: Path, content: bytes) -> None:
    """Write a file so that a reader sees all of it or nothing, however many write it at once."""
    temporary = path.with_name(f"{path.name}.tmp.{uuid.uuid4().hex[:16]}")
    # Readable by all (a container's cache), writable by nobody else, whatever the umask.
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _mark_used(folder: Path) -> None:
    try:
        if time.time() - folder.stat().st_mtime > _USE:
            os.utime(folder)
    except OSError:
        pass  # a folder that cannot be written


def _remove_unused(root: Path) -> None:
    """Remove the kernels that were not used for long: those of older versions, most of all. Nothing else goes."""
    with os.scandir(root) as entries:
        for entry in entries:
            old = entry.is_dir(follow_symlinks=False) and time.time() - entry.stat().st_mtime > KEPT
            if old and _FOLDER.fullmatch(entry.name):
                _remove(entry.path)


def _remove(folder: str) -> None:
    """Remove a folder of kernels; it stays where it holds anything else."""
    try:
        for parent, _, files in os.walk(folder, topdown=False):
            for name in filter(_FILE.fullmatch, files):
                os.unlink(os.path.join(parent, name))
            os.rmdir(parent)
    except OSError:
        pass  # in use, or not ours
