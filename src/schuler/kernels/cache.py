"""Compiled kernels on disk: what is damaged, or another user could have written, is not used.

Numba unpickles what it finds in its cache and then runs it. Here every file carries a digest and
is looked at before: it and its folder must belong to this user (or root) and be writable to
nobody else. A file that fails is compiled again; a folder that fails is gone around.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import stat
import sys
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

_DIGEST = hashlib.sha256().digest_size


def user_folder() -> Path | None:
    """Return where the user's caches are; None when there is no home."""
    chosen = os.environ.get("SCHULER_CACHE_DIR")
    if chosen:
        return Path(chosen)
    try:
        if sys.platform == "win32":
            local = os.environ.get("LOCALAPPDATA")
            return Path(local or Path.home()) / "schuler" / "Cache"
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "schuler"
        base = os.environ.get("XDG_CACHE_HOME")
        return Path(base or Path.home() / ".cache") / "schuler"
    except RuntimeError:  # no HOME, and a user whom the system does not know
        return None


def usable_folder(name: str) -> Path | None:
    """Return a folder for kernels that nobody else can write, made if need be.

    The user's own, else one among temporary files; None when neither can be had.
    """
    user = user_folder()
    fallback = Path(tempfile.gettempdir()) / f"schuler-{_user()}"
    problem = "there is no home folder"
    for base in (user, fallback):
        if base is None:
            continue
        folder = base / name
        trouble = _trouble(folder)
        if not trouble:
            if base == fallback:
                _say(f"{problem}; compiled kernels are kept in {folder}")
            return folder
        problem = f"{folder} {trouble}"
    _say(f"{problem}; kernels are compiled anew in every run")
    return None


def _trouble(folder: Path) -> str:
    """Make a folder and say why it cannot be used; nothing when it can."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.lstat()
    except OSError as error:
        return f"cannot be used ({error.strerror})"
    if not stat.S_ISDIR(found.st_mode):
        return "is no folder"
    return "" if _ours(found) else "could have been written by another user"


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0


def _ours(found: os.stat_result) -> bool:
    """Tell whether only this user, or root, can have written a file or folder."""
    if sys.platform == "win32":
        return True  # folders below a user's own are his there
    return found.st_uid in (_user(), 0) and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@cache
def _say(message: str) -> None:
    """Tell once."""
    warnings.warn(message, RuntimeWarning, stacklevel=2)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Compiled forms of one kernel, a file for each signature."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._name = repr(function)
        self._py_func = function
        self._impl = _Portable()
        self._cache_path = str(folder)
        self._cache_file = KernelFiles(folder, f"{function.__module__}.{function.__qualname__}")
        self.enable()


class _Portable(CompileResultCacheImpl):  # type: ignore[misc]
    """How Numba turns a compiled kernel into data and back; places are ours to choose."""

    def __init__(self) -> None:
        self._locator = self  # Numba asks it to make the folder, which exists

    def ensure_cache_path(self) -> None:
        """Nothing is left to do."""

    def check_cachable(self, compiled: Any) -> bool:
        """Tell whether a kernel can be kept."""
        return not (compiled.library.has_dynamic_globals or compiled.lifted)


class KernelFiles:
    """Files of one kernel: a digest, and the pickled key and code.

    Parameters
    ----------
    folder : Path
        Where they are.
    name : str
        Name of the kernel.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._name = name.replace("<", "").replace(">", "")

    def load(self, key: Any) -> Any:
        """Return what was kept for a signature; None when there is nothing that can be used."""
        path = self._path(key)
        try:
            data = _read(path)
        except FileNotFoundError:
            return None
        except OSError as error:
            _say(f"{self._folder}: a kernel cannot be read ({error.strerror}); compiled anew")
            return None
        if data is not None and hashlib.sha256(data[_DIGEST:]).digest() == data[:_DIGEST]:
            with suppress(Exception):  # of another version of a library
                kept, code = pickle.loads(data[_DIGEST:])
                if kept == key:
                    return code
        _say(f"{self._folder}: a compiled kernel was damaged or not yours and is compiled anew")
        with suppress(OSError):
            path.unlink()
        return None

    def save(self, key: Any, code: Any) -> None:
        """Keep code for a signature; a folder that takes none is told once."""
        content = dumps((key, code))
        temporary = ""
        try:
            handle, temporary = tempfile.mkstemp(prefix=".", dir=self._folder)  # mode 600
            with os.fdopen(handle, "wb") as stream:
                stream.write(hashlib.sha256(content).digest() + content)
            Path(temporary).replace(self._path(key))
        except OSError as error:
            _say(f"{self._folder}: compiled kernels cannot be kept ({error.strerror})")
            if temporary:
                with suppress(OSError):
                    Path(temporary).unlink()

    def flush(self) -> None:
        """Forget all (Numba calls it when a kernel is compiled again on purpose)."""
        for path in self._folder.glob(f"{self._name}-*.kernel"):
            with suppress(OSError):
                path.unlink()

    def _path(self, key: Any) -> Path:
        # repr, because pickled bytes of equal keys may differ
        return (
            self._folder
            / f"{self._name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.kernel"
        )


def _read(path: Path) -> bytes | None:
    """Return the bytes of a file that only this user can have written."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as stream:
        found = os.fstat(handle)
        return stream.read() if stat.S_ISREG(found.st_mode) and _ours(found) else None
