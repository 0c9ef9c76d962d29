"""De-noising of a whole record by the discrete wavelet transform. Not causal.

Every output sample depends on samples (taps - 1)(2**level - 1) later: the result is for looking
at, for fitting and for off-line filters, and not for a filter that claims to run in real time
(see `schuler.denoising.causal`).

A low-pass with unit gain at zero frequency leaves the white-noise density N as it is, and N is
what integrates into position: keep N in the filter after de-noising (spec 2.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.curves.finite_signal import checked_rate, finite_samples
from schuler.data.exportable import Exportable
from schuler.denoising.thresholds import noise_scale, stein_threshold, universal_threshold
from schuler.errors import InputError
from schuler.types import FloatArray

Threshold = Literal["sure", "universal", "none"]
Mode = Literal["soft", "hard"]
Scale = Literal["mln", "sln", "one"]

_USUAL_LEVEL = 6
_MOTION = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Denoised(Exportable):
    """A de-noised record and how it was made.

    Parameters
    ----------
    signal : (n,) ndarray
        De-noised, as long as the input.
    level : int
        Levels of decomposition (LOD).
    thresholds : (level,) ndarray
        In the unit of the signal, finest level first; infinite where all details were removed.
    noise_scales : (level,) ndarray
        Standard deviation of the noise that the thresholds assume, finest first.
    kept : (level,) ndarray
        Share of the detail coefficients that is not zero afterwards, finest first.
    approximation_band : (float, float)
        What the approximation holds: 0 to rate/2**(level + 1), in Hz, or in cycles a sample
        where no rate was given.
    wavelet, mode, threshold, scale, details : str
        As asked for.
    reach : int
        Samples of the future that an output sample may depend on, away from the ends.
    rate : float or None
        Samples a second.
    flags : tuple of str
        "constant"; "unit noise" where scale "one" removes every detail because the data are not
        of unit noise; "coarse steps" where more than half of the finest details are exactly zero,
        so that their median says nothing; "motion in details" where scale "mln" takes a level
        for three times as noisy as the finest: more likely it holds motion, which the threshold
        then removes (use fewer levels, or scale "sln").

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import denoise
    >>> denoise(np.random.default_rng(1).standard_normal(4_096), level=4).level
    4
    """

    JSON = (
        "level thresholds noise_scales kept approximation_band wavelet mode threshold scale "
        "details causal reach_samples=reach rate_hz=rate flags"
    )

    signal: FloatArray
    level: int
    thresholds: FloatArray
    noise_scales: FloatArray
    kept: FloatArray
    approximation_band: tuple[float, float]
    wavelet: str
    mode: str
    threshold: str
    scale: str
    details: str
    reach: int
    rate: float | None
    flags: tuple[str, ...]

    @property
    def causal(self) -> bool:
        """False: the transform looks ahead by `reach` samples."""
        return False


def level_for_band(band: float, rate: float) -> int:
    """Most levels of decomposition whose approximation still holds everything up to a frequency.

    Parameters
    ----------
    band : float
        Frequency, Hz.
    rate : float
        Samples a second, Hz.

    Returns
    -------
    int
        Level L with rate / 2^(L+1) not below `band`.

    Raises
    ------
    InputError
        A band that is not between zero and half the rate.

    Notes
    -----
    Erratum E-003-8 of S003: 12.5 Hz at 200 Hz are three levels, not four.

    Examples
    --------
    >>> import schuler
    >>> schuler.level_for_band(12.5, 200.0)
    3
    """
    rate = checked_rate(rate)
    if not (np.isfinite(band) and 0.0 < band <= 0.25 * rate):
        raise InputError(f"band is {band:g} Hz", expected=f"above 0, at most {0.25 * rate:g} Hz")
    return math.floor(math.log2(rate / band) - 1.0 + 1e-9)


def denoise(
    signal: ArrayLike,
    *,
    wavelet: str = "db4",
    level: int | None = None,
    band: float | None = None,
    rate: float | None = None,
    threshold: Threshold = "sure",
    mode: Mode = "soft",
    scale: Scale = "mln",
    details: Literal["threshold", "zero"] = "threshold",
) -> Denoised:
    """De-noise a record by thresholding its wavelet coefficients.

    Parameters
    ----------
    signal : (n,) array_like
        Samples in any unit.
    wavelet : str
        Any discrete wavelet of PyWavelets; "db4" has 8 taps, as in S003 and S004.
    level : int, optional
        Levels of decomposition; default from `band`, else 6 or as many as the record bears.
    band : float, optional
        Highest frequency in Hz that is to stay in the approximation; needs `rate`.
    rate : float, optional
        Samples a second.
    threshold : {"sure", "universal", "none"}
        Stein's unbiased risk estimate level by level, sqrt(2 ln n), or zero.
    mode : {"soft", "hard"}
        What stays is shrunk by the threshold, or not.
    scale : {"mln", "sln", "one"}
        Noise scale level by level, from the finest level, or one: "one" says that the data have
        unit noise already. Data in rad/s or m/s² have not, and lose all details under it, which
        is what S004's table 2 shows (spec 2.5, E-004-8).
    details : {"threshold", "zero"}
        "zero" removes all details whatever the threshold: the linear low-pass.

    Returns
    -------
    Denoised
        The signal and the thresholds. Not causal.

    Raises
    ------
    InputError
        Not (n,) or not finite, an unknown wavelet or option, a level beyond what the record
        bears, a band without a rate.

    Notes
    -----
    Half-point symmetric extension. Spec 2.5; S003 section 5, S004 sections 4.5 and 5.6. The
    white-noise density N of the signal is not changed by it: keep N in the filter.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import denoise
    >>> time = np.arange(4_096) / 100.0
    >>> noisy = np.sin(time) + 0.3 * np.random.default_rng(1).standard_normal(time.size)
    >>> bool(np.std(denoise(noisy).signal - np.sin(time)) < 0.1)
    True
    """
    import pywt

    values = finite_samples(signal, shortest=2)
    rate = None if rate is None else checked_rate(rate)
    _check_options(threshold, mode, scale, details)
    try:
        basis = pywt.Wavelet(wavelet)
    except (ValueError, TypeError):
        raise InputError(
            f"wavelet '{wavelet}'", expected="a discrete wavelet of PyWavelets, such as 'db4'"
        ) from None
    levels = _levels(level, band, rate, pywt.dwt_max_level(values.size, basis.dec_len))
    # a constant changes no detail; without it no digits are lost
    offset = float(values[0])
    coefficients = pywt.wavedec(values - offset, basis, mode="symmetric", level=levels)
    finest_first = coefficients[:0:-1]
    scales = _scales(finest_first, scale)
    judged = details != "zero" and threshold != "none"
    flags = _warnings(finest_first, scales if scale == "mln" and judged else scales[:1])
    limits = np.zeros(levels)
    kept = np.zeros(levels)
    for k, d in enumerate(finest_first):
        limits[k] = math.inf if details == "zero" else _limit(d, scales[k], threshold, values.size)
        if d.any() and limits[k] > 0.0:
            d[:] = _shrunk(d, limits[k], mode)
        kept[k] = np.count_nonzero(d) / d.size
    if scale == "one" and judged and not kept.any() and not flags:
        flags = ("unit noise",)
    restored = pywt.waverec(coefficients, basis, mode="symmetric")[: values.size] + offset
    highest = (1.0 if rate is None else rate) / 2.0 ** (levels + 1)
    return Denoised(
        signal=np.asarray(restored, dtype=np.float64),
        level=levels,
        thresholds=limits,
        noise_scales=scales,
        kept=kept,
        approximation_band=(0.0, highest),
        wavelet=wavelet,
        mode=mode,
        threshold=threshold,
        scale=scale,
        details=details,
        reach=int((basis.dec_len - 1) * (2**levels - 1)),
        rate=rate,
        flags=flags,
    )


def _check_options(threshold: str, mode: str, scale: str, details: str) -> None:
    allowed = (
        ("threshold", threshold, ("sure", "universal", "none")),
        ("mode", mode, ("soft", "hard")),
        ("scale", scale, ("mln", "sln", "one")),
        ("details", details, ("threshold", "zero")),
    )
    for name, given, choices in allowed:
        if given not in choices:
            raise InputError(f"{name} '{given}'", expected=", ".join(choices))


def _levels(level: int | None, band: float | None, rate: float | None, most: int) -> int:
    if level is not None and band is not None:
        raise InputError("both level and band are given", expected="one of them")
    if band is not None:
        if rate is None:
            raise InputError("a band in Hz without a rate", expected="rate=...")
        wanted = level_for_band(band, rate)
    elif level is not None:
        wanted = int(level)
    else:
        wanted = min(_USUAL_LEVEL, most)
    if wanted != level and level is not None:
        raise InputError(f"level {level}", expected="a whole number")
    if not 1 <= wanted <= most:
        raise InputError(
            f"{wanted} levels of decomposition",
            expected=f"from 1 to {most} for this length and wavelet" if most else "a longer signal",
        )
    return wanted


def _scales(finest_first: list[FloatArray], scale: Scale) -> FloatArray:
    if scale == "one":
        return np.ones(len(finest_first))
    if scale == "sln":
        return np.full(len(finest_first), _robust_scale(finest_first[0]))
    return np.array([_robust_scale(d) for d in finest_first])


def _warnings(finest_first: list[FloatArray], scales: FloatArray) -> tuple[str, ...]:
    if not any(d.any() for d in finest_first):
        return ("constant",)
    flags = []
    if 2 * np.count_nonzero(finest_first[0] == 0.0) > finest_first[0].size:
        flags.append("coarse steps")
    if (scales > _MOTION * scales[0]).any():
        flags.append("motion in details")
    return tuple(flags)


def _robust_scale(details: FloatArray) -> float:
    """Median scale; where more than half are zero (coarse steps) the plain standard deviation."""
    found = noise_scale(details)
    return found if found > 0.0 else float(np.sqrt(np.mean(details**2)))


def _limit(details: FloatArray, sd: float, threshold: Threshold, samples: int) -> float:
    if threshold == "none" or sd == 0.0:
        return 0.0
    if threshold == "universal":
        return sd * universal_threshold(samples)
    return sd * stein_threshold(details / sd)


def _shrunk(details: FloatArray, limit: float, mode: Mode) -> FloatArray:
    if mode == "hard":
        return np.where(np.abs(details) > limit, details, 0.0)
    if math.isinf(limit):
        return np.zeros_like(details)
    return np.sign(details) * np.maximum(np.abs(details) - limit, 0.0)
