"""All channels of one recording: a noise model, and what a person should know about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.data.exportable import Exportable
from schuler.data.imu import ImuRecording
from schuler.errors import EstimationError, SchulerError
from schuler.estimation.allan_route import identify_signal
from schuler.estimation.disturbances.lines import Line
from schuler.estimation.disturbances.prepare import followed, taken_out
from schuler.estimation.identification import Identification
from schuler.estimation.ieee952 import classical_reading, ieee952_to_dict
from schuler.estimation.record import spell_duration
from schuler.noise import NoiseModel, Process
from schuler.noise.effects import Effect
from schuler.types import FloatArray
from schuler.units import format_value

_GRID_SAMPLES = 20_000
_NOTABLE_DISCREPANCY = 0.02
_NOTABLE_ROUNDING = 0.005
# of the power, from which noise is too small to be seen through the steps: sd of 0.4 steps
_HIDDEN = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ImuCharacterization(Exportable):
    """The noise of every recorded channel.

    Parameters
    ----------
    recording_name : str
        Which recording.
    channels : dict of str to Identification
        By channel name.
    noise_model : NoiseModel
        The same as a model for filters and simulations, with errors and limits.
    findings : tuple of str
        What is worth knowing, in plain language.
    rate : float
        Samples a second.
    duration : float
        Length in s.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, characterize_imu, simulate_static
    >>> model = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))
    >>> imu = simulate_static(model, 120.0, 50.0, np.random.default_rng(1))
    >>> found = characterize_imu(imu)
    >>> sorted(found.channels)[:2]
    ['accel_x', 'accel_y']
    >>> round(found.rate)
    50
    """

    JSON = "recording=recording_name rate_hz=rate duration_s=duration channels findings"

    recording_name: str
    channels: dict[str, Identification]
    noise_model: NoiseModel
    findings: tuple[str, ...]
    rate: float
    duration: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON: SI, with standard errors."""
        coefficients = {
            c: ieee952_to_dict(one.ieee952, classical_reading(one.curve, one.slopes, one.process))
            for c, one in self.channels.items()
        }
        return Exportable.to_dict(self) | {"ieee952": coefficients}


def characterize_imu(imu: ImuRecording, model: str | Process = "auto") -> ImuCharacterization:
    """Identify the noise of every channel of a recording at rest.

    Parameters
    ----------
    imu : ImuRecording
        Lying still, evenly sampled (screen and repair it first).
    model : str or Process
        As for `identify`, for every channel.

    Returns
    -------
    ImuCharacterization
        Processes, noise model, findings.

    Raises
    ------
    EstimationError
        Too short, or a channel that does not vary.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, characterize_imu, simulate_static
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> imu = simulate_static(model, 300.0, 100.0, np.random.default_rng(1))
    >>> sorted(characterize_imu(imu).channels)[:3]
    ['accel_x', 'accel_y', 'accel_z']
    """
    rate = imu.rate
    channels: dict[str, Identification] = {}
    columns = {} if imu.temperature is None else {"temperature": imu.temperature}
    for name in imu.channels:
        try:
            channels[name] = identify_signal(imu.channel(name), rate, model, columns)
        except SchulerError as error:
            raise error.at(f"{imu.name}, {name}") from None
    if not channels:
        raise EstimationError(f"recording '{imu.name}' has no channel", expected="at least one")
    return ImuCharacterization(
        recording_name=imu.name,
        channels=channels,
        noise_model=model_of(channels, rate, imu.name, imu.duration),
        findings=tuple(findings_of(imu, channels, imu.duration)),
        rate=rate,
        duration=imu.duration,
    )


def model_of(
    channels: Mapping[str, Identification], rate: float, name: str, duration: float
) -> NoiseModel:
    """Return what was found of the channels of a recording as a noise model."""
    return NoiseModel(
        processes={c: found.process for c, found in channels.items()},
        standard_errors={c: found.standard_errors for c, found in channels.items()},
        rate=rate,
        source=f"fit to the Allan deviation of {name}, {spell_duration(duration)} at rest",
        limits={c: found.limits for c, found in channels.items()},
        effects={c: found.effects for c, found in channels.items() if found.effects},
    )


def findings_of(
    imu: ImuRecording, channels: Mapping[str, Identification], duration: float
) -> list[str]:
    """Say what is worth knowing; of a long record, `imu` is the first piece."""
    hidden, lines = _rounding(imu, channels)
    told = {c: found for c, found in channels.items() if c not in hidden}
    lines = [*lines, *_flags(channels)]
    lines += [_record_length(duration, told)] if told else []
    lines += [text for c, found in channels.items() if (text := _crossing(c, found))]
    lines += [text for c, found in channels.items() if (text := _undecided(c, found))]
    lines += _not_seen(channels)
    rough = {c: f for c, f in channels.items() if f.diagnostics.discrepancy > _NOTABLE_DISCREPANCY}
    if rough:
        worst = max(f.diagnostics.discrepancy for f in rough.values())
        lines.append(
            f"{_join(rough)}: no sum of these processes describes the Allan deviation to better "
            f"than about {100.0 * worst:.0f} %, which the standard errors allow for: look for "
            f"vibration, temperature or something that touched the sensor"
        )
    late = {
        c: f.diagnostics.tau[0] for c, f in channels.items() if f.diagnostics.tau[0] > 5 / imu.rate
    }
    if late:
        lines.append(
            f"{_join(late)}: clusters below {max(late.values()):.2g} s were left out of the fit: "
            f"neighbouring samples are correlated (a low-pass filter in the sensor) or hold lines "
            f"of vibration"
        )
    drifting = [c for c, f in channels.items() if "rate_ramp" in {p.kind for p in f.process.parts}]
    if drifting and imu.temperature is None:
        lines.append(
            f"{_join(drifting)}: a steady drift was found, as a sensor shows that warms up: log "
            f"its temperature beside it, or let it run for an hour first"
        )
    return lines


def _join(names: Mapping[str, object] | Sequence[str]) -> str:
    return ", ".join(names)


def _record_length(duration: float, channels: Mapping[str, Identification]) -> str:
    weakest = [
        (verdict.relative_error, channel, verdict)
        for channel, found in channels.items()
        for verdict in found.verdict.parameters
    ]
    error, channel, verdict = max(weakest, key=lambda w: w[0])
    length = spell_duration(duration)
    if verdict.enough:
        return f"{length} were recorded, enough for every parameter to be known to 10 % or better"
    where = f"{channel} {verdict.parameter.replace('.', ' ').replace('_', ' ')}"
    return (
        f"{length} were recorded; the least certain parameter, {where}, is known to "
        f"{100.0 * error:.0f} %: 10 % would take about {spell_duration(verdict.wanted_duration)}"
    )


def _flags(channels: Mapping[str, Identification]) -> list[str]:
    """What was done to the signals, channels of the same flag together."""
    said: dict[str, list[str]] = {}
    for channel, found in channels.items():
        sensor = channel.split("_")[0]
        spoken = {followed(e): followed(e, _size(e, sensor)) for e in found.effects}
        spoken |= {taken_out(a): taken_out(a, _amplitude(a, sensor)) for a in found.lines}
        for flag in found.flags:
            said.setdefault(spoken.get(flag, flag), []).append(channel)
    return [f"{_join(names)}: {flag}" for flag, names in said.items()]


def _size(effect: Effect, sensor: str) -> str:
    """Size of an effect in the unit of the sensor's bias instability."""
    unit = "K" if effect.column == "temperature" else "unit"
    per = {"square": f"{unit}²", "rate": f"{unit}/s"}.get(effect.term, unit)
    return (
        _with_error(effect.coefficient, effect.standard_error, f"{sensor} bias instability")
        + f" per {per}"
    )


def _amplitude(line: Line, sensor: str) -> str:
    """Amplitude of a line in the unit of the sensor's bias."""
    return _with_error(
        line.amplitude, line.amplitude_error if line.steady else 0.0, f"{sensor} bias"
    )


def _with_error(value: float, error: float, kind: str) -> str:
    size = format_value(value, kind, digits=4)
    number, _, unit = size.partition(" ")
    return (
        f"{number} ± {format_value(error, kind, digits=2)}" if error > 0.0 else f"{number} {unit}"
    )


def _crossing(channel: str, found: Identification) -> str | None:
    """Warn where the flat part is only where white noise and random walk cross (spec 2.4 b)."""
    curve = found.curve
    lowest = int(np.argmin(curve.deviation))
    if not 0 < lowest < curve.tau.size - 1:
        return None
    reading = classical_reading(curve, found.slopes, found.process)
    if "random_walk" not in {p.kind for p in found.process.parts} or reading.flicker_share > 0.5:
        return None
    kind = f"{channel.split('_')[0]} bias instability"
    return (
        f"{channel}: the bias instability that one would read off the lowest point, "
        f"{format_value(reading.minimum, kind, digits=3)} at {reading.minimum_at:.3g} s, is for "
        f"{100.0 * (1.0 - reading.flicker_share):.0f} % just where white noise and random walk "
        f"cross: use the fitted processes instead"
    )


def _undecided(channel: str, found: Identification) -> str | None:
    """Name the structure that describes the data nearly as well."""
    rivals = found.rivals
    if not rivals:
        return None
    own = " + ".join(p.label or p.kind for p in found.process.parts)
    other = min(rivals, key=lambda s: rivals[s])
    spoken = other.replace("_", " ").replace("gauss markov", "Gauss-Markov")
    return (
        f"{channel}: {own} is the best description, but {spoken} is nearly as good (its criterion "
        f"is {rivals[other]:.1f} worse): a longer record would tell"
    )


def _not_seen(channels: Mapping[str, Identification]) -> list[str]:
    lines = []
    for sensor in ("gyro", "accel"):
        missing = {
            c: found.limits["random_walk.density"]
            for c, found in channels.items()
            if c.startswith(sensor) and "random_walk.density" in found.limits
        }
        if missing:
            limit = format_value(max(missing.values()), f"{sensor} random walk", digits=2)
            lines.append(
                f"{_join(missing)}: no random walk was found; more than {limit} is excluded (95 %)"
            )
    return lines


def grid_step(values: FloatArray) -> float | None:
    """Return the step of the grid on which all values lie, None if there is none."""
    least = 1e-9 * max(float(np.abs(values[:_GRID_SAMPLES]).max()), 1e-300)
    jumps = np.abs(np.diff(values[:_GRID_SAMPLES]))
    jumps = jumps[jumps > least]
    if jumps.size < 10:  # hardly ever a step: a coarse grid
        jumps = np.abs(np.diff(values))
        jumps = jumps[jumps > least]
    if not jumps.size:
        return None
    # the smallest jump, then the mean of all that are this jump, against rounding in the file
    step = float(np.mean(jumps[jumps < 1.5 * jumps.min()]))
    multiples = jumps / step
    off = np.abs(multiples - np.round(multiples))
    if float(np.mean(off < 0.02)) < 0.999 or float(np.median(multiples)) > 1e3:
        return None
    return step


def _rounding(
    imu: ImuRecording, channels: Mapping[str, Identification]
) -> tuple[set[str], list[str]]:
    """Return the channels whose noise is hidden by rounding, and what is to be said of grids."""
    hidden: set[str] = set()
    lines = []
    for sensor, kind in (("gyro", "angular rate"), ("accel", "acceleration")):
        shares: dict[str, float] = {}
        steps: dict[str, float] = {}
        for channel, found in channels.items():
            step = grid_step(imu.channel(channel)) if channel.startswith(sensor) else None
            white = found.parameters.get("white_noise.density", 0.0)
            if step is None or white <= 0.0:
                continue
            share = step**2 / 12.0 / imu.rate / white**2
            if share > _NOTABLE_ROUNDING:
                steps[channel], shares[channel] = step, share
        below = [c for c, share in shares.items() if share > _HIDDEN]
        if below:
            hidden |= set(below)
            grid = format_value(max(steps[c] for c in below), kind, digits=3)
            lines.append(
                f"{_join(below)}: the noise is smaller than the steps of {grid} and hidden by "
                "them: N and all else above are those of the rounding, those of the sensor are not "
                "known; set a finer range"
            )
        seen = {c: share for c, share in shares.items() if c not in hidden}
        if seen:
            lines.append(
                f"{_join(seen)}: values lie on a grid of "
                f"{format_value(max(steps[c] for c in seen), kind, digits=3)}; rounding makes up "
                f"to {100.0 * max(seen.values()):.1f} % of the white noise power"
            )
    return hidden, lines
