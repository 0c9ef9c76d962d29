"""A drive with known truth, driven again and again with new noise, through the same outages.

What S004 could not do: seven outages of one IMU, judged against its own solution, cannot tell
which error model is better (spec 8.4, E-004-15, E-004-18). Here the errors are those against the
truth, the noise is drawn anew for every seed, and every model meets the same draw.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.data.exportable import Exportable
from schuler.evaluation.error_model_comparison import add_track, check_models
from schuler.evaluation.outage_windows import OutageStatistics, Window, judge_run
from schuler.navigation.error_models.catalogue import ErrorModel
from schuler.navigation.navigate import withhold
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigation.run import run
from schuler.navigation.settings import NavigationSettings
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import dcm_from_rotation_vector
from schuler.simulation import Profile, ideal_imu, simulate_gnss, simulate_imu
from schuler.types import FloatArray

START_VELOCITY_SD = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class OutageTwin(Exportable):
    """A drive, its sensor, its receiver and its outages.

    Parameters
    ----------
    profile : Profile
        True motion.
    ideal : ImuRecording
        What a sensor without errors records of it.
    noise : NoiseModel
        True errors of the sensor, turn-on biases included.
    windows : tuple of (start, seconds)
        Outages, seconds after the first fix.
    position_sd, velocity_sd : float
        Of the receiver, m and m/s.
    tilt_sd, heading_sd : float
        Of the alignment at the start, rad.
    turn_on_accel, turn_on_gyro : float
        What the filters are told of the turn-on biases, m/s² and rad/s.

    Examples
    --------
    >>> import schuler
    >>> noise = schuler.NoiseModel.isotropic(schuler.WhiteNoise(1e-3), schuler.WhiteNoise(1e-2))
    >>> twin = schuler.outage_twin(schuler.motorcycle(120.0), noise, [(90.0, 10.0)])
    >>> twin.position_sd
    1.0
    """

    profile: Profile
    ideal: ImuRecording
    noise: NoiseModel
    windows: tuple[Window, ...]
    position_sd: float = 1.0
    velocity_sd: float = 0.05
    tilt_sd: float = float(np.radians(0.5))
    heading_sd: float = float(np.radians(1.0))
    turn_on_accel: float = 0.0
    turn_on_gyro: float = 0.0

    @property
    def truth(self) -> GnssRecording:
        """True positions at the fixes, as a receiver of 1 mm gives them."""
        time = np.arange(self.profile.start + 1.0, self.ideal.time[-1] + 1e-9, 1.0)
        path = self.profile.trajectory(time)
        next_to_none = np.full((time.size, 3), 1e-3)
        return GnssRecording(
            time=time,
            position=path.position,
            velocity=path.velocity,
            position_sd=next_to_none,
            velocity_sd=next_to_none,
            name="truth",
        )


@dataclass(frozen=True, slots=True, eq=False)
class TwinDraw:
    """One repetition: what was measured, and how the filter starts."""

    imu: ImuRecording  # with errors
    gnss: GnssRecording  # without the outages
    alignment: Alignment  # truth and a draw


def outage_twin(
    profile: Profile,
    noise: NoiseModel,
    windows: Sequence[Window],
    *,
    rate: float = 100.0,
    turn_on_accel: float = 0.0,
    turn_on_gyro: float = 0.0,
) -> OutageTwin:
    """Prepare a drive with known truth that is driven again and again with new noise.

    Parameters
    ----------
    profile : Profile
        True motion.
    noise : NoiseModel
        True errors of the sensor, turn-on biases included.
    windows : sequence of (start, seconds)
        Outages, s after the first fix.
    rate : float
        Samples a second, Hz.
    turn_on_accel, turn_on_gyro : float
        What the filters are told of the turn-on biases, m/s² and rad/s.

    Returns
    -------
    OutageTwin
        With what a sensor without errors records.

    Notes
    -----
    What S004 could not do: seven outages of one IMU cannot tell which error model is better
    (erratum E-004-15).

    Examples
    --------
    >>> import schuler
    >>> drive = schuler.motorcycle(120.0)
    >>> noise = schuler.NoiseModel.isotropic(schuler.WhiteNoise(1e-3), schuler.WhiteNoise(1e-2))
    >>> schuler.outage_twin(drive, noise, [(90.0, 10.0)]).windows
    ((90.0, 10.0),)
    """
    return OutageTwin(
        profile=profile,
        ideal=ideal_imu(profile, rate),
        noise=noise,
        windows=tuple(windows),
        turn_on_accel=turn_on_accel,
        turn_on_gyro=turn_on_gyro,
    )


def draw_outage_twin(twin: OutageTwin, rng: np.random.Generator) -> TwinDraw:
    """Draw the errors of sensor, receiver and alignment of one repetition.

    Parameters
    ----------
    twin : OutageTwin
        The drive.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    TwinDraw
        Recordings with errors, and how the filter starts.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> drive = schuler.motorcycle(120.0)
    >>> noise = schuler.NoiseModel.isotropic(schuler.WhiteNoise(1e-3), schuler.WhiteNoise(1e-2))
    >>> twin = schuler.outage_twin(drive, noise, [(90.0, 10.0)])
    >>> schuler.draw_outage_twin(twin, np.random.default_rng(0)).imu.gyro.shape[1]
    3
    """
    sensor, receiver, start = rng.spawn(3)
    gnss = simulate_gnss(
        twin.profile,
        1.0,
        position_sd=twin.position_sd,
        velocity_sd=twin.velocity_sd,
        rng=receiver,
        start=twin.profile.start + 1.0,
    )
    first = twin.profile.trajectory(twin.ideal.time[:1])
    psi = start.standard_normal(3) * [twin.tilt_sd, twin.tilt_sd, twin.heading_sd]
    alignment = Alignment(
        rotation=dcm_from_rotation_vector(-psi) @ first.rotation[0],
        tilt_sd=twin.tilt_sd,
        heading_sd=twin.heading_sd,
        gyro_bias=np.zeros(3),
        gyro_bias_sd=None,
        rest=(0.0, 1.0),
        method="truth and a draw",
        velocity=first.velocity[0] + START_VELOCITY_SD * start.standard_normal(3),
    )
    return TwinDraw(
        simulate_imu(twin.ideal, twin.noise, sensor), withhold(gnss, twin.windows), alignment
    )


def run_outages(
    twin: OutageTwin,
    models: Sequence[ErrorModel],
    drawn: TwinDraw,
    tracks: list[dict[str, FloatArray]] | None = None,
) -> dict[str, tuple[OutageStatistics, float]]:
    """Run every error model through the outages of one draw.

    Parameters
    ----------
    twin : OutageTwin
        The drive.
    models : sequence of ErrorModel
        With names of their own.
    drawn : TwinDraw
        One repetition.
    tracks : list, optional
        Receives for each outage a dict of tracks (n, 2) east and north in m, by model; "reference"
        is the truth.

    Returns
    -------
    dict of str to (OutageStatistics, float)
        By model: errors in the outages, and the mean NIS per degree of freedom.

    Raises
    ------
    InputError
        Two models of one name.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> drive = schuler.motorcycle(120.0)
    >>> white = schuler.WhiteNoise(1e-3)
    >>> twin = schuler.outage_twin(
    ...     drive, schuler.NoiseModel.isotropic(white, white), [(90.0, 10.0)]
    ... )
    >>> reading = schuler.AllanReading(1e-3, 1e-5, 100.0, 1e-6)
    >>> channels = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    >>> model = schuler.error_model("18AV", {c: reading for c in channels})
    >>> drawn = schuler.draw_outage_twin(twin, np.random.default_rng(0))
    >>> errors, _ = schuler.run_outages(twin, [model], drawn)["18AV"]
    >>> len(errors.windows)
    1
    """
    check_models(models)
    truth = twin.truth
    found: dict[str, tuple[OutageStatistics, float]] = {}
    if tracks is not None:
        tracks.extend({} for _ in twin.windows)
    for model in models:
        sensors = model.sensor_model(twin.turn_on_accel, twin.turn_on_gyro, 1.0 / twin.ideal.rate)
        setup = RunSetup(
            sensors, NoiseFactors.none(), TimeOffsets(), drawn.alignment, np.zeros(3),
            settings=NavigationSettings(false_alarm=0.0),
        )  # fmt: skip
        own = model.measured(drawn.imu)
        scale = model.white_scale(drawn.imu)
        scale = None if scale is None else scale[: own.size]
        done = run(own, drawn.gnss, setup, white_scale=scale).causal
        judged = judge_run(done, truth, setup, twin.windows)
        if tracks is not None:
            for track, window in zip(tracks, judged, strict=True):
                add_track(track, model.name, window, truth)
        found[model.name] = (OutageStatistics(judged), done.innovations.gnss.mean_nis)
    return found
