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
        """The error: one line on standard error beside progress, never a traceback."""
        lines = [s for s in self.err.strip().splitlines() if not s.startswith("... ")]
        assert len(lines) == 1, self.err
        assert "Traceback" not in self.err
        assert lines[0].startswith("schuler: ")
        return lines[0]
