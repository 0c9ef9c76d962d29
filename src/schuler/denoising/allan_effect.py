"""What de-noising does to the Allan curve: figure 17 of S004."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.curves.allan import allan_deviation
from schuler.curves.allan_curve import AllanCurve
from schuler.data.to_dict import ToDict
from schuler.denoising.wavelet import Denoised
from schuler.errors import InputError
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class AllanEffect(ToDict):
    """Allan curves before and after, on the same cluster times."""

    JSON = (
        "tau_s=raw.tau raw=raw.deviation denoised=denoised.deviation ratio "
        "attenuated_below_s=attenuated_below equal_above_s=equal_above findings"
    )

    # raw, denoised: of the record and of what is left of it
    raw: AllanCurve
    denoised: AllanCurve
    # 2**level sample intervals in s: for shorter clusters the deviation falls
    attenuated_below: float
    # 5 * 2**level sample intervals in s: for longer ones it stays as it was to 3 %, N included (at
    # 4 * 2**level white noise is still 3.6 % down)
    equal_above: float

    @property
    def ratio(self) -> FloatArray:
        """Deviation after over deviation before; NaN where there was none before."""
        out = np.full(self.raw.deviation.shape, np.nan)
        before = self.raw.deviation
        np.divide(self.denoised.deviation, before, out=out, where=before > 0.0)
        return out

    def findings(self) -> tuple[str, ...]:
        """Return what this means, in plain sentences."""
        short = self.raw.tau < self.attenuated_below
        long = self.raw.tau > self.equal_above
        ratio = self.ratio
        found = []
        if short.any() and np.isfinite(ratio[short]).all():
            found.append(
                f"below {self.attenuated_below:g} s the Allan deviation falls, to "
                f"{100.0 * float(ratio[short].min()):.0f} % at the least"
            )
        if long.any() and np.isfinite(ratio[long]).all():
            change = 100.0 * float(np.abs(ratio[long] - 1.0).max())
            found.append(
                f"above {self.equal_above:g} s it changes by {change:.1f} % at most: white noise "
                "and bias instability are as before, keep N in the filter"
            )
        return tuple(found)


def allan_effect(
    signal: ArrayLike, rate: float, denoised: Denoised, taus: ArrayLike | None = None
) -> AllanEffect:
    """Return the Allan curves of a record before and after de-noising."""
    values = np.asarray(signal)
    if values.shape != denoised.signal.shape:
        raise InputError(
            f"record of {values.shape} and de-noised one of {denoised.signal.shape}",
            expected="the same length",
        )
    step = 2.0**denoised.level / rate
    return AllanEffect(
        raw=allan_deviation(values, rate, taus),
        denoised=allan_deviation(denoised.signal, rate, taus),
        attenuated_below=step,
        equal_above=5.0 * step,
    )
