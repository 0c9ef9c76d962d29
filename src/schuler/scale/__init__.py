"""Work that takes long: what to show while it runs."""

from schuler.scale.progress import Progress, progress

__all__ = ["Progress", "progress"]
