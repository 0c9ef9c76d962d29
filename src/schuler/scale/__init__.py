"""Work that takes long: what to show while it runs."""

from schuler.scale.progress import Advance, progress

__all__ = ["Advance", "progress"]
