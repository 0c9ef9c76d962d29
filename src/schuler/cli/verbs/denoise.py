"""`schuler denoise`: a recording with its noise taken off by wavelets, and what that costs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cyclopts import Parameter

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_imu
from schuler.cli.options.files import Written
from schuler.cli.options.reading import ImuReading
from schuler.cli.parsing import title_of
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.imu import ImuRecording
    from schuler.denoising import Denoised


@Parameter(name="*")
@dataclass(frozen=True)
class Wavelets:
    """How the noise is taken off.

    Parameters
    ----------
    band : float, optional
        Highest frequency of the motion in Hz, which stays: decides the levels.
    level : int, optional
        Levels of decomposition instead; 6 if neither is given.
    details : str
        threshold (what stands out of the noise stays, by Stein's unbiased risk estimate) or zero
        (a plain low-pass).
    causal : bool
        Without looking ahead: a plain low-pass whose answer comes late, by a delay that is told.
    wavelet : str
        Any orthogonal wavelet of PyWavelets.
    """

    band: float | None = None
    level: int | None = None
    details: Literal["threshold", "zero"] = "threshold"
    causal: bool = False
    wavelet: str = "db4"


def denoise(
    source: Path,
    target: Path,
    /,
    *,
    how: Wavelets = Wavelets(),
    written: Written = Written(),
    reading: ImuReading = ImuReading(),
) -> int:
    """Take noise off an IMU recording by wavelets.

    For looking and for off-line filters. It does not make a navigation filter better: what
    integrates into position is the white-noise density, which de-noising leaves as it is.

    Example: `schuler denoise imu.csv smooth.csv --band 5 --report denoised.html`

    Parameters
    ----------
    source : Path
        IMU recording in any format that is read.
    target : Path
        File to write, in the form that its ending says.
    """
    from schuler.io.registry import recording_format

    if how.band is not None and how.level is not None:
        raise InputError("--band and --level together", expected="one of them")
    write = recording_format(target.suffix).write_recording
    assert write is not None
    job = Job(written, target, inputs=(source,))
    imu = load_imu(source, reading.options(repair=False))
    with working("De-noising"):
        smooth, found = denoised(imu, how)
    return job.finish(
        Result(
            title=f"De-noising of {title_of(source)}",
            sections=sections(imu, found, smooth),
            show=lambda screen: show_denoised(screen, imu, found, how),
            json=lambda: {
                "rate_hz": imu.rate,
                "causal": how.causal,
                "channels": {c: one.to_dict() for c, one in found.items()},
            },
            settings={"details": how.details, "causal": how.causal, "wavelet": how.wavelet},
            files=((target, lambda path: write(path, smooth)),),
            with_origin=True,
        )
    )


def denoised(imu: ImuRecording, how: Wavelets) -> tuple[ImuRecording, dict[str, Denoised]]:
    """Return the recording without noise, and how each channel was treated."""
    import numpy as np

    from schuler.data import CHANNELS
    from schuler.denoising import denoise as take_off
    from schuler.navigation.error_models.sensor_denoising import SensorDenoising

    found = {
        c: take_off(
            imu.channel(c), wavelet=how.wavelet, level=how.level, band=how.band, rate=imu.rate,
            details="zero" if how.causal else how.details,
        )
        for c in imu.channels
    }  # fmt: skip
    if how.causal:
        levels = {c: one.level for c, one in found.items()}
        return SensorDenoising(levels, how.wavelet, "causal").apply(imu), found
    columns = [found[c].signal if c in found else np.full(imu.size, np.nan) for c in CHANNELS]
    gyro, accel = np.column_stack(columns[:3]), np.column_stack(columns[3:])
    said = (*imu.history, f"de-noised by wavelet {how.wavelet}, looking ahead")
    return replace(imu, gyro=gyro, accel=accel, history=said), found


def sections(
    imu: ImuRecording, found: dict[str, Denoised], smooth: ImuRecording
) -> tuple[object, ...]:
    """Return what the page shows: every channel before and after, then the recording."""
    from schuler.denoising import allan_effect
    from schuler.report.sections.noise.denoising import denoising_section, in_short
    from schuler.report.sections.noise.method_words import shown_name

    effects = {c: allan_effect(imu.channel(c), imu.rate, one) for c, one in found.items()}
    pages = [
        replace(
            denoising_section(effects[c], one, c),
            title=f"De-noising: {shown_name(c)}",
            summary=in_short(effects) if c == next(iter(found)) else (),
        )
        for c, one in found.items()
    ]
    return (*pages, smooth)


def show_denoised(
    screen: Screen, imu: ImuRecording, found: dict[str, Denoised], how: Wavelets
) -> None:
    """Print what was done to every channel."""
    from schuler.report.numbers import number, percent

    screen.heading("De-noising", f"{imu.name}, {imu.rate:.6g} Hz")
    rows = []
    for channel, one in found.items():
        before, after = imu.channel(channel), one.signal
        left = float((after - after.mean()).std() / (before - before.mean()).std())
        rows.append(
            (channel, str(one.level), f"0 to {number(one.approximation_band[1])} Hz",
             percent(float(one.kept[0])), percent(left), ", ".join(one.flags) or "-")
        )  # fmt: skip
    columns = ("channel", "levels", "band that stays", "finest details kept", "sd left")
    screen.table((*columns, "watch"), rows)
    reach = max(one.reach for one in found.values())
    seconds = reach / imu.rate
    if how.causal:
        screen.line("without looking ahead: a plain low-pass, its delay taken off the stamps")
    else:
        screen.line(f"a sample depends on up to {seconds:.3g} s after it: off-line use only")
    screen.line("the white-noise density N is what it was: keep it in a filter", "dim")
