"""Before the first run with an array: what is known of one fused IMU, for every mechanization.

Alignment, offsets of time and tuning are those of `prepare` on the fused recording; what they say
of the constant parts of the gyros is said of every sensor by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from schuler.arrays.common_axes import require_common_axes
from schuler.arrays.synthesis.fused_noise import combine_noise_models
from schuler.data import GnssRecording, ImuRecording
from schuler.data.array import ImuArray
from schuler.navigation.aiding.parity import Parity
from schuler.navigation.error_models.sensor_error_model import (
    generic_noise_model,
    sensor_error_model,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_faults import (
    ArrayFaults,
    find_array_faults,
    without_faults,
)
from schuler.navigation.mechanizations.array_model import (
    Fusion,
    extended_model,
    fused_model,
    noise_models_of,
    sensor_directions,
    without_idle_states,
)
from schuler.navigation.mechanizations.array_recording import (
    bias_jumps,
    complete_array,
    filled_array,
    fused_recording,
)
from schuler.navigation.mechanizations.array_weights import (
    FilterWeights,
    chosen_weights,
    followed_variances,
)
from schuler.navigation.mechanizations.sensor_table import Absence, SensorTable, sensor_table
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.prepare import prepare_drive
from schuler.navigation.preparation.setup import RunSetup, SensorStart
from schuler.navigation.settings import NavigationSettings, Progress, nobody_listens
from schuler.noise.noise_model import NoiseModel
from schuler.types import BoolArray, FloatArray

EARTH_RATE = 7.3e-5
"""The earth's rate about an unknown north stays in the mean of gyros at rest, rad/s."""
NOTHING_KNOWN = 1e3
"""Standard deviation of what a gyro shows that is out, rad/s."""
NOT_JUDGED = ArrayFaults()


@dataclass(frozen=True, slots=True, eq=False)
class PreparedArray:
    """An array and what every mechanization needs to know of it."""

    array: ImuArray  # complete, cut to where it can be used
    recording: ImuRecording  # the fused IMU, same stamps
    table: SensorTable  # who counts how much, when
    # one for each IMU, in its own axes, as the noise models say
    models: tuple[SensorErrorModel, ...]
    noise_models: tuple[NoiseModel, ...]  # one for each IMU
    setup: RunSetup  # from `prepare` on the fused recording
    settings: NavigationSettings  # what the user said; the body takes the place of the IMU.
    notes: tuple[str, ...] = ()  # what was done to the array, in words
    faults: ArrayFaults = NOT_JUDGED  # who was taken out, when and why

    @property
    def fusion(self) -> Fusion:
        """How the sensors are added up at first."""
        return self.table.fusions[0]

    def filled(self) -> PreparedArray:
        """With IMUs of which a sensor is out filled by the others, where each IMU has a filter."""
        return replace(self, array=filled_array(self.array, self.table))

    @property
    def lever_arm(self) -> FloatArray:
        """GNSS antenna from the origin of the body, m."""
        return self.setup.lever_arm + self.fusion.centre

    @property
    def whole(self) -> bool:
        """Whether the fused IMU has the stamps of the array: no gaps, no new starts."""
        condition = self.setup.condition
        return not (any(u.gap for u in condition.gaps) or condition.restarts)

    def sensor_start(self, *, each: bool = True) -> SensorStart:
        """Return what is known of all sensor states at the first sample."""
        rest = self.setup.alignment.rest
        out = None
        if rest is not None:
            held = self.table.row_at(np.array(rest))
            out = np.asarray(self.table.out[held[0] : held[1] + 1, 1].any(axis=0))
        return sensor_start(
            self.array, self.models, self.fusion, self.setup.alignment, each=each, out=out
        )

    def synthetic_setup(self) -> RunSetup:
        """Return the setup of the filter that knows what is left of the sensors when fused.

        What is left changes with the table, by differences that only parity shows: the filter
        then is the extended one.
        """
        if not self.table.constant:
            return self.extended_setup(parity=True)
        base, merge = fused_model(self.models, self.fusion)
        start = merged_start(self.sensor_start(each=False), merge)
        return replace(self.setup, sensor_start=start).with_sensors(base)

    def extended_setup(self, *, parity: bool) -> RunSetup:
        """Return the setup of the filter that knows the errors of every sensor."""
        base = extended_model(self.models, self.fusion, self.array.names)
        start = self.sensor_start(each=parity)
        own = replace(self.setup, sensor_start=start).with_sensors(base)
        if not self.table.constant:
            own = replace(own, stretches=self.table.stretches(self.models, own.factors))
        if not parity:
            return own
        source = Parity(self.array, self.table, self.models, own.model.size)
        return replace(own, sources=(*own.sources, source))


def prepare_array(
    array: ImuArray,
    gnss: GnssRecording,
    noise_models: NoiseModel | Sequence[NoiseModel] | None,
    settings: NavigationSettings,
    progress: Progress | None = None,
    *,
    faults: bool | ArrayFaults = True,
    weights: FilterWeights = "constant",
) -> PreparedArray:
    """Look for faults of an array, align it, find time offsets and noise of the fused IMU.

    Parameters
    ----------
    array : ImuArray
        Two IMUs or more, missing values as NaN.
    gnss : GnssRecording
        As for `navigate`.
    noise_models : NoiseModel, sequence of NoiseModel, or None
        As for `navigate_array`.
    settings : NavigationSettings
        What the user says.
    progress : callable, optional
        Called with a line of text now and then.
    faults : bool or ArrayFaults
        Whether faults of sensors are looked for; or which are known.
    weights : str
        As for `navigate_array`.

    Returns
    -------
    PreparedArray
        For `ArrayFilter`; `navigate_array` makes one by itself.

    Raises
    ------
    InputError
        As `navigate_array`.
    NavigationError
        As `navigate`.

    Examples
    --------
    See `ArrayFilter`.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, place = np.random.default_rng(1), schuler.tetrahedron_mounting(0.05)
    >>> ride = schuler.motorcycle(120.0)
    >>> noise = schuler.NoiseModel.isotropic(schuler.WhiteNoise(1e-3), schuler.WhiteNoise(3e-3))
    >>> parts = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(parts, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.1, velocity_sd=0.05, rng=rng)
    >>> settings = schuler.NavigationSettings(time_offset=0.0, tune_noise=False)
    >>> schuler.prepare_array(array, gnss, noise, settings).array.count
    4
    """
    say = progress or nobody_listens
    complete = complete_array(array)
    whole, notes = complete.array, complete.notes
    tuned = noise_models is None if settings.tune_noise is None else settings.tune_noise
    given = generic_noise_model() if noise_models is None else noise_models
    if not isinstance(given, NoiseModel) and len(given) == array.count != whole.count:
        kept = [array.names.index(name) for name in whole.names]
        given = [given[i] for i in kept]
    noises = noise_models_of(given, whole.count)
    models = tuple(
        without_idle_states(
            sensor_error_model(
                n, turn_on_accel=settings.turn_on_accel, turn_on_gyro=settings.turn_on_gyro
            )
        )
        for n in noises
    )
    found = faults if isinstance(faults, ArrayFaults) else NOT_JUDGED
    if faults is True:
        say("looking for faults of sensors")
        found = find_array_faults(whole, models)
        notes = (*notes, *found.notes)
    silent = tuple((whole.names[i], start, stop) for i, start, stop in complete.silences)
    found = replace(found, silent=silent)
    if not isinstance(faults, ArrayFaults):
        require_common_axes(without_faults(whole, found.absences))
    silences = [
        Absence(kind, (3 * i, 3 * i + 1, 3 * i + 2), start, stop)
        for i, start, stop in complete.silences
        for kind in (0, 1)
    ]
    absences = (*silences, *found.absences)
    chosen, noise = chosen_weights(weights, whole.count, noise_only=found.noise_only), None
    if chosen != "constant":
        seen = without_faults(whole, absences)
        noise = followed_variances(seen, models, chosen, relative=tuned)
    table = sensor_table(whole.time, whole.mounting, models, absences, noise)
    fusion, jumps = table.fusions[0], bias_jumps(whole, table)
    prepared = prepare_drive(
        _shifted(fused_recording(whole, table), table, -jumps),
        gnss,
        combine_noise_models(noises, {"gyro": fusion.gyro, "accel": fusion.accel}),
        replace(
            settings,
            lever_arm="estimate" if settings.estimates_arm else settings.arm - fusion.centre,
            tune_noise=tuned or settings.tune_noise,
        ),
        progress,
    )
    recording, setup = _shifted(prepared.imu, table, jumps), prepared.setup
    if recording.size != whole.size:
        after = np.nextafter(recording.time[-1], np.inf)
        whole = whole.between(float(recording.time[0]), float(after))
    return PreparedArray(whole, recording, table, models, noises, setup, settings, notes, found)


def _shifted(recording: ImuRecording, table: SensorTable, shift: FloatArray) -> ImuRecording:
    """Add something to every row of the table, (b, 6), accelerometers first."""
    if not shift.any():
        return recording
    own = shift[table.row_at(recording.time)]
    return replace(recording, gyro=recording.gyro + own[:, 3:], accel=recording.accel + own[:, :3])


def sensor_start(
    array: ImuArray,
    models: Sequence[SensorErrorModel],
    fusion: Fusion,
    alignment: Alignment,
    *,
    each: bool = True,
    out: BoolArray | None = None,
) -> SensorStart:
    """Tell the biases of all gyros from the alignment.

    At rest each gyro shows its own, the turn of the earth apart, which is common to all; those that
    are `out` (3 k,) then show nothing. In motion the alignment found that of the fused gyro; each
    gets its share of it by the prior.
    """
    extended = extended_model(models, fusion, array.names)
    covariance = extended.initial_covariance
    nothing = SensorStart(np.zeros(extended.size), covariance)
    if alignment.gyro_bias_sd is None:
        return nothing
    if alignment.rest is None:
        shown = np.where(extended.channel >= 3, extended.direction.T, 0.0)
        spread = alignment.gyro_bias_sd**2 * np.eye(3)
        return _conditioned(covariance, covariance @ shown.T, shown @ covariance @ shown.T + spread,
                            alignment.gyro_bias)  # fmt: skip
    mean, variance, length = _at_rest(array, alignment.rest)
    if out is not None:
        variance[out] = NOTHING_KNOWN**2
    shared, own = rest_covariances(models, length)
    whole = own + np.diag(variance) + EARTH_RATE**2 * fusion.axes @ fusion.axes.T
    if each:
        return _conditioned(covariance, shared, whole, mean)
    pi = fusion.gyro
    return _conditioned(covariance, shared @ pi.T, pi @ whole @ pi.T, pi @ mean)


def _conditioned(
    prior: FloatArray, shared: FloatArray, spread: FloatArray, value: FloatArray
) -> SensorStart:
    """Gauss: x given a measurement with covariance `spread` that shares `shared` with x."""
    gain = np.linalg.solve(spread, shared.T).T
    covariance = prior - gain @ shared.T
    return SensorStart(gain @ value, 0.5 * (covariance + covariance.T))


def rest_covariances(
    models: Sequence[SensorErrorModel], length: float
) -> tuple[FloatArray, FloatArray]:
    """What the means of all gyros over a rest have to do with the states at its start."""
    total = sum(m.size for m in models)
    shared, own = np.zeros((total, 3 * len(models))), np.zeros((3 * len(models),) * 2)
    first = 0
    for i, model in enumerate(models):
        directions = sensor_directions(model)
        for j in range(model.size):
            if model.channel[j] < 3 or model.partner[j] >= 0:
                continue
            start = float(model.initial_covariance[j, j])
            passed = -float(model.drift[j, 0]) * length
            diffusion = float(model.diffusion[j, 0])
            if passed < 1e-6:
                kept, variance = 1.0, start + diffusion * length / 3.0
            else:
                kept = -np.expm1(-passed) / passed
                stationary = diffusion * length / (2.0 * passed)
                wander = 2.0 * (passed - 1.0 + np.exp(-passed)) / passed**2 - kept**2
                variance = start * kept**2 + stationary * wander
            axis = slice(3 * i, 3 * i + 3)
            shared[first + j, axis] = start * kept * directions[j]
            own[axis, axis] += variance * np.outer(directions[j], directions[j])
        first += model.size
    return shared, own


def _at_rest(array: ImuArray, rest: tuple[float, float]) -> tuple[FloatArray, FloatArray, float]:
    """Mean of every gyro over a rest (3 k,), the variance of its white part, and the time, s."""
    part = slice(*np.searchsorted(array.time, rest, side="left"))
    gyro = array.gyro[part].reshape(-1, 3 * array.count)
    # neighbouring differences: slow changes are part of the model
    count = gyro.shape[0]
    white = np.mean(np.diff(gyro, axis=0) ** 2, axis=0) / 2.0
    return gyro.mean(axis=0), white / count, count / array.rate


def merged_start(start: SensorStart, merge: FloatArray) -> SensorStart:
    """Turn what is known of all sensors into what is known of the fused states."""
    return SensorStart(merge @ start.state, merge @ start.covariance @ merge.T)


def own_factors(setup: RunSetup, rotation: FloatArray) -> RunSetup:
    """Turn the noise factors that were found on the body's axes to those of one IMU."""
    square = rotation**2
    white = setup.factors.white**2
    own = np.sqrt(np.concatenate([white[:3] @ square, white[3:] @ square]))
    return replace(setup, factors=replace(setup.factors, white=own))
