"""Noise of records larger than memory: one pass over pieces, then the usual joint fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from schuler.curves.allan_sums import AllanAccumulator
from schuler.data.imu import ImuRecording
from schuler.errors import EstimationError, InputError
from schuler.estimation.characterization import ImuCharacterization, findings_of, model_of
from schuler.estimation.identification import Identification
from schuler.estimation.joint_fit import identify_curve
from schuler.noise import Process
from schuler.screening.screen import screen

NOT_LOOKED_AT = (
    "the record was read in pieces: lines of vibration, light outliers and temperature were not "
    "taken off (a part that fits into memory tells whether they matter)"
)


def characterize_pieces(
    pieces: Iterable[ImuRecording], model: str | Process = "auto", name: str = ""
) -> ImuCharacterization:
    """Identify the noise of a record that comes in pieces, in memory that does not grow.

    Pieces in which the sensor moved are left out, samples around knocks and gaps end a stretch.

    Parameters
    ----------
    pieces : iterable of ImuRecording
        In the order of time, as `read_imu_pieces` returns them.
    model : str or Process
        As for `identify`.
    name : str
        Of the record.

    Returns
    -------
    ImuCharacterization
        As that of `characterize_imu` by the Allan deviation; the findings say what was left out.

    Raises
    ------
    InputError
        Pieces of different rates or channels.
    EstimationError
        No piece at rest, or a channel that does not vary.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, simulate_static
    >>> from schuler.estimation.long_record import characterize_pieces
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> imu = simulate_static(model, 600.0, 100.0, np.random.default_rng(1))
    >>> halves = [imu.between(0.0, 300.0), imu.between(300.0, 600.0)]
    >>> found = characterize_pieces(halves)
    >>> round(found.channels["gyro_x"].parameters["white_noise.density"] / 5e-5, 2)
    1.0
    """
    first: ImuRecording | None = None
    collected: AllanAccumulator | None = None
    end, left_out, knocks = -np.inf, 0, 0
    for piece in pieces:
        if first is None or collected is None:
            first, collected = piece, AllanAccumulator(piece.rate, len(piece.channels))
        _require_same(first, piece)
        screening = screen(piece)
        if not screening.static:
            left_out += 1
            continue
        if piece.time[0] - end > 1.5 / first.rate:
            collected.pause()
        knocks += len(screening.disturbed)
        end = _add(collected, piece, screening.disturbed)
    if first is None or collected is None:
        raise InputError("there are no pieces", expected="at least one recording")
    if end == -np.inf:
        raise EstimationError(
            f"the sensor moved in all {left_out} pieces", expected="a sensor lying still"
        )
    curve = collected.sums().curve()
    channels: dict[str, Identification] = {
        c: identify_curve(curve.column(j), model) for j, c in enumerate(first.channels)
    }
    said = [NOT_LOOKED_AT]
    if left_out:
        said.append(f"{left_out} pieces were left out, in which the sensor moved")
    if knocks:
        said.append(f"{knocks} knocks were cut out")
    duration = curve.duration
    return ImuCharacterization(
        recording_name=name or first.name,
        channels=channels,
        noise_model=model_of(channels, first.rate, name or first.name, duration),
        findings=(*said, *findings_of(first, channels, duration)),
        rate=first.rate,
        duration=duration,
    )


def _require_same(first: ImuRecording, piece: ImuRecording) -> None:
    if first.channels != piece.channels:
        raise InputError(
            f"a piece holds {', '.join(piece.channels)}", expected=", ".join(first.channels)
        )
    if abs(piece.rate - first.rate) > 0.01 * first.rate:
        raise InputError(
            f"a piece from {piece.time[0]:.3f} s on has {piece.rate:.6g} Hz",
            expected=f"{first.rate:.6g} Hz as the first",
        )


def _add(
    collected: AllanAccumulator, piece: ImuRecording, disturbed: Iterable[tuple[int, int]]
) -> float:
    """Add what is undisturbed and without gaps; return when the last stretch ends."""
    signal = np.column_stack([piece.channel(c) for c in piece.channels])
    end = -np.inf
    for k, (start, stop) in enumerate(_stretches(piece, disturbed)):
        if k:
            collected.pause()
        collected.add(signal[start:stop])
        end = float(piece.time[stop - 1])
    return end


def _stretches(
    piece: ImuRecording, disturbed: Iterable[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    gaps = np.flatnonzero(np.diff(piece.time) > 1.5 / piece.rate) + 1
    cuts = sorted([*((int(g), int(g)) for g in gaps), *disturbed, (piece.size, piece.size)])
    start = 0
    for begin, stop in cuts:
        if begin - start > 1:
            yield start, begin
        start = max(start, stop)
