"""How much of a receiver's claimed deviation is white, how much lasts, and for how long.

Errors of GNSS positions are hardly ever white: multipath, orbits and ambiguities held a little
wrong last for a minute. A filter that takes them for white averages them away and claims far too
little. The claim is split (`GnssErrorModel`), and the innovations of the drive at the full rate of
GNSS decide by how much: on the white share, on the slow one, which may be raised above what the
claim leaves and never lowered, as innovations hardly see it, on its correlation time, and on the
deviations of velocity. What they do not tell stays at the prior.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.earth import ned_from_geodetic
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.aiding.standstill import REST_INTERVAL, detect_standstill
from schuler.navigation.innovation_likelihood import slower_imu
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.preparation.standing import BEGINS_ANEW
from schuler.navigation.tuning.likelihood import EDGE, enough_to_tune
from schuler.navigation.tuning.linear_drive import DriveLikelihood
from schuler.navigation.tuning.vibration import level_at, vibration_level
from schuler.screening.screen import Finding
from schuler.types import BoolArray, FloatArray

SHORTEST_STAND = 8.0
"""Seconds of a stand that is looked at."""
STAND_EDGE = 0.5
"""Seconds of its ends that are left out."""
STILL = 0.1
"""Median speed of GNSS, m/s, above which a vehicle creeps."""
SURE_STAND = 0.999
"""Probability that errors as small as supposed would have wandered less."""


@dataclass(frozen=True, slots=True, eq=False)
class Wander:
    """Of every stand: seconds (k,), how far fixes went north and east (k, 2), claimed sd (k, 2)."""

    seconds: FloatArray
    way: FloatArray
    sd: FloatArray

    def least_slow(self, white: float, time: float, most: float, sure: float = SURE_STAND) -> float:
        """Least lasting share of the claimed variance that the stands allow, up to a limit."""
        from scipy.stats import chi2

        if not self.seconds.size:
            return 0.0
        square = self.way**2 / (2.0 * self.sd**2)
        gone = 1.0 - np.exp(-self.seconds[:, None] / time)
        limit = float(chi2.ppf(sure, square.size))
        for slow in (0.0, *np.geomspace(0.01, most, 100).tolist()):
            if float(np.sum(square / (white + slow * gone))) <= limit:
                return float(slow)
        return most


def wander_at_stands(imu: ImuRecording, gnss: GnssRecording, offset: float) -> Wander:
    """Look at all stands; `offset`: of GNSS, s. None without velocities, which tell creeping."""
    found = []
    rest = detect_standstill(imu).time
    if gnss.velocity is not None and rest.size:
        assert gnss.position_sd is not None
        time = gnss.time + offset
        local = ned_from_geodetic(gnss.position, gnss.position[0])[:, :2]
        for stand in np.split(rest, np.flatnonzero(np.diff(rest) > BEGINS_ANEW) + 1):
            i, j = np.searchsorted(time, [stand[0] + STAND_EDGE, stand[-1] - STAND_EDGE])
            j -= 1
            if j <= i or time[j] - time[i] < SHORTEST_STAND:
                continue
            speed = gnss.velocity[i : j + 1, :2]
            if np.median(np.linalg.norm(speed, axis=1)) > STILL:
                continue
            way = local[j] - local[i]
            # what creeping may have done of it is not the receiver's
            crept = np.diff(time[i : j + 1]) @ (0.5 * (speed[1:] + speed[:-1]))
            way = np.where(np.abs(way - crept) < np.abs(way), way - crept, way)
            found.append([time[j] - time[i], *way, *gnss.position_sd[[i, j], :2].max(axis=0)])
    table = np.array(found).reshape(-1, 5)
    table = table[np.isfinite(table).all(axis=1)]
    return Wander(table[:, 0], table[:, 1:3], table[:, 3:])


WHITE, SLOW, TIME, VELOCITY = "gnss white", "gnss slow", "gnss time", "gnss velocity"
USUAL_TIME = 60.0
"""Correlation time of the prior, s."""
LONGEST_TIME = 300.0
LEAST_WHITE = 0.04
"""Share of the claimed variance: receivers smooth while they stand."""
PRIOR_SD = {WHITE: 1.5, SLOW: 0.7, TIME: 0.7, VELOCITY: 1.5}
"""Nepers."""
FLOOR = {WHITE: float(np.log(LEAST_WHITE)), SLOW: 0.0, TIME: -3.0, VELOCITY: float(np.log(0.5))}
MOST_SLOW = 16.0
"""Share of the claimed variance: what looks larger is not the receiver's error."""
FEWEST_FIXES = 20
TOLD = 0.5
"""Standard error, in nepers, below which a drive is said to tell."""
WORTH_SAYING = 1.5
"""Factor by which stands raise the slow share that is said: less is chance as well."""
LARGE = 3.0
"""Shares of the claimed variance above it are not the receiver's alone."""


def split_errors(setup: RunSetup) -> GnssErrorModel | None:
    """Return the split that the drive is to decide on, if there is any."""
    slow = setup.measurements.correlated
    return slow if isinstance(slow, GnssErrorModel) and slow.fit else None


def with_split(setup: RunSetup, x: Mapping[str, float]) -> RunSetup:
    """Return a setup with the split at some values: log w, log of b over what w leaves, log tau."""
    before = split_errors(setup)
    if before is None or WHITE not in x:
        return setup
    white = float(np.exp(x[WHITE]))
    left = max(abs(1.0 - white), 0.1 * white)
    time = min(USUAL_TIME * float(np.exp(x.get(TIME, 0.0))), LONGEST_TIME)
    slow = min(left * float(np.exp(x.get(SLOW, 0.0))), max(MOST_SLOW, left))
    split = replace(before, white=white, slow=slow, correlation_time=time)
    factors = setup.factors
    velocity_sd = factors.velocity_sd * float(np.exp(x.get(VELOCITY, 0.0)))
    return replace(
        setup,
        model=split.in_model(setup.model),
        measurements=replace(setup.measurements, correlated=split),
        factors=replace(factors, velocity_sd=velocity_sd),
    )


def split_start(
    setup: RunSetup, names: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where a search begins, inverse variances of its prior, its floor; free where not known."""
    split = split_errors(setup)
    assert split is not None
    left = max(abs(1.0 - split.white), 0.1 * split.white)
    begin = {
        WHITE: np.log(split.white),
        SLOW: np.log(max(split.slow, 1e-3) / left),
        TIME: np.log(split.correlation_time / USUAL_TIME),
    }
    # half of the velocity's deviations, or what the drive has found already
    found = min(0.0, FLOOR[VELOCITY] - float(np.log(setup.factors.velocity_sd)))
    low = FLOOR | {VELOCITY: found}
    floor = np.array([low.get(n, -np.inf) for n in names])
    start = np.maximum([begin.get(n, 0.0) for n in names], floor)
    prior = np.array([PRIOR_SD[n] ** -2 if n in PRIOR_SD else 0.0 for n in names])
    return start, prior, floor


def fit_split(imu: ImuRecording, gnss: GnssRecording, setup: RunSetup) -> RunSetup:
    """Find the split under which the innovations were most likely, and say it."""
    split = split_errors(setup)
    if split is None or gnss.size < FEWEST_FIXES:
        return setup
    slow = slower_imu(imu).between(-np.inf, enough_to_tune(imu, gnss, setup))
    level = level_at(slow.time, imu, vibration_level(imu)) if setup.vibration.active else None
    names = (WHITE, SLOW, TIME, *((VELOCITY,) if gnss.velocity is not None else ()))
    start, prior, floor = split_start(setup, names)

    def at(x: FloatArray) -> RunSetup:
        return with_split(setup, dict(zip(names, x.tolist(), strict=True)))

    moving = _moving(imu, gnss.time)

    none = np.zeros(len(names), dtype=np.bool_)
    drive = DriveLikelihood(slow, [gnss], at, none, level, lambda i: i.select(moving(i.time)))
    inside = (gnss.time > slow.time[0] + EDGE) & (gnss.time < slow.time[-1] - EDGE)
    if not moving(gnss.time[inside]).any():
        return setup
    found = drive.maximise(start, prior, floor)
    done = _judged(at(found.x), dict(zip(names, found.sd.tolist(), strict=True)))
    return _as_at_stands(imu, gnss, done)


def _as_at_stands(imu: ImuRecording, gnss: GnssRecording, setup: RunSetup) -> RunSetup:
    """With errors that last no smaller than fixes show while the vehicle stands, and say it."""
    split = setup.measurements.correlated
    assert isinstance(split, GnssErrorModel)
    wander = wander_at_stands(imu, gnss, setup.offsets.position)
    least = wander.least_slow(split.white, split.correlation_time, MOST_SLOW)
    if least <= split.slow:
        return setup
    before, split = split.slow, replace(split, slow=least, told=True)
    setup = replace(setup, measurements=replace(setup.measurements, correlated=split))
    if least < WORTH_SAYING * before:
        return setup
    farthest = int(np.argmax(np.linalg.norm(wander.way, axis=1)))
    finding = Finding(
        "claims",
        "warning",
        f"while the vehicle stands GNSS positions wander, by "
        f"{np.linalg.norm(wander.way[farthest]):.2g} m in {wander.seconds[farthest]:.0f} s where "
        f"the receiver claims {wander.sd[farthest].max():.2g} m: "
        + str(split.to_dict()["gnss_errors"]),
        value=least,
        cure="give the receiver's true deviation (--gnss-position-sd)",
    )
    return setup.telling(finding)


def _moving(imu: ImuRecording, fixes: FloatArray) -> Callable[[FloatArray], BoolArray]:
    """Tell which moments are not at rest; all, where too few fixes are not.

    Receivers smooth their positions while they stand: what these show is not so in motion.
    """
    rest = detect_standstill(imu).time

    def moving(time: FloatArray) -> BoolArray:
        if not rest.size:
            return np.ones(time.size, dtype=np.bool_)
        after = np.searchsorted(rest, time)
        before = np.abs(time - rest[np.maximum(after - 1, 0)])
        near = np.minimum(before, np.abs(rest[np.minimum(after, rest.size - 1)] - time))
        return np.asarray(near > REST_INTERVAL)

    if moving(fixes).sum() < FEWEST_FIXES:
        rest = np.empty(0)
    return moving


def _judged(setup: RunSetup, sd: dict[str, float]) -> RunSetup:
    """Whether the drive has told; a receiver that is off by far more than it claims is named."""
    split = setup.measurements.correlated
    assert isinstance(split, GnssErrorModel)
    left = max(abs(1.0 - split.white), 0.1 * split.white)
    told = sd[SLOW] < TOLD or split.slow > 1.5 * left
    split = replace(split, told=told)
    setup = replace(setup, measurements=replace(setup.measurements, correlated=split))
    if max(split.slow, split.white) <= LARGE:
        return setup
    finding = Finding(
        "claims",
        "warning",
        "errors of GNSS positions are larger than the receiver says: "
        + str(split.to_dict()["gnss_errors"]),
        value=split.white + split.slow,
        cure="check lever arm, time offset and axes, and let the noise follow the drive where the "
        "IMU shakes more than its noise model says (--tune-noise): all of these look like errors "
        "of the receiver; else give its true deviation (--gnss-position-sd)",
    )
    return setup.telling(finding)
