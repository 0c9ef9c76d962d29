"""Trajectories and recordings as tables: Parquet, and CSV with the digits that mean something."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from schuler.io.format import TrackColumns

if TYPE_CHECKING:
    from schuler.data import GnssRecording, ImuRecording


def write_csv(path: Path, track: TrackColumns) -> None:
    """Write a trajectory as CSV."""
    from schuler.io.trajectory import write_columns

    write_columns(path, dict(track), ".csv")


def write_parquet(path: Path, track: TrackColumns) -> None:
    """Write a trajectory as Parquet."""
    from schuler.io.trajectory import write_columns

    write_columns(path, dict(track), ".parquet")


def recording_csv(path: Path, recording: ImuRecording | GnssRecording) -> None:
    """Write a recording as CSV."""
    write_csv(path, recording.to_columns())


def recording_parquet(path: Path, recording: ImuRecording | GnssRecording) -> None:
    """Write a recording as Parquet."""
    write_parquet(path, recording.to_columns())
