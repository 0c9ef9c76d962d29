"""What redundant sensors say of each other's biases, as a measurement of the filter. Spec 7.5.

GNSS sees the biases of an array only as far as they are fused, pi b. The other combinations,
V b with V A = 0, show in the parity vector V ell directly: motion has no part in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.merit import parity_matrix
from schuler.data.array import ImuArray
from schuler.data.mounting import Mounting
from schuler.errors import InputError
from schuler.navigation.aiding.schedule import AidingSchedule, linear_measurements, merge_schedules
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_model import (
    Fusion,
    extended_model,
    fusion_of,
    sensor_directions,
    without_idle_states,
)
from schuler.navigation.mechanizations.array_recording import arm_forces
from schuler.navigation.mechanizations.sensor_table import SensorTable
from schuler.noise.noise_model import NoiseModel
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Parity:
    """Means of the parity vector over intervals that do not overlap."""

    array: ImuArray  # complete
    # with which the filter is fed; least squares in every row, as then the noise of the parity and
    # that of the fused measurement are not correlated.
    table: SensorTable
    # one for each IMU, in its own axes, in the order of `extended_model`
    models: Sequence[SensorErrorModel]
    states: int  # sensor states of the filter, of which those of the models are the first
    interval: float = 1.0  # seconds that are averaged

    def rows(self) -> AidingSchedule:
        """Return the measurements: 3 (k - 1) of the accelerometers, as many of the gyros."""
        time = self.array.time
        ends = interval_ends(time, self.interval)
        # the axes are the same over an interval; noise may change in it
        ends = np.union1d(ends, np.searchsorted(time, self.table.set_changes - 1e-9) - 1)
        ends = ends[ends >= 0]
        row = self.table.row_at(time[ends[1:]])
        parts = []
        for kind, values in ((0, self.array.accel), (1, self.array.gyro)):
            seen = values.reshape(self.array.size, -1)
            if kind == 0:
                seen = seen - arm_forces(self.array, self.table)
            total = np.concatenate([np.zeros((1, seen.shape[1])), np.cumsum(seen, axis=0)])
            mean = (total[ends[1:] + 1] - total[ends[:-1] + 1]) / np.diff(ends)[:, None]
            shown = axis_rows(self.models, kind, self.states)
            span = np.diff(time[ends])
            for number in np.unique(row):
                for mine in _alike(np.flatnonzero(row == number), span):
                    measured = self.measured(kind, int(number), mean[mine], shown)
                    if measured is not None:
                        z, matrix, noise = measured
                        length = float(np.median(span[mine]))
                        parts.append(
                            linear_measurements(time[ends[1:]][mine], z, matrix, noise / length)
                        )
        return merge_schedules(parts, float(time[0]), float(time[-1]))

    def measured(
        self, kind: int, row: int, mean: FloatArray, shown: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Values, rows on the states and noise density of the parity of the axes in use."""
        variance = self.table.variance[row, kind]
        used = np.isfinite(variance)
        if not np.all(variance[used] > 0.0):
            raise InputError(
                "a parity update with sensors without white noise",
                expected="a noise model with white noise on every axis",
            )
        parity = parity_matrix(self.table.fusions[0].axes[used], np.sqrt(variance[used]))
        if not len(parity):
            return None
        return mean[:, used] @ parity.T, parity @ shown[used], (parity * variance[used]) @ parity.T


def _alike(rows: NDArray[np.int64], span: FloatArray) -> list[NDArray[np.int64]]:
    """Intervals that are whole, and each of those that a change of the axes has cut."""
    whole = span[rows] > 0.9 * float(np.median(span))
    return [part for part in (rows[whole], *rows[~whole][:, None]) if part.size]


def axis_rows(models: Sequence[SensorErrorModel], kind: int, states: int) -> FloatArray:
    """Return how all states show on the sensor axes of one kind."""
    shown = np.zeros((3 * len(models), states))
    first = 0
    for i, model in enumerate(models):
        own = sensor_directions(model).T
        own = np.where((model.channel >= 0) & (model.channel // 3 == kind), own, 0.0)
        shown[3 * i : 3 * i + 3, first : first + model.size] = own
        first += model.size
    return shown


def parity_rows(
    models: Sequence[SensorErrorModel], fusion: Fusion, states: int
) -> tuple[FloatArray, FloatArray]:
    """Return the rows of the parity measurement on the sensor states, V b, whitened."""
    white = [np.concatenate([m.white_density[3 * q : 3 * q + 3] for m in models]) for q in (0, 1)]
    rows = [
        parity_matrix(fusion.axes, w) @ axis_rows(models, q, states) for q, w in enumerate(white)
    ]
    return rows[0], rows[1]


def interval_ends(time: FloatArray, interval: float) -> NDArray[np.int64]:
    """Last samples of consecutive intervals, the start of the first included."""
    if not interval > 0.0:
        raise InputError(f"an interval of {interval:g} s", expected="a positive number")
    marks = np.arange(time[0], time[-1] + 1e-9, interval)
    ends = np.unique(np.searchsorted(time, marks - 1e-6 * interval))
    if ends.size < 2:
        raise InputError(
            f"a recording of {time[-1] - time[0]:.2f} s with intervals of {interval:g} s",
            expected="an interval that fits into the recording",
        )
    found: NDArray[np.int64] = ends.astype(np.int64)
    return found


def array_error_model(
    noise_models: Sequence[NoiseModel],
    mounting: Mounting,
    *,
    turn_on_accel: float,
    turn_on_gyro: float,
) -> tuple[SensorErrorModel, FloatArray]:
    """Return the error states of every sensor of an array, and what parity measures of them.

    Parameters
    ----------
    noise_models : sequence of NoiseModel
        One for each IMU.
    mounting : Mounting
        Of the IMUs on the body.
    turn_on_accel, turn_on_gyro : float
        Standard deviations of constants at switch-on, m/s² and rad/s; zero: no such states.

    Returns
    -------
    model : SensorErrorModel
        Of the extended filter, m states.
    rows : (6 (k - 1), 9 + m) ndarray
        Of the parity vectors on all states, navigation first, whitened; for `observability`.

    Raises
    ------
    InputError
        Numbers of models and IMUs that differ.

    Notes
    -----
    S002 (9), (13): GNSS sees six combinations of the 6 k biases, parity sees the others.

    Examples
    --------
    >>> import schuler
    >>> gyro = schuler.WhiteNoise(1e-3) + schuler.GaussMarkov(1e-3, 100.0)
    >>> accel = schuler.WhiteNoise(1e-2) + schuler.GaussMarkov(0.1, 60.0)
    >>> noise = [schuler.NoiseModel.isotropic(gyro, accel)] * 4
    >>> none = {"turn_on_accel": 0.0, "turn_on_gyro": 0.0}
    >>> model, rows = schuler.array_error_model(noise, schuler.tetrahedron_mounting(), **none)
    >>> model.size, rows.shape
    (24, (18, 33))
    """
    if len(noise_models) != mounting.count:
        raise InputError(
            f"{len(noise_models)} noise models for {mounting.count} IMUs", expected="one for each"
        )
    models = [
        without_idle_states(
            sensor_error_model(noise, turn_on_accel=turn_on_accel, turn_on_gyro=turn_on_gyro)
        )
        for noise in noise_models
    ]
    fusion = fusion_of(mounting, models)
    wide = extended_model(models, fusion, [str(i + 1) for i in range(len(models))])
    rows = np.vstack(parity_rows(models, fusion, wide.size))
    return wide, np.hstack([np.zeros((rows.shape[0], 9)), rows])
