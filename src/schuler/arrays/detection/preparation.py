"""Before faults are looked for: an array on one clock, in one set of axes, with known errors.

A verdict is possible only where what healthy sensors differ by is known. An array that motion
rules is calibrated, by a calibration of another recording or in passing; where its samples are
vibration it is low-passed; and what is left in motion goes into the thresholds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.arrays.calibration.calibrate import calibrate_array
from schuler.arrays.calibration.judging import calibrated_biases, track_phases, with_own_delays
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import low_passed, mask_saturated
from schuler.arrays.common_axes import DEVIATIONS, check_axes, require_common_axes
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.motion_errors import (
    mean_of_present,
    motion_errors,
    proportional_errors,
)
from schuler.data import ImuArray
from schuler.data.exportable import Exportable
from schuler.errors import EstimationError, InputError
from schuler.rotations import rotation_vector_from_dcm
from schuler.types import FloatArray

BANDWIDTH = 8.0
"""Of the motion of vehicles and hands; above it there is vibration, which sensors do not share."""
SHORT = 0.1
"""Seconds of the means that tell vibration from noise: it cancels in them faster."""
COLOURED = 0.3
"""Share of white scatter in these means below which the samples are vibration."""
WANDER = {"gyro": 2.5, "accel": 1.0}
"""Slow wander of a healthy bias, in deviations of what half seconds differ by."""
LARGEST_TURN, LARGEST_SCALE = float(np.radians(1.0)), 0.005
"""Between gyros of an array that passes as calibrated, rad and a share of the rate."""
RULED = 2.0
"""How much larger than their floor motion makes the differences in an array that is not."""
KNOWN = 0.005
"""Standard deviation of the elements of a calibration that is good enough to judge by."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedDetection(Exportable):
    """An array that can be judged, and how.

    Parameters
    ----------
    array : ImuArray
        Calibrated and low-passed where that was needed.
    settings : FaultSettings
        With wander and motion errors as they were found, never less than what was given.
    notes : tuple of str
        What was done, and what cannot be judged, in words.
    not_judged : dict of str to float
        By kind of sensor the share of the time in which motion hides faults of five times the
        wander.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, prepare_detection
    >>> rng = np.random.default_rng(1)
    >>> gyro, accel = 1e-3 * rng.standard_normal((2, 6_000, 4, 3))
    >>> accel[..., 2] -= 9.81
    >>> array = ImuArray(np.arange(6_000) / 100.0, gyro, accel, Mounting.aligned(4))
    >>> prepare_detection(array).array.count
    4
    """

    array: ImuArray
    settings: FaultSettings
    notes: tuple[str, ...]
    not_judged: dict[str, float]


def prepare_detection(
    array: ImuArray,
    settings: FaultSettings | None = None,
    *,
    calibration: ArrayCalibration | None = None,
) -> PreparedDetection:
    """Bring an array into a state in which its sensors can be judged.

    Parameters
    ----------
    array : ImuArray
        In the sensors' own axes.
    settings : FaultSettings, optional
        Wander and uncertainties in it are lower bounds.
    calibration : ArrayCalibration, optional
        From another recording of the same array. Without one, an array whose differences motion
        rules is calibrated in passing, with the faults that may be in it.

    Returns
    -------
    PreparedDetection
        For `detect_faults`.

    Raises
    ------
    InputError
        Axes that are not what the mounting says, or an array that motion rules and that moves too
        little to be calibrated in passing.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, prepare_detection
    >>> rng = np.random.default_rng(1)
    >>> gyro, accel = 1e-3 * rng.standard_normal((2, 6_000, 4, 3))
    >>> accel[..., 2] -= 9.81
    >>> array = ImuArray(np.arange(6_000) / 100.0, gyro, accel, Mounting.aligned(4))
    >>> prepare_detection(array).array.count
    4
    """
    how = FaultSettings() if settings is None else settings
    notes: list[str] = []
    bandwidth = BANDWIDTH if _vibrates(array) else None
    if bandwidth is not None:
        notes.append(f"vibration rules the samples: judged below {bandwidth:g} Hz")
    if calibration is None:
        require_common_axes(array, broken_may_pass=True)
        if not _ruled_by_motion(array if bandwidth is None else low_passed(array, bandwidth)):
            used = array if bandwidth is None else low_passed(array, bandwidth)
            return _with_errors(used, how, notes, motion=bandwidth is not None)
        calibration = _in_passing(array, bandwidth)
        notes.append(
            "the array was not calibrated: calibrated in passing, on this recording, in which a "
            "fault that lasts may hide (a calibration of another recording shows it: schuler "
            "calibrate, --calibration)"
        )
    used, saturated = _calibrated(array, calibration, bandwidth)
    if saturated > 0.0:
        notes.append(
            f"saturated samples were left out, up to {saturated:.1f} s of a unit; where every gyro "
            "is saturated, accelerometers apart from each other are not judged either"
        )
    return _with_errors(used, how, notes, motion=True)


def _calibrated(
    array: ImuArray, calibration: ArrayCalibration, bandwidth: float | None
) -> tuple[ImuArray, float]:
    """Apply a calibration with what is this recording's own; also seconds that were saturated."""
    masked, counts = mask_saturated(array)
    used = masked if bandwidth is None else low_passed(masked, bandwidth)
    here = calibrated_biases(calibration, array)
    slow = used if bandwidth is not None else low_passed(masked, BANDWIDTH)
    here = with_own_delays(here, slow)
    track = track_phases(here, array) if bandwidth is None else None
    if track is not None:
        here = replace(here, delay=np.zeros(here.count))
    return here.apply(used, track), float(counts.max()) / array.rate


def _in_passing(array: ImuArray, bandwidth: float | None) -> ArrayCalibration:
    try:
        found = calibrate_array(array, bandwidth=bandwidth)
    except EstimationError as error:
        reason = str(error)
    else:
        worst = float(np.median(found.gyro_deviation_sd))
        if worst < KNOWN:
            return found
        reason = f"its motion tells sensitivities to {100.0 * worst:.1f} % only"
    raise InputError(
        "the array is not calibrated: what its gyros differ by grows with motion, and it cannot be "
        f"calibrated in passing ({reason})",
        expected="sensors that differ by noise and faults alone",
        cure="calibrate the array on a recording in which it is turned about all axes (schuler "
        "calibrate) and give that as --calibration",
    )


def _with_errors(
    array: ImuArray, settings: FaultSettings, notes: list[str], *, motion: bool
) -> PreparedDetection:
    """Put what motion leaves into the settings, and say where it hides faults."""
    if not motion:
        return PreparedDetection(array, settings, tuple(notes), {})
    errors = motion_errors(array)
    gyro, accel = errors.get("gyro"), errors.get("accel")
    if gyro is not None:
        settings = replace(
            settings,
            gyro_wander=max(settings.gyro_wander, WANDER["gyro"] * gyro.floor),
            scale_uncertainty=max(settings.scale_uncertainty, gyro.scale),
            delay_uncertainty=max(settings.delay_uncertainty, gyro.timing),
        )
    if accel is not None:
        settings = replace(
            settings,
            accel_wander=max(settings.accel_wander, WANDER["accel"] * accel.floor),
            accel_scale_uncertainty=max(settings.accel_scale_uncertainty, accel.scale),
            accel_delay_uncertainty=max(settings.accel_delay_uncertainty, accel.timing),
            arm_uncertainty=max(settings.arm_uncertainty, accel.arm),
        )
    hidden = _hidden(array, settings)
    for kind, share in hidden.items():
        if share >= 0.005:
            title = "gyros" if kind == "gyro" else "accelerometers"
            notes.append(
                f"{title}: in {100.0 * share:.0f} % of the time motion hides faults, and they are "
                "not judged then"
            )
    return PreparedDetection(array, settings, tuple(notes), hidden)


def _hidden(array: ImuArray, settings: FaultSettings) -> dict[str, float]:
    body = array.in_body()
    rate = mean_of_present(body.gyro)
    shares = {}
    for kind, wander in (("gyro", settings.gyro_wander), ("accel", settings.accel_wander)):
        values = body.gyro if kind == "gyro" else body.accel
        if np.isnan(values).all():
            continue
        vectors = mean_of_present(values)
        extra = settings.motion_variance(
            body.time, vectors, "gyro" if kind == "gyro" else "accel", rate
        )
        shares[kind] = 0.0 if extra is None else float(np.mean(extra > (5.0 * wander) ** 2))
    return shares


def _vibrates(array: ImuArray) -> bool:
    """Whether what gyros or accelerometers differ by cancels in short means faster than noise."""
    length = round(SHORT * array.rate)
    if length < 4:
        return False
    return any(_white_share(v, length) < COLOURED for v in (array.gyro, array.accel))


def _white_share(values: FloatArray, length: int) -> float:
    """Variance of short means against that of samples if they were white, median of the axes."""
    count = values.shape[0] // length
    parts = values[: count * length].reshape(count, length, -1)
    # motion is slow: second differences of samples and of means are free of it
    sample = np.nanmedian(np.abs(np.diff(parts, n=2, axis=1)), axis=(0, 1)) / np.sqrt(6.0)
    mean = np.nanmedian(np.abs(np.diff(parts.mean(axis=1), n=2, axis=0)), axis=0) / np.sqrt(6.0)
    known = np.isfinite(sample) & np.isfinite(mean) & (sample > 0.0)
    if not known.any():
        return 1.0
    return float(np.median(mean[known] ** 2 * length / sample[known] ** 2))


def _ruled_by_motion(array: ImuArray) -> bool:
    """Whether gyros differ by turns or scales that a calibration would take away."""
    share = float(proportional_errors(array).max())
    axes = check_axes(array)
    for turn, deviation in zip(axes.turn, axes.turn_sd, strict=True):
        angle = np.linalg.norm(rotation_vector_from_dcm(np.nan_to_num(turn, nan=0.0)))
        large = np.isfinite(turn).all() and angle > max(LARGEST_TURN, DEVIATIONS * deviation)
        # an offset turns the mean rate as well, but does not follow its changes
        if large and share > 0.5 * LARGEST_TURN:
            return True
    found = motion_errors(array).get("gyro")
    if found is None:
        return False
    speed = np.linalg.norm(mean_of_present(array.in_body().gyro), axis=1)
    lively = float(np.nanquantile(speed, 0.9))
    # the spread over all units, and one unit that is out of scale by itself
    scale = max(found.scale, share)
    return scale > LARGEST_SCALE and scale * lively > RULED * found.floor
