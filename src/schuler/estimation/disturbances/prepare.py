"""A signal as a fit should see it: without its lines, and by a route that outliers cannot sway."""

from __future__ import annotations

from dataclasses import dataclass

from schuler.estimation.disturbances.lines import Line, without_lines
from schuler.estimation.disturbances.outliers import Contamination, contamination
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A signal made ready, and what to say about it.

    Parameters
    ----------
    values : (n,) ndarray
        Lines taken out.
    lines : tuple of Line
        What was taken out.
    contamination : Contamination
        How far outliers reach.
    """

    values: FloatArray
    lines: tuple[Line, ...]
    contamination: Contamination

    @property
    def robust(self) -> bool:
        """Whether a robust estimate is called for."""
        return self.contamination.serious

    def flags(self, robustly: bool) -> tuple[str, ...]:
        """What was done to the signal, in plain words."""
        said = []
        if self.robust and robustly:
            said.append(
                f"outliers: {self.contamination.words}; fitted by robust wavelet moments "
                "(gmwm-robust), which hold them back"
            )
        said += [
            f"{line.words} of amplitude {line.amplitude:.4g} "
            f"{'± ' + format(line.amplitude_error, '.2g') + ' ' if line.steady else ''}"
            "was taken out before the fit"
            for line in self.lines
        ]
        if any(not line.steady for line in self.lines):
            said.append("its band was filled with noise: do not believe a quantisation term")
        return tuple(said)


def prepared(values: FloatArray, rate: float) -> Prepared:
    """Take out lines, and tell whether outliers decide."""
    seen = contamination(values)
    if seen.serious:
        # outliers hide lines, and a sinusoid fitted to them would be wrong
        return Prepared(values, (), seen)
    found = without_lines(values, rate)
    return Prepared(found.signal, found.lines, seen)
