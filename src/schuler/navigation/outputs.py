"""What a smoother needs of a run of the filter, in bytes."""

from __future__ import annotations


def node_bytes(size: int, width: int) -> int:
    """Bytes that one node keeps for the smoother."""
    return 8 * (size * size + 9 * size + (size - 9) * width + size + 2)


def measurement_bytes(size: int) -> int:
    """Bytes that one measurement keeps for the smoother: rows of H and gains."""
    return 8 * 6 * size
