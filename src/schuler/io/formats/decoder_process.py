"""Files whose decoders are written in C and trust what they read: decoded in another process.

What comes back is an archive of numbers; nothing of it is ever unpickled.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import damaged

SECONDS, BYTES_PER_SECOND = 8.0, 2e6
"""CPU time granted: to start, and for a damaged file that never ends, by its size."""
MEMORY, PER_BYTE = 1 << 30, 40
"""Addresses granted: the libraries take half of the first; compressed files grow."""
_CODE = """
import sys
sys.path[:] = {path!r}
from schuler.io.formats.decoder_process import answer
answer({module!r}, {name!r}, {file!r}, {seconds}, {memory})
"""


def decoded_apart(
    path: Path, title: str, module: str, name: str, seconds: float = SECONDS
) -> dict[str, Any]:
    """Return the arrays that a function of a module finds in a file, called in another process.

    A file that ends that process, or that takes more time or memory than its size explains, is
    refused; memory that its decoder spoils is not ours. Costs about half a second. Where no other
    process can be started, the function is called here.
    """
    if not sys.executable:
        return only_numbers(getattr(import_module(module), name)(path))
    size = path.stat().st_size
    seconds += size / BYTES_PER_SECOND
    code = _CODE.format(
        path=sys.path, module=module, name=name, file=str(path),
        seconds=int(seconds), memory=MEMORY + PER_BYTE * size,
    )  # fmt: skip
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL, capture_output=True,
            timeout=6.0 * seconds, check=False, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise damaged(path, title, TimeoutError(f"not read in {6.0 * seconds:.0f} s")) from None
    except OSError:
        return only_numbers(getattr(import_module(module), name)(path))
    last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
    if last.startswith("MemoryError") or "ArrayMemoryError" in last:
        raise damaged(path, title, MemoryError("it claims more than there is"))
    if done.returncode:
        raise damaged(path, title, RuntimeError(f"its decoder ends with {done.returncode}"))
    return _received(done.stdout)


def answer(module: str, name: str, file: str, seconds: int, memory: int) -> None:
    """Decode a file under limits, in a process of its own, and write what it holds to stdout."""
    decode = getattr(import_module(module), name)
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    try:
        found = only_numbers(decode(Path(file)))
    except InputError as error:
        told = {k: getattr(error, k) for k in ("found", "expected", "cure", "where")}
        sys.stdout.buffer.write(b"E" + json.dumps(told).encode())
        return
    leaves = list(_leaves((), found))
    names = np.array(json.dumps([keys for keys, _ in leaves]))
    archive = io.BytesIO()
    np.savez(archive, *[value for _, value in leaves], allow_pickle=False, names=names)
    sys.stdout.buffer.write(b"A" + archive.getvalue())


def only_numbers(found: dict[str, Any]) -> dict[str, Any]:
    """Return the structs and the arrays of numbers; texts, cells and objects are left out."""
    kept: dict[str, Any] = {}
    for key, value in found.items():
        if isinstance(value, dict):
            kept[str(key)] = only_numbers(value)
        elif value is not None and np.asarray(value).dtype.kind in "fiub":
            kept[str(key)] = np.asarray(value)
    return kept


def _leaves(keys: tuple[str, ...], value: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves((*keys, key), inner)
    else:
        yield keys, value


def _received(data: bytes) -> dict[str, Any]:
    """Return the arrays that another process wrote, or raise the error that it met."""
    if data[:1] == b"E":
        told = json.loads(data[1:])
        raise InputError(told.pop("found"), **told)
    found: dict[str, Any] = {}
    with np.load(io.BytesIO(data[1:]), allow_pickle=False) as archive:
        for k, (*parents, name) in enumerate(json.loads(str(archive["names"]))):
            place = found
            for parent in parents:
                place = place.setdefault(parent, {})
            place[name] = archive[f"arr_{k}"]
    return found
