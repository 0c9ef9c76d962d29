"""Files whose decoders are written in C and trust what they read: decoded in another process."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from schuler.errors import InputError
from schuler.io.format import damaged

SECONDS = 120.0
_LIMITS = """
import sys
sys.path[:] = {path!r}
try:
    import resource
    most = {size} * 30 + (4 << 30)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
except (ImportError, ValueError, OSError):
    pass
from importlib import import_module
from pathlib import Path
import pickle
from schuler.errors import InputError
try:
    found = getattr(import_module({module!r}), {name!r})(Path({file!r}))
except InputError as error:
    found = error
sys.stdout.buffer.write(pickle.dumps(found))
"""


def decoded_apart(path: Path, title: str, module: str, name: str) -> Any:
    """Return what a function of a module makes of a file, called in another process.

    A file that ends that process is refused; memory that its decoder spoils is not ours. Costs
    about half a second. Where no other process can be started, the function is called here.
    """
    if not sys.executable:
        return getattr(import_module(module), name)(path)
    size = path.stat().st_size
    code = _LIMITS.format(path=sys.path, size=size, module=module, name=name, file=str(path))
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL, capture_output=True,
            timeout=SECONDS, check=False, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise damaged(path, title, TimeoutError(f"not read in {SECONDS:g} s")) from None
    except OSError:
        return getattr(import_module(module), name)(path)
    last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
    if last.startswith("MemoryError"):
        raise damaged(path, title, MemoryError("it claims more than there is"))
    if done.returncode:
        raise damaged(path, title, RuntimeError(f"its decoder ends with {done.returncode}"))
    found = pickle.loads(done.stdout)
    if isinstance(found, InputError):
        raise found
    return found
