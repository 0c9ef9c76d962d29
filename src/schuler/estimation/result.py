"""What every way of identification answers: a process, its numbers, their errors, what is left."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from schuler.data.exportable import Exportable
from schuler.data.to_dict import plain
from schuler.estimation.disturbances.lines import Line
from schuler.estimation.ieee952 import Coefficient, ieee952_of, ieee952_to_dict
from schuler.estimation.residuals.diagnostics import ResidualDiagnostics
from schuler.noise import Process, ProcessSum
from schuler.noise.effects import Effect


@runtime_checkable
class MethodResult(Protocol):
    """What can be asked of any result of `identify`."""

    @property
    def method(self) -> str:
        """Name of the method, as `identify` takes it."""
        ...

    @property
    def process(self) -> Process | None:
        """Process of the signal; None where the method has none."""
        ...

    @property
    def parameters(self) -> dict[str, float]:
        """Estimates by name, SI."""
        ...

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors by the same names, for those that have one."""
        ...

    @property
    def diagnostics(self) -> Any:
        """How well the model describes the signal."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        ...


class Fit(Protocol):
    """A result of an estimator in full."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class MethodIdentification(Exportable):
    """The result of any estimator in the words that all of them share.

    Parameters
    ----------
    method : str
        As `identify` was asked.
    process : Process or None
        In the unit of the signal.
    no_process : str
        Why there is none; empty where there is one.
    parameters : dict of str to float
        Estimates, SI.
    standard_errors : dict of str to float
        By the same names.
    limits : dict of str to float
        95 % upper limits of terms that were looked for and not found, where the method has them.
    diagnostics : ResidualDiagnostics or None
        What is left when the model has predicted every sample; None where it cannot predict.
    converged : bool
        The estimator ended at its optimum (always true for those that do not iterate).
    flags : tuple of str
        What to know before use, in plain words; empty if nothing.
    fit : Fit
        The estimator's own result, with all that is not common.
    lines : tuple of Line
        Lines of vibration that were taken out first.
    effects : tuple of Effect
        What follows a column beside the signal, taken out first.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import WhiteNoise, compare_methods
    >>> signal = WhiteNoise(1e-3).simulate(20_000, 0.01, np.random.default_rng(1))
    >>> found = compare_methods(signal, 100.0, ("slope",)).results["slope"]
    >>> found.method
    'slope'
    """

    JSON = "method no_process upper_limits_95=limits diagnostics converged flags fit"

    method: str
    process: Process | None
    no_process: str
    parameters: dict[str, float]
    standard_errors: dict[str, float]
    limits: dict[str, float]
    diagnostics: ResidualDiagnostics | None
    converged: bool
    flags: tuple[str, ...]
    fit: Fit
    lines: tuple[Line, ...] = field(default=(), kw_only=True)
    effects: tuple[Effect, ...] = field(default=(), kw_only=True)

    @property
    def ieee952(self) -> dict[str, Coefficient]:
        """N, B, K, Q, R of IEEE Std 952, SI; empty ones where the method does not speak of them."""
        return ieee952_of(self.process, self.standard_errors, self.limits)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        parameters = {
            key: {"value": value, "standard_error": self.standard_errors.get(key)}
            for key, value in self.parameters.items()
        }
        named = {
            "processes": process_to_list(self.process),
            "parameters": plain(parameters),
            "ieee952": ieee952_to_dict(self.ieee952),
        }
        told = {"lines": self.lines, "effects": self.effects}
        return Exportable.to_dict(self) | named | {k: plain(v) for k, v in told.items() if v}


def process_to_list(process: Process | None) -> list[dict[str, Any]]:
    """Return the parts of a process as plain Python for JSON."""
    if process is None:
        return []
    return [{"kind": part.kind, **part.parameters} for part in process.components]


def fitted_to_dict(
    process: ProcessSum,
    parameters: Mapping[str, float],
    standard_errors: Mapping[str, float],
    intervals: Mapping[str, tuple[float, float]],
) -> dict[str, Any]:
    """Return parts and parameters of a fitted sum as plain Python for JSON."""
    return {
        "processes": [
            {"kind": part.kind, "name": name, **part.parameters}
            for name, part in zip(process.names, process.parts, strict=True)
        ],
        "parameters": {
            key: {
                "value": value,
                "standard_error": plain(standard_errors[key]),
                "interval_95": plain(intervals[key]),
            }
            for key, value in parameters.items()
        },
    }
