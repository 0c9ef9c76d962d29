"""The noise of all channels of one sensor: a process each, with errors and where it came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from schuler.data.columns import Columns, table_of
from schuler.data.exportable import Exportable
from schuler.data.imu import CHANNELS
from schuler.errors import ModelError, SchulerError
from schuler.noise._checks import not_negative, positive
from schuler.noise.base import Process, ProcessSum
from schuler.noise.effects import Effect
from schuler.noise.noise_model_file import Content, noise_model_text, read_noise_model

if TYPE_CHECKING:
    from pathlib import Path

Numbers = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel(Exportable):
    """A stochastic process for every channel of an inertial measurement unit.

    Parameters
    ----------
    processes : mapping of str to Process
        By channel name out of `schuler.data.CHANNELS`; gyro channels in rad/s, accelerometer
        channels in m/s². Stored as `ProcessSum`s.
    standard_errors : mapping of str to mapping of str to float
        By channel, then by parameter ("gauss_markov.sigma"), in SI.
    rate : float or None
        Samples a second at which it was fitted.
    source : str
        Where it came from, for people.
    limits : mapping of str to mapping of str to float
        By channel and parameter: 95 % upper limits, in SI, of terms that were looked for and not
        found.
    effects : mapping of str to sequence of Effect
        By channel: what follows a quantity beside it, such as temperature; `navigate` and `fuse`
        take it off a recording that has the column.

    Raises
    ------
    ModelError
        A channel that does not exist, or an error or limit for something that is not there.

    Examples
    --------
    >>> from schuler import GaussMarkov, NoiseModel, WhiteNoise
    >>> gyro = WhiteNoise(5e-5) + GaussMarkov(2e-5, 100.0)
    >>> accel = WhiteNoise(7e-4)
    >>> model = NoiseModel.isotropic(gyro, accel)
    >>> sorted(model.processes)[:2]
    ['accel_x', 'accel_y']
    """

    processes: Mapping[str, Process]
    standard_errors: Numbers = field(default_factory=dict)
    rate: float | None = None
    source: str = ""
    limits: Numbers = field(default_factory=dict)
    effects: Mapping[str, Sequence[Effect]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for channel in (
            *self.processes,
            *self.standard_errors,
            *self.limits,
            *self.effects,
        ):
            if channel not in CHANNELS:
                raise ModelError(
                    f"noise model has a channel '{channel}'", expected=f"of {', '.join(CHANNELS)}"
                )
        if not self.processes:
            raise ModelError("noise model has no channel", expected="at least one")
        ordered = {c: self.processes[c] for c in CHANNELS if c in self.processes}
        sums = {c: p if isinstance(p, ProcessSum) else ProcessSum((p,)) for c, p in ordered.items()}
        for channel, errors in self.standard_errors.items():
            known = sums[channel].parameters if channel in sums else {}
            for key, value in errors.items():
                if key not in known:
                    raise ModelError(f"{channel} has a standard error of '{key}', but no such term")
                not_negative(value, f"standard error of {channel} {key}")
        if self.rate is not None:
            object.__setattr__(self, "rate", positive(self.rate, "rate"))
        object.__setattr__(self, "processes", sums)
        own = {c: tuple(e) for c, e in self.effects.items() if e}
        object.__setattr__(self, "effects", own)
        for name in ("standard_errors", "limits"):
            given: Numbers = getattr(self, name)
            copy = {c: dict(v) for c, v in given.items()}
            object.__setattr__(self, name, copy)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that have a process, in the order of `schuler.data.CHANNELS`."""
        return tuple(self.processes)

    def to_columns(self) -> Columns:
        """Return one row for each parameter of each channel, SI."""
        return table_of(
            [
                {
                    "channel": channel,
                    "parameter": key,
                    "value": value,
                    "standard_error": self.standard_errors.get(channel, {}).get(key),
                }
                for channel in self.channels
                for key, value in self.process(channel).parameters.items()
            ]
        )

    def process(self, channel: str) -> ProcessSum:
        """Return the process of one channel.

        Parameters
        ----------
        channel : str
            Out of `schuler.data.CHANNELS`.

        Returns
        -------
        ProcessSum
            In rad/s or m/s².

        Raises
        ------
        ModelError
            The model does not have this channel.
        """
        found = self.processes.get(channel)
        if found is None:
            raise ModelError(
                f"noise model has no channel '{channel}'",
                expected=f"one of {', '.join(self.channels)}",
            )
        assert isinstance(found, ProcessSum)
        return found

    @classmethod
    def isotropic(cls, gyro: Process, accel: Process) -> NoiseModel:
        """Return a model with one process for all gyros and one for all accelerometers.

        Parameters
        ----------
        gyro : Process
            Of x, y and z, in rad/s.
        accel : Process
            Of x, y and z, in m/s².

        Returns
        -------
        NoiseModel
            Without standard errors.
        """
        return cls({c: gyro if c.startswith("gyro") else accel for c in CHANNELS})

    @classmethod
    def load(cls, path: str | Path) -> NoiseModel:
        """Read a noise model that `save` or a person wrote.

        Parameters
        ----------
        path : str or Path
            YAML file.

        Returns
        -------
        NoiseModel
            In SI.

        Raises
        ------
        InputError
            The file cannot be read, a key is missing or not known, a value is impossible.
        UnitError
            A unit is not known or of the wrong kind.
        """
        content = read_noise_model(path)
        try:
            return cls(
                content.processes,
                content.standard_errors,
                content.rate,
                content.source,
                content.limits,
                content.effects,
            )
        except SchulerError as error:
            raise (error if error.where else error.at(str(path))) from None

    def save(self, path: str | Path, units: Literal["datasheet", "si"] = "datasheet") -> None:
        """Write the model as YAML for people.

        Parameters
        ----------
        path : str or Path
            File to write; it appears only when it is complete.
        units : {"datasheet", "si"}
            "0.24 deg/sqrt(h)" or "6.98e-05 rad/s/sqrt(Hz)".
        """
        from schuler.data.table import write_text

        write_text(path, self.to_yaml(units))

    def to_yaml(self, units: Literal["datasheet", "si"] = "datasheet") -> str:
        """Return the text that `save` writes.

        Parameters
        ----------
        units : {"datasheet", "si"}
            As for `save`.

        Returns
        -------
        str
            YAML with comments.
        """
        content = Content(
            self.processes,
            self.standard_errors,
            self.rate,
            self.source,
            self.limits,
            self.effects,
        )
        return noise_model_text(content, units)
