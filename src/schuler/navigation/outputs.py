"""What a run of the filter leaves behind: at samples, at measurements, at nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class SampleOutputs:
    """The filter's state at every IMU sample; arrays with n rows, as in `run_filter`."""

    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    position_covariance: FloatArray
    velocity_sd: FloatArray
    attitude_sd: FloatArray

    @classmethod
    def empty(cls, rows: int) -> SampleOutputs:
        """Arrays to be written.

        Parameters
        ----------
        rows : int
            Samples; 0 to write none.

        Returns
        -------
        SampleOutputs
            Uninitialised.
        """
        return cls(
            position=np.empty((rows, 3)),
            velocity=np.empty((rows, 3)),
            rotation=np.empty((rows, 3, 3)),
            position_covariance=np.empty((rows, 3, 3)),
            velocity_sd=np.empty((rows, 3)),
            attitude_sd=np.empty((rows, 3)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class AidingOutputs:
    """What happened at every aiding measurement; arrays with u rows, as in `run_filter`."""

    residual: FloatArray
    deviation: FloatArray
    nis: FloatArray
    degrees: IntArray
    accepted: NDArray[np.bool_]
    row: FloatArray
    gain: FloatArray
    scalar: FloatArray

    @classmethod
    def empty(cls, rows: int, kept: int, size: int) -> AidingOutputs:
        """Arrays to be written.

        Parameters
        ----------
        rows : int
            Measurements.
        kept : int
            Measurements of which rows of H and gains are kept for a smoother.
        size : int
            States s.

        Returns
        -------
        AidingOutputs
            Not yet used.
        """
        return cls(
            residual=np.full((rows, 3), np.nan),
            deviation=np.full((rows, 3), np.nan),
            nis=np.zeros(rows),
            degrees=np.zeros(rows, dtype=np.int64),
            accepted=np.zeros(rows, dtype=np.bool_),
            row=np.zeros((kept, 3, size)),
            gain=np.zeros((kept, 3, size)),
            scalar=np.zeros((rows, 3, 2)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class NodeOutputs:
    """What the smoother needs; arrays with k rows, as in `run_filter`.

    A run that keeps little has time and sensor states of all nodes, and no rows of the others.
    """

    time: FloatArray
    sensor_state: FloatArray
    sensor_sd: FloatArray
    covariance: FloatArray
    top: FloatArray
    transition: FloatArray
    error: FloatArray
    aid: IntArray

    @property
    def size(self) -> int:
        """Number of nodes."""
        return int(self.time.size)

    @classmethod
    def empty(cls, rows: int, kept: int, size: int, width: int) -> NodeOutputs:
        """Arrays to be written.

        Parameters
        ----------
        rows : int
            Nodes.
        kept : int
            Nodes that a smoother will need.
        size, width : int
            States s, and those of the largest block of sensor states.

        Returns
        -------
        NodeOutputs
            Uninitialised where it is large.
        """
        m = size - 9
        return cls(
            time=np.zeros(rows),
            sensor_state=np.zeros((rows, m)),
            sensor_sd=np.zeros((rows, m)),
            covariance=np.empty((kept, size, size)),
            top=np.empty((kept, 9, size)),
            transition=np.empty((kept, m, width)),
            error=np.empty((kept, size)),
            aid=np.zeros((kept, 2), dtype=np.int64),
        )


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
