"""What a command answered, and the noise of the small recordings."""

from __future__ import annotations

from dataclasses import dataclass

GYRO_N, ACCEL_N = 1e-4, 1e-3
"""White noise of the recordings in SI."""


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str

    def one_line(self) -> str:
        """The error: one line on standard error, never a traceback."""
        lines = self.err.strip().splitlines()
        assert len(lines) == 1, self.err
        assert "Traceback" not in self.err
        assert lines[0].startswith("schuler: ")
        return lines[0]
