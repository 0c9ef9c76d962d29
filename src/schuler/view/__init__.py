"""A window in the browser onto one folder: its recordings and results, and what to do with them."""

from schuler.view.server import serve

__all__ = ["serve"]
