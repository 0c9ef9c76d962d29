"""By how much to inflate the numbers of a static log for a filter on a drive, and how sure that is.

What a sensor does on a bench is not what it does in a vehicle: vibration, scale factors and
everything a model leaves out come on top. The usual advice is to multiply by ten, or by a hundred.
Here the drive answers: the factors on white noise and on what drives the biases, one each for
accelerometers and gyros, under which the innovations of GNSS were most likely, thinned so that the
likelihood feels what an outage needs (tuning/tune.py), with their intervals and with what the
common factors would cost. Spec 7.9.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.data.exportable import Exportable
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.preparation.prepare import prepare_drive
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigation.run import run
from schuler.navigation.settings import NavigationOptions, navigation_settings
from schuler.navigation.tuning.tune import Sought, Tuning, tune
from schuler.noise.noise_model import NoiseModel
from schuler.types import FloatArray

# factors that people use
COMMON_FACTORS = (1.0, 3.0, 10.0, 30.0, 100.0)
# a factor of this many nepers is one standard deviation of the prior: it says next to nothing
VAGUE_SD = 4.0
# steps of the search for the other factors where one is held
STEPS_BESIDE = 3
# of a normal distribution, 95 %
TWO_SIDED = 1.959963984540054

_PARAMETERS = {
    "white accel": ("accelerometer", "white noise"),
    "white gyro": ("gyro", "white noise"),
    "drive accel": ("accelerometer", "bias walk"),
    "drive gyro": ("gyro", "bias walk"),
}


@dataclass(frozen=True, slots=True, eq=False)
class NoiseInflation(Exportable):
    """One kind of noise of one sensor: what the bench says, and what the drive needs.

    Parameters
    ----------
    sensor : {"accelerometer", "gyro"}
        Three channels.
    kind : {"white noise", "bias walk"}
        Which density: of the white noise, or of what drives the bias states.
    static : (3,) ndarray
        Densities of the given model for x, y, z: per sqrt(Hz) or per sqrt(s), SI.
    factor, lower, upper : float
        Most likely factor, and its 95 % interval.
    profile_factors : (k,) ndarray
        Factors that were tried.
    profile_loss : (k,) ndarray
        By how much the log-likelihood lies below its maximum there, everything else at its best.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, simulate_drive, tune_noise
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> found = tune_noise(imu, gnss, model, factors=(1.0, 3.0), time_offset=0.0)
    >>> found.inflations[0].sensor
    'accelerometer'
    """

    JSON = "sensor kind static_density=static tuned_density=tuned factor"

    sensor: str
    kind: str
    static: FloatArray
    factor: float
    lower: float
    upper: float
    profile_factors: FloatArray
    profile_loss: FloatArray

    @property
    def tuned(self) -> FloatArray:
        """Densities (3,) for a filter on such a drive."""
        return self.static * self.factor

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        pairs = zip(self.profile_factors.tolist(), self.profile_loss.tolist(), strict=True)
        return Exportable.to_dict(self) | {
            "interval_95": [self.lower, self.upper],
            "profile": [{"factor": f, "log_likelihood_lost": loss} for f, loss in pairs],
        }


@dataclass(frozen=True, slots=True, eq=False)
class NoiseTuning(Exportable):
    """What a drive says of a noise model.

    Parameters
    ----------
    inflations : tuple of NoiseInflation
        White noise and bias walk of accelerometers and gyros; a kind that the model does not have
        is left out.
    noise_model : NoiseModel
        The given one with the factors, ready for `navigate`.
    receiver : dict of str to (float, float, float)
        Factor on the receiver's standard deviations of "position" and "velocity", with its 95 %
        interval.
    offsets : TimeOffsets
        Of GNSS.
    gain : float
        Log-likelihood won over the given model, GNSS's standard deviations tuned in both.
    nis_before, nis_after : float
        Normalised innovation squared of GNSS over its degrees of freedom at the full rate, with
        the given model and with the tuned one; one is honest.
    converged : bool
        Whether the search ended by itself.
    setup : RunSetup
        Ready to run.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, simulate_drive, tune_noise
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> found = tune_noise(imu, gnss, model, factors=(1.0, 3.0), time_offset=0.0)
    >>> len(found.inflations) > 0
    True
    """

    JSON = (
        "inflations time_offset_position_s=offsets.position "
        "time_offset_velocity_s=offsets.velocity log_likelihood_gain=gain "
        "nis_over_degrees_static=nis_before nis_over_degrees_tuned=nis_after converged"
    )

    inflations: tuple[NoiseInflation, ...]
    noise_model: NoiseModel
    receiver: dict[str, tuple[float, float, float]]
    offsets: TimeOffsets
    gain: float
    nis_before: float
    nis_after: float
    converged: bool
    setup: RunSetup

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        receiver = {
            name: {"factor": factor, "interval_95": [lower, upper]}
            for name, (factor, lower, upper) in self.receiver.items()
        }
        return Exportable.to_dict(self) | {"receiver_sd": receiver}


def tune_noise(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel,
    *,
    factors: Sequence[float] = COMMON_FACTORS,
    progress: Callable[[str], None] | None = None,
    **options: Unpack[NavigationOptions],
) -> NoiseTuning:
    """Find by how much a drive inflates the noise of a static log.

    Parameters
    ----------
    imu, gnss, progress, **options
        As for `navigate`, but for `tune_noise`.
    noise_model : NoiseModel
        Usually from a static log.
    factors : sequence of float
        Where the likelihood of each factor is shown.

    Returns
    -------
    NoiseTuning
        Factors with 95 % intervals, the likelihood over them, and the inflated model. The
        intervals are asymptotic (spec 7.9; sandwich over pieces of 20 s); white noise is taken
        as constant over the drive.

    Raises
    ------
    SchulerError
        As `navigate`, or too few GNSS epochs.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, simulate_drive, tune_noise
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> found = tune_noise(imu, gnss, model, factors=(1.0, 3.0), time_offset=0.0)
    >>> len(found.inflations) > 0
    True
    """
    say = progress or (lambda _: None)
    settings = navigation_settings(tune_noise, options, tune_noise=False)
    prepared = prepare_drive(imu, gnss, noise_model, settings, progress)
    cut, start = prepared.imu, replace(prepared.setup, factors=NoiseFactors.none())

    def search(fixed: dict[str, float], first: dict[str, float], longest: int = 30) -> Tuning:
        offsets = settings.estimates_offset and not fixed
        sought = Sought("sensors", offsets, first, fixed, VAGUE_SD, longest)
        return tune(cut, gnss, start, sought, progress)

    say("looking for the most likely factors")
    best = search({}, {})
    names = [n for n in _PARAMETERS if n in best.values]
    offsets = {n: v for n, v in best.values.items() if "offset" in n}
    static = search(dict.fromkeys(names, 0.0) | offsets, {})
    inflations = []
    for name in names:
        sensor, kind = _PARAMETERS[name]
        say(f"likelihood of the {kind} of the {sensor}")
        loss = [
            best.log_likelihood
            - search({name: float(np.log(f))} | offsets, best.values, STEPS_BESIDE).log_likelihood
            for f in factors
        ]
        factor, lower, upper = _interval(best, name)
        inflations.append(
            NoiseInflation(
                sensor,
                kind,
                _densities(start.model, sensor, kind),
                factor,
                lower,
                upper,
                np.asarray(factors, dtype=np.float64),
                np.maximum(np.array(loss), 0.0),
            )
        )
    say("filtering with both")
    return NoiseTuning(
        inflations=tuple(inflations),
        noise_model=inflated(noise_model, {(i.sensor, i.kind): i.factor for i in inflations}),
        receiver={
            n.removeprefix("sd "): _interval(best, n)
            for n in ("sd position", "sd velocity")
            if n in best.values
        },
        offsets=best.setup.offsets,
        gain=best.log_likelihood - static.log_likelihood,
        nis_before=_nis(cut, gnss, replace(start, offsets=best.setup.offsets)),
        nis_after=_nis(cut, gnss, best.setup),
        converged=best.converged,
        setup=best.setup,
    )


def inflated(model: NoiseModel, factors: dict[tuple[str, str], float]) -> NoiseModel:
    """Multiply the noise of a model."""
    from schuler.noise import ProcessSum

    processes = {}
    for channel in model.channels:
        sensor = "gyro" if channel.startswith("gyro") else "accelerometer"
        white = factors.get((sensor, "white noise"), 1.0)
        walk = factors.get((sensor, "bias walk"), 1.0)
        parts = [_scaled(p, white, walk) for p in model.process(channel).components]
        processes[channel] = ProcessSum(tuple(parts))
    source = f"{model.source}, inflated by a drive" if model.source else "inflated by a drive"
    return NoiseModel(processes, rate=model.rate, source=source)


def _scaled(part: Any, white: float, walk: float) -> Any:
    """A component of the same kind with its noise multiplied."""
    from schuler.noise import BiasInstability, GaussMarkov, RandomWalk, WhiteNoise

    if isinstance(part, WhiteNoise):
        return replace(part, density=part.density * white)
    if isinstance(part, RandomWalk):
        return replace(part, density=part.density * walk)
    if isinstance(part, GaussMarkov):
        return replace(part, sigma=part.sigma * walk)
    if isinstance(part, BiasInstability):
        return replace(part, level=part.level * walk)
    if hasattr(part, "driving_variance"):
        return replace(part, driving_variance=part.driving_variance * walk**2)
    return part


def _interval(found: Tuning, name: str) -> tuple[float, float, float]:
    value, sd = found.values[name], found.standard_errors[name]
    reach = TWO_SIDED * sd
    return float(np.exp(value)), float(np.exp(value - reach)), float(np.exp(value + reach))


def _densities(model: SensorErrorModel, sensor: str, kind: str) -> FloatArray:
    """Of x, y, z; the driving noise is that of all states of a channel together."""
    first = 0 if sensor == "accelerometer" else 3
    if kind == "white noise":
        return model.white_density[first : first + 3].copy()
    driven = np.zeros(3)
    for axis in range(3):
        own = model.channel == first + axis
        driven[axis] = np.sqrt(model.diffusion[own, 0].sum())
    return driven


def _nis(imu: ImuRecording, gnss: GnssRecording, setup: RunSetup) -> float:
    return float(run(imu, gnss, setup).causal.innovations.gnss.mean_nis)
