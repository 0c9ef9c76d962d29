"""The streaming low-pass: never looks ahead, equals the off-line one, delay as stated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from schuler.denoising import CausalDenoiser, denoise
from schuler.denoising.causal import approximation_filter
from schuler.errors import InputError


def in_pieces(filtered: CausalDenoiser, signal: np.ndarray, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    out, k = [], 0
    while k < signal.size:
        m = int(rng.integers(0, 70))
        out.append(filtered.push(signal[k : k + m]))
        k += m
    return np.concatenate(out)


@pytest.mark.parametrize(
    ("wavelet", "level", "taps"), [("db4", 3, 8), ("db4", 6, 8), ("haar", 4, 2), ("coif1", 2, 6)]
)
def test_exact_form_is_the_off_line_filter_shifted(wavelet: str, level: int, taps: int) -> None:
    signal = np.random.default_rng(1).standard_normal(4000).cumsum() + 100.0
    off_line = denoise(signal, wavelet=wavelet, level=level, details="zero").signal
    causal = CausalDenoiser(wavelet, level)
    delay = (taps - 1) * (2**level - 1)
    assert causal.delay == delay
    found = in_pieces(causal, signal, 2)
    assert found.shape == signal.shape
    # the ends of the record are extended differently, as far as the filter reaches
    np.testing.assert_allclose(found[2 * delay :], off_line[delay:-delay], atol=1e-9)


@pytest.mark.parametrize("form", ["exact", "fast"])
def test_pieces_do_not_matter_and_the_future_does_not_either(form: Any) -> None:
    rng = np.random.default_rng(3)
    signal = rng.standard_normal(1500)
    whole = CausalDenoiser("db4", 4, form=form).push(signal)
    np.testing.assert_allclose(
        in_pieces(CausalDenoiser("db4", 4, form=form), signal, 4), whole, atol=1e-12
    )
    one_by_one = CausalDenoiser("db4", 4, form=form)
    single = np.array([one_by_one.push(x)[0] for x in signal[:400]])
    np.testing.assert_allclose(single, whole[:400], atol=1e-12)
    other = signal.copy()
    other[700:] = 1e6
    changed = CausalDenoiser("db4", 4, form=form).push(other)
    np.testing.assert_array_equal(changed[:700], whole[:700])
    assert np.abs(changed[700:] - whole[700:]).max() > 1.0


@pytest.mark.parametrize("form", ["exact", "fast"])
def test_constants_pass_from_the_first_sample(form: Any) -> None:
    np.testing.assert_allclose(
        CausalDenoiser("db4", 7, form=form).push(np.full(3000, 9.81)), 9.81, rtol=1e-12
    )


@pytest.mark.parametrize("form", ["exact", "fast"])
def test_a_slow_motion_is_late_by_the_stated_delay(form: Any) -> None:
    causal = CausalDenoiser("db4", 5, form=form, rate=100.0)
    t = np.arange(20_000.0)
    ramp = 3.0 + 0.01 * t
    out = causal.push(ramp)
    late = (ramp - out)[5000:] / 0.01
    np.testing.assert_allclose(late, causal.delay, atol=1e-6)
    assert causal.delay_seconds == pytest.approx(causal.delay / 100.0)


def test_fast_form_answers_much_sooner_than_the_exact_one() -> None:
    fast = CausalDenoiser("db4", 7, form="fast", rate=100.0)
    exact = CausalDenoiser("db4", 7, rate=100.0)
    # (taps - 1)(2^L - 1) at 100 Hz against the centre of the soonest db4 low-pass
    assert exact.delay_seconds == pytest.approx(8.89)
    assert fast.delay_seconds < 1.4
    noise = np.random.default_rng(5).standard_normal(100_000)
    # a low-pass to 1/256 cycles a sample keeps about 1/128 of the power
    for causal in (fast, exact):
        assert np.var(causal.push(noise)[2000:]) == pytest.approx(1.0 / 128.0, rel=0.15)


def test_the_filter_is_the_cascade_of_the_transform() -> None:
    import pywt

    signal = np.random.default_rng(6).standard_normal(600)
    coefficients = pywt.wavedec(signal, "db4", mode="symmetric", level=3)[0]
    low = approximation_filter("db4", 3)
    assert low.size == 7 * 7 + 1
    assert np.sum(low**2) == pytest.approx(1.0, abs=1e-10)
    k = 20
    newest = 8 * (k + 1) - 1
    direct = low @ signal[newest - low.size + 1 : newest + 1][::-1]
    assert direct == pytest.approx(coefficients[k], abs=1e-10)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"level": 0}, "level"),
        ({"level": 40}, "level"),
        ({"level": 2.5}, "whole number"),
        ({"wavelet": "db99"}, "db99"),
        ({"wavelet": "bior2.2"}, "orthogonal"),
        ({"form": "quick"}, "quick"),
        ({"rate": 0.0}, "rate"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        CausalDenoiser(**arguments)


def test_bad_samples_are_refused_and_leave_the_state() -> None:
    causal = CausalDenoiser("db4", 2)
    first = causal.push([1.0, 2.0])
    for bad in ([np.nan], [np.inf], [[1.0, 2.0]]):
        with pytest.raises(InputError, match="finite"):
            causal.push(bad)
    assert causal.push([]).size == 0
    np.testing.assert_allclose(
        np.concatenate([first, causal.push([3.0])]),
        CausalDenoiser("db4", 2).push([1.0, 2.0, 3.0]),
        atol=1e-14,
    )
    with pytest.raises(InputError, match="without a rate"):
        _ = causal.delay_seconds
