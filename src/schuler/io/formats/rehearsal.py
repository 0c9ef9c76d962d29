"""Files whose decoders are written in C and trust what they read: tried in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

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
getattr(import_module({module!r}), {name!r})(Path({file!r}))
"""


def rehearse(path: Path, title: str, module: str, name: str) -> None:
    """Let another process read a file; when that does not survive it, the file is refused.

    What the reader raises is left to the caller's own attempt, as is everything where no other
    process can be started. Costs about half a second.
    """
    if not sys.executable:
        return
    size = path.stat().st_size
    code = _LIMITS.format(path=sys.path, size=size, module=module, name=name, file=str(path))
    try:
        done = subprocess.run(
            [sys.executable, "-c", code],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            timeout=SECONDS, check=False, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise damaged(path, title, TimeoutError(f"not read in {SECONDS:g} s")) from None
    except OSError:
        return
    last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
    if last.startswith("MemoryError"):
        raise damaged(path, title, MemoryError("it claims more than there is"))
    if done.returncode < 0 or done.returncode > 1:  # a signal, or how Windows tells of a crash
        raise damaged(path, title, RuntimeError(f"its decoder ends with {done.returncode}"))
