"""MEMS inertial sensors: error models, redundant IMUs, and GNSS/INS with honest uncertainty.

The public nouns and verbs are imported when they are first used, so that `import schuler` costs
next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from schuler.characterize.allan import AllanCurve, allan_deviation
    from schuler.characterize.screening import Screening, repair, screen
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.data.trajectory import Innovations, NavigationSolution, Trajectory
    from schuler.errors import SchulerError
    from schuler.evaluate.outages import OutageEvaluation, evaluate_outages
    from schuler.export.kalibr import kalibr_yaml, write_kalibr
    from schuler.identify import Identification, ImuCharacterization, characterize_imu, identify
    from schuler.navigate import navigate
    from schuler.processes import (
        BiasInstability,
        GaussMarkov,
        NoiseModel,
        Process,
        ProcessSum,
        Quantization,
        RandomWalk,
        RateRamp,
        Sinusoid,
        TurnOnBias,
        WhiteNoise,
    )
    from schuler.readers import read_gnss, read_imu
    from schuler.report import write_report
    from schuler.simulate import simulate_gnss, simulate_imu, simulate_static

__version__ = "0.1.0"

_HOMES = {
    "schuler.errors": ("SchulerError",),
    "schuler.data": (
        "GnssRecording",
        "ImuRecording",
        "Innovations",
        "NavigationSolution",
        "Trajectory",
    ),
    "schuler.readers": ("read_gnss", "read_imu"),
    "schuler.processes": (
        "BiasInstability",
        "GaussMarkov",
        "NoiseModel",
        "Process",
        "ProcessSum",
        "Quantization",
        "RandomWalk",
        "RateRamp",
        "Sinusoid",
        "TurnOnBias",
        "WhiteNoise",
    ),
    "schuler.characterize.screening": ("Screening", "repair", "screen"),
    "schuler.characterize.allan": ("AllanCurve", "allan_deviation"),
    "schuler.identify": (
        "Identification",
        "ImuCharacterization",
        "characterize_imu",
        "identify",
    ),
    "schuler.simulate": ("simulate_gnss", "simulate_imu", "simulate_static"),
    "schuler.navigate": ("navigate",),
    "schuler.evaluate.outages": ("OutageEvaluation", "evaluate_outages"),
    "schuler.export.kalibr": ("kalibr_yaml", "write_kalibr"),
    "schuler.report": ("write_report",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "AllanCurve",
    "BiasInstability",
    "GaussMarkov",
    "GnssRecording",
    "Identification",
    "ImuCharacterization",
    "ImuRecording",
    "Innovations",
    "NavigationSolution",
    "NoiseModel",
    "OutageEvaluation",
    "Process",
    "ProcessSum",
    "Quantization",
    "RandomWalk",
    "RateRamp",
    "SchulerError",
    "Screening",
    "Sinusoid",
    "Trajectory",
    "TurnOnBias",
    "WhiteNoise",
    "allan_deviation",
    "characterize_imu",
    "evaluate_outages",
    "identify",
    "kalibr_yaml",
    "navigate",
    "read_gnss",
    "read_imu",
    "repair",
    "screen",
    "simulate_gnss",
    "simulate_imu",
    "simulate_static",
    "write_kalibr",
    "write_report",
]


class _VerbRoom(ModuleType):
    """A room named like its verb: `schuler.identify` is the package and can be called.

    Importing a room puts it into this namespace under its name, over a function of that name;
    so the room itself answers as the verb, whichever is met first.
    """

    @property
    def _verb(self) -> Any:
        return self.__dict__[self.__name__.rpartition(".")[2]]

    @property
    def __signature__(self) -> Any:
        from inspect import signature

        return signature(self._verb)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self._verb(*arguments, **options)


class _Package(ModuleType):
    """The package itself: rooms that are verbs are made callable when they are imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, ModuleType) and _HOME_OF.get(name) == value.__name__:
            value.__class__ = _VerbRoom
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'schuler' has no attribute '{name}'")
    home = import_module(_HOME_OF[name])
    value = home if home.__name__ == f"{__name__}.{name}" else getattr(home, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
