"""Look at a recording before anything is computed from it: report, and repair when asked.

`screen` only looks. `repair` returns a new recording whose history says what was done; it never
makes up a sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.screening import clocks, motion, stuck, values
from schuler.screening.finding import Finding

__all__ = [
    "Finding",
    "Screening",
    "clean_segments",
    "longest_rest",
    "repair",
    "repair_until_clean",
    "screen",
]

_SHOWN = 5  # intervals named in a message


@dataclass(frozen=True, slots=True, eq=False)
class Screening(Exportable):
    """What was seen in a recording.

    Parameters
    ----------
    name : str
        Name of the recording.
    size : int
        Number of samples.
    duration : float
        Seconds.
    rate : float
        Samples a second, gaps left out.
    jitter : float
        Standard deviation of the time steps, gaps left out, s.
    static : bool
        True when the sensor stood still throughout.
    findings : tuple of Finding
        Errors first, then warnings, then what is good to know.
    repeated : (n,) ndarray of bool
        Rows that repeat the row before.
    disturbed : tuple of (int, int)
        First row and row behind the last of each knock or outlier of a static recording.
    gaps : tuple of int
        Rows before which samples are missing.
    rest : tuple of (float, float)
        Intervals in which the sensor stood still, s.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, screen, simulate_static
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> round(screen(simulate_static(model, 60.0, 100.0, np.random.default_rng(1))).rate, 3)
    100.0
    """

    JSON = (
        "name samples=size duration_s=duration rate_hz=rate jitter_s=jitter static "
        "disturbed_rows=disturbed rest_s=rest findings"
    )

    TABLE = "findings"

    name: str
    size: int
    duration: float
    rate: float
    jitter: float
    static: bool
    findings: tuple[Finding, ...]
    repeated: NDArray[np.bool_]
    disturbed: tuple[tuple[int, int], ...] = ()
    gaps: tuple[int, ...] = ()
    rest: tuple[tuple[float, float], ...] = field(default=())

    @property
    def lines(self) -> tuple[str, ...]:
        """Findings in plain words, one a line."""
        return tuple(f"{f.severity}: {f.message}" for f in self.findings)

    def of_kind(self, kind: str) -> tuple[Finding, ...]:
        """Return the findings of one kind.

        Parameters
        ----------
        kind : str
            See `Finding`.

        Returns
        -------
        tuple of Finding
            Perhaps empty.
        """
        return tuple(f for f in self.findings if f.kind == kind)

    def require_usable(self) -> None:
        """Raise the first finding that is an error.

        Raises
        ------
        InputError
            A stuck axis, or whatever else makes results wrong.
        """
        for finding in self.findings:
            if finding.severity == "error":
                raise InputError(finding.message, where=self.name)

    def repaired(self, imu: ImuRecording, *, close_up: bool = False) -> ImuRecording:
        """Return `repair` of the recording this screening belongs to."""
        return repair(imu, self, close_up=close_up)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        counts = {"repeated_rows": int(self.repeated.sum()), "gaps": len(self.gaps)}
        return Exportable.to_dict(self) | counts


def screen(imu: ImuRecording) -> Screening:
    """Look at a recording and report what a careful engineer would want to know.

    Parameters
    ----------
    imu : ImuRecording
        Any recording; channels that were not recorded are left out.

    Returns
    -------
    Screening
        Rate, jitter, gaps, repeated rows, stuck axes, bursts of noise in one axis, noise that
        changes for good, saturation, knocks and outliers (of static recordings, where motion
        cannot be the cause), units suspected to be wrong, the gravity axis, the steps of
        quantisation, and times of rest.

    Notes
    -----
    Knocks: a sample is disturbed when it is further than 8 robust standard deviations (1.4826 times
    the median absolute deviation) from the median of its 10 s block. A channel in which more
    than 0.5 % of the samples are beyond 4 of them has heavy tails; its own outliers are then its
    noise and no knocks.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, screen, simulate_static
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> imu = simulate_static(model, 60.0, 100.0, np.random.default_rng(1))
    >>> screen(imu).static
    True
    """
    steps = clocks.look_at_steps(imu)
    repeated = clocks.repeated_rows(imu)
    still = motion.look_at_rest(imu, steps.rate)
    disturbed, disturbances = motion.look_for_knocks(imu, steps.rate, still)
    findings = [
        *steps.findings,
        *clocks.findings_on_rows(imu, repeated),
        *values.stuck_axes(imu),
        *stuck.findings_on_stuck(imu, stuck.stuck_intervals(imu)),
        *stuck.findings_on_bursts(imu),
        *(stuck.findings_on_levels(imu) if still.static else ()),
        *values.saturation(imu),
        *disturbances,
        *values.suspected_units(imu, still),
        *values.gravity(imu, still),
        *values.grids(imu),
        *still.findings,
    ]
    # heavy tails of a channel whose noise changes are that change
    changed = {c for f in findings if f.kind == "noise level" for c in f.channels}
    findings = [f for f in findings if f.kind != "heavy tails" or not changed & set(f.channels)]
    order = {"error": 0, "warning": 1, "info": 2}
    return Screening(
        name=imu.name,
        size=imu.size,
        duration=imu.duration,
        rate=steps.rate,
        jitter=steps.jitter,
        static=still.static,
        findings=tuple(sorted(findings, key=lambda f: order[f.severity])),
        repeated=repeated,
        disturbed=disturbed,
        gaps=steps.gaps,
        rest=still.rest,
    )


def repair(imu: ImuRecording, screening: Screening, *, close_up: bool = False) -> ImuRecording:
    """Return the recording without repeated rows and, if asked, without knocks.

    Parameters
    ----------
    imu : ImuRecording
        The recording that was screened.
    screening : Screening
        What was seen in it.
    close_up : bool
        Cut out the disturbed samples and move what follows forward in time, so that the series
        stays evenly spaced. Right for the noise of a static recording, where the time of day does
        not matter; wrong for navigation, which needs every sample at its time. False: the
        disturbed samples stay.

    Returns
    -------
    ImuRecording
        A new recording with a line of history for each repair; the same one when there was
        nothing to do. Of a run of repeated rows the first is kept; no sample is made up.

    Raises
    ------
    InputError
        The screening belongs to another recording, or nothing would be left.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, repair, screen, simulate_static
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> imu = simulate_static(model, 60.0, 100.0, np.random.default_rng(1))
    >>> repair(imu, screen(imu)).size == imu.size
    True
    """
    if screening.repeated.size != imu.size:
        raise InputError(
            f"the screening is of {screening.repeated.size} samples, the recording has {imu.size}",
            expected="the screening of this recording",
        )
    keep = ~screening.repeated
    history = list(imu.history)
    if screening.repeated.any():
        share = 100.0 * float(screening.repeated.mean())
        history.append(
            f"left out {int(screening.repeated.sum())} rows ({share:.1f} %) that repeat the row "
            "before (averaging neighbours would be the other choice)"
        )
    time = np.array(imu.time)
    if close_up and screening.disturbed:
        step = 1.0 / screening.rate
        cut = 0
        for first, stop in screening.disturbed:
            keep[first:stop] = False
            cut += stop - first
            if first > 0 and stop < imu.size:
                time[stop:] -= time[stop] - (time[first - 1] + step)
        history.append(
            f"cut out {cut} samples around {len(screening.disturbed)} knocks or outliers "
            f"(at {_times(imu, screening.disturbed)}) and closed up time"
        )
    if len(history) == len(imu.history):
        return imu
    if int(keep.sum()) < 2:
        raise InputError(f"nothing would be left of '{imu.name}'", cure="check the recording")
    return replace(
        imu,
        time=time[keep],
        gyro=imu.gyro[keep],
        accel=imu.accel[keep],
        temperature=None if imu.temperature is None else imu.temperature[keep],
        history=tuple(history),
    )


def repair_until_clean(imu: ImuRecording, screening: Screening, rounds: int = 5) -> ImuRecording:
    """Repair and look again until nothing new is found: a knock may hide another."""
    for _ in range(rounds):
        mended = repair(imu, screening, close_up=True)
        if mended is imu:
            break
        imu = mended
        screening = screen(imu)
        if not screening.disturbed and not screening.repeated.any():
            break
    return imu


def longest_rest(imu: ImuRecording, screening: Screening) -> ImuRecording:
    """Return the longest stretch in which the sensor stood still."""
    if not screening.rest:
        raise InputError(f"'{imu.name}' never stands still", expected="a log of a sensor at rest")
    start, stop = max(screening.rest, key=lambda r: r[1] - r[0])
    first, last = np.searchsorted(imu.time, [start, stop])
    part = slice(int(first), max(int(last), int(first) + 2))
    return replace(
        imu,
        time=imu.time[part],
        gyro=imu.gyro[part],
        accel=imu.accel[part],
        temperature=None if imu.temperature is None else imu.temperature[part],
        history=(*imu.history, f"the longest rest, {start:.1f} to {stop:.1f} s"),
    )


def clean_segments(
    imu: ImuRecording, screening: Screening, shortest: float = 1.0
) -> tuple[ImuRecording, ...]:
    """Return the pieces between knocks, outliers and gaps.

    Parameters
    ----------
    imu : ImuRecording
        The recording that was screened.
    screening : Screening
        What was seen in it.
    shortest : float
        Pieces shorter than this many seconds are left out.

    Returns
    -------
    tuple of ImuRecording
        Longest first, each with a line of history.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import clean_segments, screen, simulate_static
    >>> imu = simulate_static(None, 60.0, 100.0, np.random.default_rng(1))
    >>> len(clean_segments(imu, screen(imu)))
    1
    """
    edges = [(0, 0), *((g, g) for g in screening.gaps), *screening.disturbed, (imu.size, imu.size)]
    edges.sort()
    pieces = []
    start = 0
    for stop, behind in edges:
        start, begin = max(start, behind), start
        if stop - begin < 2 or imu.time[stop - 1] - imu.time[begin] < shortest:
            continue
        part = slice(begin, stop)
        pieces.append(
            replace(
                imu,
                time=imu.time[part],
                gyro=imu.gyro[part],
                accel=imu.accel[part],
                temperature=None if imu.temperature is None else imu.temperature[part],
                history=(*imu.history, f"clean piece, rows {begin} to {stop - 1}"),
            )
        )
    return tuple(sorted(pieces, key=lambda p: -p.duration))


def _times(imu: ImuRecording, rows: tuple[tuple[int, int], ...]) -> str:
    text = ", ".join(f"{imu.time[a]:.2f}" for a, _ in rows[:_SHOWN])
    return text + (", ... s" if len(rows) > _SHOWN else " s")


def first_look(imu: ImuRecording) -> tuple[Finding, ...]:
    """Return what values alone tell: axes that never change, units that cannot be."""
    still = motion.look_at_rest(imu, imu.rate)
    return (*values.stuck_axes(imu), *values.suspected_units(imu, still))
