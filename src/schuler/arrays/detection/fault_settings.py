"""How faults are looked for: false-alarm rates, time constants, what motion may explain."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from schuler.arrays.lever_arms import fill_gaps
from schuler.arrays.redundant import RedundantSensors, Sensor
from schuler.arrays.tracking import OnlineSettings, Watch
from schuler.errors import InputError
from schuler.types import FloatArray

SMOOTHING, SLOW = 0.1, 100.0
"""Seconds over which motion is averaged, and of the memory of the slow mean of a force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSettings:
    """How faults are looked for, taken out and let back in.

    Parameters
    ----------
    false_alarm_rate : float
        Probability that a sample without fault counts as inconsistent: for statistics and plots,
        nothing is taken out by it.
    exclusions_per_hour : float
        Healthy axes and units that may be taken out in an hour, for Gaussian noise. All tests and
        time constants share it.
    time_constants : tuple of float
        Of the smoothed residuals, s: short ones find large faults soon, long ones small faults.
    spike : float
        Deviations beyond which one sample of one axis is not used.
    unit_evidence : float
        Probability with which a fault of one axis may be taken for one of its whole unit.
    readmission : float
        Deviations from what the others predict within which an axis that is out behaves.
    hold : float
        How long it must behave before it is let back in, s; doubled each time.
    wander_time_constant : float
        Memory of how much larger smoothed residuals are than white noise makes them, s.
    gyro_wander, accel_wander : float
        Standard deviation of slow wander of a bias that is no fault, rad/s and m/s²: no test
        looks for lasting faults much below five times that.
    scale_uncertainty : float
        Standard deviation of what scale factors and misalignments leave, as a share of the motion.
    delay_uncertainty : float
        Standard deviation of the timing between sensors, s.
    accel_scale_uncertainty, accel_delay_uncertainty : float
        The same for accelerometers, where they are larger.
    arm_uncertainty : float
        Of the lever arms, m: rotation makes forces of them.
    accel_clip : float or None
        Deviations at which samples of accelerometers are clipped, if not as those of the gyros.
    online : OnlineSettings
        Of weights and biases.

    Examples
    --------
    >>> from schuler import FaultSettings
    >>> FaultSettings(false_alarm_rate=1e-4).time_constants
    (0.5, 2.0, 8.0)
    """

    false_alarm_rate: float = 0.001
    exclusions_per_hour: float = 1e-3
    time_constants: tuple[float, ...] = (0.5, 2.0, 8.0)
    spike: float = 6.0
    unit_evidence: float = 0.001
    readmission: float = 3.0
    hold: float = 10.0
    wander_time_constant: float = 60.0
    gyro_wander: float = np.radians(0.01)
    accel_wander: float = 0.005
    scale_uncertainty: float = 0.0
    delay_uncertainty: float = 0.0
    accel_scale_uncertainty: float = 0.0
    accel_delay_uncertainty: float = 0.0
    arm_uncertainty: float = 0.0
    accel_clip: float | None = None
    online: OnlineSettings = field(default_factory=OnlineSettings)

    def __post_init__(self) -> None:
        rates = (self.false_alarm_rate, self.unit_evidence)
        positive = (self.exclusions_per_hour, self.spike, self.readmission, self.hold)
        if not all(0.0 < r < 1.0 for r in rates):
            raise InputError(
                f"probabilities {rates[0]:g} and {rates[1]:g}", expected="between 0 and 1"
            )
        if not (
            self.time_constants
            and all(v > 0.0 for v in (*positive, *self.time_constants, self.wander_time_constant))
            and min(self.gyro_wander, self.accel_wander, self.scale_uncertainty) >= 0.0
            and min(self.accel_scale_uncertainty, self.accel_delay_uncertainty) >= 0.0
            and min(self.delay_uncertainty, self.arm_uncertainty) >= 0.0
        ):
            raise InputError(
                "settings of the fault tests that are not positive",
                expected="rates, deviations and time constants above zero, and at least one "
                "time constant",
            )

    def online_of(self, sensor: Sensor) -> OnlineSettings:
        """Return the settings of weights and biases of one kind of sensor."""
        if sensor == "gyro" or self.accel_clip is None:
            return self.online
        return replace(self.online, clip=self.accel_clip)

    def watch(self, sensors: RedundantSensors) -> Watch:
        """Return the thresholds for some sensors.

        Parameters
        ----------
        sensors : RedundantSensors
            How many axes and units there are.

        Returns
        -------
        Watch
            A residual smoothed over T is new about every 2 T: the false exclusions of an hour are
            spread over 3600 / (2 T) tests of every axis and unit, and over the time constants.
        """
        from scipy.stats import chi2, f

        tests = len(self.time_constants) * (sensors.count + sensors.units)
        probability = np.minimum(
            self.exclusions_per_hour * 2.0 * np.asarray(self.time_constants) / 3600.0 / tests, 0.01
        )
        size = int(np.bincount(sensors.unit).max())
        # variances are estimates too: of as many samples as their memory is worth
        memory = 2.0 * self.online.time_constant / sensors.step
        return Watch(
            time_constants=self.time_constants,
            axis_threshold=tuple(f.isf(probability, 1, memory).tolist()),
            unit_threshold=tuple((size * f.isf(probability, size, size * memory)).tolist()),
            unit_margin=float(chi2.isf(self.unit_evidence, max(size - 1, 1))),
            spike=self.spike**2,
            readmission=self.readmission**2,
            hold=self.hold,
            factor_time_constant=self.wander_time_constant,
            wander=self.gyro_wander if sensors.sensor == "gyro" else self.accel_wander,
        )

    def motion_variance(
        self, time: FloatArray, vectors: FloatArray, sensor: Sensor, rate: FloatArray | None = None
    ) -> FloatArray | None:
        """Return what motion may add to the variance of every axis, (n,), from the past alone.

        (scale |x|)² + (delay |dx/dt|)², and for accelerometers (arm (|w|² + |dw/dt|))². Of a force
        only what differs from its own slow mean counts: the rest is in the biases. None when all
        uncertainties are zero.
        """
        scale, delay, arm = self.scale_uncertainty, self.delay_uncertainty, 0.0
        if sensor == "accel":
            scale = max(scale, self.accel_scale_uncertainty)
            delay = max(delay, self.accel_delay_uncertainty)
            arm = self.arm_uncertainty if rate is not None else 0.0
        if scale == delay == arm == 0.0:
            return None
        step = float(np.median(np.diff(time)))
        x = _smoothed(fill_gaps(time, vectors), step)
        change = x if sensor == "gyro" else x - _slow_mean(x, step, self.online.learning)
        variance = scale**2 * np.sum(change**2, axis=1)
        variance += delay**2 * np.sum(_slope(x, time) ** 2, axis=1)
        if arm > 0.0 and rate is not None:
            w = _smoothed(fill_gaps(time, rate), step)
            turning = np.sum(w**2, axis=1) + np.linalg.norm(_slope(w, time), axis=1)
            variance += (arm * turning) ** 2
        return np.asarray(variance)


def _smoothed(x: FloatArray, step: float) -> FloatArray:
    """Mean over the last tenth of a second: vibration is no motion."""
    length = max(round(SMOOTHING / step), 1)
    total = np.cumsum(np.concatenate([np.repeat(x[:1], length, axis=0), x]), axis=0)
    return np.asarray((total[length:] - total[:-length]) / length)


def _slow_mean(x: FloatArray, step: float, learning: float) -> FloatArray:
    """Mean of the past with a long memory, at first that of the samples that are learnt from."""
    from scipy.signal import lfilter

    share = step / SLOW
    start = x[: max(round(learning / step), 1)].mean(axis=0)
    return np.asarray(lfilter([share], [1.0, share - 1.0], x - start, axis=0) + start)


def _slope(x: FloatArray, time: FloatArray) -> FloatArray:
    slope = np.zeros_like(x)
    slope[1:] = np.diff(x, axis=0) / np.diff(time)[:, None]
    return slope
