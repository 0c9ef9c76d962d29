"""The public names of schuler, once: where each is defined."""

from .arrays.calibration.calibrate import (
    calibrate_array as calibrate_array,
)
from .arrays.calibration.result import (
    ArrayCalibration as ArrayCalibration,
)
from .arrays.clocks.jumps import (
    SampleJump as SampleJump,
)
from .arrays.clocks.jumps import (
    find_jumps as find_jumps,
)
from .arrays.clocks.jumps import (
    undo_jumps as undo_jumps,
)
from .arrays.clocks.synchronization import (
    Synchronization as Synchronization,
)
from .arrays.clocks.synchronization import (
    synchronize as synchronize,
)
from .arrays.detection.fault_settings import (
    FaultSettings as FaultSettings,
)
from .arrays.detection.faults import (
    FaultDetection as FaultDetection,
)
from .arrays.detection.faults import (
    detect_faults as detect_faults,
)
from .arrays.detection.healthy_motion import (
    HealthyMotion as HealthyMotion,
)
from .arrays.detection.healthy_motion import (
    LastingFaultSettings as LastingFaultSettings,
)
from .arrays.detection.healthy_motion import (
    learn_healthy_motion as learn_healthy_motion,
)
from .arrays.detection.lasting_faults import (
    LastingFaults as LastingFaults,
)
from .arrays.detection.lasting_faults import (
    detect_lasting_faults as detect_lasting_faults,
)
from .arrays.geometry import (
    Geometry as Geometry,
)
from .arrays.merit import (
    FiguresOfMerit as FiguresOfMerit,
)
from .arrays.merit import (
    figures_of_merit as figures_of_merit,
)
from .arrays.optimum import (
    OptimalGeometry as OptimalGeometry,
)
from .arrays.optimum import (
    optimize_geometry as optimize_geometry,
)
from .arrays.read import (
    read_array as read_array,
)
from .arrays.synthesis.synthetic import (
    SyntheticImu as SyntheticImu,
)
from .arrays.synthesis.synthetic import (
    synthesize as synthesize,
)
from .arrays.synthesis.volatility import (
    averaged_volatility as averaged_volatility,
)
from .curves.allan import (
    allan_deviation as allan_deviation,
)
from .curves.allan_curve import (
    AllanCurve as AllanCurve,
)
from .curves.autocorrelation import (
    AutocorrelationCurve as AutocorrelationCurve,
)
from .curves.autocorrelation import (
    autocorrelation as autocorrelation,
)
from .curves.spectrum import (
    SpectrumCurve as SpectrumCurve,
)
from .curves.spectrum import (
    power_spectral_density as power_spectral_density,
)
from .curves.wavelet_variance import (
    WaveletVarianceCurve as WaveletVarianceCurve,
)
from .curves.wavelet_variance import (
    wavelet_variance as wavelet_variance,
)
from .data.array import (
    ImuArray as ImuArray,
)
from .data.gnss import (
    GnssRecording as GnssRecording,
)
from .data.imu import (
    ImuRecording as ImuRecording,
)
from .data.mounting import (
    Mounting as Mounting,
)
from .data.trajectory import (
    Innovations as Innovations,
)
from .data.trajectory import (
    NavigationSolution as NavigationSolution,
)
from .data.trajectory import (
    Trajectory as Trajectory,
)
from .denoising.causal import (
    CausalDenoiser as CausalDenoiser,
)
from .denoising.wavelet import (
    Denoised as Denoised,
)
from .denoising.wavelet import (
    denoise as denoise,
)
from .errors import (
    SchulerError as SchulerError,
)
from .estimation.arma.fit import (
    fit_arma as fit_arma,
)
from .estimation.arma.result import (
    ArmaFit as ArmaFit,
)
from .estimation.arma.selection import (
    select_arma as select_arma,
)
from .estimation.autoregressive.fit import (
    fit_ar as fit_ar,
)
from .estimation.autoregressive.fit import (
    select_ar as select_ar,
)
from .estimation.autoregressive.result import (
    ArFit as ArFit,
)
from .estimation.characterization import (
    ImuCharacterization as ImuCharacterization,
)
from .estimation.characterization import (
    characterize_imu as characterize_imu,
)
from .estimation.comparison.methods import (
    ImuMethodComparison as ImuMethodComparison,
)
from .estimation.comparison.methods import (
    MethodComparison as MethodComparison,
)
from .estimation.comparison.methods import (
    compare_methods as compare_methods,
)
from .estimation.comparison.methods import (
    compare_methods_imu as compare_methods_imu,
)
from .estimation.garch.arma_garch import (
    ArmaGarchFit as ArmaGarchFit,
)
from .estimation.garch.arma_garch import (
    fit_arma_garch as fit_arma_garch,
)
from .estimation.garch.fit import (
    fit_garch as fit_garch,
)
from .estimation.garch.result import (
    GarchFit as GarchFit,
)
from .estimation.garch.selection import (
    select_garch as select_garch,
)
from .estimation.gmwm.fit import (
    fit_gmwm as fit_gmwm,
)
from .estimation.gmwm.replicates import (
    PooledIdentification as PooledIdentification,
)
from .estimation.gmwm.replicates import (
    fit_gmwm_replicates as fit_gmwm_replicates,
)
from .estimation.identification import (
    Identification as Identification,
)
from .estimation.identify import (
    identify as identify,
)
from .estimation.maximum_likelihood import (
    fit_maximum_likelihood as fit_maximum_likelihood,
)
from .estimation.orthogonal_search.result import (
    FosFit as FosFit,
)
from .estimation.orthogonal_search.search import (
    fast_orthogonal_search as fast_orthogonal_search,
)
from .estimation.residuals.tests import (
    arch_lm_test as arch_lm_test,
)
from .estimation.residuals.tests import (
    ljung_box_test as ljung_box_test,
)
from .estimation.result import (
    MethodIdentification as MethodIdentification,
)
from .evaluation.error_model_comparison import (
    ErrorModelComparison as ErrorModelComparison,
)
from .evaluation.error_model_comparison import (
    compare_error_models as compare_error_models,
)
from .evaluation.outages import (
    OutageEvaluation as OutageEvaluation,
)
from .evaluation.outages import (
    evaluate_outages as evaluate_outages,
)
from .io.kalibr import (
    kalibr_yaml as kalibr_yaml,
)
from .io.kalibr import (
    write_kalibr as write_kalibr,
)
from .io.read import (
    read_gnss as read_gnss,
)
from .io.read import (
    read_imu as read_imu,
)
from .navigation.aiding.barometer import (
    Barometer as Barometer,
)
from .navigation.aiding.general import (
    AidedState as AidedState,
)
from .navigation.aiding.general import (
    AidingState as AidingState,
)
from .navigation.aiding.general import (
    MeasurementSource as MeasurementSource,
)
from .navigation.aiding.gnss import (
    CorrelatedGnss as CorrelatedGnss,
)
from .navigation.aiding.gnss import (
    GnssErrorModel as GnssErrorModel,
)
from .navigation.aiding.heading import (
    Heading as Heading,
)
from .navigation.aiding.magnetometer import (
    Magnetometer as Magnetometer,
)
from .navigation.aiding.options import GnssWeighting as GnssWeighting
from .navigation.aiding.options import (
    MeasurementOptions as MeasurementOptions,
)
from .navigation.error_models.catalogue import (
    ErrorModel as ErrorModel,
)
from .navigation.error_models.sources import (
    error_models as error_models,
)
from .navigation.mechanizations.navigate_array import (
    navigate_array as navigate_array,
)
from .navigation.navigate import (
    navigate as navigate,
)
from .navigation.observability import (
    Observability as Observability,
)
from .navigation.observability import (
    Segment as Segment,
)
from .navigation.observability import (
    observability as observability,
)
from .navigation.preparation.prepare import (
    prepare as prepare,
)
from .navigation.streaming import (
    FilterState as FilterState,
)
from .navigation.streaming import (
    GnssReceiver as GnssReceiver,
)
from .navigation.streaming import (
    NavigationFilter as NavigationFilter,
)
from .navigation.tuning.inflation import (
    NoiseInflation as NoiseInflation,
)
from .navigation.tuning.inflation import (
    NoiseTuning as NoiseTuning,
)
from .navigation.tuning.inflation import (
    tune_noise as tune_noise,
)
from .noise.arma import (
    ARMA as ARMA,
)
from .noise.autoregressive import (
    Autoregressive as Autoregressive,
)
from .noise.base import (
    Process as Process,
)
from .noise.base import (
    ProcessSum as ProcessSum,
)
from .noise.drifts import (
    RandomWalk as RandomWalk,
)
from .noise.drifts import (
    RateRamp as RateRamp,
)
from .noise.drifts import (
    Sinusoid as Sinusoid,
)
from .noise.drifts import (
    TurnOnBias as TurnOnBias,
)
from .noise.gauss_markov import (
    BiasInstability as BiasInstability,
)
from .noise.gauss_markov import (
    GaussMarkov as GaussMarkov,
)
from .noise.noise_model import (
    NoiseModel as NoiseModel,
)
from .noise.white import (
    Quantization as Quantization,
)
from .noise.white import (
    WhiteNoise as WhiteNoise,
)
from .report.write import (
    write_report as write_report,
)
from .screening.screen import (
    Screening as Screening,
)
from .screening.screen import (
    repair as repair,
)
from .screening.screen import (
    screen as screen,
)
from .simulation.gnss import (
    simulate_gnss as simulate_gnss,
)
from .simulation.imu import (
    simulate_imu as simulate_imu,
)
from .simulation.imu import (
    simulate_static as simulate_static,
)
from .simulation.scenario import (
    Scenario as Scenario,
)
from .simulation.scenario import (
    SimulatedDrive as SimulatedDrive,
)
from .simulation.scenario import (
    simulate_drive as simulate_drive,
)

__version__: str

__all__ = [
    "ARMA",
    "AidedState",
    "AidingState",
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
    "FiguresOfMerit",
    "FilterState",
    "FosFit",
    "GarchFit",
    "GaussMarkov",
    "Geometry",
    "GnssErrorModel",
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
    "MeasurementSource",
    "MethodComparison",
    "MethodIdentification",
    "Mounting",
    "NavigationFilter",
    "NavigationSolution",
    "NoiseInflation",
    "NoiseModel",
    "NoiseTuning",
    "Observability",
    "OptimalGeometry",
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
    "figures_of_merit",
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
    "optimize_geometry",
    "power_spectral_density",
    "prepare",
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
    "undo_jumps",
    "wavelet_variance",
    "write_kalibr",
    "write_report",
]
