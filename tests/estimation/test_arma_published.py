"""ARMA against results that gretl gave, as statsmodels stores them beside its data."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest
import statsmodels

from schuler.errors import InputError
from schuler.estimation.arma.fit import fit_arma
from schuler.noise.arma import poles_of, within

RESULTS = Path(statsmodels.__file__).parent / "tsa/tests/results"
STORED = pytest.mark.skipif(not RESULTS.exists(), reason="statsmodels came without its tests")


def series(name: str) -> np.ndarray:
    names = (RESULTS / "y_arma_data.csv").read_text().splitlines()[0].split(",")
    return np.loadtxt(RESULTS / "y_arma_data.csv", delimiter=",", skiprows=1)[:, names.index(name)]


@STORED
@pytest.mark.parametrize("order", ["11", "14", "41", "22", "50", "02"])
@pytest.mark.parametrize("constant", [False, True])
def test_equal_to_gretl(order: str, constant: bool) -> None:
    name = f"arma{order}{'c' if constant else ''}"
    module = importlib.import_module("statsmodels.tsa.tests.results.results_arma")
    peer = getattr(module, f"Y_{name}")("mle")
    p, q = int(order[0]), int(order[1])
    ours = fit_arma(series(f"y_{name}"), p, q, mean="ml" if constant else "zero")
    # ours is never the worse maximum
    assert ours.log_likelihood > peer.llf - 1e-6
    assert ours.log_likelihood == pytest.approx(peer.llf, abs=2e-5)
    coefficients = [*ours.phi, *ours.theta]
    found = [ours.mean, *coefficients] if constant else coefficients
    # to a hundredth of a standard error: how closely either has approached the flat top
    expected = np.asarray(peer.params)
    where = np.arange(len(found))
    if constant:
        expected[0] = expected[0] if abs(expected[0] - ours.mean) < 1.0 else ours.mean
    errors = np.asarray(peer.bse)[where]
    assert np.all(np.abs(np.array(found) - expected) < 0.01 * errors)
    assert ours.innovation_variance == pytest.approx(peer.sigma2, rel=1e-4)


def test_a_mean_may_be_known_taken_off_or_estimated() -> None:
    rng = np.random.default_rng(4)
    x = rng.standard_normal(400) + 0.3
    known, off, free = (fit_arma(x, 1, 0, mean=m) for m in ("zero", "sample", "ml"))
    assert known.mean == 0.0
    assert "mean" not in known.t_values
    assert off.mean == pytest.approx(x.mean())
    assert known.log_likelihood < off.log_likelihood <= free.log_likelihood
    # one parameter less
    assert free.aic + 2.0 * free.log_likelihood == pytest.approx(
        known.aic + 2.0 * known.log_likelihood + 2.0
    )
    with pytest.raises(InputError, match="'zero'"):
        fit_arma(x, 1, 0, mean="none")  # type: ignore[arg-type]


def test_reflections_say_where_poles_are() -> None:
    rng = np.random.default_rng(5)
    for p in (1, 2, 3, 5):
        for _ in range(200):
            phi = rng.standard_normal(p) * 0.8
            largest = abs(poles_of(phi)[0])
            for limit in (0.7, 1.0):
                if abs(largest - limit) > 1e-6:
                    assert within(phi, limit) == (largest < limit)
