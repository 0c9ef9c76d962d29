"""Noise models for GNSS/INS programs: KF-GINS, NaveGo, PSINS."""

from __future__ import annotations

import io
import math

import numpy as np

from schuler.errors import ModelError
from schuler.io.format import Format, NoiseRequest
from schuler.io.noise_forms.numbers import number, rate_of, sensor_numbers, source_line
from schuler.noise import NoiseModel
from schuler.unit_grammar import STANDARD_GRAVITY
from schuler.units import scale

_PER_DEGREE_AN_HOUR = scale("deg/h", "gyro bias")
_DEGREES_A_ROOT_HOUR = scale("deg/sqrt(h)", "gyro white noise")


def kf_gins(model: NoiseModel, request: NoiseRequest) -> str:
    """Return `imunoise` of KF-GINS; its bias is Gauss-Markov with one correlation time."""
    accel, gyro = sensor_numbers(model, "accel"), sensor_numbers(model, "gyro")
    hours = max(gyro.correlation_time, accel.correlation_time) / 3600.0

    def three(value: float) -> str:
        return f"[ {number(value)}, {number(value)}, {number(value)} ]"

    lines = [
        source_line(model),
        "# Bias and correlation time are those of the Gauss-Markov noise of the worst axis.",
        "imunoise:",
        f"  arw: {three(gyro.density / _DEGREES_A_ROOT_HOUR)}  # deg/sqrt(h)",
        f"  vrw: {three(accel.density * 60.0)}  # m/s/sqrt(h)",
        f"  gbstd: {three(gyro.sigma / _PER_DEGREE_AN_HOUR)}  # deg/h",
        f"  abstd: {three(accel.sigma * 1e5)}  # mGal",
        "  gsstd: [ 300.0, 300.0, 300.0 ]  # ppm, not known to the noise model",
        "  asstd: [ 300.0, 300.0, 300.0 ]  # ppm, not known to the noise model",
        f"  corrtime: {number(hours)}  # h",
        "# antlever is forward, right, down",
    ]
    return "\n".join(lines) + "\n"


def navego(model: NoiseModel, request: NoiseRequest) -> bytes:
    """Return a struct `imu` of NaveGo as MATLAB 5: SI, one number an axis."""
    from scipy.io import savemat

    rate = rate_of(model, request)
    imu: dict[str, object] = {"freq": rate, "ini_align": np.zeros((1, 3))}
    for sensor, white, walk, letter in (("gyro", "arw", "arrw", "g"),
                                        ("accel", "vrw", "vrrw", "a")):  # fmt: skip
        numbers = sensor_numbers(model, sensor)
        one = np.ones((1, 3))
        imu |= {
            white: numbers.density * one,
            walk: numbers.walk * one,
            f"{letter}b_sta": np.zeros((1, 3)),
            f"{letter}b_dyn": numbers.sigma * one,
            f"{letter}b_corr": numbers.correlation_time * one,
            f"{letter}b_psd": numbers.sigma * math.sqrt(numbers.correlation_time) * one,
            f"{letter}_std": numbers.density * math.sqrt(rate) * one,
        }
    stream = io.BytesIO()
    savemat(stream, {"imu": imu})  # type: ignore[arg-type]  # a stream is taken
    return stream.getvalue()


def psins(model: NoiseModel, request: NoiseRequest) -> str:
    """Return a call of imuerrset of PSINS: deg/h, ug, deg/sqrt(h), ug/sqrt(Hz)."""
    accel, gyro = sensor_numbers(model, "accel"), sensor_numbers(model, "gyro")
    if gyro.density <= 0.0 or accel.density <= 0.0:
        raise ModelError("no white noise", expected="white noise of gyros and accelerometers")
    micro = 1e-6 * STANDARD_GRAVITY
    lines = [
        source_line(model, "%"),
        "% imuerrset(eb deg/h, db ug, web deg/sqrt(h), wdb ug/sqrt(Hz), sqrtR0G, TauG, "
        "sqrtR0A, TauA)",
        "imuerr = imuerrset("
        f"{number(gyro.sigma / _PER_DEGREE_AN_HOUR)}, {number(accel.sigma / micro)}, "
        f"{number(gyro.density / _DEGREES_A_ROOT_HOUR)}, {number(accel.density / micro)}, "
        f"{number(gyro.sigma / _PER_DEGREE_AN_HOUR)}, {number(gyro.correlation_time)}, "
        f"{number(accel.sigma / micro)}, {number(accel.correlation_time)});",
    ]
    return "\n".join(lines) + "\n"


FORMATS = (
    Format("kf-gins-noise", "KF-GINS imunoise", write_noise=kf_gins),
    Format("navego", "NaveGo struct (.mat)", (".mat",), write_noise=navego),
    Format("psins", "PSINS imuerrset (.m)", write_noise=psins),
)
