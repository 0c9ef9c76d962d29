"""The linear wavelet low-pass in real time, sample by sample, with its delay stated."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.types import FloatArray


class CausalDenoiser:
    """Wavelet low-pass (all details removed) that never looks ahead.

    Parameters
    ----------
    wavelet : str
        An orthogonal wavelet of PyWavelets.
    level : int
        Levels of decomposition.
    form : {"exact", "fast"}
        "exact" gives what `denoise(..., details="zero")` gives, `delay` = (taps - 1)(2**level - 1)
        samples later (db4, 7 levels, 100 Hz: 8.9 s): the transform and its inverse each take half
        of it. "fast" is the approximation filter alone, applied to every sample in the order
        that answers soonest: the same band, unit gain at zero frequency, no more than the delay
        of `delay` samples (db4, 7 levels: 1.3 s), but not the same output.
    rate : float, optional
        Samples a second, for `delay_seconds`.

    Raises
    ------
    InputError
        An unknown or not orthogonal wavelet, a level below one or above 16, an unknown form.

    Notes
    -----
    Before the first sample the signal is taken to have been constant, so that there is no step
    at the start. Spec 2.5 gives (taps - 1)(2**level - 1)/2, the centre of the approximation
    filter: what it takes to compute a coefficient, not yet to rebuild the signal from it.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import CausalDenoiser
    >>> CausalDenoiser(level=3).delay
    49.0
    """

    def __init__(
        self,
        wavelet: str = "db4",
        level: int = 6,
        *,
        form: Literal["exact", "fast"] = "exact",
        rate: float | None = None,
    ) -> None:
        if form not in ("exact", "fast"):
            raise InputError(f"form '{form}'", expected="'exact' or 'fast'")
        if int(level) != level or not 1 <= level <= 16:
            raise InputError(f"level {level}", expected="a whole number from 1 to 16")
        if rate is not None and not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"rate is {rate:g} Hz", expected="a finite number above zero")
        self.wavelet = wavelet
        self.level = int(level)
        self.form = form
        self.rate = rate
        self._low = approximation_filter(wavelet, self.level)
        self._answer = _soonest(self._low)
        self._past = np.zeros(0)
        self._coefficients = np.zeros(0)
        self._pushed = 0

    @property
    def reach(self) -> int:
        """Samples that one output depends on before and, off-line, after it."""
        return self._low.size - 1

    @property
    def delay(self) -> float:
        """Samples by which the output is late: at all frequencies if exact, at zero if fast."""
        if self.form == "exact":
            return float(self.reach)
        return float(np.arange(self._answer.size) @ self._answer)

    @property
    def delay_seconds(self) -> float:
        """The same in s.

        Raises
        ------
        InputError
            No rate was given.
        """
        if self.rate is None:
            raise InputError("delay in seconds without a rate", expected="rate=...")
        return self.delay / self.rate

    def push(self, samples: ArrayLike) -> FloatArray:
        """Take new samples and return as many outputs.

        Parameters
        ----------
        samples : (k,) array_like
            In order; one sample may be given as a number.

        Returns
        -------
        (k,) ndarray
            Output at the time of each sample, which belongs to the signal `delay` samples before.
            Until `delay` samples are in, what precedes the first one counts as constant.

        Raises
        ------
        InputError
            Not finite or not (k,).
        """
        new = np.atleast_1d(np.asarray(samples, dtype=np.float64))
        if new.ndim != 1 or not np.isfinite(new).all():
            raise InputError("samples are not finite numbers (k,)", expected="finite numbers")
        if new.size == 0:
            return np.zeros(0)
        if self._pushed == 0:
            self._past = np.full(self.reach, new[0])
        whole = np.concatenate([self._past, new])
        self._past = whole[whole.size - self.reach :]
        if self.form == "fast":
            self._pushed += new.size
            return np.convolve(whole, self._answer, mode="valid")
        return self._rebuilt(whole, new.size)

    def _rebuilt(self, whole: FloatArray, count: int) -> FloatArray:
        """Coefficients as they become known, and the signal out of them `reach` samples later."""
        step, reach = 2**self.level, self.reach
        first = self._pushed  # row of the first new sample
        if first == 0:
            # all the coefficients of the constant before, by their gain at zero frequency
            steady = whole[0] * float(self._low.sum())
            self._coefficients = np.full(2 * reach // step + 2, steady)
        # coefficient k is known with row step * (k + 1) - 1, from the reach + 1 rows up to it
        ends = np.arange((first // step) * step + step - 1, first + count, step)
        ends = ends[ends >= first]
        rows = (ends - first)[:, None] + np.arange(reach + 1)[None, ::-1]
        known = whole[rows] @ self._low if ends.size else np.zeros(0)
        line = np.concatenate([self._coefficients, known])
        newest = (first + count) // step - 1  # index of the last coefficient in line
        out = np.zeros(count)
        wanted = np.arange(first, first + count) - reach  # rows of the output
        # those whose support holds the row: row <= end <= row + reach
        low = -((-(wanted + 1)) // step) - 1
        for offset in range(reach // step + 1):
            index = low + offset
            tap = step * (index + 1) - 1 - wanted
            use = tap <= reach
            out[use] += line[index[use] - newest - 1 + line.size] * self._low[tap[use]]
        self._coefficients = line[line.size - (2 * reach // step + 2) :]
        self._pushed += count
        return out


def approximation_filter(wavelet: str, level: int) -> FloatArray:
    """Filter from a signal to its approximation coefficients at a level."""
    import pywt

    try:
        basis = pywt.Wavelet(wavelet)
    except (ValueError, TypeError):
        raise InputError(f"wavelet '{wavelet}'", expected="such as 'db4'") from None
    if not basis.orthogonal:
        raise InputError(f"wavelet '{wavelet}'", expected="an orthogonal one, such as 'db4'")
    low = np.asarray(basis.dec_lo, dtype=np.float64)
    out = np.ones(1)
    for k in range(level):
        spread = np.zeros((low.size - 1) * 2**k + 1)
        spread[:: 2**k] = low
        out = np.convolve(out, spread)
    return out


def _soonest(low: FloatArray) -> FloatArray:
    """The filter, or its mirror image, whichever is earlier; unit gain at zero frequency."""
    centre = float(np.arange(low.size) @ low) / float(low.sum())
    ordered = low if centre <= 0.5 * (low.size - 1) else low[::-1]
    return np.asarray(ordered / ordered.sum())
