"""The one way a file is written: whole or not at all, where the user's links and devices point.

A temporary file beside the target is filled, brought to the disk and renamed. It is locked while
its writer lives: another run sees by that that it is not alone, and clears what a killed run has
left. Devices, FIFOs and sockets are written into, never replaced.
"""

from __future__ import annotations

import atexit
import errno
import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from schuler.errors import InputError

_PREFIX = ".schuler-"
_SUFFIX = ".tmp"
_SYSTEM_ERROR = re.compile(r"os error (\d+)")


_ALIVE: set[OutputFile] = set()


@atexit.register
def release_all() -> None:
    """Remove everything temporary, as at the end of a command or of the program."""
    for output in tuple(_ALIVE):
        output.release()


def is_temporary(path: Path) -> bool:
    """Tell whether a file is the temporary one of an output of this program."""
    return any(output.temporary == path for output in _ALIVE)


class OutputFile:
    """A file to be written: claimed, filled, and published or released.

    Parameters
    ----------
    path : str or Path
        Where it shall appear.

    Raises
    ------
    InputError
        It cannot be written there.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self._process = os.getpid()
        self._lock: int | None = None
        with _told(self.path):
            self.special = _is_special(self.path)
            # A link is followed, so that the rename hits what it points to.
            self._target = self.path if self.special else Path(os.path.realpath(self.path))
            if not self.special and self._target.exists() and not os.access(self._target, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            folder = Path(tempfile.gettempdir()) if self.special else self._target.parent
            mark = f"{_PREFIX}{_digest(self._target)}-"
            self.others = _clear(folder, mark)
            self.temporary = self._claim(folder, mark)
        _ALIVE.add(self)

    def _claim(self, folder: Path, mark: str) -> Path:
        while True:
            handle, name = tempfile.mkstemp(prefix=mark, suffix=_SUFFIX, dir=folder)
            if _locked(handle) and _is_open_as(handle, name):
                self._lock = handle
                return Path(name)
            os.close(handle)  # somebody who clears was faster

    def fill(self, write: Callable[[Path], None]) -> None:
        """Let a function write the temporary file, and bring it to the disk."""
        with _told(self.path):
            write(self.temporary)
            with self.temporary.open("rb+") as stream:
                os.fsync(stream.fileno())

    def publish(self) -> None:
        """Make what was filled appear."""
        with _told(self.path):
            if self.special:
                with self.temporary.open("rb") as source, self.path.open("wb") as sink:
                    shutil.copyfileobj(source, sink)
            else:
                _like(self.temporary, self._target)
                self.temporary.replace(self._target)
                _sync_folder(self._target.parent)
        self.release()

    def release(self) -> None:
        """Remove what is temporary."""
        _ALIVE.discard(self)
        if self._lock is None or os.getpid() != self._process:
            return
        _remove(self.temporary)
        os.close(self._lock)
        self._lock = None


class _told:
    """Turn what the operating system says of a file into one line for the user."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if not isinstance(error, Exception) or isinstance(error, InputError):
            return
        number = error.errno if isinstance(error, OSError) else None
        if number is None:  # libraries in Rust tell the number in the text only
            match = _SYSTEM_ERROR.search(str(error))
            number = int(match[1]) if match else None
        if number is None:
            return
        cures = {errno.ENOSPC: "free some space or name another place",
                 errno.EDQUOT: "free some space or name another place",
                 errno.EPIPE: "whoever reads it left before the end"}  # fmt: skip
        raise InputError(
            f"cannot write there ({os.strerror(number)})",
            expected="" if number in cures else "an existing folder that can be written",
            cure=cures.get(number, ""),
            where=str(self._path),
        ) from None


def _is_special(path: Path) -> bool:
    """Tell whether something stands there that must not be replaced by a file."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    return not stat.S_ISREG(mode)


def _digest(target: Path) -> str:
    return hashlib.sha256(os.fsencode(target)).hexdigest()[:12]


def _clear(folder: Path, mark: str) -> bool:
    """Remove what killed runs left in a folder; tell whether another run writes this target."""
    others = False
    for left in folder.glob(f"{_PREFIX}*{_SUFFIX}"):
        with suppress(OSError):
            handle = os.open(left, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
            try:
                if _locked(handle):
                    _remove(left)
                else:
                    others = others or left.name.startswith(mark)
            finally:
                os.close(handle)
    return others


def _remove(temporary: Path) -> None:
    with suppress(OSError):
        temporary.unlink(missing_ok=True)
    shutil.rmtree(workspace(temporary), ignore_errors=True)


def workspace(temporary: Path) -> Path:
    """Return the folder beside a temporary file for writers that need one; removed with it."""
    return temporary.with_suffix(".files")


def _locked(handle: int) -> bool:
    """Lock an open file; False when another process holds it."""
    try:
        import fcntl
    except ImportError:  # Windows: nobody can remove what another has open
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _is_open_as(handle: int, name: str) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), Path(name).stat())
    except FileNotFoundError:
        return False


def _like(temporary: Path, target: Path) -> None:
    """Give a new file the mode and owner of the one it replaces, else those of any new file."""
    try:
        old = target.stat()
    except FileNotFoundError:
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        return
    if hasattr(os, "chown"):
        with suppress(OSError):
            os.chown(temporary, old.st_uid, old.st_gid)
    temporary.chmod(stat.S_IMODE(old.st_mode))


def _sync_folder(folder: Path) -> None:
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
