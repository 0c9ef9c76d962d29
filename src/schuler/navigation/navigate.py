"""The verb `navigate`: an IMU and a GNSS recording in, a trajectory with honest uncertainty out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Unpack

import numpy as np

from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.errors import InputError
from schuler.navigation.error_models.catalogue import ErrorModel
from schuler.navigation.error_models.sensor_error_model import generic_noise_model
from schuler.navigation.preparation.prepare import prepare_drive
from schuler.navigation.run import run, run_error_model
from schuler.navigation.settings import NavigationOptions, Progress, navigation_settings
from schuler.noise.effects import compensated
from schuler.noise.noise_model import NoiseModel


def withhold(gnss: GnssRecording, windows: Sequence[tuple[float, float]]) -> GnssRecording:
    """Return the recording without the epochs of the given windows."""
    since = gnss.time - gnss.time[0]
    keep = np.ones(gnss.size, dtype=bool)
    for start, seconds in windows:
        if not (seconds > 0.0 and start >= 0.0):
            raise InputError(
                f"outage of {seconds:g} s at {start:g} s", expected="START >= 0 and SECONDS > 0"
            )
        keep &= ~((since >= start - 1e-6) & (since < start + seconds - 1e-6))
    if not keep.any():
        raise InputError("the outages leave no GNSS at all", expected="some epochs outside them")
    return gnss.select(keep)


def check_smoothing(smooth: bool | str) -> None:
    """Raise for a smoothing that does not exist."""
    if not (isinstance(smooth, bool) or smooth == "fixed-lag"):
        raise InputError(f"smoothing '{smooth}'", expected="False, True or 'fixed-lag'")


def navigate(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None = None,
    *,
    outages: Sequence[tuple[float, float]] = (),
    smooth: bool | Literal["fixed-lag"] = False,
    lag: float = 5.0,
    error_model: ErrorModel | None = None,
    progress: Progress | None = None,
    **options: Unpack[NavigationOptions],
) -> NavigationSolution:
    """Estimate the trajectory of an IMU with loosely coupled GNSS. Spec 7.1 to 7.3, 7.8.

    Parameters
    ----------
    imu : ImuRecording
        All six channels.
    gnss : GnssRecording
        Positions, velocities if there are any, with standard deviations, on a time axis that
        differs from the IMU's by at most a second.
    noise_model : NoiseModel or None
        Of the sensor, usually from a static log; None: a generic one, tuned on the drive.
    outages : sequence of (start, seconds)
        GNSS that is withheld from everything, alignment and tuning included; start in seconds
        after the first GNSS epoch.
    smooth : bool or "fixed-lag"
        Return the smoothed solution instead of the causal one: by the whole recording (True), or
        by what is measured up to `lag` after each moment ("fixed-lag").
    lag : float
        Of fixed-lag smoothing, s.
    error_model : ErrorModel or None
        What the filter is told of its sensor in place of the noise model, from `error_model` or
        `error_models` ("15AV", "flicker4", ...); alignment and time offsets come from the noise
        model.
    progress : callable or None
        Called with a line of text now and then.
    lever_arm : (3,) array_like or "estimate", default (0, 0, 0)
        GNSS antenna from IMU, in IMU axes, m.
    heading : float or None, default None
        Heading of the IMU's x axis at the start, rad; None: found from GNSS.
    mounting : (3, 3) ndarray or None, default None
        Vehicle (forward, right, down) from IMU, where known.
    time_offset : "estimate", float or (float, float), default "estimate"
        Seconds to add to GNSS time to get IMU time, one for both or position and velocity.
    tune_noise : bool or None, default None
        Whether to scale noise and receiver standard deviations by the likelihood of the drive;
        None: where no noise model is given, or the IMU shakes and the drive contradicts it.
    aiding : sequence of str, default ()
        What is known of the vehicle: "nhc", it has wheels and rolls along its forward axis
        (mounting, place and slip of the rear axle, and pitch of the springs become states);
        "zupt", it does not move while the IMU feels no motion; "wheel", together with "nhc": the
        vibration of the wheels tells their speed, once GNSS has told their circumference.
    false_alarm : float, default 1e-6
        Probability with which the innovation gate refuses a good measurement; 0: no gate.
    smoother_memory : float, default 5e8
        Bytes that may be kept for smoothing; a run that needs more is computed twice, part by
        part, to the same numbers.
    turn_on_accel : float, default 0.3
        Standard deviation of the accelerometers' constants at switch-on, m/s².
    turn_on_gyro : float, default radians(0.5)
        Likewise of the gyros, rad/s.
    measurements : MeasurementOptions, default MeasurementOptions()
        How GNSS is weighted (gate, Huber, Student-t, adaptive noise), its slow errors, and other
        sensors: heading, barometer, magnetometer.

    Returns
    -------
    NavigationSolution
        At the rate of the IMU, with every setting used.

    Raises
    ------
    InputError
        Recordings without what is needed, or an option that does not exist.
    NavigationError
        No overlap, no heading, no mounting where it is needed, or a run that diverges.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, navigate, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> solution = navigate(drive.imus[0], drive.gnss, model, time_offset=0.0, tune_noise=False)
    >>> solution.trajectory.time.size > 1_000
    True
    """
    check_smoothing(smooth)
    if noise_model is not None:
        imu = compensated(imu, noise_model.effects)
    settings = navigation_settings(navigate, options)
    used = withhold(gnss, outages) if outages else gnss
    prepared = prepare_drive(imu, used, noise_model, settings, progress)
    if progress is not None:
        progress("filtering")
    how: dict[str, Any] = {"smooth": smooth is True, "lag": lag if smooth == "fixed-lag" else None}
    if error_model is None:
        done = run(prepared.imu, used, prepared.setup, **how)
    else:
        measured = error_model.measured(imu)
        done = run_error_model(error_model, measured, prepared.imu, used, prepared.setup, **how)
    solution = done.smoothed or done.lagged or done.causal
    solution.settings["outages"] = [list(w) for w in outages]
    solution.settings["noise_model"] = (noise_model or generic_noise_model()).source
    return solution
