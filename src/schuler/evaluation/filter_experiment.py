"""An experiment with many draws of one drive: what the filter errs, and what it claims."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from schuler import earth
from schuler.data import ImuRecording, Trajectory
from schuler.errors import InputError
from schuler.navigation.aiding.gnss import GnssPosition, GnssVelocity
from schuler.navigation.aiding.schedule import AidingSchedule, merge_schedules
from schuler.navigation.engine import FilterRun, InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import dcm_from_rotation_vector, rotation_vector_from_dcm
from schuler.simulation import Profile, TriadErrors, ideal_imu, simulate_gnss, simulate_imu
from schuler.types import FloatArray

NAVIGATION = 9
"""Components of position, velocity and attitude: the degrees of freedom of the NEES."""


@dataclass(frozen=True, slots=True, eq=False)
class FilterExperiment:
    """The filter on one drive: every run draws sensor errors, fixes and start anew.

    An experiment for `monte_carlo`. Every run gives, for each model that the filter is told (all
    on the same draw), "NAME: position", "NAME: velocity" and "NAME: attitude", the length of the
    error at the end in m, m/s and rad; "NAME: rms", that of the position over the run, m; "NAME:
    nees", the normalised square of the nine errors at the end; "NAME: nis", that of all
    innovations, a component.

    Parameters
    ----------
    profile : Profile
        The true motion.
    noise_model : NoiseModel
        What is drawn.
    told : mapping of str to NoiseModel
        What the filter is told, by name; if empty, what is drawn, as "truth".
    rate, gnss_rate : float
        Hz.
    position_sd, velocity_sd : float
        Of the fixes, white, m (vertical 1.5 times it) and m/s.
    turn_on : (float, float)
        Standard deviation of the biases that are drawn and told: gyros rad/s, accelerometers m/s².
    start_sd : (9,) ndarray
        Of the start: position m, velocity m/s, attitude rad, each north, east, down.
    lever_arm : (3,) ndarray
        Antenna from IMU, m.

    Raises
    ------
    InputError
        Rates or deviations that are not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import FilterExperiment, NoiseModel, WhiteNoise, monte_carlo
    >>> from schuler.simulation import car_urban
    >>> model = NoiseModel.isotropic(WhiteNoise(2e-4), WhiteNoise(2e-3))
    >>> experiment = FilterExperiment(car_urban(120.0, 3), model)
    >>> result = monte_carlo(experiment, runs=20, seed=1)
    >>> mean, low, high = result.squares_within("truth: nees", 9)
    >>> bool(low < mean < high)
    True
    """

    profile: Profile
    noise_model: NoiseModel
    told: Mapping[str, NoiseModel] = field(default_factory=dict)
    rate: float = 100.0
    gnss_rate: float = 1.0
    position_sd: float = 0.5
    velocity_sd: float = 0.05
    turn_on: tuple[float, float] = (2e-3, 0.05)
    start_sd: FloatArray = field(
        default_factory=lambda: np.array([1.0] * 3 + [0.1] * 3 + [0.01, 0.01, 0.02])
    )
    lever_arm: FloatArray = field(default_factory=lambda: np.zeros(3))
    _ideal: ImuRecording = field(init=False, repr=False)
    _truth: Trajectory = field(init=False, repr=False)
    _metres: FloatArray = field(init=False, repr=False)
    _models: dict[str, SensorErrorModel] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("rate", "gnss_rate", "position_sd", "velocity_sd"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise InputError(f"{name} is {getattr(self, name)}", expected="above zero")
        if np.shape(self.start_sd) != (9,) or not np.all(np.asarray(self.start_sd) > 0.0):
            raise InputError("start_sd", expected="nine numbers above zero")
        ideal = ideal_imu(self.profile, self.rate)
        object.__setattr__(self, "_ideal", ideal)
        truth = self.profile.trajectory(ideal.time)
        object.__setattr__(self, "_truth", truth)
        north, east = earth.metres_per_radian(truth.position)
        scale = np.stack([north, east, -np.ones(north.size)], axis=-1)
        object.__setattr__(self, "_metres", scale)
        gyro, accel = self.turn_on
        models = {
            name: sensor_error_model(
                model, turn_on_accel=accel, turn_on_gyro=gyro, interval=1.0 / self.rate
            )
            for name, model in (self.told or {"truth": self.noise_model}).items()
        }
        object.__setattr__(self, "_models", models)

    def __call__(self, rng: np.random.Generator) -> dict[str, float]:
        """Draw once, and run the filter with every model on that draw."""
        imu, schedule, start = self._drawn(rng)
        gate = gate_thresholds(0.0)
        found: dict[str, float] = {}
        for name, model in self._models.items():
            begin = _begun(start, model, np.asarray(self.start_sd))
            done = run_engine(imu, begin, model, schedule, gate=gate, keep_nodes=False)
            found |= {f"{name}: {k}": v for k, v in self._judged(done).items()}
        return found

    def _drawn(
        self, rng: np.random.Generator
    ) -> tuple[ImuRecording, AidingSchedule, tuple[FloatArray, FloatArray, FloatArray]]:
        sensor, receiver, start = rng.spawn(3)
        gyro, accel = (TriadErrors(bias=sd * start.standard_normal(3)) for sd in self.turn_on)
        imu = simulate_imu(
            self._ideal, self.noise_model, sensor, gyro_errors=gyro, accel_errors=accel
        )
        gnss = simulate_gnss(
            self.profile, self.gnss_rate, position_sd=self.position_sd,
            velocity_sd=self.velocity_sd, rng=receiver, lever_arm=self.lever_arm,
            start=self.profile.start + 1.0 / self.gnss_rate,
        )  # fmt: skip
        lever = np.asarray(self.lever_arm, dtype=np.float64)
        rows = [GnssPosition(gnss, lever).rows(), GnssVelocity(gnss, lever).rows()]
        schedule = merge_schedules(rows, float(imu.time[0]), float(imu.time[-1]))
        error = np.asarray(self.start_sd) * start.standard_normal(NAVIGATION)
        truth = self._truth
        return imu, schedule, (
            truth.position[0] + error[:3] / self._metres[0],
            truth.velocity[0] + error[3:6],
            dcm_from_rotation_vector(-error[6:]) @ truth.rotation[0],
        )  # fmt: skip

    def _judged(self, done: FilterRun) -> dict[str, float]:
        truth, samples = self._truth, done.samples
        away = (samples.position - truth.position) * self._metres
        turn = -rotation_vector_from_dcm(samples.rotation[-1] @ truth.rotation[-1].T)
        slip = samples.velocity[-1] - truth.velocity[-1]
        error = np.concatenate([away[-1], slip, turn])
        covariance = done.final.covariance[:NAVIGATION, :NAVIGATION]
        aiding = done.aiding
        used = aiding.degrees > 0
        return {
            "position": float(np.linalg.norm(away[-1])),
            "velocity": float(np.linalg.norm(slip)),
            "attitude": float(np.linalg.norm(turn)),
            "rms": float(np.sqrt(np.mean(np.sum(away**2, axis=1)))),
            "nees": float(error @ np.linalg.solve(covariance, error)),
            "nis": float(aiding.nis[used].sum() / aiding.degrees[used].sum()),
        }


def _begun(
    start: tuple[FloatArray, FloatArray, FloatArray], model: SensorErrorModel, sd: FloatArray
) -> InitialState:
    size = NAVIGATION + model.size
    covariance = np.zeros((size, size))
    covariance[:NAVIGATION, :NAVIGATION] = np.diag(sd**2)
    covariance[NAVIGATION:, NAVIGATION:] = model.initial_covariance
    return InitialState(*start, np.zeros(model.size), covariance)
