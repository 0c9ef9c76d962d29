"""Results on disk, one small file for each piece of work, so that a killed run goes on."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from schuler.errors import InputError

# NumPy is imported where it is used: a worker has to set its threads before.
if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Arrays: TypeAlias = "dict[str, NDArray[np.float64]]"


class Kept:
    """A folder of results.

    Parameters
    ----------
    folder : Path
        Made when it does not exist.

    Raises
    ------
    InputError
        The folder cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"cannot keep results there ({error.strerror})",
                expected="a folder",
                where=str(folder),
            ) from None

    def load(self, key: str) -> Arrays | None:
        """Return the result of a piece of work."""
        return read_arrays(self.folder / f"{key}.npz")

    def save(self, key: str, arrays: Mapping[str, NDArray[np.float64]], /) -> None:
        """Keep the result of a piece of work; the file appears only when it is complete."""
        import numpy as np

        from schuler.data.table import write_atomically

        def write(path: Path) -> None:
            with path.open("wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, **arrays)

        write_atomically(self.folder / f"{key}.npz", write)

    def names(self) -> Iterator[str]:
        """Return the names of all results, in order."""
        return iter(sorted(path.stem for path in self.folder.glob("*.npz")))


def read_arrays(path: Path) -> Arrays | None:
    """Return the arrays of a file."""
    import numpy as np

    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: np.asarray(archive[name], dtype=np.float64) for name in archive.files}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
