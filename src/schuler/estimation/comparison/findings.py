"""What a comparison of methods teaches, in plain language."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from schuler.curves.allan_curve import AllanCurve
from schuler.curves.spectrum import SpectrumCurve
from schuler.errors import ModelError
from schuler.estimation.arma.fit import ArmaFit
from schuler.estimation.comparison.parameters import ParameterAgreement
from schuler.estimation.gmwm.fit import GmwmIdentification
from schuler.estimation.identification import Identification
from schuler.estimation.orthogonal_search.result import FosFit
from schuler.estimation.residuals.diagnostics import ResidualDiagnostics
from schuler.estimation.result import MethodIdentification
from schuler.estimation.series_methods import ArGarchFit
from schuler.estimation.slopes import SlopeReadings
from schuler.noise import ProcessSum
from schuler.noise.arma_exchange import arma_to_gauss_markov_sum
from schuler.noise.gauss_markov import FLICKER_LEVEL
from schuler.noise.parameter_names import spoken_name
from schuler.units import format_value

Results = Mapping[str, Identification | MethodIdentification]

_CROSSING_SHARE = 0.5
_OUTLIERS = 1.1
_NOTABLE_MISFIT = 0.01
_NEIGHBOURS = 6
_LINE = 1.5
_SURE = 20.0
_PROCESS_METHODS = ("ml", "gmwm", "allan", "psd")


def spoken(value: float, quantity: str, name: str) -> str:
    """Return a number in datasheet units where the signal is a known channel, else in its own."""
    sensor = name.split("_")[0]
    if sensor in ("gyro", "accel"):
        return format_value(value, f"{sensor} {quantity}", digits=3)
    return f"{value:.3g}"


def findings_of(
    name: str,
    curve: AllanCurve,
    spectrum: SpectrumCurve,
    results: Results,
    parameters: Sequence[ParameterAgreement],
    residuals: Mapping[str, ResidualDiagnostics],
    failures: Mapping[str, str],
) -> tuple[str, ...]:
    """Collect what is worth knowing."""
    lines = [
        *_agreement(parameters),
        *_misfit(results),
        *_spectral_lines(spectrum),
        *_crossing(name, curve, results),
        *_robust(name, results),
    ]
    lines += [*_yule_walker(results), *_garch(results), *_arma(name, results), *_fos(results)]
    lines += [*_left_out(residuals), *_whiteness(residuals)]
    lines += [f"{method}: {text}" for method, text in failures.items()]
    return tuple(lines)


def _agreement(parameters: Sequence[ParameterAgreement]) -> list[str]:
    judged = [p for p in parameters if p.agree is not None]
    if not judged:
        return []
    apart = [p for p in judged if not p.agree]
    if not apart:
        worst = max(judged, key=lambda p: p.worst)
        methods = list(dict.fromkeys(m for p in judged for m in p.values if m in _VOTERS))
        what = f"all {len(judged)} parameters" if len(judged) > 1 else "the parameter"
        return [
            f"{', '.join(methods)} agree within their errors on {what} they "
            f"share; the largest difference is {worst.worst:.1f} combined standard deviations "
            f"({spoken_name(worst.parameter)})"
        ]
    told = []
    for p in sorted(apart, key=lambda p: -p.worst):
        first, second = p.worst_pair
        low, high = sorted((p.values[first], p.values[second]))
        ratio = high / low
        size = f"{100.0 * (ratio - 1.0):.2g} %" if ratio < 2.0 else f"{ratio:.2g} times"
        told.append(f"{spoken_name(p.parameter)} by {p.worst:.1f} ({first} and {second}, {size})")
    return [f"methods differ, in combined standard deviations: {'; '.join(told)}"]


_VOTERS = ("allan", "psd", "gmwm", "ml")


def _misfit(results: Results) -> list[str]:
    """Where no sum of processes fits, every method strikes its own balance."""
    missed = {}
    for method, result in results.items():
        fit = result.fit if isinstance(result, MethodIdentification) else result
        if isinstance(fit, Identification) and fit.diagnostics.discrepancy > _NOTABLE_MISFIT:
            missed[method] = fit.diagnostics.discrepancy
    if not missed:
        return []
    sizes = ", ".join(f"{method} by {100.0 * size:.0f} %" for method, size in missed.items())
    return [
        f"no sum of these processes fits (in deviation {sizes}): every method strikes its own "
        "balance"
    ]


def _spectral_lines(spectrum: SpectrumCurve) -> list[str]:
    """Points that stand far above their neighbours: vibration, which other curves smear out."""
    density, lower = spectrum.density, spectrum.lower
    if not (density > 0.0).all():
        return []
    found = []
    for k in range(_NEIGHBOURS, density.size - _NEIGHBOURS):
        before, after = density[k - _NEIGHBOURS : k], density[k + 1 : k + 1 + _NEIGHBOURS]
        level = max(float(np.median(before)), float(np.median(after)))
        if spectrum.degrees_of_freedom[k] > _SURE and lower[k] > _LINE * level:
            found.append((math.sqrt(float(density[k]) / level), float(spectrum.frequency[k])))
    found = sorted(found, reverse=True)[:3]
    if not found:
        return []
    shown = ", ".join(f"{f:.3g} Hz ({ratio:.2g} times)" for ratio, f in found)
    return [
        f"lines stand above the spectrum around them at {shown}: vibration, which Allan and "
        "wavelet variance spread over all times near its period and take for noise"
    ]


def _crossing(name: str, curve: AllanCurve, results: Results) -> list[str]:
    """The flat part that is where white noise and random walk cross (spec 2.4 b)."""
    slopes = next((r.slopes for r in results.values() if isinstance(r, Identification)), None)
    slope = results.get("slope")
    if isinstance(slope, MethodIdentification) and isinstance(slope.fit, SlopeReadings):
        slopes = slope.fit
    fitted = next((results[m] for m in ("allan", *_PROCESS_METHODS) if m in results), None)
    if slopes is None or slopes.bias_instability is None or fitted is None:
        return []
    process = fitted.process
    if not isinstance(process, ProcessSum) or "random_walk" not in {p.kind for p in process.parts}:
        return []
    reading = slopes.bias_instability
    tau = np.array([math.sqrt(reading.start * reading.stop)])
    level = reading.value * FLICKER_LEVEL
    crossing = sum(
        float(p.allan_variance(tau)[0])
        for p in process.parts
        if p.kind in ("white_noise", "random_walk")
    )
    if crossing < _CROSSING_SHARE * level**2:
        return []
    left = math.sqrt(max(level**2 - crossing, 0.0)) / FLICKER_LEVEL
    read, rest = (spoken(v, "bias instability", name) for v in (reading.value, left))
    return [
        f"the bias instability read off the flat part at {tau[0]:.3g} s is where N and K cross: "
        f"{rest}, not {read}"
    ]


def _robust(name: str, results: Results) -> list[str]:
    plain, robust = (_gmwm(results, m) for m in ("gmwm", "gmwm-robust"))
    if robust is None or plain is None:
        return []
    both = [p.parameters.get("white_noise.density", 0.0) for p in (plain, robust)]
    if min(both) <= 0.0 or max(both) / min(both) < _OUTLIERS:
        return []
    shown = [spoken(v, "white noise", name) for v in both]
    held = (
        f"; {100.0 * robust.wavelet.outliers:.2g} % of the samples count for nothing"
        if robust.wavelet.outliers > 0.0
        else ""
    )
    return [
        f"outliers decide the plain estimate: white noise is {shown[0]} with them and {shown[1]} "
        f"for the bulk of the samples{held}"
    ]


def _gmwm(results: Results, method: str) -> GmwmIdentification | None:
    found = results.get(method)
    fit = found.fit if isinstance(found, MethodIdentification) else None
    return fit if isinstance(fit, GmwmIdentification) else None


def _yule_walker(results: Results) -> list[str]:
    found = results.get("ar-yule-walker")
    if not isinstance(found, MethodIdentification):
        return []
    return [
        f"Yule-Walker is biased here: {text}"
        for text in found.flags
        if "Yule-Walker" in text or "triangular" in text
    ]


def _garch(results: Results) -> list[str]:
    found = results.get("garch")
    if not isinstance(found, MethodIdentification) or not isinstance(found.fit, ArGarchFit):
        return []
    garch = found.fit.garch
    if garch.persistence <= 0.0 or garch.method not in ("maximum likelihood", "variance targeting"):
        return [f"GARCH: {text}" for text in garch.flags]
    before = garch.before.arch_lm.p_value if garch.before else math.nan
    after = garch.after.arch_lm.p_value if garch.after else math.nan
    life = garch.half_life / garch.rate
    weight = float(garch.alpha.sum())
    weak = weight < 0.01 or garch.standard_errors.get("alpha_1", 0.0) > 0.5 * weight
    if before > 0.01 and weak:
        return [
            f"no sign that the variance changes with time: ARCH-LM p is {before:.2g}, and past "
            f"squares have a weight of {weight:.2g}"
        ]
    line = (
        f"variance clusters: persistence {garch.persistence:.5g}, half-life {life:.3g} s; "
        f"ARCH-LM p is {before:.2g} before and {after:.2g} after GARCH"
    )
    return [line + (f" (weak: past squares have a weight of {weight:.2g})" if weak else "")]


def _arma(name: str, results: Results) -> list[str]:
    found = results.get("arma")
    if not isinstance(found, MethodIdentification) or not isinstance(found.fit, ArmaFit):
        return []
    fit = found.fit
    if fit.order == (0, 0):
        return ["ARMA: white noise is enough"]
    orders = f"ARMA({fit.order[0]}, {fit.order[1]})"
    try:
        parts = arma_to_gauss_markov_sum(fit.process)
    except ModelError as error:
        return [f"{orders} is no sum of white noise and Gauss-Markov noises: {error.found}"]
    texts = []
    for part in parts.parts:
        if part.kind == "white_noise":
            texts.append(f"white noise {spoken(part.parameters['density'], 'white noise', name)}")
        else:
            sigma = spoken(part.parameters["sigma"], "bias instability", name)
            texts.append(f"Gauss-Markov {sigma} over {part.parameters['correlation_time']:.3g} s")
    return [f"{orders} is exactly {' + '.join(texts)}"]


def _fos(results: Results) -> list[str]:
    found = results.get("fos")
    if not isinstance(found, MethodIdentification) or not isinstance(found.fit, FosFit):
        return []
    fit = found.fit
    gain = 1.0 - fit.mean_square_error / fit.deviation**2
    share = f"{100.0 * gain:.2g} %" if gain > 0.0 else "nothing"
    return [
        f"FOS chose {len(fit.terms)} of {fit.candidates} terms; on the third of the record that "
        f"it had not seen they explain {share} of the variance"
    ]


def _left_out(residuals: Mapping[str, ResidualDiagnostics]) -> list[str]:
    if all(d.block == 1 for d in residuals.values()):
        return []
    return [
        "the sensor's own low-pass filter (or vibration) correlates neighbouring samples: the fits "
        "leave fast times out, and their one-step errors are those of means over such times"
    ]


def _whiteness(residuals: Mapping[str, ResidualDiagnostics]) -> list[str]:
    if not residuals:
        return []
    white = [m for m, d in residuals.items() if d.white]
    rest = {m: d for m, d in residuals.items() if not d.white}
    lines = []
    if white:
        lines.append(f"one-step errors of {', '.join(white)} are white")
    if rest:
        worst = max(rest.values(), key=lambda d: abs(d.largest_correlation[1]))
        best = min(rest.values(), key=lambda d: abs(d.largest_correlation[1]))
        span = "/".join(f"{abs(d.largest_correlation[1]):.2g}" for d in (best, worst))
        lines.append(
            f"correlation is left in the one-step errors of {', '.join(rest)} "
            f"(largest {span if len(rest) > 1 else span.split('/')[0]})"
        )
    return lines
