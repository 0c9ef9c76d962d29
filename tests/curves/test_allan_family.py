"""Relatives of the Allan deviation: equal to peers, right on power laws, intervals that cover."""

from __future__ import annotations

import math
import time
from typing import Any

import allantools
import numpy as np
import pytest

from schuler.curves.allan import allan_deviation
from schuler.curves.allan_family import KINDS, family_deviation
from schuler.curves.allan_family_confidence import (
    Kind,
    difference_degrees_of_freedom,
    variance_bias,
)
from schuler.errors import InputError
from schuler.noise import BiasInstability, Process, Quantization, RandomWalk, WhiteNoise

PEERS: dict[str, Any] = {
    "nonoverlapping": allantools.adev,
    "modified": allantools.mdev,
    "hadamard": allantools.ohdev,
    "total": allantools.totdev,
    "modified total": allantools.mtotdev,
    "hadamard total": allantools.htotdev,
}


@pytest.mark.parametrize("kind", KINDS)
def test_equals_allantools_to_nine_digits(kind: Kind) -> None:
    rng = np.random.default_rng(1)
    signal = (WhiteNoise(1.0) + RandomWalk(0.3)).simulate(600, 0.1, rng) + 9.81
    # windows are taken one by one up to 7 samples a cluster
    factors = [1, 2, 3, 5, 6, 7] if " " in kind else [1, 2, 3, 5, 17, 50, 120, 190]
    curve = family_deviation(signal, 10.0, np.array(factors) / 10.0, kind)
    np.testing.assert_array_equal(curve.factors, factors)
    tau, deviation, _, _ = PEERS[kind](signal, rate=10.0, data_type="freq", taus=curve.tau)
    np.testing.assert_allclose(tau, curve.tau)
    np.testing.assert_allclose(curve.deviation, deviation, rtol=1e-9)


@pytest.mark.parametrize("kind", ["modified total", "hadamard total"])
def test_sparse_windows_lose_next_to_nothing(kind: Kind) -> None:
    signal = RandomWalk(1.0).simulate(500, 1.0, np.random.default_rng(2))
    curve = family_deviation(signal, 1.0, [24.0], kind)
    every = PEERS[kind](signal, rate=1.0, data_type="freq", taus=[24.0])[1][0]
    # 500 samples of a walk know the deviation at 24 s to about 15 %
    assert curve.deviation[0] == pytest.approx(every, rel=0.01)
    assert curve.deviation[0] != every


CLOSED = [
    # kind, process, variance at tau (modified: Allan & Barnes 1981; Hadamard: SP 1065, table 3)
    ("modified", WhiteNoise(2.0), lambda t: 0.5 * 4.0 / t),
    ("modified", Quantization(2.0), lambda t: 3.0 * 4.0 / t**3),
    ("hadamard", WhiteNoise(2.0), lambda t: 4.0 / t),
    ("hadamard", RandomWalk(2.0), lambda t: 4.0 * t / 6.0),
    ("hadamard", Quantization(2.0), lambda t: 10.0 / 3.0 * 4.0 / t**2),
    ("nonoverlapping", RandomWalk(2.0), lambda t: 4.0 * t / 3.0),
    ("total", WhiteNoise(2.0), lambda t: 4.0 / t),
    ("modified total", WhiteNoise(2.0), lambda t: 0.7705 * 0.5 * 4.0 / t),
    ("hadamard total", RandomWalk(2.0), lambda t: 0.7705 * 4.0 * t / 6.0),
]


@pytest.mark.parametrize(("kind", "process", "closed"), CLOSED, ids=lambda v: str(v)[:20])
def test_expectations_are_the_closed_forms(kind: Kind, process: Process, closed: Any) -> None:
    rng = np.random.default_rng(3)
    signals = np.column_stack([process.simulate(4000, 1.0, rng) for _ in range(30)])
    curve = family_deviation(signals, 1.0, [20.0, 50.0], kind)
    mean = np.mean(curve.deviation**2, axis=1)
    spread = np.sqrt(2.0 / curve.degrees_of_freedom.mean(axis=1) / 30)
    # a continuous walk differs from its samples by a part in 1/m²; averages by 1/(2 m²)
    assert (np.abs(mean / closed(curve.tau) - 1.0) < 4.0 * spread + 2e-3).all()


def test_hadamard_does_not_see_a_ramp_and_allan_does() -> None:
    noise = np.random.default_rng(4).standard_normal(20_000)
    ramp = noise + 1e-3 * np.arange(20_000)
    taus = [1.0, 10.0, 300.0]
    clean = family_deviation(noise, 1.0, taus, "hadamard").deviation
    np.testing.assert_allclose(
        family_deviation(ramp, 1.0, taus, "hadamard").deviation, clean, rtol=1e-9
    )
    allan = allan_deviation(ramp, 1.0, taus).deviation
    # ramp r: r tau / sqrt(2)
    assert allan[2] == pytest.approx(1e-3 * 300.0 / math.sqrt(2.0), rel=0.1)


def test_modified_tells_quantisation_from_white_noise() -> None:
    rng = np.random.default_rng(5)
    taus = np.array([4.0, 32.0])
    steps = []
    for process in (Quantization(1.0), WhiteNoise(1.0)):
        deviation = family_deviation(process.simulate(100_000, 1.0, rng), 1.0, taus).deviation
        steps.append(math.log(deviation[1] / deviation[0]) / math.log(8.0))
    assert steps[0] == pytest.approx(-1.5, abs=0.03)
    # m = 4 has not reached the limit: (1 + 1/(2 m²))/2
    assert steps[1] == pytest.approx(-0.5, abs=0.04)


@pytest.mark.parametrize(
    ("law", "order", "modified", "terms", "dense_factor"),
    [
        ("white", 2, False, 60, 6),
        ("white", 2, True, 60, 5),
        ("walk", 2, False, 60, 6),
        ("walk", 3, False, 60, 20),
        ("quantization", 3, False, 90, 6),
        ("white", 3, False, 30, 40),
        ("white", 2, True, 30, 40),
        ("quantization", 2, True, 70, 24),
    ],
)
def test_degrees_of_freedom_equal_the_dense_matrix(
    law: str, order: int, modified: bool, terms: int, dense_factor: int
) -> None:
    m = dense_factor
    size = terms + order * m + (m - 1 if modified else 0)
    k = np.arange(size, dtype=np.float64)
    low, high = np.minimum.outer(k, k), np.maximum.outer(k, k)
    theta = {
        "white": low,
        "walk": low**2 * (3.0 * high - low) / 6.0,
        "quantization": np.eye(size),
    }[law]
    row = np.zeros(order * m + 1)
    row[::m] = [1.0, -2.0, 1.0] if order == 2 else [-1.0, 3.0, -3.0, 1.0]
    if modified:
        row = np.convolve(row, np.ones(m) / m)
    operator = np.array([np.pad(row, (i, size - row.size - i)) for i in range(terms)])
    covariance = operator @ theta @ operator.T
    exact = np.trace(covariance) ** 2 / np.sum(covariance**2)
    found = difference_degrees_of_freedom(law, order, modified, 1, m, terms)
    assert found == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "process",
    [
        WhiteNoise(1.0),
        BiasInstability(1.0, 1.0, 1e5),
        RandomWalk(1.0),
        Quantization(1.0),
    ],
    ids=lambda p: p.kind,
)
def test_intervals_cover_the_deviation_without_total(kind: Kind, process: Process) -> None:
    runs, n = 200, 1500
    rng = np.random.default_rng(6)
    signals = np.column_stack([process.simulate(n, 1.0, rng) for _ in range(runs)])
    taus = [5.0, 24.0, 96.0]
    plain: Kind = "nonoverlapping"
    if "modified" in kind:
        plain = "modified"
    elif "hadamard" in kind:
        plain = "hadamard"
    expected = np.mean(family_deviation(signals, 1.0, taus, plain).deviation ** 2, axis=1)
    curve = family_deviation(signals, 1.0, taus, kind)
    truth = np.sqrt(expected)[:, None]
    covered = np.mean((curve.lower <= truth) & (truth <= curve.upper), axis=1)
    # 95 % less 4 sd of 200 runs and of the truth, which is simulated too
    assert (covered > 0.86).all()


def test_total_is_steadier_than_overlapping_at_long_tau() -> None:
    rng = np.random.default_rng(7)
    signals = rng.standard_normal((600, 300))
    total = family_deviation(signals, 1.0, [250.0], "total").deviation
    plain = allan_deviation(signals, 1.0, [250.0]).deviation
    assert np.std(total**2) < 0.75 * np.std(plain**2)
    assert np.mean(total**2) == pytest.approx(1.0 / 250.0, rel=0.15)


def test_bias_of_total_vanishes_for_white_noise_and_grows_for_a_walk() -> None:
    factors = np.array([10, 250])
    slopes = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    bias = variance_bias("total", slopes, factors, 1000)
    np.testing.assert_allclose(bias, [[1.0, 0.9925], [1.0, 0.8125]])
    np.testing.assert_array_equal(variance_bias("hadamard", slopes, factors, 1000), 1.0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_million_samples_are_no_matter(kind: Kind) -> None:
    signal = np.random.default_rng(8).standard_normal(1_000_000)
    family_deviation(signal[:500], 100.0, kind=kind)
    start = time.process_time()
    curve = family_deviation(signal, 100.0, [0.01, 1.0, 100.0, 1000.0], kind)
    assert time.process_time() - start < 3.0
    white = {"modified": 0.5, "modified total": 0.5 * 0.7705}.get(kind, 1.0)
    np.testing.assert_allclose(curve.deviation[1] ** 2 * 100.0, white, rtol=0.08)


def test_one_door_leads_to_every_kind() -> None:
    signal = np.random.default_rng(10).standard_normal(200)
    for kind in KINDS:
        curve = allan_deviation(signal, 4.0, kind=kind)
        assert curve.kind == kind
        np.testing.assert_array_equal(curve.upper, family_deviation(signal, 4.0, kind=kind).upper)


def test_scale_does_not_matter() -> None:
    signal = np.random.default_rng(9).standard_normal(400)
    for kind in KINDS:
        unit = family_deviation(signal, 1.0, [3.0, 40.0], kind)
        for scale in (1e-12, 1e12):
            scaled = family_deviation(scale * signal, 1.0, [3.0, 40.0], kind)
            np.testing.assert_allclose(scaled.deviation, scale * unit.deviation, rtol=1e-9)
            np.testing.assert_allclose(scaled.upper, scale * unit.upper, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_constant_signal_has_no_deviation(kind: Kind) -> None:
    curve = family_deviation(np.full(100, 9.81), 10.0, kind=kind)
    np.testing.assert_array_equal(curve.deviation, 0.0)
    assert np.isfinite(curve.degrees_of_freedom).all()


@pytest.mark.parametrize(
    ("signal", "rate", "taus", "kind", "words"),
    [
        (np.arange(3.0), 1.0, None, "modified", "3 samples"),
        (np.array([1.0, np.nan, 2.0, 3.0, 4.0]), 1.0, None, "total", "not finite.*row 1"),
        (np.array([1.0, np.inf, 2.0, 3.0, 4.0]), 1.0, None, "hadamard", "not finite"),
        (np.arange(9.0), -1.0, None, "total", "rate"),
        (np.arange(9.0), 1.0, [-1.0], "total", "above zero"),
        (np.arange(9.0), 1.0, [4.0], "hadamard", "no cluster time"),
        (np.arange(9.0), 1.0, None, "theo", "theo"),
        (np.zeros((2, 2, 9)), 1.0, None, "total", "shape"),
        (np.append(np.zeros(9), -1e200), 1.0, None, "total", "1e120"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    signal: Any, rate: float, taus: Any, kind: Any, words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        family_deviation(signal, rate, taus, kind)
    assert "\n" not in str(caught.value)
