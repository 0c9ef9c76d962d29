"""Faults of an array's sensors before a filter eats them: found, dated back, kept out.

Detection looks at the raw samples, before alignment and tuning could take a fault for a bias. It
notices a fault some time after it began; the filter does without the sensor from the onset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from schuler.arrays.detection.calibrated_parts import prepare_by_parts
from schuler.arrays.detection.fault_log import FaultRecord
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.faults import SensorFaults, detect_faults
from schuler.arrays.lever_arms import arm_coefficients, turning_tensor
from schuler.arrays.redundant import TITLES
from schuler.arrays.synthesis.least_squares import least_squares
from schuler.arrays.tracking import RECALL
from schuler.data import ImuArray
from schuler.errors import EstimationError, InputError
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.sensor_table import Absence
from schuler.screening.screen import Finding
from schuler.types import BoolArray, FloatArray

LOOK_BACK = 30.0
"""Seconds before a fault was noticed in which its onset is looked for."""
FLEETING = 0.05
"""Seconds that a verdict lasts at least that is not taken back at once."""
AGREEMENT = 5.0
"""Seconds for which two units must agree to outvote two others."""
SHOWS, LARGEST_CLIP = 20.0, 50.0
"""Deviations of the wander that a clipped sample may show, and of a sample at most."""
BIAS_MEMORY = 100.0
"""Seconds over which the differences of biases are followed, if nothing else is said."""
SEEN = 8.0
"""Seconds after a fault was noticed in which its size is measured."""
MARGIN = 0.2
"""Seconds before the likeliest onset from which a sensor is not used."""


@dataclass(frozen=True, slots=True)
class SensorAbsence:
    """A sensor that the filter did without for a while: who, when, why, until when."""

    record: FaultRecord  # when it was noticed, by what, and when it was let back in
    onset: float  # from when on it was not used, s
    size: float | None = None  # what it was off by meanwhile, rad/s or m/s²

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON."""
        return self.record.to_dict() | {
            "onset_s": self.onset,
            "size_while_out": self.size,
            "text": self.text,
        }

    @property
    def text(self) -> str:
        """One line for people."""
        from schuler.units import format_value

        r = self.record
        title = TITLES[r.sensor]
        who = f"{title} of {r.name}" if r.kind == "unit" else f"{title.removesuffix('s')} {r.name}"
        until = "to the end" if r.stop is None else f"to {r.stop:.2f} s"
        size, so_far = (r.size, " so far") if self.size is None else (self.size, "")
        off = ""
        if size is not None:
            kind = "angular rate" if r.sensor == "gyro" else "acceleration"
            off = f"off by {format_value(size, kind, digits=3)}{so_far}, "
        shown = f"F = {r.statistic:.0f} over {r.threshold:.0f}"
        if r.time_constant is not None:
            shown += f" in {r.time_constant:g} s means"
        return (
            f"{who} was not used from {self.onset:.2f} s {until}: {off}noticed at {r.start:.2f} s "
            f"({shown})"
        )


@dataclass(frozen=True, slots=True, eq=False)
class ArrayFaults:
    """What was found in an array before it was navigated with."""

    taken_out: tuple[SensorAbsence, ...] = ()  # faults, in order of time
    # sensors that contradicted one another without one that could be blamed
    contradictions: tuple[FaultRecord, ...] = ()
    absences: tuple[Absence, ...] = ()  # for the table of the filter
    notes: tuple[str, ...] = ()  # what was done, and what could not be judged, in words
    judged: bool = False  # whether sensors were judged at all
    # whether healthy sensors differ by noise alone: neither motion nor vibration rules
    noise_only: bool = False
    silent: tuple[tuple[str, float, float], ...] = ()  # IMUs that brought nothing for a while, s

    def findings(self, end: float) -> list[Finding]:
        """Who was out when and why, and who contradicted whom, of a recording that ends then."""
        found = [
            Finding(
                "sensor fault",
                "warning",
                absence.text,
                intervals=((absence.onset, _until(absence.record, end)),),
                cure="look at this sensor; --without-faults uses it all the same",
            )
            for absence in self.taken_out
        ]
        found += [
            Finding(
                "sensor fault",
                "warning",
                record.text,
                intervals=((record.start, _until(record, end)),),
                cure="with two units, or two suspects alike, nobody can tell which one is right: "
                "more sensors can",
            )
            for record in self.contradictions
        ]
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON."""
        return {
            "judged": self.judged,
            "taken_out": [a.to_dict() for a in self.taken_out],
            "contradictions": [r.to_dict() for r in self.contradictions],
            "silent": [
                {"name": n, "start_s": a, "stop_s": b, "text": f"{a:.2f} to {b:.2f} s"}
                for n, a, b in self.silent
            ],
            "notes": list(self.notes),
        }


def find_array_faults(array: ImuArray, models: Sequence[SensorErrorModel] = ()) -> ArrayFaults:
    """Look for faults of the sensors of an array, and for when they began.

    What the `models` say that healthy biases wander is no fault. An array that cannot be judged is
    navigated with as it is, which is said. Axes that are not what the mounting says raise.
    """
    try:
        ready = prepare_by_parts(array, settings_for(models, array.rate))
        found = detect_faults(ready.array, ready.settings, causal=False)
    except EstimationError as error:
        return ArrayFaults(notes=(f"faults of sensors were not looked for: {error}",))
    except InputError as error:
        if "not calibrated" not in str(error):
            raise
        return ArrayFaults(notes=(f"faults of sensors were not looked for: {error}",))
    taken_out: list[SensorAbsence] = []
    contradictions: list[FaultRecord] = []
    absences: list[Absence] = []
    turning = _turning(found.gyro)
    for sensors in found.sensors:
        blamed, doubts = believed(ready.array, ready.settings, sensors)
        contradictions += doubts
        for tested, record in blamed:
            axes = _axes(tested, record)
            onset = fault_onset(tested, axes, record, turning)
            size = fault_size(tested, axes, record, onset, turning)
            taken_out.append(SensorAbsence(record, onset, size))
            stop = np.inf if record.stop is None else record.stop
            kind = 0 if sensors.sensor == "accel" else 1
            absences.append(Absence(kind, _columns(array, tested, axes), onset, stop))
    taken_out.sort(key=lambda a: a.record.start)
    return ArrayFaults(
        tuple(taken_out),
        tuple(contradictions),
        tuple(absences),
        ready.notes,
        judged=True,
        noise_only=ready.array is array,
    )


Blamed: TypeAlias = list[tuple[SensorFaults, FaultRecord]]


def believed(
    array: ImuArray, settings: FaultSettings, sensors: SensorFaults
) -> tuple[Blamed, list[FaultRecord]]:
    """Return who is to blame, with the tests that say so, and the contradictions that are left.

    What is said shortly before sensors contradict one another is not believed. Then those that
    were out before have no vote, and the others are asked once more without them; where nobody
    was, the only two units that agree outvote two that are both strangers.
    """
    lasting = [r for r in sensors.records if r.kind in ("axis", "unit") and r.taken_out]
    lasting = [r for r in lasting if r.stop is None or r.stop - r.start > FLEETING]
    doubts = [r for r in sensors.records if r.kind == "inconsistent"]
    if not doubts:
        return [(sensors, r) for r in lasting], []
    first = min(r.start for r in doubts)
    sure = [r for r in lasting if r.start < first - RECALL]
    blamed: Blamed = [(sensors, r) for r in sure]
    gone = {_unit(sensors, r) for r in sure if r.stop is None or r.stop > first}
    rest = [i for i, name in enumerate(array.names) if name not in gone]
    if gone and len(rest) > 2:
        fewer = array.select(rest)
        again = _tested(fewer, settings, sensors)
        more, doubts = believed(fewer, settings, again)
        return blamed + [(t, r) for t, r in more if r.start >= first - RECALL], doubts
    if not gone and len(rest) == 4:
        strangers = _strangers(array, settings, sensors, first)
        one = replace(doubts[0], kind="unit", other="", stop=None)
        if strangers:
            return blamed + [(sensors, replace(one, name=name)) for name in strangers], []
    return blamed, doubts


def _unit(sensors: SensorFaults, record: FaultRecord) -> str:
    of = sensors.followed.sensors
    if record.kind == "unit":
        return record.name
    return of.unit_names[int(of.unit[of.names.index(record.name)])]


def _tested(array: ImuArray, settings: FaultSettings, sensors: SensorFaults) -> SensorFaults:
    found = detect_faults(array, settings, causal=False)
    again = found.gyro if sensors.sensor == "gyro" else found.accel
    assert again is not None
    return again


def _strangers(
    array: ImuArray, settings: FaultSettings, sensors: SensorFaults, first: float
) -> tuple[str, ...]:
    """The two units of four that are left when only one pair agrees after a moment."""
    agree = []
    for pair in combinations(range(array.count), 2):
        said = _tested(array.select(list(pair)), settings, sensors).records
        if not any(first - RECALL < r.start < first + AGREEMENT for r in said):
            agree.append(pair)
    if len(agree) != 1:
        return ()
    return tuple(name for i, name in enumerate(array.names) if i not in agree[0])


def settings_for(models: Sequence[SensorErrorModel], rate: float) -> FaultSettings:
    """Return settings by which biases that do as their models say are no faults.

    A fault must be able to show against that wander: samples are clipped no nearer than it needs.
    """
    usual = FaultSettings()
    span = usual.online.bias_time_constant or BIAS_MEMORY
    wander, clip = np.zeros(2), np.full(2, usual.online.clip)
    for model in models:
        drift, diffusion = model.drift[:, 0], model.diffusion[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            grown = diffusion * -np.expm1(2.0 * drift * span) / (-2.0 * drift)
        grown = np.where(drift == 0.0, diffusion * span, grown)
        for channel in range(6):
            own = float(np.sqrt(grown[model.channel == channel].sum()))
            sample = float(model.white_density[channel]) * np.sqrt(rate)
            wander[channel // 3] = max(wander[channel // 3], own)
            if sample > 0.0:
                clip[channel // 3] = max(clip[channel // 3], SHOWS * own / sample)
    return replace(
        usual,
        accel_wander=max(usual.accel_wander, float(wander[0])),
        gyro_wander=max(usual.gyro_wander, float(wander[1])),
        online=replace(usual.online, clip=min(float(clip[1]), LARGEST_CLIP)),
        accel_clip=min(float(clip[0]), LARGEST_CLIP),
    )


def _until(record: FaultRecord, end: float) -> float:
    return end if record.stop is None else min(record.stop, end)


def without_faults(array: ImuArray, absences: Sequence[Absence]) -> ImuArray:
    """Return an array in which the values of sensors that are out are missing."""
    gyro, accel = array.gyro.copy(), array.accel.copy()
    for a in absences:
        first, stop = np.searchsorted(array.time, [a.start, a.stop])
        # what never counts is left as it is: an array has no IMUs without values
        if stop - first < array.size:
            values = (accel, gyro)[a.kind].reshape(array.size, -1)
            values[first:stop, list(a.axes)] = np.nan
    return replace(array, gyro=gyro, accel=accel)


def _axes(sensors: SensorFaults, record: FaultRecord) -> list[int]:
    """Columns of the sensors that a record concerns."""
    of = sensors.followed.sensors
    if record.kind == "axis":
        return [of.names.index(record.name)]
    return np.flatnonzero(of.unit == of.unit_names.index(record.name)).tolist()


def _columns(array: ImuArray, sensors: SensorFaults, axes: list[int]) -> tuple[int, ...]:
    """Places of axes among all axes of the array."""
    names = [f"{name} {axis}" for name in array.names for axis in "xyz"]
    return tuple(names.index(sensors.followed.sensors.names[m]) for m in axes)


def _turning(gyro: SensorFaults | None) -> FloatArray | None:
    """What lever arms turn into specific force."""
    if gyro is None or not gyro.followed.sensors.spacing > 0.0:
        return None
    return turning_tensor(gyro.followed.sensors.time, gyro.followed.fused, causal=False)


def fault_onset(
    sensors: SensorFaults, axes: list[int], record: FaultRecord, turning: FloatArray | None
) -> float:
    """Return when a fault began: the likeliest start of a step or a ramp in what it was off by."""
    noticed = record.start
    first, last = np.searchsorted(
        sensors.followed.sensors.time, [noticed - LOOK_BACK, noticed + 1e-9]
    )
    usual = noticed - max(1.0, 2.0 * (record.time_constant or 0.5))
    off = _off(sensors, axes, slice(first, last), turning)
    time, block = sensors.followed.sensors.time[first:last], max(sensors.followed.block, 1)
    found = None if off is None else onset_of(off, time, block)
    return (usual if found is None else found) - MARGIN


def fault_size(
    sensors: SensorFaults,
    axes: list[int],
    record: FaultRecord,
    onset: float,
    turning: FloatArray | None,
) -> float | None:
    """Return what a sensor was off by while it was out, against what it was before."""
    time = sensors.followed.sensors.time
    stop = time[-1] if record.stop is None else record.stop
    # it was well for some time before it was let back in
    ends = [onset - LOOK_BACK, onset, record.start, min(record.start + SEEN, stop)]
    before, begin, first, last = (int(i) for i in np.searchsorted(time, ends))
    usual = _off(sensors, axes, slice(before, begin), turning)
    off = _off(sensors, axes, slice(first, last), turning)
    if off is None or usual is None or min(len(off), len(usual)) < 4:
        return None
    off = off - np.nanmedian(usual, axis=0)
    level, size = np.nanmedian(off, axis=0), np.sqrt(np.nanmean(off**2, axis=0))
    worst = int(np.argmax(np.nan_to_num(size)))
    # one that is stuck is off by what moves
    steady = abs(level[worst]) > 0.5 * size[worst]
    return float(level[worst] if steady else size[worst])


def _off(
    sensors: SensorFaults, axes: list[int], rows: slice, turning: FloatArray | None
) -> FloatArray | None:
    """What some axes are off by in some rows against those in use there."""
    followed = sensors.followed
    of, block = followed.sensors, max(followed.block, 1)
    if rows.stop <= rows.start:
        return None
    others = (followed.usage[rows.start // block : rows.stop // block + 1] == 0).all(axis=0)
    x = of.measurements[rows]
    if of.sensor == "accel" and turning is not None:
        x = x - turning[rows] @ arm_coefficients(of.axes, of.arms)
    return against_others(x, of.axes, axes, others, np.median(followed.variance, axis=0))


def against_others(
    measurements: FloatArray,
    axes: FloatArray,
    suspects: Sequence[int],
    others: BoolArray,
    variance: FloatArray,
) -> FloatArray | None:
    """What some axes are off by, (n, suspects), against others; None where these are too few."""
    others, those = others.copy(), list(suspects)
    others[those] = False
    if np.linalg.matrix_rank(axes[others], tol=0.3) < 3:
        return None
    fit = least_squares(axes[others], variance[others])
    return measurements[:, those] - (measurements[:, others] @ fit.pi.T) @ axes[those].T


def onset_of(off: FloatArray, time: FloatArray, block: int) -> float | None:
    """Likeliest start of a step or a ramp, s; None where it cannot be told."""
    count = len(off) // block
    if count < 4:
        return None
    begin = len(off) - count * block
    means = off[begin:].reshape(count, block, -1).mean(axis=1)
    start = _likeliest_start(means) if np.isfinite(means).all() else 0
    return float(time[begin + start * block]) if start > 0 else None


def _likeliest_start(means: FloatArray) -> int:
    """Block from which a step or a ramp explains most of the means (n, axes), each with a level."""
    n = len(means)
    index = np.arange(n)[:, None]
    since = index - np.arange(n)[None, :]
    shapes = [(since >= 0).astype(np.float64), np.maximum(since + 1, 0).astype(np.float64)]
    centred = means - means.mean(axis=0)
    explained = []
    for shape in shapes:
        level = shape - shape.mean(axis=0)
        power = np.sum(level**2, axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.sum((level.T @ centred) ** 2, axis=1) / power
        explained.append(np.where(power > 1e-9, gain, 0.0))
    best = np.max(explained, axis=0)
    return int(np.argmax(best))
