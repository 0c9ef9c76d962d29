"""The estimators themselves: lattice and direct form, stability, and what a search may claim."""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.signal import lfilter

from schuler import (
    Autoregressive,
    denoise,
    fast_orthogonal_search,
    fit_ar,
    fit_ar_orders,
    whiten_lattice,
)
from schuler_papers.experiment import Numbers, Results, Size, generator, numbers, stacked
from schuler_papers.judging import Found, Value, plain
from schuler_papers.outcome import Curve, Panel, Proof, Role
from schuler_papers.tamazin2013.predictors import ACCELEROMETER, AR_METHODS, PAPER, RATE

Stopping = Literal["family-wise", "single"]
TRUTH = np.array([-2.5790, 2.1664, -0.5874])
"""A(z) with poles 0.999, 0.98 and 0.6."""
TERMS = {((1,), (0,)), ((1, 3), (1, 1))}
"""y(n-1) and x(n-1) x(n-3)."""


def run_long(seed: int, size: Size) -> Numbers:
    """Fit AR(3) with poles near one by all methods, and whiten by lattice and direct form."""
    rng = generator(seed, PAPER, "lattice")
    samples = 50_000 if size == "quick" else 200_000
    noise = rng.standard_normal(samples + 20_000)
    y = np.asarray(lfilter([1.0], np.concatenate([[1.0], TRUTH]), noise))[20_000:]
    found: Numbers = {}
    for method in AR_METHODS:
        found[method] = fit_ar(y, 3, method).coefficients
    burg = fit_ar(y, 3, "burg")
    forward, _ = whiten_lattice(y - burg.mean, burg.reflection)
    direct = burg.residuals(y)
    found["lattice_difference"] = np.abs(forward[3:] - direct).max() / direct.std()
    short = y[:300]
    orders = fit_ar_orders(short, 6, "burg")
    reflection = fit_ar(short, 6, "burg").reflection
    centred = short - short.mean()
    energy = np.array(
        [
            np.mean(whiten_lattice(centred, reflection[:k])[0][6:] ** 2) if k else 0.0
            for k in range(7)
        ]
    )
    energy[0] = np.mean(centred[6:] ** 2)
    by_rule = energy[1:] / energy[:-1] / (1.0 - reflection**2)
    found["energy_rule"] = by_rule
    found["burg_energies"] = orders.innovation_variance
    return {name: np.asarray(value, dtype=np.float64) for name, value in found.items()}


def figures_3_and_4(results: Results, size: Size) -> Found:
    """The filter and its lattice are one; what the methods find."""
    found = {m: stacked(results, m) for m in AR_METHODS}
    values: dict[str, Value] = {
        "lattice": float(stacked(results, "lattice_difference").max()),
        "coefficients": np.stack([found["burg"], found["covariance"]], axis=2),
        "yule-walker": found["yule-walker"],
    }
    return Found(values, panels=(_spectra(results),))


def _spectra(results: Results) -> Panel:
    names = ("truth", "Burg", "covariance", "Yule-Walker")
    values = [
        TRUTH,
        *(stacked(results, m).mean(axis=0) for m in ("burg", "covariance", "yule-walker")),
    ]
    roles: tuple[Role, ...] = ("theory", "ours", "z", "paper")
    frequency = np.geomspace(1e-3, 0.5, 200)
    curves = []
    for name, a, role in zip(names, values, roles, strict=True):
        process = Autoregressive(tuple(a), 1.0, 1.0)
        psd = process.psd(frequency, onesided=False)
        curves.append(Curve(name, frequency, psd, role, "dash" if name == "truth" else "line"))
    return Panel(
        "Spectrum of the fitted models",
        "cycles a sample",
        "density",
        tuple(curves),
        "Spectra of the models fitted by three methods, and of the truth.",
        log_x=True,
        log_y=True,
    )


def energies(results: Results, size: Size) -> Found:
    """Small slips in the equations."""
    deviation = np.abs(stacked(results, "energy_rule") - 1.0).max(axis=1)
    proof = Proof(
        "the energies of Burg's errors over a finite record do not follow (9f)",
        float(deviation.min()), 1e-4, 2.0, "counter-experiment",
    )  # fmt: skip
    return Found({"deviation": deviation}, proofs={"energies": proof})


def run_short(seed: int, size: Size) -> Numbers:
    """Count unstable models of many short records."""
    rng = generator(seed, PAPER, "short-records")
    records = 60 if size == "quick" else 300
    bad = dict.fromkeys(AR_METHODS, 0)
    for _ in range(records):
        noise = rng.standard_normal(560)
        y = np.asarray(lfilter([1.0], np.concatenate([[1.0], TRUTH]), noise))[500:]
        for method in bad:
            fit = fit_ar(y, 6, method)
            bad[method] += int(np.abs(fit.reflection).max() >= 1.0)
    return numbers(**{name.replace("-", "_"): count / records for name, count in bad.items()})


def stability(results: Results, size: Size) -> Found:
    """Which method may give an unstable model."""
    worst = float(stacked(results, "yule_walker").max())
    bounded = Proof(
        "the biased autocorrelation is positive definite, so |γ| < 1 (Levinson): none is unstable",
        worst, 0.0, 0.0, "bound",
    )  # fmt: skip
    return Found(plain(results, size).values, proofs={"bounded": bounded})


def run_sparse(seed: int, size: Size) -> Numbers:
    """Search for two true terms among 54 candidates, many times; and for an epsilon."""
    rng = generator(seed, PAPER, "sparse")
    runs = 10 if size == "quick" else 20
    exact: dict[Stopping, int] = {"family-wise": 0, "single": 0}
    false_terms = 0
    for _ in range(runs):
        x, e = rng.standard_normal((2, 20_000))
        drive = 0.5 * e
        drive[3:] += 0.3 * x[2:-1] * x[:-3]
        y = np.asarray(lfilter([1.0], [1.0, -0.6], drive))
        for stopping in exact:
            fit = fast_orthogonal_search(y, 4, 2, inputs=[x], input_lags=4, stopping=stopping)
            found = set(zip(fit.terms, fit.sources, strict=True))
            exact[stopping] += int(found == TERMS)
            if stopping == "single":
                false_terms += len(found - TERMS)
    noise = rng.standard_normal(20_000)
    gaussian = np.asarray(lfilter([1.0], [1.0, -1.2, 0.5], noise))
    train, unseen = gaussian[:10_000], gaussian[10_000:]
    linear = fast_orthogonal_search(train, 10, 1, held_out=unseen)
    quadratic = fast_orthogonal_search(train, 10, 2, stopping="single", held_out=unseen)
    smooth = denoise(
        ACCELEROMETER.process.simulate(36_000, 1.0 / RATE, rng), level=8, details="zero"
    ).signal
    search = fast_orthogonal_search(1e-6 * smooth + 9.8, 10, 1, 10, stopping=None)
    by_recursion = search.ranking[-1].remaining * search.deviation**2
    return numbers(
        family_wise=exact["family-wise"] / runs,
        single=exact["single"] / runs,
        false_terms=false_terms / runs,
        two_lags=set(linear.terms) == {(1,), (2,)},
        quadratic_loss=quadratic.mean_square_error / linear.mean_square_error,
        recursion=by_recursion / search.training_mean_square_error,
        explicit=search.training_mean_square_error,
    )


def cancellation(results: Results, size: Size) -> Found:
    """Errors the size of an epsilon."""
    values: dict[str, Value] = {
        "step": float(np.spacing(9.8**2)),
        "epsilons": 2e-16 / float(np.finfo(np.float64).eps),
        "recursion": stacked(results, "recursion"),
    }
    return Found(values)
