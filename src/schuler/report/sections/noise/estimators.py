"""Tables of the estimators that predict samples, and volatility through time."""

from __future__ import annotations

import math

from schuler.estimation.arma.fit import ArmaFit
from schuler.estimation.autoregressive.result import ArFit
from schuler.estimation.comparison.methods import MethodComparison
from schuler.estimation.garch.fit import GarchFit
from schuler.estimation.orthogonal_search.result import FosFit
from schuler.estimation.result import MethodIdentification
from schuler.estimation.series_methods import ArGarchFit
from schuler.report.blocks import Block, FigureGrid, LegendItem, Section, Table
from schuler.report.figures import axis, limits, line, marks
from schuler.report.makers import channel_grid, plot
from schuler.report.numbers import MISSING, compact_with_error, number
from schuler.report.sections.noise.method_words import shown_name, unit_of
from schuler.report.sections.noise.residuals import probability

Channels = dict[str, MethodComparison]

_AR = ("ar", "ar-covariance", "ar-yule-walker")


def estimator_sections(channels: Channels) -> tuple[Section, ...]:
    """Show AR, ARMA, FOS and GARCH, as far as they were asked for."""
    predictors = [t for t in (_ar(channels), _arma(channels), _fos(channels)) if t.rows]
    garch = _garch_rows(channels)
    sections = []
    if predictors:
        sections.append(Section("Predictors of samples", tuple(predictors)))
    if garch:
        volatility: tuple[Block, ...] = (_volatility(channels), _garch_table(garch))
        sections.append(Section("Volatility", volatility))
    return tuple(sections)


def predictor_rows(channels: Channels) -> tuple[tuple[str, ...], ...]:
    """Return the models that predict samples in short, with what they leave."""
    rows: list[tuple[str, ...]] = []
    for name, c in channels.items():
        label = shown_name(name)
        for method, result in c.results.items():
            words = _in_short(result.fit) if isinstance(result, MethodIdentification) else ""
            if words:
                left = c.residuals.get(method)
                rows.append((label, method, words, left.verdict if left else MISSING))
                label = ""
    return tuple(rows)


def _in_short(fit: object) -> str:
    if isinstance(fit, ArFit):
        return f"AR({fit.order})"
    if isinstance(fit, ArmaFit):
        return f"ARMA({fit.order[0]}, {fit.order[1]})"
    if isinstance(fit, FosFit):
        return f"{len(fit.terms)} of {fit.candidates} terms"
    if isinstance(fit, ArGarchFit):
        p, q = fit.garch.order
        return f"AR({fit.ar.order})-GARCH({p}, {q}), persistence {fit.garch.persistence:.5g}"
    return ""


def _fits(channels: Channels, method: str) -> list[tuple[str, MethodIdentification]]:
    found = []
    for name, c in channels.items():
        result = c.results.get(method)
        if isinstance(result, MethodIdentification):
            found.append((name, result))
    return found


def _ar(channels: Channels) -> Table:
    rows: list[tuple[str, ...]] = []
    for name in channels:
        label = shown_name(name)
        for method in _AR:
            for owner, result in _fits(channels, method):
                fit = result.fit
                if owner != name or not isinstance(fit, ArFit):
                    continue
                shown = [
                    compact_with_error(float(a), float(e))
                    for a, e in zip(fit.coefficients[:4], fit.standard_errors[:4], strict=True)
                ]
                shown += [MISSING] * (4 - len(shown))
                slowest = float(abs(fit.poles[0])) if fit.order else 0.0
                rows.append(
                    (label, method, str(fit.order), *shown, f"{slowest:.5f}", _first(result.flags))
                )
                label = ""
    return Table(
        "Autoregressive models, A(z) = 1 + a₁ z⁻¹ + …; the order by BIC on the same samples",
        ("channel", "method", "order", "a₁", "a₂", "a₃", "a₄", "largest pole", "to know"),
        tuple(rows),
        words=(0, 1, 8),
    )


def _first(flags: tuple[str, ...]) -> str:
    if not flags:
        return ""
    text = flags[0]
    return text if len(text) <= 90 else text[:88].rsplit(" ", 1)[0] + " …"


def _arma(channels: Channels) -> Table:
    rows: list[tuple[str, ...]] = []
    for name, result in _fits(channels, "arma"):
        fit = result.fit
        if not isinstance(fit, ArmaFit):
            continue
        label = shown_name(name)
        for key in result.parameters:
            if not key.startswith(("phi", "theta")):
                continue
            words = key.replace("phi_", "φ").replace("theta_", "θ")
            rows.append(
                (
                    label,
                    f"({fit.order[0]}, {fit.order[1]})" if label else "",
                    words,
                    compact_with_error(fit.values[key], fit.standard_errors[key]),
                    compact_with_error(fit.values[key], fit.robust_standard_errors[key]),
                    number(fit.t_values[key], 3),
                    probability(fit.p_values[key]),
                )
            )
            label = ""
        if not sum(fit.order):
            rows.append((label, "(0, 0)", "white noise", *[MISSING] * 4))
    return Table(
        "ARMA by exact maximum likelihood, orders by BIC",
        ("channel", "(p, q)", "parameter", "estimate", "with robust error", "t", "p"),
        tuple(rows),
        words=(0, 1, 2),
    )


def _fos(channels: Channels) -> Table:
    rows: list[tuple[str, ...]] = []
    for name, result in _fits(channels, "fos"):
        fit = result.fit
        if not isinstance(fit, FosFit):
            continue
        label = shown_name(name)
        gain = 1.0 - fit.mean_square_error / fit.deviation**2
        for k, term in enumerate(fit.names):
            rows.append(
                (
                    label,
                    term,
                    compact_with_error(float(fit.coefficients[k]), float(fit.standard_errors[k])),
                    number(100.0 * fit.ranking[k].error_reduction, 2),
                    number(fit.ranking[k].strength, 3),
                    number(100.0 * gain, 2) if label else "",
                )
            )
            label = ""
        if not fit.terms:
            rows.append((label, "none", *[MISSING] * 4))
    return Table(
        "Fast Orthogonal Search, terms in the order of their worth",
        ("channel", "term", "coefficient", "explains %", "strength", "held-out gain %"),
        tuple(rows),
        words=(0, 1),
        note="Strength: chi-square with one degree of freedom for a needless term. Held-out gain: "
        "share of the variance that all terms explain in data that the search has not seen.",
        folded=True,
    )


def _garch_rows(channels: Channels) -> list[tuple[str, GarchFit]]:
    return [
        (name, result.fit.garch)
        for name, result in _fits(channels, "garch")
        if isinstance(result.fit, ArGarchFit)
    ]


def _garch_table(found: list[tuple[str, GarchFit]]) -> Table:
    rows: list[tuple[str, ...]] = []
    for name, fit in found:
        unit, factor = unit_of(name)
        errors = fit.standard_errors
        weights = [
            " ".join(
                compact_with_error(v, errors.get(k, 0.0)) for k, v in fit.values.items() if p in k
            )
            for p in ("alpha_", "beta_")
        ]
        variance = fit.unconditional_variance
        sd = number(math.sqrt(variance) / factor, 4) if math.isfinite(variance) else MISSING
        tests = [
            probability(t.arch_lm.p_value) if t is not None else MISSING
            for t in (fit.before, fit.after)
        ]
        life = fit.half_life / fit.rate
        rows.append(
            (
                shown_name(name),
                *weights,
                f"{fit.persistence:.5g}",
                number(life) + " s" if math.isfinite(life) else MISSING,
                f"{sd} {unit}".strip(),
                *tests,
                "yes" if fit.converged else "no",
                _first(fit.flags),
            )
        )
    return Table(
        "GARCH of the one-step errors of the AR model",
        (
            "channel",
            "α",
            "β",
            "persistence",
            "half-life",
            "mean sd",
            "ARCH-LM p before",
            "after",
            "converged",
            "to know",
        ),
        tuple(rows),
        words=(0, 9),
        note="Errors are those of quasi maximum likelihood, right whatever the shape of the noise.",
    )


def _volatility(channels: Channels) -> FigureGrid:
    figures = []
    for name, c in channels.items():
        if c.volatility is None:
            continue
        unit, factor = unit_of(name)
        found = c.volatility
        measured, model = found.measured / factor, found.model / factor
        long = found.time[-1] > 3600.0
        time = found.time / (3600.0 if long else 1.0)
        figures.append(
            plot(
                shown_name(name),
                "Standard deviation of the one-step errors through time.",
                (
                    marks(time, measured, "@data", "measured", size=2.5),
                    line(time, model, "@model", "GARCH", width=1.2),
                ),
                axis("time in h" if long else "time in s"),
                axis(f"standard deviation{unit and f' in {unit}'}", limits=limits(measured, model)),
                height=250,
            )
        )
    return channel_grid(
        figures,
        (
            LegendItem("root mean square in a block", "@data", "point"),
            LegendItem("GARCH", "@model"),
        ),
        "Volatility through time: up to 600 blocks; every sample's variance is foretold "
        "from the samples before it.",
    )
