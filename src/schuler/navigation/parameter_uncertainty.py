"""What is not known of tuned noise and time offsets, carried into the claims (delta method).

A filter believes its parameters. On a short drive those that were found by its likelihood are
poorly known, and what they leave open is as large as what the filter claims. The drive is solved
again with the parameters moved along each column of a square root of their covariance; the squares
of what changes add up to the covariance that is missing. Oehlert 1992, The American Statistician
46:27; Hamilton 1986, Journal of Econometrics 33:387, does so for Kalman filters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.earth import metres_per_radian
from schuler.navigation.engine import SampleOutputs, gate_thresholds
from schuler.navigation.innovation_likelihood import slower_imu
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.segments import run_in_segments
from schuler.navigation.smoother import smooth_run
from schuler.navigation.tuning.tune import setup_at
from schuler.navigation.tuning.vibration import level_at, vibration_level
from schuler.rotations import rotation_vector_from_dcm
from schuler.screening.screen import Finding
from schuler.types import FloatArray

LONGEST = 600.0
"""Seconds of a recording that is short: a longer one tells its noise well enough."""
INTERVAL = 0.5
DOMINANT = 2.0
"""Missing over claimed variance of position at which it is said."""


@dataclass(frozen=True, slots=True, eq=False)
class MissingCovariance:
    """What a filter does not know of itself."""

    time: FloatArray  # (m,): seconds
    position: FloatArray  # (m, 3, 3): north, east, down, m²
    # velocity, attitude: (m, 3) variances
    velocity: FloatArray
    attitude: FloatArray

    def added(self, solution: NavigationSolution) -> NavigationSolution:
        """Return a solution that claims it too, and says so where it outweighs the rest."""
        at = solution.trajectory.time

        def there(values: FloatArray) -> FloatArray:
            flat = values.reshape(self.time.size, -1)
            columns = [np.interp(at, self.time, c) for c in flat.T]
            return np.stack(columns, axis=-1).reshape(at.size, *values.shape[1:])

        position = there(self.position)
        before = np.trace(solution.position_covariance[:, :2, :2], axis1=1, axis2=2)
        ratio = float(np.median(np.trace(position[:, :2, :2], axis1=1, axis2=2) / before))
        settings = solution.settings | {"missing_over_claimed_variance": ratio}
        if ratio > DOMINANT:
            finding = Finding(
                "short drive",
                "warning",
                "claims hang on noise and offsets that this short drive hardly tells: they are "
                f"{np.sqrt(1.0 + ratio):.1f} times what the filter by itself claims",
                value=ratio,
                cure="give a noise model of the IMU, or record a longer drive",
            )
            settings["findings"] = [*settings["findings"], finding.to_dict()]
        return replace(
            solution,
            position_covariance=solution.position_covariance + position,
            velocity_sd=np.sqrt(solution.velocity_sd**2 + there(self.velocity)),
            attitude_sd=np.sqrt(solution.attitude_sd**2 + there(self.attitude)),
            settings=settings,
        )


def with_arm_uncertainty(
    solution: NavigationSolution, covariance: FloatArray | None
) -> NavigationSolution:
    """Claim of an IMU's position what is not known of the arm to the antenna that GNSS sees."""
    if covariance is None:
        return solution
    turned = solution.trajectory.rotation @ covariance @ solution.trajectory.rotation.mT
    return replace(solution, position_covariance=solution.position_covariance + turned)


def missing_covariance(
    imu: ImuRecording, gnss: GnssRecording, setup: RunSetup, *, smooth: bool
) -> tuple[MissingCovariance, MissingCovariance | None] | None:
    """Of the filter and of the smoother; None where nothing was tuned or the drive is long."""
    spread = setup.spread
    wheel = setup.vehicle is not None and "wheel" in setup.vehicle.constraints
    if spread is None or wheel or setup.stretches is not None or imu.duration > LONGEST:
        return None
    slow = slower_imu(imu)
    level = level_at(slow.time, imu, vibration_level(imu))
    pick = slice(None, None, max(int(INTERVAL * slow.rate), 1))

    def solved(one: RunSetup) -> list[SampleOutputs]:
        return _solved(slow, gnss, one, level, smooth=smooth)

    base = solved(setup)
    moved = [solved(setup_at(column, setup)) for column in spread.columns()]
    time = slow.time[pick]
    found = [
        _squares(time, pick, base[k], [m[k] for m in moved]) for k in range(2 if smooth else 1)
    ]
    return found[0], found[1] if smooth else None


def _solved(
    imu: ImuRecording, gnss: GnssRecording, setup: RunSetup, level: FloatArray, *, smooth: bool
) -> list[SampleOutputs]:
    """States at the samples, causal and perhaps smoothed."""
    scale = setup.vibration.white_scale(level) if setup.vibration.active else None
    scale = setup.condition.noise_scale(imu.time, scale, setup.model.white_density)
    done = run_in_segments(
        imu,
        setup.initial_state(imu, gnss),
        setup.restarts(gnss),
        setup.model,
        setup.schedule(imu, gnss),
        gate=gate_thresholds(setup.settings.false_alarm),
        robustness=setup.measurements.weighting.array(),
        white_scale=scale,
        vehicle=setup.vehicle_states,
        keep_nodes=smooth,
        smoother_memory=setup.settings.smoother_memory,
    )
    if not smooth:
        return [done.samples]
    return [done.samples, smooth_run(done, setup.model, imu.time).samples]


def _squares(
    time: FloatArray, pick: slice, base: SampleOutputs, moved: list[SampleOutputs]
) -> MissingCovariance:
    """Sums of squares of the changes."""
    north, east = metres_per_radian(base.position[pick])
    unit = np.stack([north, east, -np.ones(time.size)], axis=1)
    position = np.zeros((time.size, 3, 3))
    velocity, attitude = np.zeros((2, time.size, 3))
    for one in moved:
        shift = (one.position[pick] - base.position[pick]) * unit
        turn = one.rotation[pick] @ base.rotation[pick].transpose(0, 2, 1)
        position += shift[:, :, None] * shift[:, None, :]
        velocity += (one.velocity[pick] - base.velocity[pick]) ** 2
        attitude += rotation_vector_from_dcm(turn) ** 2
    return MissingCovariance(time, position, velocity, attitude)
