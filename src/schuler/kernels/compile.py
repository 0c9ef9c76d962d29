"""The one decorator that compiles kernels, and the cache that cannot go stale.

Numba does not notice when a cached kernel calls a kernel of another file that has changed. The
cache directory is therefore named after a digest of all kernel sources and of the Numba version:
edit anything and a new directory is used.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def _user_cache() -> Path:
    chosen = os.environ.get("SCHULER_CACHE_DIR")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", str(Path.home()))) / "schuler" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "schuler"
    return Path(os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))) / "schuler"


@lru_cache(maxsize=1)
def cache_directory() -> Path:
    """Return the directory of compiled kernels that belongs to exactly these sources."""
    digest = hashlib.sha256(numba.__version__.encode())
    here = Path(__file__).parent
    for source in sorted(here.rglob("*.py")):
        digest.update(source.relative_to(here).as_posix().encode())
        digest.update(source.read_bytes())
    return _user_cache() / f"kernels-{digest.hexdigest()[:16]}"


def kernel(
    *, reduction: bool = False, inline: bool = False
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Compile a function with Numba when it is first called, and keep the result on disk."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = str(cache_directory())
        try:
            compiled = numba.njit(
                function,
                cache=True,
                nogil=True,
                error_model="numpy",
                fastmath={"reassoc", "contract"} if reduction else False,
                forceinline=inline,
            )
        finally:
            numba.config.CACHE_DIR = before
        return cast("Callable[P, R]", compiled)

    return decorate
