"""How much of a receiver's claimed deviation is white, how much lasts, and for how long.

Errors of GNSS positions are hardly ever white: multipath, orbits and ambiguities held a little
wrong last for a minute. A filter that takes them for white averages them away and claims far too
little. The claim is split (`GnssErrorModel`), and the innovations of the drive at the full rate of
GNSS decide by how much: on the white share, on the slow one, which may be raised above what the
claim leaves and never lowered, as innovations hardly see it, on its correlation time, and on the
deviations of velocity. What they do not tell stays at the prior.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.innovation_likelihood import InnovationSequence, slower_imu
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.scoring import maximise
from schuler.navigation.tuning.vibration import level_at, vibration_level
from schuler.screening.screen import Finding
from schuler.types import FloatArray

WHITE, SLOW, TIME, VELOCITY = "gnss white", "gnss slow", "gnss time", "gnss velocity"
USUAL_TIME = 60.0
"""Correlation time of the prior, s."""
LONGEST_TIME = 300.0
LEAST_WHITE = 0.04
"""Share of the claimed variance: receivers smooth while they stand."""
PRIOR_SD = {WHITE: 1.5, SLOW: 0.7, TIME: 0.7, VELOCITY: 1.5}
"""Nepers."""
FLOOR = {WHITE: float(np.log(LEAST_WHITE)), SLOW: 0.0, TIME: -3.0, VELOCITY: float(np.log(0.5))}
TOLD = 0.5
"""Standard error, in nepers, below which a drive is said to tell."""
LARGE = 3.0
"""A slow share above it is not the receiver's alone."""


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
    split = replace(
        before, white=white, slow=left * float(np.exp(x.get(SLOW, 0.0))), correlation_time=time
    )
    factors = setup.factors
    velocity_sd = factors.velocity_sd * float(np.exp(x.get(VELOCITY, 0.0)))
    return replace(
        setup,
        model=split.in_model(setup.model),
        measurements=replace(setup.measurements, correlated=split),
        factors=replace(factors, velocity_sd=velocity_sd),
    )


def fit_split(imu: ImuRecording, gnss: GnssRecording, setup: RunSetup) -> RunSetup:
    """Find the split under which the innovations were most likely, and say it."""
    split = split_errors(setup)
    if split is None or gnss.size < 20:
        return setup
    slow = slower_imu(imu)
    level = level_at(slow.time, imu, vibration_level(imu)) if setup.vibration.active else None
    names = (WHITE, SLOW, TIME, *((VELOCITY,) if gnss.velocity is not None else ()))
    left = max(abs(1.0 - split.white), 0.1 * split.white)
    begin = {
        WHITE: np.log(split.white),
        SLOW: np.log(max(split.slow, 1e-3) / left),
        TIME: np.log(split.correlation_time / USUAL_TIME),
    }
    floor = np.array([FLOOR[n] for n in names])
    start = np.maximum([begin.get(n, 0.0) for n in names], floor)
    prior = np.array([PRIOR_SD[n] ** -2 for n in names])

    def at(x: FloatArray) -> RunSetup:
        return with_split(setup, dict(zip(names, x.tolist(), strict=True)))

    def evaluate(x: FloatArray) -> InnovationSequence:
        return innovations(slow, [gnss], at(x), level)

    found = maximise(evaluate, start, prior, floor)
    done = at(found.x)
    finding = _finding(done, dict(zip(names, found.sd.tolist(), strict=True)))
    condition = replace(done.condition, findings=(*done.condition.findings, finding))
    return replace(done, condition=condition)


def _finding(setup: RunSetup, sd: dict[str, float]) -> Finding:
    """The split in words."""
    split = setup.measurements.correlated
    assert isinstance(split, GnssErrorModel)
    told = sd[SLOW] < TOLD or split.slow > 1.5 * max(abs(1.0 - split.white), 0.1 * split.white)
    white, slow = (100.0 * float(np.sqrt(s)) for s in (split.white, split.slow))
    why = "by the innovations" if told else "default: this drive does not tell"
    text = (
        f"errors of GNSS positions: {white:.0f} % of the claimed sd is white, {slow:.0f} % lasts "
        f"about {split.correlation_time:.0f} s ({why})"
    )
    large = split.slow > LARGE
    return Finding(
        "GNSS errors",
        "warning" if large else "info",
        text,
        value=split.slow,
        cure="check lever arm, time offset and axes: what is wrong with them looks like slow "
        "errors of the receiver"
        if large
        else "",
    )
