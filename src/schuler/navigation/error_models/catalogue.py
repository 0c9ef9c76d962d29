"""The catalogue of error models: what a filter may be told of its sensor, by name.

15AV, 18AV, 18AVWD, 15AR and 27AR are those of Quinchia et al. 2013 (S004), from what that paper
reads off an Allan curve; they are sums of processes like any other. Where the paper is wrong the
model says so in `notes`, and "+corrected" takes the right parameters. The others are ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError, ModelError
from schuler.navigation.error_models.allan_readings import AllanReading
from schuler.navigation.error_models.changing_noise import ChangingNoise, averaged_noise
from schuler.navigation.error_models.sensor_denoising import SensorDenoising
from schuler.navigation.error_models.sensor_error_model import (
    SensorErrorModel,
    sensor_error_model,
    with_misalignments,
    with_scale_factors,
)
from schuler.noise import (
    ARMA,
    Autoregressive,
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Process,
    ProcessSum,
    RandomWalk,
    WhiteNoise,
)
from schuler.noise.gauss_markov import FLICKER_LEVEL
from schuler.types import FloatArray

ERROR_MODELS: dict[str, str] = {
    "15AV": "white noise and one Gauss-Markov noise on every channel",
    "18AV": "the same, and a random walk on the accelerometers",
    "18AVWD": "18AV on wavelet de-noised measurements",
    "15AR": "white noise and AR(1) fitted to the de-noised static record",
    "27AR": "white noise and AR(3) fitted to the de-noised static record",
    "flicker4": "white noise, bias instability as four Gauss-Markov noises, random walk",
    "own": "the processes of the noise model as they are",
}
"""Every base model, in words."""

OPTIONS: dict[str, str] = {
    "corrected": "one Gauss-Markov noise through the flat part as it should be (E-004-7)",
    "turn-on": "a state that holds the turn-on constant of every channel",
    "scale": "scale factor errors as states",
    "misalignment": "misalignments between the axes as states",
    "averaged": "white noise that follows the average of its squares over the last second",
    "garch": "white noise that follows the GARCH model of the static record",
}
"""What may follow a base model after a plus sign."""

FLICKER_TIMES = (1.0, 1000.0)
# how far scale factors and angles of a calibrated consumer sensor are usually out
SCALE_FACTOR_SD = 3e-3
MISALIGNMENT_SD = 3e-3


@dataclass(frozen=True, slots=True, eq=False)
class ErrorModel:
    """What a filter is told of its sensor.

    Parameters
    ----------
    name : str
        As asked for, such as "18AV+turn-on".
    noise_model : NoiseModel
        The processes of all six channels.
    hold_constants : bool
        Whether every channel gets a state that can hold a constant.
    denoising : SensorDenoising or None
        What is done to the measurements before the filter sees them.
    notes : tuple of str
        What to know before use: where the paper's form is wrong, what had to be assumed.
    scale_factor_sd, misalignment_sd : float
        Of the constant states for scale factor errors and misalignments; zero: no such states.
    changing_noise : ChangingNoise or "averaged" or None
        How the white noise changes from sample to sample; "averaged" with the average of the last
        second at whatever rate the drive has.

    Examples
    --------
    >>> from schuler import ErrorModel, NoiseModel, WhiteNoise
    >>> ErrorModel("mine", NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))).name
    'mine'
    """

    name: str
    noise_model: NoiseModel
    hold_constants: bool = False
    denoising: SensorDenoising | None = None
    notes: tuple[str, ...] = field(default=())
    scale_factor_sd: float = 0.0
    misalignment_sd: float = 0.0
    changing_noise: ChangingNoise | Literal["averaged"] | None = None

    def sensor_model(
        self, turn_on_accel: float, turn_on_gyro: float, interval: float | None = None
    ) -> SensorErrorModel:
        """Return the states and the white noise for the filter.

        Parameters
        ----------
        turn_on_accel, turn_on_gyro : float
            Standard deviation of the constant at switch-on, m/s² and rad/s.
        interval : float, optional
            Sample interval of the IMU, s; default: that of the AR models in it.

        Returns
        -------
        SensorErrorModel
            For `run_engine`.

        Raises
        ------
        ModelError
            An AR model of another sample interval that cannot be changed to this one exactly.
        """
        model = sensor_error_model(
            self.noise_model,
            turn_on_accel=turn_on_accel,
            turn_on_gyro=turn_on_gyro,
            interval=interval or self.interval,
            hold_constants=self.hold_constants,
        )
        scale, turned = self.scale_factor_sd, self.misalignment_sd
        model = with_scale_factors(model, accel_sd=scale, gyro_sd=scale)
        return with_misalignments(model, accel_sd=turned, gyro_sd=turned)

    @property
    def interval(self) -> float | None:
        """Sample interval of the AR models in it, s; None without any."""
        parts = [p for c in self.noise_model.channels for p in self.noise_model.process(c).parts]
        found = [p.interval for p in parts if isinstance(p, Autoregressive | ARMA)]
        return max(found, default=None)

    @property
    def states(self) -> int:
        """Number of states of the filter, position, velocity and attitude included."""
        return 9 + self.sensor_model(0.0, 0.0).size

    @property
    def cautions(self) -> tuple[str, ...]:
        """What to know before use: the notes, and a constant at switch-on that no state holds."""
        if self.hold_constants:
            return self.notes
        lacking = "no state holds the constant that a sensor has at switch-on: +turn-on adds one"
        return (*self.notes, lacking)

    def measured(self, imu: ImuRecording) -> ImuRecording:
        """Return the recording that this model's filter works on.

        Parameters
        ----------
        imu : ImuRecording
            As recorded.

        Returns
        -------
        ImuRecording
            De-noised where the model asks for it, else the same.
        """
        return imu if self.denoising is None else self.denoising.apply(imu)

    def white_scale(self, imu: ImuRecording) -> FloatArray | None:
        """Return what multiplies the squared white-noise densities, sample by sample.

        Parameters
        ----------
        imu : ImuRecording
            As recorded: de-noised measurements do not show how loud the noise is.

        Returns
        -------
        (n, 6) ndarray or None
            For `run`; None where the noise is constant.
        """
        changing = self.changing_noise
        if changing is None:
            return None
        if changing == "averaged":
            changing = averaged_noise(imu.duration / max(imu.size - 1, 1))
        return changing.white_scale(imu)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: name, states, processes of every channel, notes."""
        return {
            "name": self.name,
            "states": self.states,
            "hold_constants": self.hold_constants,
            "denoising": None if self.denoising is None else self.denoising.to_dict(),
            "changing_noise": self.changing_noise.to_dict()
            if isinstance(self.changing_noise, ChangingNoise)
            else self.changing_noise,
            "notes": list(self.notes),
            "processes": {
                c: [{"kind": p.kind, **p.parameters} for p in self.noise_model.process(c).parts]
                for c in self.noise_model.channels
            },
        }


def split_model_name(name: str) -> tuple[str, tuple[str, ...]]:
    """Split "BASE+OPTION+..." and check both."""
    base, *options = (part.strip() for part in name.split("+"))
    known = {m.lower(): m for m in ERROR_MODELS}
    if base.lower() not in known:
        raise InputError(f"error model '{base}'", expected=", ".join(ERROR_MODELS))
    wrong = [o for o in options if o not in OPTIONS]
    if wrong:
        raise InputError(
            f"option '{wrong[0]}' of error model '{name}'", expected=", ".join(OPTIONS)
        )
    return known[base.lower()], tuple(options)


def error_model(
    name: str,
    readings: Mapping[str, AllanReading],
    *,
    autoregressive: Mapping[str, Autoregressive] | None = None,
    noise_model: NoiseModel | None = None,
    denoising: SensorDenoising | None = None,
    changing_noise: ChangingNoise | None = None,
) -> ErrorModel:
    """Build an error model of the catalogue by its name.

    Parameters
    ----------
    name : str
        "15AV", "18AV", "18AVWD", "15AR", "27AR", "18AV+turn-on", "flicker4", "own", and others that
        `schuler outages --models` lists; "+averaged" or "+garch" behind it follows the noise.
    readings : mapping of str to AllanReading
        N, B, K by channel, SI.
    autoregressive : mapping of str to Autoregressive, optional
        By channel, for the AR models.
    noise_model : NoiseModel, optional
        For "own".
    denoising : SensorDenoising, optional
        Of the measurements; S004 Table 7 for "18AVWD" if not given.
    changing_noise : ChangingNoise, optional
        How noise is followed.

    Returns
    -------
    ErrorModel
        States of the filter and what is done to its measurements.

    Raises
    ------
    InputError
        An unknown name, or what it needs is missing.

    Notes
    -----
    S004 equations (19) to (36) and Table 8.

    Examples
    --------
    >>> import schuler
    >>> reading = schuler.AllanReading(1e-3, 1e-5, 100.0, 1e-6)
    >>> channels = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    >>> schuler.error_model("18AV", {c: reading for c in channels}).states
    18
    """
    base, options = split_model_name(name)
    missing = [c for c in CHANNELS if c not in readings]
    if missing and base != "own":
        raise InputError(f"no readings of {', '.join(missing)}", expected="all six channels")
    corrected = "corrected" in options
    if "averaged" in options and "garch" in options:
        raise InputError(f"error model '{name}'", expected="averaged or garch")
    if "garch" in options and changing_noise is None:
        raise InputError(
            f"error model '{name}' without a GARCH model",
            cure="give a static recording of the sensor at the rate of the drive",
        )
    notes: list[str] = []
    wavelets = None
    if base == "own":
        if noise_model is None:
            raise InputError("error model 'own' without a noise model", cure="give a noise model")
        processes: dict[str, Process] = dict(noise_model.processes)
    elif base in ("15AR", "27AR"):
        order = 1 if base == "15AR" else 3
        processes = _autoregressive(readings, autoregressive, order, notes)
    elif base == "flicker4":
        processes = {c: _flicker(c, r) for c, r in readings.items()}
    else:
        walk = base != "15AV"
        processes = {c: _allan(c, r, walk, corrected) for c, r in readings.items()}
        notes += _allan_notes(readings, corrected)
        if base == "18AVWD":
            wavelets = denoising or SensorDenoising.table_7()
            notes += wavelets.notes
    return ErrorModel(
        name="+".join((base, *options)),
        noise_model=NoiseModel(processes=processes, source=f"{base}: {ERROR_MODELS[base]}"),
        hold_constants="turn-on" in options or base in ("own", "flicker4"),
        denoising=wavelets,
        notes=tuple(notes),
        scale_factor_sd=SCALE_FACTOR_SD if "scale" in options else 0.0,
        misalignment_sd=MISALIGNMENT_SD if "misalignment" in options else 0.0,
        changing_noise=_changing(options, changing_noise),
    )


def _changing(
    options: tuple[str, ...], given: ChangingNoise | None
) -> ChangingNoise | Literal["averaged"] | None:
    if "averaged" in options:
        return given or "averaged"
    return given if "garch" in options else None


def _allan(channel: str, r: AllanReading, walk: bool, corrected: bool) -> ProcessSum:
    """S004 (19), (20): the random walk belongs to the accelerometers."""
    plateau = GaussMarkov.through_plateau(r.bias_instability, r.flat_time)
    if not corrected:
        # S004 (29) and table 5: the plateau as sigma, its cluster time as correlation time
        plateau = GaussMarkov(FLICKER_LEVEL * r.bias_instability, r.flat_time)
    parts: list[Process] = [WhiteNoise(r.white_noise), plateau]
    if walk and channel.startswith("accel"):
        parts.append(RandomWalk(r.random_walk))
    return ProcessSum(tuple(parts))


def _allan_notes(readings: Mapping[str, AllanReading], corrected: bool) -> list[str]:
    notes = []
    if not corrected:
        notes.append(
            "E-004-7: sigma = 0.664 B with Tc = cluster time of the flat part reaches 62 % of the "
            "plateau, at 1.9 times its time; a filter told this is overconfident. Right: "
            "1.076 B and a time 1.89 times shorter (+corrected)"
        )
    crossed = [c for c, r in readings.items() if r.crossing]
    if crossed:
        notes.append(
            f"E-004-9: the bias instability of {', '.join(crossed)} is where white noise and "
            "random walk cross, no plateau"
        )
    return notes


def _flicker(channel: str, r: AllanReading) -> ProcessSum:
    shortest, longest = FLICKER_TIMES
    parts: list[Process] = [WhiteNoise(r.white_noise)]
    if r.bias_instability > 0.0 and not r.crossing:
        parts.append(BiasInstability(r.bias_instability, shortest, longest))
    if r.random_walk > 0.0:
        parts.append(RandomWalk(r.random_walk))
    return ProcessSum(tuple(parts))


def _autoregressive(
    readings: Mapping[str, AllanReading],
    fits: Mapping[str, Autoregressive] | None,
    order: int,
    notes: list[str],
) -> dict[str, Process]:
    processes: dict[str, Process] = {}
    for channel in CHANNELS:
        fit = None if fits is None else fits.get(channel)
        if fit is None:
            raise InputError(
                f"no autoregressive fit of {channel}",
                expected=f"AR({order}) of all six channels",
                cure="give a static recording to fit them to",
            )
        if fit.order != order:
            raise ModelError(f"AR({fit.order}) of {channel}", expected=f"AR({order})")
        processes[channel] = ProcessSum((WhiteNoise(readings[channel].white_noise), fit))
    notes.append(
        "E-004-11: a fit to the one-step error of de-noised data describes the low-pass, and "
        "counts its white noise a second time as bias; it says nothing about the slow bias"
    )
    return processes
