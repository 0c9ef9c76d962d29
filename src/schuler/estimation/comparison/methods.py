"""Several methods on one signal, side by side: what they find, what they leave, who agrees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.curves.allan import allan_deviation
from schuler.curves.allan_curve import AllanCurve
from schuler.curves.finite_signal import checked_rate
from schuler.curves.spectrum import SpectrumCurve, power_spectral_density
from schuler.data.exportable import Exportable
from schuler.data.imu import ImuRecording
from schuler.data.to_dict import plain
from schuler.errors import EstimationError, InputError, SchulerError
from schuler.estimation.comparison.curves import (
    CorrelationPoints,
    Theory,
    correlation_points,
    theory_of,
)
from schuler.estimation.comparison.findings import findings_of
from schuler.estimation.comparison.parameters import (
    ParameterAgreement,
    compare_parameters,
    shared_structure,
)
from schuler.estimation.disturbances.prepare import has_lines, prepared
from schuler.estimation.identification import Identification
from schuler.estimation.identify import METHODS, STRUCTURAL, identify, identify_structure
from schuler.estimation.parts import checked_model
from schuler.estimation.predictors.innovation_floor import innovation_variance_of_signal
from schuler.estimation.residuals.diagnostics import ResidualDiagnostics
from schuler.estimation.result import MethodIdentification
from schuler.estimation.series_methods import ArGarchFit
from schuler.estimation.signals import checked_signal
from schuler.estimation.structure_methods import fastest_block, process_diagnostics
from schuler.noise import Process
from schuler.types import FloatArray

Result = Identification | MethodIdentification

DEFAULT_METHODS = ("allan", "slope", "psd", "gmwm", "ml")
_FIT_A_MODEL = ("allan", "psd", "gmwm", "gmwm-robust", "ml")
_BANDED = ("psd", "ml")
_BLOCKS = 600
_FEWEST = 100
_FLOOR_SAMPLES = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Volatility:
    """The standard deviation of one-step errors through time, in blocks."""

    time: FloatArray  # (b,): middle of every block in s from the start
    model: FloatArray  # (b,): what GARCH says, root of the mean variance, in u
    measured: FloatArray  # (b,): root mean square of the one-step errors, in u


@dataclass(frozen=True, slots=True, eq=False)
class MethodComparison(Exportable):
    """What several methods say about one signal.

    Parameters
    ----------
    name : str
        Of the signal; "gyro_x" and the like are shown in datasheet units.
    rate : float
        Samples a second.
    samples : int
        Length of the signal.
    results : dict of str to Identification or MethodIdentification
        By method.
    failures : dict of str to str
        One line for each method that had no answer.
    parameters : tuple of ParameterAgreement
        Values, errors, differences.
    residuals : dict of str to ResidualDiagnostics
        What each method leaves, where it can predict.
    theory : dict of str to Theory
        What the process of each method says the curves are.
    allan, spectrum, correlation : AllanCurve, SpectrumCurve, CorrelationPoints
        Measured.
    floor : float or None
        Innovation variance by the spectrum of the signal: no predictor is better.
    volatility : Volatility or None
        With method "garch".
    structure : str
        Where the structure of the processes came from.
    findings : tuple of str
        What is worth knowing, in plain language.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import WhiteNoise, compare_methods
    >>> signal = WhiteNoise(1e-3).simulate(20_000, 0.01, np.random.default_rng(1))
    >>> found = compare_methods(signal, 100.0, ("allan", "slope"))
    >>> found.samples, found.failures
    (20000, {})
    """

    JSON = (
        "name rate_hz=rate samples structure agree parameters failures residuals "
        "innovation_variance_floor=floor findings"
    )

    name: str
    rate: float
    samples: int
    results: dict[str, Result]
    failures: dict[str, str]
    parameters: tuple[ParameterAgreement, ...]
    residuals: dict[str, ResidualDiagnostics]
    theory: dict[str, Theory]
    allan: AllanCurve
    spectrum: SpectrumCurve
    correlation: CorrelationPoints
    floor: float | None
    volatility: Volatility | None
    structure: str
    findings: tuple[str, ...]

    @property
    def agree(self) -> bool | None:
        """True where all methods agree on all parameters they share; None if none is shared."""
        verdicts = [p.agree for p in self.parameters if p.agree is not None]
        return all(verdicts) if verdicts else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        curves = {
            "tau_s": self.allan.tau,
            "allan_deviation": self.allan.deviation,
            "frequency_hz": self.spectrum.frequency,
            "two_sided_density": self.spectrum.two_sided,
            "lag_s": self.correlation.lag,
            "correlation": self.correlation.correlation,
            "theory": self.theory,
        }
        methods = {m: {"method": m, **r.to_dict()} for m, r in self.results.items()}
        return Exportable.to_dict(self) | {"methods": methods, "curves": plain(curves)}


@dataclass(frozen=True, slots=True, eq=False)
class ImuMethodComparison(Exportable):
    """Several methods on every channel of a recording.

    Parameters
    ----------
    recording_name : str
        Which recording.
    channels : dict of str to MethodComparison
        By channel name.
    rate : float
        Samples a second.
    duration : float
        Length in s.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, compare_methods_imu, simulate_static
    >>> model = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))
    >>> imu = simulate_static(model, 120.0, 50.0, np.random.default_rng(1))
    >>> len(compare_methods_imu(imu, ("slope",)).channels)
    6
    """

    JSON = "recording=recording_name rate_hz=rate duration_s=duration channels"

    recording_name: str
    channels: dict[str, MethodComparison]
    rate: float
    duration: float

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods that answered for some channel, in the order of `METHODS`."""
        return tuple(m for m in METHODS if any(m in c.results for c in self.channels.values()))

    @property
    def findings(self) -> tuple[str, ...]:
        """Findings of all channels, each with the names of its channels in front."""
        grouped: dict[str, list[str]] = {}
        for name, comparison in self.channels.items():
            for text in comparison.findings:
                grouped.setdefault(text, []).append(name)
        return tuple(f"{', '.join(names)}: {text}" for text, names in grouped.items())


def compare_methods(
    signal: ArrayLike,
    rate: float,
    methods: Sequence[str] = DEFAULT_METHODS,
    *,
    model: str | Process = "shared",
    name: str = "",
    columns: Mapping[str, ArrayLike] | None = None,
    told: Callable[[str], None] | None = None,
) -> MethodComparison:
    """Put several methods to one signal and lay their answers side by side.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at rest.
    rate : float
        Samples a second.
    methods : sequence of str
        Out of `schuler.estimation.METHODS`, or ("all",).
    model : {"shared", "auto", "classical"} or Process
        "shared": the first method that fits processes chooses the structure, and the others fit
        the same, so that parameters mean the same; "auto": each chooses for itself.
    name : str
        Of the signal, such as "gyro_x": findings then speak in datasheet units.
    columns : mapping of str to (n,) array_like, optional
        As for `identify`, for all methods whose answer is a sum of processes.
    told : callable, optional
        Is told the method that is at work.

    Returns
    -------
    MethodComparison
        Methods without an answer are in `failures`, with the reason.

    Raises
    ------
    InputError
        An unknown method, a signal that is not one-dimensional or not finite, an impossible rate.
    EstimationError
        Fewer than 100 samples, a signal that does not vary, or no method has an answer.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import WhiteNoise, compare_methods
    >>> signal = WhiteNoise(1e-3).simulate(20_000, 0.01, np.random.default_rng(1))
    >>> sorted(compare_methods(signal, 100.0, ("allan", "slope")).results)
    ['allan', 'slope']
    """
    wanted = _checked(methods)
    values, rate = checked_signal(signal, _FEWEST), checked_rate(rate)
    model = model if model == "shared" else checked_model(model)
    ready = prepared(values, rate, columns, lines=not has_lines(model))
    results: dict[str, Result] = {}
    failures: dict[str, str] = {}
    shared: Process | None = None
    shortest: float | None = None
    structure = "each method chose its own" if model in ("shared", "auto") else "as given"
    for method in wanted:
        if told is not None:
            told(method)
        use: Any = "auto" if isinstance(model, str) and model == "shared" else model
        if method not in _FIT_A_MODEL:
            use = "auto"
        elif isinstance(model, Process):
            use = shared_structure(model, method) or "auto"
        elif model == "shared":
            use = shared_structure(shared, method) or "auto"
        try:
            if method in STRUCTURAL:
                banded = shortest if method in _BANDED else None
                results[method] = identify_structure(ready, use, method, banded)
            else:
                results[method] = identify(values, rate, use, method=method)
        except SchulerError as error:
            failures[method] = str(error)
            continue
        if shortest is None:
            shortest = _shortest_time(results[method])
        if method in _FIT_A_MODEL and shared is None and model == "shared":
            shared = ready.without_lines(results[method].process)
            structure = f"chosen by method '{method}', the same for all that fit a structure"
    if not results:
        raise EstimationError(
            "no method has an answer: " + "; ".join(f"{m}: {t}" for m, t in failures.items())
        )
    return _described(values, rate, name, results, failures, structure)


def _shortest_time(result: Result) -> float | None:
    """The time above which a fit holds, if it left out faster ones."""
    fit = result.fit if isinstance(result, MethodIdentification) else result
    if not isinstance(fit, Identification):
        return None
    rate = fit.curve.rate
    block = fastest_block(fit, rate)
    return block / rate if block > 1 else None


def _checked(methods: Sequence[str]) -> tuple[str, ...]:
    if isinstance(methods, str):
        methods = (methods,)
    if "all" in methods:
        return tuple(METHODS)
    for method in methods:
        if method not in METHODS:
            raise InputError(f"method '{method}'", expected=f"all, {', '.join(METHODS)}")
    if not methods:
        raise InputError("no method to compare", expected=", ".join(METHODS))
    return tuple(m for m in METHODS if m in methods)


def _described(
    values: FloatArray,
    rate: float,
    name: str,
    results: dict[str, Result],
    failures: dict[str, str],
    structure: str,
) -> MethodComparison:
    """Add curves, theory, residuals and findings."""
    first = results.get("allan")
    known = first.curve if isinstance(first, Identification) else None
    allan = known or allan_deviation(values, rate)
    spectrum = power_spectral_density(values, rate, onesided=False)
    correlation = correlation_points(values, rate)
    residuals: dict[str, ResidualDiagnostics] = {}
    theory: dict[str, Theory] = {}
    for method, result in results.items():
        if result.process is not None:
            theory[method] = theory_of(result.process, allan, spectrum, correlation)
        left = result.diagnostics
        if isinstance(result, Identification):
            left = process_diagnostics(values, result.process, rate, fastest_block(result, rate))
        if isinstance(left, ResidualDiagnostics):
            residuals[method] = left
    parameters = compare_parameters(results)
    floor = innovation_variance_of_signal(values) if values.size >= _FLOOR_SAMPLES else None
    return MethodComparison(
        name=name,
        rate=rate,
        samples=values.size,
        results=results,
        failures=failures,
        parameters=parameters,
        residuals=residuals,
        theory=theory,
        allan=allan,
        spectrum=spectrum,
        correlation=correlation,
        floor=floor,
        volatility=_volatility(values, rate, results),
        structure=structure if any(m in STRUCTURAL for m in results) else "",
        findings=findings_of(name, allan, spectrum, results, parameters, residuals, failures),
    )


def _volatility(values: FloatArray, rate: float, results: dict[str, Result]) -> Volatility | None:
    found = results.get("garch")
    if not isinstance(found, MethodIdentification) or not isinstance(found.fit, ArGarchFit):
        return None
    errors = found.fit.residuals(values)
    model = found.fit.volatility(values)
    starts = np.unique(np.linspace(0, errors.size, min(_BLOCKS, errors.size) + 1).astype(np.int64))
    sizes = np.diff(starts)
    scale = float(np.abs(errors).max())

    def block_rms(series: FloatArray) -> FloatArray:
        return np.asarray(
            scale * np.sqrt(np.add.reduceat((series / scale) ** 2, starts[:-1]) / sizes)
        )

    first = values.size - errors.size
    middle = (first + starts[:-1] + 0.5 * sizes) / rate
    return Volatility(middle, block_rms(model), block_rms(errors))


def compare_methods_imu(
    imu: ImuRecording,
    methods: Sequence[str] = DEFAULT_METHODS,
    *,
    model: str | Process = "shared",
    told: Callable[[str, float], None] | None = None,
) -> ImuMethodComparison:
    """Put several methods to every channel of a recording at rest.

    Parameters
    ----------
    imu : ImuRecording
        Lying still, evenly sampled (screen and repair it first).
    methods, model
        As for `compare_methods`.
    told : callable, optional
        Is told what is at work and the share that is done.

    Returns
    -------
    ImuMethodComparison
        By channel.

    Raises
    ------
    InputError, EstimationError
        As from `compare_methods`, with the channel named.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, compare_methods_imu, simulate_static
    >>> model = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))
    >>> imu = simulate_static(model, 120.0, 50.0, np.random.default_rng(1))
    >>> len(compare_methods_imu(imu, ("slope",)).channels)
    6
    """
    wanted = _checked(methods)
    columns = {} if imu.temperature is None else {"temperature": imu.temperature}
    channels: dict[str, MethodComparison] = {}
    if not imu.channels:
        raise EstimationError(f"recording '{imu.name}' has no channel", expected="at least one")
    done, total = 0, len(imu.channels) * len(wanted)

    for channel in imu.channels:

        def say(method: str, channel: str = channel) -> None:
            nonlocal done
            if told is not None:
                told(f"{channel}, {METHODS[method]}", done / total)
            done += 1

        try:
            channels[channel] = compare_methods(
                imu.channel(channel),
                imu.rate,
                wanted,
                model=model,
                name=channel,
                columns=columns,
                told=say,
            )
        except SchulerError as error:
            raise error.at(f"{imu.name}, {channel}") from None
    return ImuMethodComparison(imu.name, channels, imu.rate, imu.duration)
