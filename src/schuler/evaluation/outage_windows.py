"""Outages: where they are laid, and solutions judged by the GNSS that was withheld there."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.data.exportable import Exportable
from schuler.data.to_dict import ToDict
from schuler.earth import metres_per_radian
from schuler.errors import InputError
from schuler.evaluation.floor import white_noise_floor
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.preparation.fixes import screen_fixes
from schuler.navigation.preparation.setup import RunSetup
from schuler.types import FloatArray

Window = tuple[float, float]

# chi-square of two degrees of freedom at the probability of 2 sigma, 0.9545
TWO_SIGMA = 6.180074306244168
# before the first window, the run needs this long to align and settle (s)
SETTLING = 60.0
# a solution with a longer step between samples has a break there (s)
LONGEST_STEP = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class OutageWindow(ToDict):
    """One outage, judged at every epoch that was withheld."""

    JSON = (
        "start_s duration_s max_m mean_m rms_m end_m claimed_sd_m end_claimed_sd_m "
        "white_noise_floor_m=floor_m within_2_sigma"
    )

    # start_s, duration_s: seconds after the first GNSS epoch, and length
    start_s: float
    duration_s: float
    # max_m, mean_m: horizontal error
    max_m: float
    mean_m: float
    # claimed horizontal standard deviation (root of the sum of both variances) where the error is
    # largest
    claimed_sd_m: float
    within_2_sigma: float  # share of epochs inside the 95.4 % ellipse of the claimed covariance
    time: FloatArray  # (k,): seconds after the first GNSS epoch
    error_ned: FloatArray  # (k, 3): solution minus GNSS at the antenna, m
    covariance: FloatArray  # (k, 2, 2): claimed, north and east, GNSS's own included, m²
    # (k,): what white noise alone does, see `white_noise_floor`, m; None: not asked for.
    floor: FloatArray | None = None

    @property
    def horizontal_m(self) -> FloatArray:
        """Horizontal error at every epoch, m."""
        return np.asarray(np.hypot(self.error_ned[:, 0], self.error_ned[:, 1]))

    @property
    def rms_m(self) -> float:
        """Root mean square of the horizontal error over the window, m."""
        return float(np.sqrt(np.mean(self.horizontal_m**2)))

    @property
    def end_m(self) -> float:
        """Horizontal error at the last withheld epoch, m."""
        return float(self.horizontal_m[-1])

    @property
    def end_claimed_sd_m(self) -> float:
        """Claimed horizontal standard deviation at the last withheld epoch, m."""
        return float(np.sqrt(np.trace(self.covariance[-1])))

    @property
    def floor_m(self) -> float | None:
        """White-noise floor at the last withheld epoch, m."""
        return None if self.floor is None else float(self.floor[-1])


@dataclass(frozen=True, slots=True, eq=False)
class OutageStatistics(Exportable):
    """All windows of one kind of solution.

    Parameters
    ----------
    windows : tuple of OutageWindow
        In order of time.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, evaluate_outages, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> found = evaluate_outages(imu, gnss, model, windows=((60.0, 10.0),), time_offset=0.0)
    >>> len(found.causal.windows)
    1
    """

    JSON = (
        "mean_of_max_m median_of_max_m worst_m mean_m rms_m end_rms_m claimed_over_real "
        "white_noise_floor_m=floor_m within_2_sigma windows"
    )

    windows: tuple[OutageWindow, ...]

    @property
    def mean_of_max_m(self) -> float:
        """Mean over the windows of the largest horizontal error, m."""
        return float(np.mean([w.max_m for w in self.windows]))

    @property
    def median_of_max_m(self) -> float:
        """Median over the windows of the largest horizontal error, m."""
        return float(np.median([w.max_m for w in self.windows]))

    @property
    def worst_m(self) -> float:
        """Largest horizontal error of all, m."""
        return float(max(w.max_m for w in self.windows))

    @property
    def mean_m(self) -> float:
        """Mean over the windows of the mean horizontal error, m."""
        return float(np.mean([w.mean_m for w in self.windows]))

    @property
    def within_2_sigma(self) -> float:
        """Share of all withheld epochs inside their claimed 95.4 % ellipse."""
        weights = [w.time.size for w in self.windows]
        return float(np.average([w.within_2_sigma for w in self.windows], weights=weights))

    def circular_error_m(self, share: float) -> float:
        """Radius that holds a share of all horizontal errors (CEP for one half), m."""
        return float(np.quantile(np.concatenate([w.horizontal_m for w in self.windows]), share))

    @property
    def rms_m(self) -> float:
        """Root mean square of all horizontal errors, m."""
        return float(np.sqrt(np.mean(np.concatenate([w.horizontal_m for w in self.windows]) ** 2)))

    @property
    def end_rms_m(self) -> float:
        """Root mean square over the windows of the error at their ends, m."""
        return float(np.sqrt(np.mean([w.end_m**2 for w in self.windows])))

    @property
    def claimed_over_real(self) -> float:
        """Claimed over real horizontal error at all epochs, both root mean squares."""
        claimed = np.concatenate([np.trace(w.covariance, axis1=1, axis2=2) for w in self.windows])
        real = self.rms_m
        return float(np.sqrt(claimed.mean())) / real if real > 0.0 else math.inf

    @property
    def floor_m(self) -> float | None:
        """Root mean square over the windows of their white-noise floors, m."""
        floors = [f for w in self.windows if (f := w.floor_m) is not None]
        return float(np.sqrt(np.mean(np.square(floors)))) if floors else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        radius = {f"cep{k}_m": self.circular_error_m(k / 100.0) for k in (50, 95)}
        return Exportable.to_dict(self) | radius


def sweep_windows(
    seconds: float, every: float, duration: float, settling: float = SETTLING
) -> tuple[Window, ...]:
    """Lay out windows systematically over a run."""
    if not (seconds > 0.0 and every > 0.0):
        raise InputError(f"sweep of {seconds:g} s every {every:g} s", expected="positive numbers")
    starts = np.arange(settling, duration - seconds - 5.0 + 1e-6, every)
    if not starts.size:
        raise InputError(
            f"no window of {seconds:g} s fits into a run of {duration:.0f} s",
            expected=f"at least {settling + seconds + 5.0:.0f} s of GNSS",
        )
    return tuple((float(s), float(seconds)) for s in starts)


def deal_windows(windows: Sequence[Window]) -> tuple[tuple[Window, ...], ...]:
    """Deal windows into runs so that GNSS is back between two windows of a run.

    Between two windows of one run there is at least as much GNSS as the first took away.
    """
    runs: list[list[Window]] = []
    for start, seconds in sorted(windows):
        for group in runs:
            before, length = group[-1]
            if start >= before + 2.0 * length - 1e-6:
                group.append((start, seconds))
                break
        else:
            runs.append([(start, seconds)])
    return tuple(tuple(r) for r in runs)


def judge_window(
    solution: NavigationSolution,
    gnss: GnssRecording,
    window: Window,
    *,
    lever_arm: FloatArray,
    time_offset: float,
    sd_factor: float,
    white_density: FloatArray | None = None,
    lasting: GnssErrorModel | None = None,
) -> OutageWindow:
    """Compare a solution with the GNSS positions of one window.

    Parameters
    ----------
    solution : NavigationSolution
        That went without GNSS through the window.
    gnss : GnssRecording
        What was withheld; its own standard deviations count.
    window : (start, seconds)
        After the first epoch of `gnss`, s.
    lever_arm : (3,) ndarray
        Of the antenna in the body, m.
    time_offset : float
        Of GNSS, s.
    sd_factor : float
        On the standard deviations of GNSS.
    white_density : (6,) ndarray, optional
        Of accelerometers and gyros in the filter; gives the floor of white noise.
    lasting : GnssErrorModel, optional
        Errors of GNSS that last, as the filter had them: withheld fixes hold them too, and are
        compared with position and error together. Where the solution tells nothing of them,
        with position alone.

    Returns
    -------
    OutageWindow
        Errors and claimed standard deviations, m.

    Raises
    ------
    InputError
        No epoch inside the window.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> ride = schuler.motorcycle(120.0)
    >>> gyro = schuler.WhiteNoise(1e-3) + schuler.GaussMarkov(1e-3, 100.0)
    >>> accel = schuler.WhiteNoise(1e-2) + schuler.GaussMarkov(0.02, 100.0)
    >>> noise, place = schuler.NoiseModel.isotropic(gyro, accel), schuler.Mounting.aligned(2)
    >>> rng = np.random.default_rng(0)
    >>> two = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(two, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.05, velocity_sd=0.03, rng=rng)
    >>> found = schuler.navigate_array(
    ...     array, gnss, noise, outages=[(100.0, 5.0)], time_offset=0.0
    ... )
    >>> judged = schuler.judge_window(
    ...     found.solution, gnss, (100.0, 5.0), lever_arm=np.zeros(3), time_offset=0.0,
    ...     sd_factor=1.0,
    ... )
    >>> judged.max_m < 50.0
    True
    """
    start, seconds = window
    since = gnss.time - gnss.time[0]
    path = solution.trajectory
    stamp = gnss.time + time_offset
    inside = (since >= start - 1e-6) & (since < start + seconds - 1e-6)
    inside &= (stamp >= path.time[0]) & (stamp <= path.time[-1])
    # a fix that fits none of its neighbours is no truth, and where nothing was solved nothing is
    # judged
    inside &= ~screen_fixes(gnss).wrong
    behind = np.clip(np.searchsorted(path.time, stamp), 1, path.size - 1)
    inside &= path.time[behind] - path.time[behind - 1] < LONGEST_STEP
    if not inside.any():
        raise InputError(
            f"no GNSS epoch to compare with in the outage {start:g}:{seconds:g}",
            expected=f"a window inside 0 .. {since[-1]:.0f} s",
        )
    truth, time = gnss.position[inside], stamp[inside]
    found = np.column_stack([np.interp(time, path.time, path.position[:, i]) for i in range(3)])
    near = np.clip(np.searchsorted(path.time, time), 0, path.size - 1)
    arm = path.rotation[near] @ lever_arm
    north, east = metres_per_radian(truth)
    error = arm + np.column_stack(
        [
            (found[:, 0] - truth[:, 0]) * north,
            (found[:, 1] - truth[:, 1]) * east,
            truth[:, 2] - found[:, 2],
        ]
    )
    assert gnss.position_sd is not None
    own = gnss.position_sd[inside, :2] * sd_factor
    claimed = solution.position_covariance[near][:, :2, :2].copy()
    if lasting is not None and solution.gnss_error_covariance is not None:
        slow, shared = _lasting_errors(solution, lasting, time, own)
        error[:, :2] += slow
        claimed += shared
        own = own * np.sqrt(lasting.white)
    claimed[:, [0, 1], [0, 1]] += own**2
    distance = np.einsum(
        "ki,ki->k", error[:, :2], np.linalg.solve(claimed, error[:, :2, None])[:, :, 0]
    )
    horizontal = np.linalg.norm(error[:, :2], axis=1)
    worst = int(np.argmax(horizontal))
    return OutageWindow(
        start_s=start,
        duration_s=seconds,
        max_m=float(horizontal[worst]),
        mean_m=float(horizontal.mean()),
        claimed_sd_m=float(np.sqrt(np.trace(claimed[worst]))),
        within_2_sigma=float(np.mean(distance <= TWO_SIGMA)),
        time=since[inside],
        error_ned=error,
        covariance=claimed,
        floor=None
        if white_density is None
        else white_noise_floor(
            white_density,
            path.rotation[near[0]],
            since[inside] - start,
            latitude=float(truth[0, 0]),
        ),
    )


def _lasting_errors(
    solution: NavigationSolution, lasting: GnssErrorModel, time: FloatArray, sd: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Errors of fixes that a solution knew of (k, 2), and what they add to its covariance.

    sd (k, 2): claimed of the fixes. A state of the filter is off by true minus estimated.
    """
    at = solution.sensor_error_time
    node = np.clip(np.searchsorted(at, time, side="right") - 1, 0, at.size - 1)
    states = slice(lasting.place, lasting.place + 2)
    scale = sd * np.sqrt(lasting.slow)
    assert solution.gnss_error_covariance is not None
    with_position = solution.gnss_error_covariance[node, :2, :2] * scale[:, None, :]
    added = -with_position - with_position.transpose(0, 2, 1)
    own = scale * solution.sensor_errors_sd[node, states]
    added[:, [0, 1], [0, 1]] += own**2
    return scale * solution.sensor_errors[node, states], added


def judge_run(
    solution: NavigationSolution, gnss: GnssRecording, setup: RunSetup, windows: Iterable[Window]
) -> tuple[OutageWindow, ...]:
    """Judge a solution in several windows, with receiver and IMU as its run has found them."""
    slow = setup.measurements.correlated
    return tuple(
        judge_window(
            solution,
            gnss,
            window,
            lever_arm=setup.lever_arm,
            time_offset=setup.offsets.position,
            sd_factor=setup.factors.position_sd,
            white_density=setup.model.white_density,
            lasting=slow if isinstance(slow, GnssErrorModel) else None,
        )
        for window in windows
    )


def in_order(windows: Iterable[OutageWindow]) -> OutageStatistics:
    """Statistics of windows, in order of time."""
    return OutageStatistics(tuple(sorted(windows, key=lambda w: (w.start_s, w.duration_s))))


def asked_windows(
    windows: Sequence[Window], sweep: Window | None, gnss: GnssRecording, imu: ImuRecording
) -> Sequence[Window]:
    """Return the windows that were given, or those of a sweep, all inside a recording."""
    if sweep is not None:
        windows = _seen(sweep_windows(sweep[0], sweep[1], gnss.duration), gnss, imu)
    if not windows:
        raise InputError("no outage was asked for", cure="give windows or a sweep")
    for start, seconds in windows:
        if start < 0.0 or seconds <= 0.0 or start + seconds > gnss.duration:
            raise InputError(
                f"outage {start:g}:{seconds:g} reaches outside the run",
                expected=f"START:SECONDS inside 0 .. {gnss.duration:.0f} s after the first fix",
            )
    return windows


def _seen(windows: Sequence[Window], gnss: GnssRecording, imu: ImuRecording) -> Sequence[Window]:
    """Return the windows of a sweep that can be judged; those without fixes or IMU are said."""
    behind = np.clip(np.searchsorted(imu.time, gnss.time), 1, imu.size - 1)
    # clocks may differ by as much as the longest step
    near = [imu.time[np.clip(behind + k, 0, imu.size - 1)] for k in (-1, 0)]
    good = (gnss.time - near[0] < LONGEST_STEP) & (near[1] - gnss.time < LONGEST_STEP)
    time = gnss.time[good & ~screen_fixes(gnss).wrong] - gnss.time[0]
    edges = np.array([(start, start + seconds) for start, seconds in windows]) - 1e-6
    held = np.diff(np.searchsorted(time, edges))[:, 0] > 0
    if not held.any():
        raise InputError("no window of the sweep can be judged", expected="fixes and IMU in one")
    empty = [w for w, there in zip(windows, held, strict=True) if not there]
    if empty:
        told = ", ".join(f"{start:g}:{seconds:g}" for start, seconds in empty)
        warnings.warn(f"left out of the sweep, without fixes or IMU there: {told}", stacklevel=3)
    return [w for w, there in zip(windows, held, strict=True) if there]
