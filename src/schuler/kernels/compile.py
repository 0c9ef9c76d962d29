"""The one decorator that compiles kernels, and the cache that cannot go stale.

Numba does not notice when a cached kernel calls a kernel of another file that has changed. The
cache directory is therefore named after a digest of all kernel sources and of the Numba version:
edit anything and a new directory is used.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import ParamSpec, TypeVar, cast

import numba

from schuler.kernels.cache import KernelCache, usable_folder

P = ParamSpec("P")
R = TypeVar("R")


@lru_cache(maxsize=1)
def cache_directory() -> Path | None:
    """Return the directory of compiled kernels that belongs to exactly these sources.

    None when there is no place that nobody else can write.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    here = Path(__file__).parent
    for source in sorted(here.rglob("*.py")):
        digest.update(source.relative_to(here).as_posix().encode())
        digest.update(source.read_bytes())
    python = f"py{sys.version_info[0]}{sys.version_info[1]}{sys.abiflags}"
    return usable_folder(f"kernels-{digest.hexdigest()[:16]}-{python}")


def kernel(
    *, reduction: bool = False, inline: bool = False
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Compile a function with Numba when it is first called, and keep the result on disk."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        compiled = numba.njit(
            function,
            nogil=True,
            error_model="numpy",
            fastmath={"reassoc", "contract"} if reduction else False,
            forceinline=inline,
        )
        folder = cache_directory()
        if folder is not None and not numba.config.DISABLE_JIT:
            compiled._cache = KernelCache(function, folder)
        return cast("Callable[P, R]", compiled)

    return decorate
