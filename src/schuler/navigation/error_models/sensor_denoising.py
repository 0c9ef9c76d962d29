"""Wavelet de-noising of the measurements before the filter: the WD of 18AVWD, and what it costs.

A low-pass of unit gain leaves the white-noise density as it is: the filter keeps the N of the raw
data (spec 2.5). What it takes away is motion above its band, and, in real time, promptness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from schuler.data import CHANNELS, ImuRecording
from schuler.data.exportable import Exportable
from schuler.errors import InputError

Form = Literal["off-line", "causal"]
PAPERS_RATE = 100.0
"""Hz, of the sensor in S004."""


@dataclass(frozen=True, slots=True, eq=False)
class SensorDenoising(Exportable):
    """Levels of decomposition for every channel.

    Parameters
    ----------
    levels : mapping of str to int
        By channel; channels that are not named stay as they are.
    wavelet : str
        As for `denoise`.
    form : {"off-line", "causal"}
        The transform over the whole record, which looks ahead; or the approximation filter
        alone, which does not, and whose answer for a moment comes `latency` later.

    Examples
    --------
    >>> from schuler import SensorDenoising
    >>> SensorDenoising({"gyro_z": 4}).form
    'off-line'
    """

    JSON = "levels wavelet form reach_samples=reach"

    levels: Mapping[str, int]
    wavelet: str = "db4"
    form: Form = "off-line"

    def __post_init__(self) -> None:
        wrong = [c for c in self.levels if c not in CHANNELS]
        if wrong or self.form not in ("off-line", "causal"):
            raise InputError(
                f"de-noising of {', '.join(self.levels)}, {self.form}",
                expected=f"channels out of {', '.join(CHANNELS)}; off-line or causal",
            )
        object.__setattr__(self, "levels", dict(self.levels))

    @classmethod
    def table_7(cls, form: Form = "off-line", rate: float = PAPERS_RATE) -> SensorDenoising:
        """Seven levels, six for the accelerometers y and z: S004 table 7.

        At another rate than the paper's as many as leave the same band.
        """
        more = round(math.log2(rate / PAPERS_RATE))
        usual = {c: 6 if c in ("accel_y", "accel_z") else 7 for c in CHANNELS}
        return cls({c: max(level + more, 1) for c, level in usual.items()}, form=form)

    @property
    def reach(self) -> int:
        """Samples that an answer waits for: of the future off-line, of delay if causal."""
        return max((self._delay(level) for level in self.levels.values()), default=0)

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know before use."""
        how = (
            f"looks {self.reach} samples ahead: not for a filter that claims to run in real time"
            if self.form == "off-line"
            else f"the answer for a moment comes {self.reach} samples after it"
        )
        return (
            f"E-004-14: de-noising does not change the white-noise density N, and the filter keeps "
            f"that of the raw data; {how}",
        )

    def apply(self, imu: ImuRecording) -> ImuRecording:
        """Return the recording with its channels de-noised."""
        kept = imu.size if self.form == "off-line" else imu.size - self.reach
        if kept < 2:
            raise InputError(
                f"{imu.size} samples for a filter that is {self.reach} samples late",
                cure="use fewer levels of decomposition",
            )
        columns = {c: imu.channel(c)[:kept] for c in CHANNELS}
        for channel, level in self.levels.items():
            columns[channel] = self._filtered(imu.channel(channel), level)[:kept]
        return replace(
            _first(imu, kept),
            gyro=np.stack([columns[c] for c in CHANNELS[:3]], axis=-1),
            accel=np.stack([columns[c] for c in CHANNELS[3:]], axis=-1),
            history=(*imu.history, f"wavelet de-noised, {self.form}"),
        )

    def _delay(self, level: int) -> int:
        from schuler.denoising import CausalDenoiser

        form: Literal["exact", "fast"] = "exact" if self.form == "off-line" else "fast"
        return round(CausalDenoiser(self.wavelet, level, form=form).delay)

    def _filtered(self, values: np.ndarray[Any, Any], level: int) -> np.ndarray[Any, Any]:
        from schuler.denoising import CausalDenoiser, denoise

        if self.form == "off-line":
            return denoise(values, wavelet=self.wavelet, level=level, details="zero").signal
        late = CausalDenoiser(self.wavelet, level, form="fast").push(values)
        return late[self._delay(level) :]


def _first(imu: ImuRecording, kept: int) -> ImuRecording:
    if kept == imu.size:
        return imu
    return imu.between(float(imu.time[0]), float(imu.time[kept]))
