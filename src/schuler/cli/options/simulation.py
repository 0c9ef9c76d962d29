"""What is simulated, as options of the command line."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from schuler.cli.options.groups import MOTION, RECEIVER, SIMULATED
from schuler.cli.parsing import parse_numbers
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.data.mounting import Mounting
    from schuler.noise.noise_model import NoiseModel
    from schuler.simulation.receivers import GnssGrade
    from schuler.simulation.scenario import SensorFaults

Motion = Literal["static", "car_urban", "car_mixed", "motorcycle", "ski", "walk", "drone"]


@Parameter(name="*", group=MOTION)
@dataclass(frozen=True)
class MotionOptions:
    """What moves, and what goes wrong.

    Parameters
    ----------
    motion : str
        What moves.
    duration : float, optional
        Seconds; the usual one of the motion if not given.
    waypoints : Path, optional
        CSV or Parquet with time_s, latitude_deg, longitude_deg, height_m (and roll_deg,
        pitch_deg, heading_deg): the motion goes smoothly through them.
    track : Path, optional
        GNSS recording: a smooth motion that it could have come from.
    seed : int
        Of everything random; the same seed gives the same files on any machine.
    fault : tuple of str
        gap:START:SECONDS, hold:START:SECONDS, jump:START:STEP[:SECONDS],
        stuck:CHANNEL:START[:SECONDS], step:CHANNEL:START:SIZE[:SECONDS],
        ramp:CHANNEL:START:SLOPE[:SECONDS], noise:CHANNEL:START:SD[:SECONDS],
        fix:START:METRES (one wrong position), late:START:STEP[:SECONDS] (stamps of GNSS). SI
        units. May be repeated.
    """

    motion: Motion = "car_urban"
    duration: float | None = None
    waypoints: Path | None = None
    track: Path | None = None
    seed: int = 0
    fault: Annotated[tuple[str, ...], Parameter(negative=())] = ()


@Parameter(name="*", group=SIMULATED)
@dataclass(frozen=True)
class SensorOptions:
    """The IMU.

    Parameters
    ----------
    grade : str
        Typical sensor: phone, consumer, industrial, tactical, or none for an ideal one.
    noise : Path, optional
        Noise model as YAML, from `schuler characterize --noise-out`, instead of a grade.
    rate : float
        Samples a second.
    mounting : str
        ROLL,PITCH,YAW in deg that turn the vehicle's axes (forward, right, down) into those of
        the IMU.
    vibration : float
        Engine, wheels and road of a car or motorcycle, rotors of a drone: 1 as usual, 0 none.
    scale_factor : float
        Standard deviation of the scale factors, ppm.
    misalignment : float
        Standard deviation of the angles between the axes and where they should be, deg.
    g_sensitivity : float
        Standard deviation of what the gyros show of the force, deg/s per g.
    gyro_range : float, optional
        Largest rate delivered, deg/s.
    accel_range : float, optional
        Largest force delivered, g.
    gyro_step : float
        Rounding of the rates, deg/s.
    accel_step : float
        Rounding of the forces, mg.
    warming : float
        Kelvin by which the device warms up, biases with it.
    jitter : float
        Standard deviation of the time stamps, ms.
    clock : float
        Error of the rate of its clock, ppm.
    repeated : float
        Share of rows that repeat the row before.
    array : str, optional
        Several IMUs: tetrahedron, tetrahedron:RADIUS in m, or a number of IMUs side by side.
    """

    grade: str = "consumer"
    noise: Path | None = None
    rate: float = 100.0
    mounting: str = "0,0,0"
    vibration: float = 0.0
    scale_factor: float = 0.0
    misalignment: float = 0.0
    g_sensitivity: float = 0.0
    gyro_range: float | None = None
    accel_range: float | None = None
    gyro_step: float = 0.0
    accel_step: float = 0.0
    warming: float = 0.0
    jitter: float = 0.0
    clock: float = 0.0
    repeated: float = 0.0
    array: str | None = None

    def noise_model(self) -> NoiseModel | None:
        """Return the noise that is drawn from, None for an ideal sensor."""
        from schuler.noise import NoiseModel
        from schuler.simulation.grades import grade_noise

        if self.noise is not None:
            return NoiseModel.load(self.noise)
        return None if self.grade == "none" else grade_noise(self.grade)

    def errors(self) -> SensorFaults:
        """Return the errors of the sensor beside its noise, in SI."""
        from schuler.simulation.scenario import SensorFaults
        from schuler.units import STANDARD_GRAVITY as G

        return SensorFaults(
            scale_factor=1e-6 * self.scale_factor,
            misalignment=radians(self.misalignment),
            g_sensitivity=radians(self.g_sensitivity) / G,
            gyro_range=inf if self.gyro_range is None else radians(self.gyro_range),
            accel_range=inf if self.accel_range is None else self.accel_range * G,
            gyro_step=radians(self.gyro_step),
            accel_step=1e-3 * self.accel_step * G,
            warming=self.warming,
        )

    def places(self) -> Mounting | None:
        """Return where the IMUs of an array sit, None for one IMU."""
        if self.array is None:
            return None
        from schuler.arrays.geometry import orthogonal_mounting, tetrahedron_mounting

        name, _, radius = self.array.partition(":")
        try:
            if name == "tetrahedron":
                return tetrahedron_mounting(float(radius or 0.0))
            count = int(self.array)
            if not 2 <= count <= 64:
                raise ValueError
            return orthogonal_mounting(count)
        except ValueError:
            raise InputError(
                f"--array {self.array}",
                expected="--array tetrahedron, tetrahedron:RADIUS in m, or a number of IMUs such "
                "as 4",
            ) from None


@Parameter(name="*", group=RECEIVER)
@dataclass(frozen=True)
class ReceiverOptions:
    """GNSS.

    Parameters
    ----------
    gnss : str
        Receiver: code (one frequency), differential, or rtk (fixed).
    gnss_rate : float
        Fixes a second.
    lever_arm : str
        X,Y,Z from the IMU to the antenna in m, in the axes of the IMU.
    latency : str
        Seconds by which stamps are late: one number, or POSITION,VELOCITY.
    claimed_scale : float
        Claimed over real standard deviations.
    outage : tuple of str
        START:SECONDS without GNSS. May be repeated.
    outliers : str, optional
        SHARE:METRES of fixes that are off.
    velocity : bool
        Whether the receiver gives velocities.
    """

    gnss: Literal["code", "differential", "rtk"] = "rtk"
    gnss_rate: float = 1.0
    lever_arm: str = "0,0,0"
    latency: str = "0"
    claimed_scale: float = 1.0
    outage: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    outliers: str | None = None
    velocity: Annotated[bool, Parameter(negative="--no-velocity")] = True

    def grade(self) -> GnssGrade:
        """Return how good the receiver is."""
        from schuler.simulation.receivers import DIFFERENTIAL_CODE, L1_CODE, RTK_FIXED

        return {"code": L1_CODE, "differential": DIFFERENTIAL_CODE, "rtk": RTK_FIXED}[self.gnss]

    def latencies(self) -> tuple[float, float]:
        """Return by how much stamps of position and velocity are late, s."""
        count = 2 if "," in self.latency else 1
        late = parse_numbers(self.latency, count, "--latency SECONDS or POSITION,VELOCITY")
        return late[0], late[-1]

    def outages(self) -> tuple[tuple[float, float], ...]:
        """Return start and length of the stretches without GNSS, s."""
        example = "--outage START:SECONDS, such as 120:30"
        pairs = (parse_numbers(o, 2, example, ":") for o in self.outage)
        return tuple((start, seconds) for start, seconds in pairs)

    def wrong_fixes(self) -> tuple[float, float]:
        """Return the share of fixes that are off, and by how many m."""
        if self.outliers is None:
            return 0.0, 50.0
        share, size = parse_numbers(self.outliers, 2, "--outliers SHARE:METRES, as 0.02:50", ":")
        return share, size
