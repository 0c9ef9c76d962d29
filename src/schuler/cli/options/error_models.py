"""`schuler outages --models ...`: several error models through the same outages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cyclopts import Parameter

from schuler.errors import InputError

if TYPE_CHECKING:
    pass

MOST_ROWS = 12


@Parameter(name="*")
@dataclass(frozen=True)
class ModelOptions:
    """Which error models to compare.

    Parameters
    ----------
    models : str, optional
        Error models with commas between, each through the same outages: 15AV, 18AV, 18AVWD, 15AR,
        27AR (Quinchia et al. 2013), flicker4, own; with +corrected, +turn-on, +scale,
        +misalignment, +averaged, +garch behind them.
    static : Path, optional
        The same sensor at rest, at the rate of the drive: gives the noise where no --noise is
        given, and what AR models are fitted to.
    denoising : str
        For 18AVWD: off-line, which looks ahead, or causal, which answers late.
    """

    models: str | None = None
    static: Path | None = None
    denoising: Literal["off-line", "causal"] = "off-line"

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
