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
    from schuler.characterize.autocorrelation import AutocorrelationCurve, autocorrelation
    from schuler.characterize.screening import Screening, repair, screen
    from schuler.characterize.spectrum import SpectrumCurve, power_spectral_density
    from schuler.characterize.wavelet_variance import WaveletVarianceCurve, wavelet_variance
    from schuler.data.array import ImuArray, Mounting
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.data.trajectory import Innovations, NavigationSolution, Trajectory
    from schuler.denoise import CausalDenoiser, Denoised, denoise
    from schuler.errors import SchulerError
    from schuler.evaluate.error_model_comparison import (
        ErrorModelComparison,
        compare_error_models,
    )
    from schuler.evaluate.outages import OutageEvaluation, evaluate_outages
    from schuler.export.kalibr import kalibr_yaml, write_kalibr
    from schuler.fuse.calibration.door import calibrate_array
    from schuler.fuse.calibration.result import ArrayCalibration
    from schuler.fuse.clocks.jumps import SampleJump, find_jumps
    from schuler.fuse.clocks.synchronization import Synchronization, synchronize
    from schuler.fuse.fault_settings import FaultSettings
    from schuler.fuse.faults import FaultDetection, detect_faults
    from schuler.fuse.geometry import Geometry
    from schuler.fuse.lasting_faults import (
        HealthyMotion,
        LastingFaults,
        LastingFaultSettings,
        detect_lasting_faults,
        learn_healthy_motion,
    )
    from schuler.fuse.reading import read_array
    from schuler.fuse.synthetic import SyntheticImu, synthesize
    from schuler.fuse.volatility import averaged_volatility
    from schuler.identify import (
        Identification,
        ImuCharacterization,
        MethodIdentification,
        characterize_imu,
        identify,
    )
    from schuler.identify.arma.fit import ArmaFit, fit_arma
    from schuler.identify.arma.selection import select_arma
    from schuler.identify.autoregressive.fit import ArFit, fit_ar, select_ar
    from schuler.identify.comparison.methods import (
        ImuMethodComparison,
        MethodComparison,
        compare_methods,
        compare_methods_imu,
    )
    from schuler.identify.garch.arma_garch import ArmaGarchFit, fit_arma_garch
    from schuler.identify.garch.fit import GarchFit, fit_garch
    from schuler.identify.garch.selection import select_garch
    from schuler.identify.gmwm.fit import fit_gmwm
    from schuler.identify.gmwm.replicates import PooledIdentification, fit_gmwm_replicates
    from schuler.identify.maximum_likelihood import fit_maximum_likelihood
    from schuler.identify.orthogonal_search.search import FosFit, fast_orthogonal_search
    from schuler.identify.residuals.tests import arch_lm_test, ljung_box_test
    from schuler.navigate import navigate, navigate_array
    from schuler.navigate.inflation import NoiseInflation, NoiseTuning, tune_noise
    from schuler.navigate.observability import Observability, Segment, observability
    from schuler.navigate.streaming import FilterState, GnssReceiver, NavigationFilter
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
    from schuler.processes.arma import ARMA
    from schuler.processes.autoregressive import Autoregressive
    from schuler.readers import read_gnss, read_imu
    from schuler.report import write_report
    from schuler.simulate import simulate_gnss, simulate_imu, simulate_static

__version__ = "0.1.0"

_HOMES = {
    "schuler.errors": ("SchulerError",),
    "schuler.data": (
        "GnssRecording",
        "ImuArray",
        "ImuRecording",
        "Innovations",
        "Mounting",
        "NavigationSolution",
        "Trajectory",
    ),
    "schuler.readers": ("read_gnss", "read_imu"),
    "schuler.navigate.measurements": ("MeasurementOptions",),
    "schuler.navigate.weighting": ("GnssWeighting",),
    "schuler.navigate.attitude_sources": (
        "Barometer",
        "CorrelatedGnss",
        "Heading",
        "Magnetometer",
    ),
    "schuler.simulate.scenario": ("Scenario", "SimulatedDrive", "simulate_drive"),
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
        "MethodIdentification",
        "characterize_imu",
        "identify",
    ),
    "schuler.processes.autoregressive": ("Autoregressive",),
    "schuler.processes.arma": ("ARMA",),
    "schuler.characterize.spectrum": ("SpectrumCurve", "power_spectral_density"),
    "schuler.characterize.autocorrelation": ("AutocorrelationCurve", "autocorrelation"),
    "schuler.characterize.wavelet_variance": ("WaveletVarianceCurve", "wavelet_variance"),
    "schuler.identify.autoregressive.fit": ("ArFit", "fit_ar", "select_ar"),
    "schuler.identify.orthogonal_search.search": ("FosFit", "fast_orthogonal_search"),
    "schuler.identify.arma.fit": ("ArmaFit", "fit_arma"),
    "schuler.identify.arma.selection": ("select_arma",),
    "schuler.identify.garch.arma_garch": ("ArmaGarchFit", "fit_arma_garch"),
    "schuler.identify.garch.fit": ("GarchFit", "fit_garch"),
    "schuler.identify.garch.selection": ("select_garch",),
    "schuler.identify.residuals.tests": ("arch_lm_test", "ljung_box_test"),
    "schuler.identify.gmwm.fit": ("fit_gmwm",),
    "schuler.identify.gmwm.replicates": ("PooledIdentification", "fit_gmwm_replicates"),
    "schuler.identify.maximum_likelihood": ("fit_maximum_likelihood",),
    "schuler.identify.comparison.methods": (
        "ImuMethodComparison",
        "MethodComparison",
        "compare_methods",
        "compare_methods_imu",
    ),
    "schuler.denoise": ("CausalDenoiser", "Denoised", "denoise"),
    "schuler.simulate": ("simulate_gnss", "simulate_imu", "simulate_static"),
    "schuler.fuse.calibration.door": ("calibrate_array",),
    "schuler.fuse.calibration.result": ("ArrayCalibration",),
    "schuler.fuse.clocks.jumps": ("SampleJump", "find_jumps"),
    "schuler.fuse.clocks.synchronization": ("Synchronization", "synchronize"),
    "schuler.fuse.reading": ("read_array",),
    "schuler.fuse.fault_settings": ("FaultSettings",),
    "schuler.fuse.faults": ("FaultDetection", "detect_faults"),
    "schuler.fuse.geometry": ("Geometry",),
    "schuler.fuse.lasting_faults": (
        "HealthyMotion",
        "LastingFaultSettings",
        "LastingFaults",
        "detect_lasting_faults",
        "learn_healthy_motion",
    ),
    "schuler.fuse.synthetic": ("SyntheticImu", "synthesize"),
    "schuler.fuse.volatility": ("averaged_volatility",),
    "schuler.navigate": ("navigate", "navigate_array"),
    "schuler.navigate.streaming": ("FilterState", "GnssReceiver", "NavigationFilter"),
    "schuler.navigate.inflation": ("NoiseInflation", "NoiseTuning", "tune_noise"),
    "schuler.navigate.observability": ("Observability", "Segment", "observability"),
    "schuler.navigate.error_models": ("ErrorModel",),
    "schuler.navigate.model_sources": ("error_models",),
    "schuler.evaluate.error_model_comparison": ("ErrorModelComparison", "compare_error_models"),
    "schuler.evaluate.outages": ("OutageEvaluation", "evaluate_outages"),
    "schuler.export.kalibr": ("kalibr_yaml", "write_kalibr"),
    "schuler.report": ("write_report",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "ARMA",
    "AllanCurve",
    "ArFit",
    "ArmaFit",
    "ArmaGarchFit",
    "ArrayCalibration",
    "AutocorrelationCurve",
    "Autoregressive",
    "Barometer",
    "BiasInstability",
    "CausalDenoiser",
    "CorrelatedGnss",
    "Denoised",
    "ErrorModel",
    "ErrorModelComparison",
    "FaultDetection",
    "FaultSettings",
    "FilterState",
    "FosFit",
    "GarchFit",
    "GaussMarkov",
    "Geometry",
    "GnssReceiver",
    "GnssRecording",
    "GnssWeighting",
    "Heading",
    "HealthyMotion",
    "Identification",
    "ImuArray",
    "ImuCharacterization",
    "ImuMethodComparison",
    "ImuRecording",
    "Innovations",
    "LastingFaultSettings",
    "LastingFaults",
    "Magnetometer",
    "MeasurementOptions",
    "MethodComparison",
    "MethodIdentification",
    "Mounting",
    "NavigationFilter",
    "NavigationSolution",
    "NoiseInflation",
    "NoiseModel",
    "NoiseTuning",
    "Observability",
    "OutageEvaluation",
    "PooledIdentification",
    "Process",
    "ProcessSum",
    "Quantization",
    "RandomWalk",
    "RateRamp",
    "SampleJump",
    "Scenario",
    "SchulerError",
    "Screening",
    "Segment",
    "SimulatedDrive",
    "Sinusoid",
    "SpectrumCurve",
    "Synchronization",
    "SyntheticImu",
    "Trajectory",
    "TurnOnBias",
    "WaveletVarianceCurve",
    "WhiteNoise",
    "allan_deviation",
    "arch_lm_test",
    "autocorrelation",
    "averaged_volatility",
    "calibrate_array",
    "characterize_imu",
    "compare_error_models",
    "compare_methods",
    "compare_methods_imu",
    "denoise",
    "detect_faults",
    "detect_lasting_faults",
    "error_models",
    "evaluate_outages",
    "fast_orthogonal_search",
    "find_jumps",
    "fit_ar",
    "fit_arma",
    "fit_arma_garch",
    "fit_garch",
    "fit_gmwm",
    "fit_gmwm_replicates",
    "fit_maximum_likelihood",
    "identify",
    "kalibr_yaml",
    "learn_healthy_motion",
    "ljung_box_test",
    "navigate",
    "navigate_array",
    "observability",
    "power_spectral_density",
    "read_array",
    "read_gnss",
    "read_imu",
    "repair",
    "screen",
    "select_ar",
    "select_arma",
    "select_garch",
    "simulate_drive",
    "simulate_gnss",
    "simulate_imu",
    "simulate_static",
    "synchronize",
    "synthesize",
    "tune_noise",
    "wavelet_variance",
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
