"""Series of textbooks: what Brockwell and Davis (2016), R's itsmr and stats print for them."""

from __future__ import annotations

import numpy as np
import pytest
from statsmodels.datasets import sunspots
from statsmodels.tsa.arima.datasets.brockwell_davis_2002 import dowj, lake, oshorts

from schuler.estimation.arma.fit import fit_arma
from schuler.estimation.autoregressive.fit import Method, fit_ar

DOW_JONES = np.diff(dowj.to_numpy())
LAKE, OVERSHORTS, RAMP = lake.to_numpy(), oshorts.to_numpy(), np.arange(1.0, 12.0)
# R itsmr::burg and itsmr::yw of the lake
BURG = (1.05853631096, -0.32639150878, 0.04784765122, 0.02620476111, 0.04444511374,
        -0.04134010262, 0.02251178970, -0.01427524694, 0.22223486915, -0.20935524387)  # fmt: skip
YULE_WALKER = (1.08213598501, -0.39658257147, 0.11793957728, -0.03326633983, 0.06209208707)


@pytest.mark.parametrize(
    ("signal", "method", "coefficients", "variance", "digits"),
    [
        (DOW_JONES, "yule-walker", (0.4219,), 0.1479, 1e-4),  # example 5.1.1
        (DOW_JONES, "burg", (0.4371,), 0.1423, 1e-4),  # 5.1.3
        (LAKE, "burg", (1.0449, -0.2456), 0.4706, 1e-4),  # 5.1.4
        (LAKE, "yule-walker", (1.0538, -0.2668), 0.4920, 1e-4),
        (LAKE, "burg", BURG, None, 1e-10),
        (LAKE, "yule-walker", YULE_WALKER, None, 1e-10),
        (RAMP, "burg", (1.9669331547, -0.9892846679), 0.02143066427, 1e-9),  # R ar.burg
    ],
)
def test_autoregressive_models_as_printed(
    signal: np.ndarray,
    method: Method,
    coefficients: tuple[float, ...],
    variance: float | None,
    digits: float,
) -> None:
    found = fit_ar(signal, len(coefficients), method, remove_mean=signal is not RAMP)
    np.testing.assert_allclose(-found.coefficients, coefficients, atol=digits)
    if variance is not None:
        assert found.innovation_variance == pytest.approx(variance, abs=digits)


@pytest.mark.parametrize(
    ("signal", "order", "printed"),
    [
        (DOW_JONES, (1, 0), {"phi": 0.4471}),  # example 5.2.4
        (LAKE, (1, 1), {"phi": 0.7446, "theta": 0.3213, "innovation_variance": 0.4750}),  # 5.2.5
        (OVERSHORTS, (0, 1), {"theta": -0.818}),  # 5.4.1
    ],
)
def test_arma_models_as_printed(
    signal: np.ndarray, order: tuple[int, int], printed: dict[str, float]
) -> None:
    found = fit_arma(signal, *order, mean="sample")
    for name, value in printed.items():
        slack = 1e-4 if abs(value) < 0.8 else 1e-3
        assert float(np.squeeze(getattr(found, name))) == pytest.approx(value, abs=slack)


def test_the_sunspots_are_climbed_to_the_top() -> None:
    numbers = sunspots.load_pandas().data["SUNACTIVITY"].to_numpy()
    # statsmodels ends at -1304.06
    assert fit_arma(numbers, 3, 2).log_likelihood == pytest.approx(-1283.786, abs=1e-3)
