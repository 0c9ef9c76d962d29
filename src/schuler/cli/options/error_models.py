"""Error models by name: several side by side (`outages --models`), or one (`navigate --model`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cyclopts import Parameter

from schuler.cli.options.groups import NOISE
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.data.imu import ImuRecording
    from schuler.navigation.error_models.catalogue import ErrorModel
    from schuler.noise.noise_model import NoiseModel


@Parameter(name="*", group=NOISE)
@dataclass(frozen=True)
class _SensorAtRest:
    """Where the noise of an error model comes from, and how 18AVWD takes it off.

    Parameters
    ----------
    static : Path, optional
        The same sensor at rest, at the rate of the drive: gives the noise where no --noise is
        given, and what AR models are fitted to.
    denoising : str
        For 18AVWD: off-line, which looks ahead, or causal, which answers late.
    """

    static: Path | None = None
    denoising: Literal["off-line", "causal"] = "off-line"


@Parameter(name="*", group=NOISE)
@dataclass(frozen=True)
class ModelOptions(_SensorAtRest):
    """Which error models to compare.

    Parameters
    ----------
    models : str, optional
        Error models with commas between, each through the same outages: 15AV, 18AV, 18AVWD, 15AR,
        27AR (Quinchia et al. 2013), flicker4, own; with +corrected, +turn-on, +scale,
        +misalignment, +averaged, +garch behind them.
    """

    models: str | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The models asked for."""
        from schuler.navigation.error_models.catalogue import split_model_name

        if self.models is None:
            if self.static is not None:
                raise InputError("--static without --models", expected="both")
            return ()
        names = tuple(n.strip() for n in self.models.split(",") if n.strip())
        whole = ["+".join((base, *more)) for base, more in map(split_model_name, names)]
        if not whole or len(set(whole)) != len(whole):
            raise InputError(f"--models {self.models}", expected="names, each once")
        return tuple(whole)


@Parameter(name="*", group=NOISE)
@dataclass(frozen=True)
class OneModel(_SensorAtRest):
    """What the filter is told of its sensor.

    Parameters
    ----------
    model : str, optional
        One error model in place of the noise model as it is: 15AV, 18AV, 18AVWD, 15AR, 27AR
        (Quinchia et al. 2013), flicker4, own; with +corrected, +turn-on, +scale, +misalignment,
        +averaged, +garch behind it.
    """

    model: str | None = None

    def found(
        self, noise: NoiseModel | None, rate: float
    ) -> tuple[ErrorModel | None, NoiseModel | None]:
        """Return the error model, and the noise model that alignment uses."""
        if self.model is None:
            if self.static is not None:
                raise InputError("--static without --model", expected="both")
            return None, noise
        if "," in self.model:
            raise InputError(
                f"--model {self.model}",
                expected="one error model",
                cure="`schuler outages --models` compares several",
            )
        models, base = built((self.model,), noise, self.static, self.denoising, rate)
        return models[0], base


def built(
    names: tuple[str, ...],
    noise: NoiseModel | None,
    static: Path | None,
    denoising: Literal["off-line", "causal"],
    rate: float,
) -> tuple[tuple[ErrorModel, ...], NoiseModel]:
    """Return the models, and the noise model to prepare a drive with."""
    from schuler.cli.loading import load_imu
    from schuler.navigation.error_models.allan_readings import readings_of_static
    from schuler.navigation.error_models.sources import error_models
    from schuler.screening.screen import screen

    at_rest: ImuRecording | None = None
    if static is not None:
        at_rest = load_imu(static, {})
        screen(at_rest).require_usable()
    models = error_models(names, noise_model=noise, static=at_rest, rate=rate, denoising=denoising)
    if noise is None:
        assert at_rest is not None
        noise = readings_of_static(at_rest)[0]
    return models, noise
