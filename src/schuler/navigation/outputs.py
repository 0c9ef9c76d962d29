"""What a smoother needs of a run of the filter, in bytes."""

from __future__ import annotations


def node_bytes(size: int, width: int) -> int:
    """Bytes that one node keeps for the smoother.

    Parameters
    ----------
    size, width : int
        States s, and those of the largest block of sensor states.

    Returns
    -------
    int
        Covariance, transition and correction.
    """
    return 8 * (size * size + 9 * size + (size - 9) * width + size + 2)


def measurement_bytes(size: int) -> int:
    """Bytes that one measurement keeps for the smoother: rows of H and gains.

    Parameters
    ----------
    size : int
        States s.

    Returns
    -------
    int
        Six rows.
    """
    return 8 * 6 * size
