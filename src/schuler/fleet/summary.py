"""What a database says of a fleet: pooled values, sensors that differ, trends, the worst first.

Noise coefficients differ by factors, so everything is done with their logarithms.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, TypeVar

import numpy as np
from scipy import stats

from schuler.data.to_dict import ToDict
from schuler.errors import InputError
from schuler.fleet.database import FleetDatabase, Measurement
from schuler.types import FloatArray

LEVEL = 0.01
"""Probability that a fleet without outliers or trends is told of one, of all its parameters."""
FEWEST_UNITS, FEWEST_LOGS = 5, 4
"""Sensors from which one can stand out, and logs of one sensor that make a trend."""
_YEAR = 365.25 * 86400.0


T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class FleetParameter(ToDict):
    """One coefficient of one axis over all sensors of a kind.

    Parameters
    ----------
    sensor, axis, name : str
        Kind of sensor, channel, coefficient of IEEE Std 952.
    units, logs, unseen : int
        Sensors and logs in which it was found, and logs that hold only an upper limit.
    value, standard_error : float
        Of the fleet, SI: the exponential of the weighted mean of logarithms.
    spread : float
        Relative standard deviation from sensor to sensor beyond the errors of the logs.
    p_value : float
        Of the hypothesis that all sensors share one value (Cochran's Q); NaN with one sensor.
    """

    sensor: str
    axis: str
    name: str
    units: int
    logs: int
    unseen: int
    value: float
    standard_error: float
    spread: float
    p_value: float

    @property
    def shared(self) -> bool:
        """Whether one value describes all sensors."""
        return not self.p_value < LEVEL


@dataclass(frozen=True, slots=True)
class Outlier(ToDict):
    """A sensor whose coefficient stands out: how many times the fleet's, and how surely."""

    sensor: str
    serial: str
    axis: str
    name: str
    ratio: float
    p_value: float


@dataclass(frozen=True, slots=True)
class Trend(ToDict):
    """A coefficient that changes: relative change per year of one sensor, or per kelvin of a kind.

    Parameters
    ----------
    sensor, serial, axis, name : str
        Which; no serial number where all sensors of the kind were taken together.
    per : str
        "year" or "K".
    slope, standard_error : float
        Of the logarithm.
    p_value : float
        Of no trend.
    """

    sensor: str
    serial: str
    axis: str
    name: str
    per: str
    slope: float
    standard_error: float
    p_value: float


@dataclass(frozen=True, slots=True)
class FleetSummary(ToDict):
    """What is known of a fleet.

    Parameters
    ----------
    parameters : tuple of FleetParameter
        Of every kind of sensor and axis.
    outliers, trends : tuple
        Those beyond chance (1 % for the whole fleet), the surest first; trends with time less
        what the kind of sensor shows of temperature.
    worst : tuple of (str, str, float)
        Kind, serial number and how many times the white noise of the fleet, the worst first.
    drives : tuple of dict
        Figures of every drive, the worst first.
    failures : tuple of (str, str)
        File and reason.
    logs : int
        All logs of the database.
    """

    parameters: tuple[FleetParameter, ...]
    outliers: tuple[Outlier, ...]
    trends: tuple[Trend, ...]
    worst: tuple[tuple[str, str, float], ...]
    drives: tuple[dict[str, Any], ...]
    failures: tuple[tuple[str, str], ...]
    logs: int


def summarise_fleet(database: FleetDatabase) -> FleetSummary:
    """Say what the logs of a database have in common and which sensors differ.

    Parameters
    ----------
    database : FleetDatabase
        With at least one log.

    Returns
    -------
    FleetSummary
        Pooled values, outliers, trends, drives and failures.

    Raises
    ------
    InputError
        An empty database.

    Notes
    -----
    The spread between sensors is that of Paule and Mandel (1982), outliers those of Rosner's
    generalised extreme deviates (1983), all tests with Bonferroni's correction.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler.fleet import FleetDatabase, LogEntry, run_batch, summarise_fleet
    >>> with FleetDatabase(Path(tempfile.mkdtemp()) / "fleet.sqlite") as fleet:
    ...     _ = run_batch([LogEntry(Path("nowhere.csv"))], fleet)
    ...     summarise_fleet(fleet).logs
    1
    """
    logs = database.logs()
    if not logs:
        raise InputError("the database holds no logs", where=str(database.path))
    measured = database.measurements()
    groups: dict[tuple[str, str, str], list[Measurement]] = defaultdict(list)
    for one in measured:
        if one.kind == "noise":
            groups[one.sensor, one.axis, one.name].append(one)
    seen = {k: [m for m in g if _usable(m)] for k, g in groups.items()}
    units = {k: _by_unit(g) for k, g in seen.items() if g}
    parameters = [
        _pooled(k, of, len(seen[k]), len(groups[k]) - len(seen[k])) for k, of in units.items()
    ]
    return FleetSummary(
        tuple(parameters),
        _outliers(units),
        _trends(seen),
        _worst(units),
        _drives(measured),
        tuple((str(r["file"]), str(r["message"])) for r in logs if r["status"] == "failed"),
        len(logs),
    )


def _usable(one: Measurement) -> bool:
    return bool(
        one.value and one.value > 0.0 and one.standard_error and math.isfinite(one.standard_error)
    )


def _logarithms(group: Iterable[Measurement]) -> tuple[FloatArray, FloatArray]:
    """Return logarithms and their standard errors."""
    values = np.array([m.value for m in group], dtype=np.float64)
    errors = np.array([m.standard_error for m in group], dtype=np.float64)
    return np.log(values), errors / values


def paule_mandel(value: FloatArray, error: FloatArray) -> tuple[float, float, float, float]:
    """Return mean, its standard error, the spread beyond the errors, and p of no spread."""
    if value.size == 1:
        return float(value[0]), float(error[0]), 0.0, math.nan

    def weighted(spread: float) -> tuple[float, float, float]:
        weight = 1.0 / (error**2 + spread**2)
        mean = float(np.sum(weight * value) / weight.sum())
        return mean, float(weight.sum()), float(np.sum(weight * (value - mean) ** 2))

    _, _, q = weighted(0.0)
    low, high = 0.0, float(np.ptp(value)) + 1e-300
    if q > value.size - 1:
        for _ in range(30):  # to a billionth of the range
            middle = 0.5 * (low + high)
            low, high = (middle, high) if weighted(middle)[2] > value.size - 1 else (low, middle)
    mean, total, _ = weighted(low)
    return mean, total**-0.5, low, float(stats.chi2.sf(q, value.size - 1))


def _by_unit(group: Sequence[Measurement]) -> dict[str, tuple[float, float]]:
    """Return the mean logarithm of each sensor and its standard error."""
    logs: dict[str, list[Measurement]] = defaultdict(list)
    for one in group:
        logs[one.serial].append(one)
    return {serial: paule_mandel(*_logarithms(some))[:2] for serial, some in logs.items()}


def _pooled(
    key: tuple[str, str, str], of_unit: Mapping[str, tuple[float, float]], logs: int, unseen: int
) -> FleetParameter:
    of_units = np.array(list(of_unit.values()))
    mean, error, spread, p = paule_mandel(of_units[:, 0], of_units[:, 1])
    value = math.exp(mean)
    count = len(of_units)
    return FleetParameter(*key, count, logs, unseen, value, value * error, spread, p)


def _outliers(
    units: Mapping[tuple[str, str, str], Mapping[str, tuple[float, float]]],
) -> tuple[Outlier, ...]:
    judged = {k: u for k, u in units.items() if len(u) >= FEWEST_UNITS}
    found = []
    for (sensor, axis, name), of_unit in judged.items():
        value, error = np.array(list(of_unit.values())).T
        middle = float(np.median(value))
        serials = list(of_unit)
        found += [
            Outlier(sensor, serials[k], axis, name, math.exp(value[k] - middle), p)
            for k, p in extreme_deviates(value, error, LEVEL / len(judged))
        ]
    return tuple(sorted(found, key=lambda o: o.p_value))


def extreme_deviates(value: FloatArray, error: FloatArray, level: float) -> list[tuple[int, float]]:
    """Return which values stand out, each with its probability (Rosner 1983, up to a third).

    The scatter of the rest is never taken to be less than the errors say.
    """
    left = list(range(value.size))
    removed: list[tuple[int, float]] = []
    last = 0
    for _ in range(value.size // 3):
        n = len(left)
        rest = value[left]
        away = np.abs(rest - rest.mean())
        k = int(np.argmax(away))
        deviation = max(float(rest.std(ddof=1)), float(np.sqrt(np.mean(error[left] ** 2))))
        ratio = min(away[k] / deviation, (n - 1) / math.sqrt(n) * (1.0 - 1e-12))
        t = ratio * math.sqrt(n * (n - 2) / ((n - 1) ** 2 - n * ratio**2))
        p = float(min(1.0, 2.0 * n * stats.t.sf(t, n - 2)))
        removed.append((left.pop(k), p))
        last = len(removed) if p < level else last
    return removed[:last]


def _trends(groups: Mapping[tuple[str, str, str], Sequence[Measurement]]) -> tuple[Trend, ...]:
    candidates = []
    for (sensor, axis, name), group in groups.items():
        warm = [m for m in group if m.temperature is not None]
        candidates.append(
            (sensor, "", axis, name, "K", warm, [float(m.temperature or 0.0) for m in warm])
        )
        dated = [(m, _seconds(m.date)) for m in _at_one_temperature(group, warm)]
        for serial, known in _by_serial(dated, lambda d: d[0].serial).items():
            own = [(m, s) for m, s in known if s is not None]
            candidates.append(
                (sensor, serial, axis, name, "year", [m for m, _ in own],
                 [s / _YEAR for _, s in own])
            )  # fmt: skip
    fits = [(c, _slope(c[5], c[6])) for c in candidates]
    fitted = [(c, f) for c, f in fits if f is not None]
    found = [
        Trend(*c[:5], *f) for c, f in fitted if f[2] * len(fitted) < LEVEL
    ]  # fmt: skip
    return tuple(sorted(found, key=lambda t: t.p_value))


def _at_one_temperature(
    group: Sequence[Measurement], warm: Sequence[Measurement]
) -> Sequence[Measurement]:
    """Take off what the kind of sensor shows of temperature: a warm summer is no ageing."""
    fit = _slope(warm, [float(m.temperature or 0.0) for m in warm])
    if fit is None or fit[2] > LEVEL:
        return group
    each = [
        _slope(own, [float(m.temperature or 0.0) for m in own])
        for own in _by_serial(warm, lambda m: m.serial).values()
    ]
    # the median of the sensors: one that ages in a warming room does not bend it
    slope = float(np.median([f[0] for f in each if f is not None] or [fit[0]]))
    middle = float(np.mean([float(m.temperature or 0.0) for m in warm]))
    out = []
    for one in group:
        if one.temperature is not None:  # where it is not known, nobody can tell the two apart
            factor = math.exp(-slope * (one.temperature - middle))
            error = None if one.standard_error is None else one.standard_error * factor
            one = replace(one, value=(one.value or 0.0) * factor, standard_error=error)
        out.append(one)
    return out


def _by_serial(items: Iterable[T], serial: Callable[[T], str]) -> dict[str, list[T]]:
    out: dict[str, list[T]] = defaultdict(list)
    for one in items:
        out[serial(one)].append(one)
    return out


def _slope(group: Sequence[Measurement], at: Sequence[float]) -> tuple[float, float, float] | None:
    """Return slope, its standard error and p over logs; each sensor has a level of its own."""
    serials, which = np.unique([m.serial for m in group], return_inverse=True)
    freedom = len(group) - len(serials) - 1
    if len(group) < FEWEST_LOGS or freedom < 2:
        return None
    value, error = _logarithms(group)
    x = np.array(at)
    weight = 1.0 / error**2
    of_all = np.bincount(which, weight)
    x -= (np.bincount(which, weight * x) / of_all)[which]
    value -= (np.bincount(which, weight * value) / of_all)[which]
    total = float(np.sum(weight * x**2))
    if not total > 0.0:
        return None
    slope = float(np.sum(weight * x * value) / total)
    left = float(np.sum(weight * (value - slope * x) ** 2)) / freedom
    deviation = math.sqrt(max(left, 1.0) / total)
    return slope, deviation, float(2.0 * stats.t.sf(abs(slope) / deviation, freedom))


def _seconds(date: str) -> float | None:
    try:
        found = datetime.fromisoformat(date)
    except ValueError:
        return None
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def _worst(
    units: Mapping[tuple[str, str, str], Mapping[str, tuple[float, float]]],
) -> tuple[tuple[str, str, float], ...]:
    away: dict[tuple[str, str], list[float]] = defaultdict(list)
    for (sensor, _, name), of_unit in units.items():
        if name == "N":
            middle = float(np.median([v for v, _ in of_unit.values()]))
            for serial, (value, _) in of_unit.items():
                away[sensor, serial].append(value - middle)
    ranked = [(s, u, math.exp(max(a))) for (s, u), a in away.items()]
    return tuple(sorted(ranked, key=lambda r: -r[2]))


def _drives(measured: Sequence[Measurement]) -> tuple[dict[str, Any], ...]:
    rows: dict[str, dict[str, Any]] = {}
    for one in measured:
        if one.kind == "drive":
            known = {"file": one.file, "sensor": one.sensor, "serial": one.serial}
            row = rows.setdefault(one.file, known | {"date": one.date})
            row[f"{one.axis} {one.name}"] = one.value
    return tuple(sorted(rows.values(), key=lambda r: -(r.get("causal mean of maxima") or 0.0)))
