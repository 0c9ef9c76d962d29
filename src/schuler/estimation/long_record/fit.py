"""Noise of records larger than memory: one pass over pieces, then the usual fits."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from schuler.data.imu import ImuRecording
from schuler.errors import InputError
from schuler.estimation.characterization import ImuCharacterization, findings_of, model_of
from schuler.estimation.gmwm.fit import fit_gmwm_curves
from schuler.estimation.identification import Identification
from schuler.estimation.joint_fit import LONGEST_FRACTION, identify_curve
from schuler.estimation.long_record.sums import RecordSums, collect_sums
from schuler.estimation.spectrum.fit import SpectrumFit, fit_spectrum
from schuler.estimation.structure_methods import random_parts, shared_flag
from schuler.noise import Process

NOT_LOOKED_AT = (
    "the record was read in pieces: lines of vibration, light outliers and temperature were not "
    "taken off (a part that fits into memory tells whether they matter)"
)


METHODS = ("allan", "gmwm", "psd")


@dataclass(frozen=True, slots=True, eq=False)
class DensityIdentification(Identification):
    """What the power spectral density found; the structure is that of the Allan deviation."""

    density: SpectrumFit

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        return Identification.to_dict(self) | {"method": "psd", "density": self.density.to_dict()}


def characterize_pieces(
    pieces: Iterable[ImuRecording],
    model: str | Process = "auto",
    name: str = "",
    method: str = "allan",
) -> ImuCharacterization:
    """Identify the noise of a record that comes in pieces, in memory that does not grow.

    Parameters
    ----------
    pieces : iterable of ImuRecording
        In the order of time, as `read_imu_pieces` returns them.
    model : str or Process
        As for `identify`.
    name : str
        Of the record.
    method : {"allan", "gmwm", "psd"}
        By the Allan deviation, by the generalised method of wavelet moments, or by the power
        spectral density.

    Returns
    -------
    ImuCharacterization
        As that of `characterize_imu`; the findings say what was left out.

    Raises
    ------
    InputError
        Pieces of different rates or channels, or another method.
    EstimationError
        No piece that can be used, or a channel that does not vary.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, simulate_static
    >>> from schuler.estimation.long_record import characterize_pieces
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> imu = simulate_static(model, 600.0, 100.0, np.random.default_rng(1))
    >>> halves = [imu.between(0.0, 300.0), imu.between(300.0, 600.0)]
    >>> found = characterize_pieces(halves)
    >>> round(found.channels["gyro_x"].parameters["white_noise.density"] / 5e-5, 2)
    1.0
    """
    return characterize_sums(collect_sums(pieces), model, name, method)


def characterize_sums(
    sums: RecordSums, model: str | Process = "auto", name: str = "", method: str = "allan"
) -> ImuCharacterization:
    """Identify the noise behind the sums of a record, or of several that were added.

    Parameters
    ----------
    sums : RecordSums
        As `collect_sums` returns them.
    model : str or Process
        As for `identify`.
    name : str
        Of the record.
    method : {"allan", "gmwm", "psd"}
        By the Allan deviation, by the generalised method of wavelet moments, or by the power
        spectral density.

    Returns
    -------
    ImuCharacterization
        As that of `characterize_imu`; the findings say what was left out.

    Raises
    ------
    InputError
        Another method.
    EstimationError
        A channel that does not vary.
    """
    curve, first = sums.allan.curve(LONGEST_FRACTION), sums.sample
    if method not in METHODS:
        raise InputError(
            f"method '{method}' on a record in pieces", expected=f"one of {', '.join(METHODS)}"
        )

    def by_allan(channel: int) -> Identification:
        return identify_curve(curve.column(channel), model)

    def by_wavelet_moments(channel: int) -> Identification:
        return fit_gmwm_curves([sums.allan.wavelet_variance(channel)], model)

    def by_density(channel: int) -> Identification:
        chosen = by_allan(channel)
        random = random_parts(chosen.process)
        fit = fit_spectrum(sums.spectrum.curve(channel, onesided=False), random)
        return DensityIdentification(
            fit.process, fit.standard_errors, fit.intervals, chosen.limits, chosen.curve,
            chosen.diagnostics, chosen.slopes, fit.verdict, fit,
            flags=tuple(shared_flag(flag) for flag in fit.flags),
        )  # fmt: skip

    fits: dict[str, Callable[[int], Identification]] = {
        "allan": by_allan, "gmwm": by_wavelet_moments, "psd": by_density,
    }  # fmt: skip
    channels = {c: fits[method](j) for j, c in enumerate(sums.channels)}
    said = [NOT_LOOKED_AT]
    if sums.left_out:
        said.append(
            f"{sums.left_out} of {sums.pieces} pieces were left out, in which the sensor moved or "
            "an axis was stuck"
        )
    if sums.knocks:
        said.append(f"{sums.knocks} knocks were cut out")
    said += [f"in {n} of {sums.pieces} pieces: {text}" for n, text in sums.seen.values()]
    name, duration = name or first.name, curve.duration
    return ImuCharacterization(
        recording_name=name,
        channels=channels,
        noise_model=model_of(channels, sums.allan.rate, name, duration),
        findings=(*said, *findings_of(first, channels, duration)),
        rate=sums.allan.rate,
        duration=duration,
    )
