"""What one pass over a record keeps of it: sums of its curves, and what the screening saw."""

from __future__ import annotations

import json
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from schuler.curves.allan_sums import AllanAccumulator, AllanSums
from schuler.curves.spectrum_sums import SEGMENT, SpectrumAccumulator, SpectrumSums
from schuler.data.imu import ImuRecording
from schuler.data.table import write_atomically
from schuler.errors import EstimationError, InputError
from schuler.screening.screen import Screening, screen

VERSION = 1
_SAMPLE = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class RecordSums:
    """Sums over a record, or over several of one sensor: those of a week are those of its days."""

    channels: tuple[str, ...]  # columns of the sums
    allan: AllanSums  # for the Allan deviation and the wavelet variance
    spectrum: SpectrumSums  # for the power spectral density
    sample: ImuRecording  # the first samples at rest
    # pieces, left_out, knocks: pieces that were read, those that were not used, knocks that were
    # cut out
    pieces: int
    left_out: int
    knocks: int
    # kinds of findings of the screening: in how many pieces, and the first message
    seen: dict[str, tuple[int, str]]

    def __add__(self, other: RecordSums) -> RecordSums:
        """Return the sums of both records, as of one that paused between them."""
        if self.channels != other.channels:
            raise InputError(
                f"sums of {', '.join(self.channels)} and of {', '.join(other.channels)}",
                expected="the same channels",
            )
        seen = dict(self.seen)
        for kind, (count, message) in other.seen.items():
            before = seen.get(kind, (0, message))
            seen[kind] = before[0] + count, before[1]
        return RecordSums(
            self.channels,
            self.allan + other.allan,
            self.spectrum + other.spectrum,
            _assuming(self.sample, other.sample.assumptions),
            self.pieces + other.pieces,
            self.left_out + other.left_out,
            self.knocks + other.knocks,
            seen,
        )

    def save(self, path: str | Path) -> None:
        """Keep the sums in a file (NPZ, by custom ``*.sums.npz``), to be added to others.

        Parameters
        ----------
        path : str or Path
            The file; it appears only when it is complete.
        """
        told = {
            "version": VERSION, "channels": self.channels, "name": self.sample.name,
            "pieces": self.pieces, "left_out": self.left_out, "knocks": self.knocks,
            "seen": self.seen, "assumptions": self.sample.assumptions,
        }  # fmt: skip
        arrays = {
            f"{kind}_{f.name}": np.asarray(getattr(sums, f.name))
            for kind, sums in (("allan", self.allan), ("spectrum", self.spectrum))
            for f in fields(sums)
        }
        arrays["schuler_sums"] = np.array(json.dumps(told))
        arrays["time"], arrays["signal"] = self.sample.time, _signal(self.sample)

        def write(target: Path) -> None:
            with target.open("wb") as stream:
                np.savez_compressed(stream, allow_pickle=False, **arrays)

        write_atomically(Path(path), write)

    @classmethod
    def load(cls, path: str | Path) -> RecordSums:
        """Read sums that were kept.

        Parameters
        ----------
        path : str or Path
            What `save` wrote.

        Returns
        -------
        RecordSums
            The same.

        Raises
        ------
        InputError
            Another file, a damaged one, or one of a newer schuler.
        """
        try:
            with np.load(path, allow_pickle=False) as archive:
                told = json.loads(str(archive["schuler_sums"]))
                if told["version"] > VERSION:
                    raise InputError(
                        f"sums of version {told['version']}, made by a newer schuler",
                        expected=f"version {VERSION}", cure="update schuler", where=str(path),
                    )  # fmt: skip
                allan = _sums_of(AllanSums, "allan", archive)
                spectrum = _sums_of(SpectrumSums, "spectrum", archive)
                time, signal = archive["time"], archive["signal"]
        except (OSError, ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile) as error:
            raise InputError(
                f"these are no sums of a record ({type(error).__name__})",
                expected="a complete file of RecordSums.save or --sums-out", where=str(path),
            ) from None  # fmt: skip
        columns = dict(zip(told["channels"], signal.T, strict=True))
        nothing = np.full(len(time), np.nan)
        gyro, accel = (
            np.column_stack([columns.get(f"{s}_{a}", nothing) for a in "xyz"])
            for s in ("gyro", "accel")
        )
        seen = {k: (int(n), str(text)) for k, (n, text) in told["seen"].items()}
        pieces, left_out, knocks = (int(told[k]) for k in ("pieces", "left_out", "knocks"))
        sample = ImuRecording(time, gyro, accel, told["name"])
        sample = _assuming(sample, map(str, told.get("assumptions", ())))
        channels = tuple(told["channels"])
        return cls(channels, allan, spectrum, sample, pieces, left_out, knocks, seen)


def _assuming(sample: ImuRecording, more: Iterable[str]) -> ImuRecording:
    return replace(sample, assumptions=tuple(dict.fromkeys([*sample.assumptions, *more])))


def _sums_of(kind: type, name: str, archive: Any) -> Any:
    found = {f.name: archive[f"{name}_{f.name}"] for f in fields(kind)}
    return kind(**{k: v if v.ndim else v.item() for k, v in found.items()})


def collect_sums(pieces: Iterable[ImuRecording], segment: int = SEGMENT) -> RecordSums:
    """Pass once over a record that comes in pieces, in memory that does not grow.

    Pieces in which the sensor moved, or an axis was stuck, are left out; samples around knocks and
    gaps end a stretch.

    Parameters
    ----------
    pieces : iterable of ImuRecording
        In the order of time, as `read_imu_pieces` returns them.
    segment : int
        Samples of a segment of the power spectral density.

    Returns
    -------
    RecordSums
        To be fitted, kept, or added to those of other parts.

    Raises
    ------
    InputError
        Pieces of different rates or channels.
    EstimationError
        No piece that can be used.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, simulate_static
    >>> from schuler.estimation.long_record import collect_sums
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> imu = simulate_static(model, 600.0, 100.0, np.random.default_rng(1))
    >>> morning, evening = (collect_sums([imu.between(t, t + 300.0)]) for t in (0.0, 300.0))
    >>> (morning + evening).allan.samples
    60000
    """
    collector: _Collector | None = None
    for piece in pieces:
        collector = collector or _Collector(piece, segment)
        collector.add(piece, screen(piece))
    if collector is None:
        raise InputError("there are no pieces", expected="at least one recording")
    return collector.sums()


class _Collector:
    def __init__(self, first: ImuRecording, segment: int) -> None:
        self.first = first
        count = len(first.channels)
        self.allan = AllanAccumulator(first.rate, count)
        self.spectrum = SpectrumAccumulator(first.rate, count, segment)
        self.sample: ImuRecording | None = None
        self.end = -np.inf
        self.pieces = self.left_out = self.knocks = 0
        self.counts: Counter[str] = Counter()
        self.messages: dict[str, str] = {}
        self.assumptions: dict[str, str] = {}  # by what is before the reason

    def add(self, piece: ImuRecording, screening: Screening) -> None:
        """Add what is undisturbed of a piece at rest."""
        _require_same(self.first, piece)
        self.pieces += 1
        for line in piece.assumptions:
            self.assumptions.setdefault(line.partition(":")[0], line)
        for finding in screening.findings:
            if finding.severity != "info" and finding.kind not in ("knock", "outlier"):
                self.counts[finding.kind] += 1
                self.messages.setdefault(finding.kind, finding.message)
        if not screening.static or any(f.severity == "error" for f in screening.findings):
            self.left_out += 1
            return
        if self.sample is None:
            self.sample = piece.between(piece.time[0], piece.time[min(_SAMPLE, piece.size - 1)])
        if piece.time[0] - self.end > 1.5 / self.first.rate:
            self._pause()
        self.knocks += len(screening.disturbed)
        signal = _signal(piece)
        for k, (start, stop) in enumerate(_stretches(piece, screening.disturbed)):
            if k:
                self._pause()
            self.allan.add(signal[start:stop])
            self.spectrum.add(signal[start:stop])
            self.end = float(piece.time[stop - 1])

    def _pause(self) -> None:
        self.allan.pause()
        self.spectrum.pause()

    def sums(self) -> RecordSums:
        """Return the sums of all pieces."""
        seen = {kind: (n, self.messages[kind]) for kind, n in self.counts.items()}
        if self.sample is None:
            why = "; ".join(text for _, text in seen.values())
            raise EstimationError(
                f"the sensor moved in all {self.left_out} pieces" + (f", or: {why}" if why else ""),
                expected="a sensor lying still",
            )
        return RecordSums(
            self.first.channels, self.allan.sums(), self.spectrum.sums(),
            _assuming(self.sample, self.assumptions.values()),
            self.pieces, self.left_out, self.knocks, seen,
        )  # fmt: skip


def _signal(imu: ImuRecording) -> Any:
    return np.column_stack([imu.channel(c) for c in imu.channels])


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
