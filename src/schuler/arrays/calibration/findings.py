"""What to know about a calibration, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.accelerometers import AccelerometerFit
from schuler.arrays.calibration.gyros import GyroFit
from schuler.arrays.calibration.poses import LEAST, PoseFit
from schuler.arrays.calibration.rows import Rests
from schuler.arrays.calibration.turns import TurnFit
from schuler.data import ImuArray
from schuler.types import FloatArray

LOST = 0.05
"""Share of missing rows of an IMU that is worth a word."""
UNRELATED = 0.01
"""Standard deviation of a sensitivity above which it is not worth much."""


def findings_of(
    array: ImuArray,
    gyros: GyroFit,
    forces: AccelerometerFit | None,
    poses: PoseFit | None,
    rests: Rests,
    turns: TurnFit | None,
    saturated: NDArray[np.int64],
    stuck: NDArray[np.int64],
) -> tuple[str, ...]:
    """Say what was seen, what was not, and what that means."""
    said = [
        f"there was no rotation about the body's axis {_axis(axis)}: what the gyros make of rates "
        "about it, and turns about the others, are not seen"
        for axis in gyros.unseen
    ]
    if not gyros.bias_from_rest:
        said.append(
            "the array was nowhere at rest: of the gyro biases only the differences from their "
            "mean are seen"
        )
    if gyros.track is not None:
        track = gyros.track
        said.append(
            f"the chips run free and are polled: each sample is up to {1e3 * track.period:.3f} ms "
            f"old, in sawtooths of {np.abs(track.beat).min():.2f} to "
            f"{np.abs(track.beat).max():.2f} Hz; their phases were tracked"
        )
    elif np.abs(gyros.delay).max() > 3.0 * gyros.delay_sd.max():
        said.append(
            f"delays between the IMUs of {1e3 * np.ptp(gyros.delay):.3g} ms were found and "
            "taken out"
        )
    if forces is None:
        said.append("there are no accelerometers in all IMUs: lever arms were not sought")
    else:
        said += _of_forces(forces, poses, rests)
    for i in range(array.count):
        missing = float(np.isnan(array.gyro[:, i]).any(axis=1).mean())
        if missing > LOST:
            said.append(
                f"{array.names[i]} lacks {100.0 * missing:.0f} % of the rows; only rows in which "
                "all IMUs are there were used"
            )
    said += [
        f"{name} shows one value again and again in {int(lost.max())} rows: it was dead there, and "
        "they were not used"
        for name, lost in zip(array.names, stuck, strict=True)
        if lost.any()
    ]
    worst = int(saturated[:, 0].max())
    if worst:
        said.append(
            f"gyros saturate: up to {worst} rows ({100.0 * worst / array.size:.1f} %) of an IMU, "
            "with a margin, were not used"
        )
    if float(np.median(gyros.deviation_sd)) > UNRELATED:
        said.append(
            "there was little motion: sensitivities are known to "
            f"{100.0 * float(np.median(gyros.deviation_sd)):.1f} % only"
        )
    if turns is not None:
        scale, error = (
            100.0 * (np.diagonal(turns.matrix) - 1.0),
            100.0 * np.diagonal(turns.matrix_sd),
        )
        each = ", ".join(f"{v:+.2f} ± {e:.2f}" for v, e in zip(scale, error, strict=True))
        said.append(
            f"gravity carried through {turns.turns} turns from pose to pose: the mean gyro would "
            f"have to be scaled by {each} % on x, y, z; that is told, not applied"
        )
    said.append(
        "what all sensors have in common (a turn of the whole, the scale of all gyros) is not "
        "seen by their differences: the gauge is their mean"
    )
    return tuple(said)


def _of_forces(forces: AccelerometerFit, poses: PoseFit | None, rests: Rests) -> list[str]:
    said = [
        f"the force hardly varied along the body's axis {_axis(axis)}: scale and bias of the "
        "accelerometers there are not told apart"
        for axis in forces.unseen
    ]
    if not forces.arms_seen:
        said.append("there was too little rotation for lever arms: the declared ones stay")
    if poses is not None:
        said.append(
            f"gravity in {poses.poses} static poses: |force| scattered by {poses.before:.3g} m/s² "
            f"before the fit of scale, axes and bias of the mean, {poses.deviation:.2g} after"
        )
    else:
        said.append(
            f"{rests.count} static poses: at least {LEAST} in all directions give scale and bias "
            "of the mean accelerometer against gravity; it was left as it is"
        )
    return said


def _axis(axis: FloatArray) -> str:
    forward = axis * np.sign(axis[np.argmax(np.abs(axis))])
    return "(" + ", ".join(f"{v:.2f}" for v in np.round(forward, 2) + 0.0) + ")"
