"""What is in the folder, and the way to it; nothing outside of it can be reached."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from schuler.errors import InputError
from schuler.io.registry import is_recording, suffixes

RESULTS = "schuler-results"
"""Folder within the folder that the window writes to."""
MOST_FILES = 2000
MOST_DEPTH = 6
_PAGES, _NUMBERS, _MODELS = (".html", ".htm"), (".json",), (".yaml", ".yml")


class Folder:
    """The folder that is shown.

    Parameters
    ----------
    root : Path
        An existing folder.
    """

    def __init__(self, root: Path) -> None:
        if not root.is_dir():
            raise InputError("is no folder", expected="a folder of recordings", where=str(root))
        self.root = root.resolve()

    def path(self, name: object, *endings: str) -> Path:
        """Return the place of something in the folder, by its name as `listing` gives it.

        Parameters
        ----------
        name : object
            Parts with ``/`` between them, seen from the folder; of a request, so anything.
        *endings : str
            Endings that are allowed; any where there is none.
        """
        if not isinstance(name, str) or not name or "\0" in name or "\\" in name:
            raise InputError("no name of a file", expected="one out of the list")
        parts = name.split("/")
        hidden = any(part.startswith(".") or not part for part in parts)  # "..", too
        place = Path(os.path.realpath(self.root.joinpath(*parts))) if not hidden else self.root
        if hidden or ":" in parts[0] or not self._holds(place) or not place.exists():
            raise InputError("not in this folder", expected="a file out of the list", where=name)
        if endings and place.suffix.lower() not in endings:
            raise InputError(f"is no {endings[0]}", where=name)
        if place.is_dir() and not all(self._holds(Path(os.path.realpath(p))) for p in _all(place)):
            raise InputError("holds links out of this folder", where=name)
        return place

    def page(self, name: object) -> Path:
        """Return the place of a page."""
        return self.path(name, *_PAGES)

    def numbers(self, name: object) -> Path:
        """Return the place of the results of a run."""
        return self.path(name, *_NUMBERS)

    def model(self, name: object) -> Path:
        """Return the place of a noise model."""
        return self.path(name, *_MODELS)

    def results(self, stem: str) -> Path:
        """Return a free place for results, without an ending."""
        place = self.root / RESULTS
        if place.is_symlink() or (place.exists() and not place.is_dir()):
            raise InputError("is no folder of its own", cure="rename it", where=RESULTS)
        try:
            place.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot be made ({error.strerror})", where=RESULTS) from None
        taken = {p.stem.partition(".")[0] for p in place.iterdir()}
        number = 1
        while f"{stem}-{number}" in taken:
            number += 1
        return place / f"{stem}-{number}"

    def name(self, place: Path) -> str:
        """Return the name of something in the folder."""
        return place.relative_to(self.root).as_posix()

    def listing(self) -> dict[str, list[str]]:
        """Return the names of recordings, pages, results and noise models."""
        found: dict[str, list[str]] = {"recordings": [], "pages": [], "numbers": [], "models": []}
        readable = suffixes() - set(_NUMBERS)
        for count, place in enumerate(self._walk(self.root, 0)):
            if count >= MOST_FILES:
                break
            ending = place.suffix.lower()
            if ending in _PAGES:
                found["pages"].append(self.name(place))
            elif ending in _NUMBERS:
                found["numbers"].append(self.name(place))
            elif ending in _MODELS:
                found["models"].append(self.name(place))
            elif place.is_dir() or ending in readable:
                found["recordings"].append(self.name(place))
        return found

    def _walk(self, place: Path, depth: int) -> Iterator[Path]:
        """Yield files, and folders that are one recording; links that lead out are left out."""
        try:
            entries = sorted(place.iterdir())
        except OSError:
            return
        for entry in entries:
            if entry.name.startswith(".") or "\\" in entry.name:
                continue
            if not self._holds(Path(os.path.realpath(entry))):
                continue
            if entry.is_file():
                yield entry
            elif entry.is_dir() and not entry.is_symlink():
                if is_recording(entry):
                    yield entry
                elif depth < MOST_DEPTH:
                    yield from self._walk(entry, depth + 1)

    def _holds(self, place: Path) -> bool:
        return place.is_relative_to(self.root)


def _all(folder: Path) -> Iterator[Path]:
    for at, folders, files in os.walk(folder):
        yield from (Path(at, name) for name in (*folders, *files))
