"""The public names of schuler, once: where each is defined."""

from .arrays.calibration.calibrate import calibrate_array as calibrate_array
from .arrays.calibration.result import ArrayCalibration as ArrayCalibration
from .arrays.calibration.single_imu import calibrate_imu as calibrate_imu
from .arrays.clocks.jumps import SampleJump as SampleJump
from .arrays.clocks.jumps import find_jumps as find_jumps
from .arrays.clocks.jumps import undo_jumps as undo_jumps
from .arrays.clocks.synchronization import Synchronization as Synchronization
from .arrays.clocks.synchronization import synchronize as synchronize
from .arrays.detection.fault_settings import FaultSettings as FaultSettings
from .arrays.detection.faults import FaultDetection as FaultDetection
from .arrays.detection.faults import detect_faults as detect_faults
from .arrays.detection.healthy_motion import HealthyMotion as HealthyMotion
from .arrays.detection.healthy_motion import LastingFaultSettings as LastingFaultSettings
from .arrays.detection.healthy_motion import learn_healthy_motion as learn_healthy_motion
from .arrays.detection.lasting_faults import LastingFaults as LastingFaults
from .arrays.detection.lasting_faults import detect_lasting_faults as detect_lasting_faults
from .arrays.detection.operating import chi_square_power as chi_square_power
from .arrays.detection.preparation import PreparedDetection as PreparedDetection
from .arrays.detection.preparation import prepare_detection as prepare_detection
from .arrays.detection.thresholds import chi_square_threshold as chi_square_threshold
from .arrays.detection.thresholds import empirical_threshold as empirical_threshold
from .arrays.detection.thresholds import likelihood_statistics as likelihood_statistics
from .arrays.detection.thresholds import threshold_performance as threshold_performance
from .arrays.geometry import Geometry as Geometry
from .arrays.geometry import tetrahedron_mounting as tetrahedron_mounting
from .arrays.merit import FiguresOfMerit as FiguresOfMerit
from .arrays.merit import figures_of_merit as figures_of_merit
from .arrays.merit import parity_matrix as parity_matrix
from .arrays.optimum import OptimalGeometry as OptimalGeometry
from .arrays.optimum import optimize_cone as optimize_cone
from .arrays.optimum import optimize_geometry as optimize_geometry
from .arrays.read import read_array as read_array
from .arrays.redundant import redundant_sensors as redundant_sensors
from .arrays.slow_axes import AxesFollower as AxesFollower
from .arrays.slow_axes import SlowAxes as SlowAxes
from .arrays.slow_axes import follow_axes as follow_axes
from .arrays.synthesis.conditional import conditional_noise as conditional_noise
from .arrays.synthesis.cornered_hat import cornered_hat as cornered_hat
from .arrays.synthesis.rate_from_accelerometers import rate_from_array as rate_from_array
from .arrays.synthesis.synthetic import SyntheticImu as SyntheticImu
from .arrays.synthesis.synthetic import synthesize as synthesize
from .arrays.synthesis.volatility import averaged_volatility as averaged_volatility
from .arrays.tracking import OnlineSettings as OnlineSettings
from .curves.allan import allan_deviation as allan_deviation
from .curves.allan_curve import AllanCurve as AllanCurve
from .curves.autocorrelation import AutocorrelationCurve as AutocorrelationCurve
from .curves.autocorrelation import autocorrelation as autocorrelation
from .curves.spectrum import SpectrumCurve as SpectrumCurve
from .curves.spectrum import power_spectral_density as power_spectral_density
from .curves.wavelet_variance import WaveletVarianceCurve as WaveletVarianceCurve
from .curves.wavelet_variance import wavelet_variance as wavelet_variance
from .data.array import ImuArray as ImuArray
from .data.gnss import GnssRecording as GnssRecording
from .data.imu import ImuRecording as ImuRecording
from .data.imu_calibration import ImuCalibration as ImuCalibration
from .data.mounting import Mounting as Mounting
from .data.track import Track as Track
from .data.trajectory import Innovations as Innovations
from .data.trajectory import NavigationSolution as NavigationSolution
from .data.trajectory import Trajectory as Trajectory
from .denoising.causal import CausalDenoiser as CausalDenoiser
from .denoising.wavelet import Denoised as Denoised
from .denoising.wavelet import denoise as denoise
from .denoising.wavelet import level_for_band as level_for_band
from .earth import ned_from_geodetic as ned_from_geodetic
from .errors import InputError as InputError
from .errors import ModelError as ModelError
from .errors import SchulerError as SchulerError
from .estimation.arma.fit import fit_arma as fit_arma
from .estimation.arma.result import ArmaFit as ArmaFit
from .estimation.arma.selection import select_arma as select_arma
from .estimation.autoregressive.fit import fit_ar as fit_ar
from .estimation.autoregressive.fit import fit_ar_orders as fit_ar_orders
from .estimation.autoregressive.fit import select_ar as select_ar
from .estimation.autoregressive.fit import whiten_lattice as whiten_lattice
from .estimation.autoregressive.result import ArFit as ArFit
from .estimation.characterization import ImuCharacterization as ImuCharacterization
from .estimation.characterization import characterize_imu as characterize_imu
from .estimation.comparison.methods import ImuMethodComparison as ImuMethodComparison
from .estimation.comparison.methods import MethodComparison as MethodComparison
from .estimation.comparison.methods import compare_methods as compare_methods
from .estimation.comparison.methods import compare_methods_imu as compare_methods_imu
from .estimation.garch.arma_garch import ArmaGarchFit as ArmaGarchFit
from .estimation.garch.arma_garch import fit_arma_garch as fit_arma_garch
from .estimation.garch.conditional_variance import ewma_variance as ewma_variance
from .estimation.garch.conditional_variance import garch_log_likelihood as garch_log_likelihood
from .estimation.garch.conditional_variance import simulate_garch as simulate_garch
from .estimation.garch.dynamic_correlation import DccFit as DccFit
from .estimation.garch.dynamic_correlation import fit_dcc as fit_dcc
from .estimation.garch.fit import fit_garch as fit_garch
from .estimation.garch.result import GarchFit as GarchFit
from .estimation.garch.selection import select_garch as select_garch
from .estimation.gauss_markov_correlation import fit_gauss_markov as fit_gauss_markov
from .estimation.gmwm.fit import fit_gmwm as fit_gmwm
from .estimation.gmwm.replicates import PooledIdentification as PooledIdentification
from .estimation.gmwm.replicates import fit_gmwm_replicates as fit_gmwm_replicates
from .estimation.identification import Identification as Identification
from .estimation.identify import identify as identify
from .estimation.maximum_likelihood import fit_maximum_likelihood as fit_maximum_likelihood
from .estimation.orthogonal_search.protocol import search_by_protocol as search_by_protocol
from .estimation.orthogonal_search.result import FosFit as FosFit
from .estimation.orthogonal_search.search import fast_orthogonal_search as fast_orthogonal_search
from .estimation.predictors.comparison import compare_predictors as compare_predictors
from .estimation.predictors.comparison import multi_step_ar as multi_step_ar
from .estimation.predictors.innovation_floor import (
    innovation_variance_of_signal as innovation_variance_of_signal,
)
from .estimation.residuals.tests import arch_lm_test as arch_lm_test
from .estimation.residuals.tests import jarque_bera_test as jarque_bera_test
from .estimation.residuals.tests import ljung_box_test as ljung_box_test
from .estimation.residuals.tests import robust_autocorrelation_band as robust_autocorrelation_band
from .estimation.result import MethodIdentification as MethodIdentification
from .estimation.slopes import slope_method as slope_method
from .estimation.spectrum.fit import identify_spectrum as identify_spectrum
from .evaluation.accuracy import TrajectoryEvaluation as TrajectoryEvaluation
from .evaluation.accuracy import evaluate_trajectory as evaluate_trajectory
from .evaluation.compare import ResultComparison as ResultComparison
from .evaluation.compare import compare_results as compare_results
from .evaluation.error_model_comparison import ErrorModelComparison as ErrorModelComparison
from .evaluation.error_model_comparison import compare_error_models as compare_error_models
from .evaluation.filter_experiment import FilterExperiment as FilterExperiment
from .evaluation.mechanizations import MechanizationComparison as MechanizationComparison
from .evaluation.mechanizations import bias_correlation as bias_correlation
from .evaluation.mechanizations import compare_mechanizations as compare_mechanizations
from .evaluation.mechanizations import trajectory_errors as trajectory_errors
from .evaluation.monte_carlo import MonteCarloResult as MonteCarloResult
from .evaluation.monte_carlo import monte_carlo as monte_carlo
from .evaluation.outage_twin import OutageTwin as OutageTwin
from .evaluation.outage_twin import draw_outage_twin as draw_outage_twin
from .evaluation.outage_twin import outage_twin as outage_twin
from .evaluation.outage_twin import run_outages as run_outages
from .evaluation.outage_windows import OutageStatistics as OutageStatistics
from .evaluation.outage_windows import judge_window as judge_window
from .evaluation.outages import OutageEvaluation as OutageEvaluation
from .evaluation.outages import evaluate_outages as evaluate_outages
from .evaluation.paired import PairedStatistics as PairedStatistics
from .evaluation.paired import paired_statistics as paired_statistics
from .evaluation.position_error import position_error_of_accel_bias as position_error_of_accel_bias
from .evaluation.position_error import position_error_of_gyro_bias as position_error_of_gyro_bias
from .evaluation.position_error import (
    position_sd_of_white_acceleration as position_sd_of_white_acceleration,
)
from .evaluation.position_error import schuler_factor as schuler_factor
from .io.kalibr import kalibr_yaml as kalibr_yaml
from .io.kalibr import write_kalibr as write_kalibr
from .io.read import read_gnss as read_gnss
from .io.read import read_imu as read_imu
from .io.read import read_imus as read_imus
from .io.tracks import read_track as read_track
from .navigation.aiding.barometer import Barometer as Barometer
from .navigation.aiding.barometer import height_of_pressure as height_of_pressure
from .navigation.aiding.general import AidedState as AidedState
from .navigation.aiding.general import AidingState as AidingState
from .navigation.aiding.general import MeasurementSource as MeasurementSource
from .navigation.aiding.gnss import CorrelatedGnss as CorrelatedGnss
from .navigation.aiding.gnss import GnssErrorModel as GnssErrorModel
from .navigation.aiding.heading import Heading as Heading
from .navigation.aiding.magnetometer import Magnetometer as Magnetometer
from .navigation.aiding.magnetometer import earth_field as earth_field
from .navigation.aiding.odometer import Odometer as Odometer
from .navigation.aiding.options import GnssWeighting as GnssWeighting
from .navigation.aiding.options import MeasurementOptions as MeasurementOptions
from .navigation.aiding.parity import array_error_model as array_error_model
from .navigation.engine import gate_thresholds as gate_thresholds
from .navigation.error_models.allan_readings import AllanReading as AllanReading
from .navigation.error_models.autoregressive_fits import autoregressive_fits as autoregressive_fits
from .navigation.error_models.catalogue import ErrorModel as ErrorModel
from .navigation.error_models.catalogue import error_model as error_model
from .navigation.error_models.sensor_denoising import SensorDenoising as SensorDenoising
from .navigation.error_models.sensor_error_model import sensor_error_model as sensor_error_model
from .navigation.error_models.sensor_states import SensorErrorModel as SensorErrorModel
from .navigation.error_models.sources import error_models as error_models
from .navigation.mechanizations.array_preparation import prepare_array as prepare_array
from .navigation.mechanizations.array_stream import ArrayFilter as ArrayFilter
from .navigation.mechanizations.navigate_array import navigate_array as navigate_array
from .navigation.mechanizations.stacked import RigidBody as RigidBody
from .navigation.navigate import navigate as navigate
from .navigation.observability import Observability as Observability
from .navigation.observability import Segment as Segment
from .navigation.observability import observability as observability
from .navigation.preparation.prepare import prepare as prepare
from .navigation.settings import NavigationSettings as NavigationSettings
from .navigation.stepping import InitialState as InitialState
from .navigation.stream.navigation_filter import NavigationFilter as NavigationFilter
from .navigation.stream.state import FilterState as FilterState
from .navigation.stream.state import GnssReceiver as GnssReceiver
from .navigation.tuning.inflation import NoiseInflation as NoiseInflation
from .navigation.tuning.inflation import NoiseTuning as NoiseTuning
from .navigation.tuning.inflation import tune_noise as tune_noise
from .noise.arma import ARMA as ARMA
from .noise.arma_exchange import arma_to_gauss_markov_sum as arma_to_gauss_markov_sum
from .noise.autoregressive import Autoregressive as Autoregressive
from .noise.base import Process as Process
from .noise.base import ProcessSum as ProcessSum
from .noise.drifts import RandomWalk as RandomWalk
from .noise.drifts import RateRamp as RateRamp
from .noise.drifts import Sinusoid as Sinusoid
from .noise.drifts import TurnOnBias as TurnOnBias
from .noise.gauss_markov import BiasInstability as BiasInstability
from .noise.gauss_markov import GaussMarkov as GaussMarkov
from .noise.noise_model import NoiseModel as NoiseModel
from .noise.white import Quantization as Quantization
from .noise.white import WhiteNoise as WhiteNoise
from .report.page import write_report as write_report
from .rotations import dcm_from_euler as dcm_from_euler
from .rotations import dcm_from_rotation_vector as dcm_from_rotation_vector
from .rotations import euler_from_dcm as euler_from_dcm
from .rotations import rotation_vector_from_dcm as rotation_vector_from_dcm
from .rotations import wahba as wahba
from .screening.screen import Screening as Screening
from .screening.screen import clean_segments as clean_segments
from .screening.screen import repair as repair
from .screening.screen import screen as screen
from .simulation.array import simulate_array as simulate_array
from .simulation.gnss import simulate_gnss as simulate_gnss
from .simulation.imu import ideal_imu as ideal_imu
from .simulation.imu import simulate_imu as simulate_imu
from .simulation.imu import simulate_static as simulate_static
from .simulation.motions.profile import Profile as Profile
from .simulation.motions.riding import motorcycle as motorcycle
from .simulation.motions.set_pieces import SetPiece as SetPiece
from .simulation.motions.set_pieces import car_with_set_pieces as car_with_set_pieces
from .simulation.motions.skiing import ski as ski
from .simulation.receivers import GnssGrade as GnssGrade
from .simulation.receivers import simulate_receiver as simulate_receiver
from .simulation.scenario import Scenario as Scenario
from .simulation.scenario import SimulatedDrive as SimulatedDrive
from .simulation.scenario import simulate_drive as simulate_drive
from .simulation.stamps import box_car as box_car
from .simulation.stamps import box_car_gain as box_car_gain

__version__: str

__all__ = [
    "ARMA",
    "AidedState",
    "AidingState",
    "AllanCurve",
    "AllanReading",
    "ArFit",
    "ArmaFit",
    "ArmaGarchFit",
    "ArrayCalibration",
    "ArrayFilter",
    "AutocorrelationCurve",
    "Autoregressive",
    "AxesFollower",
    "Barometer",
    "BiasInstability",
    "CausalDenoiser",
    "CorrelatedGnss",
    "DccFit",
    "Denoised",
    "ErrorModel",
    "ErrorModelComparison",
    "FaultDetection",
    "FaultSettings",
    "FiguresOfMerit",
    "FilterExperiment",
    "FilterState",
    "FosFit",
    "GarchFit",
    "GaussMarkov",
    "Geometry",
    "GnssErrorModel",
    "GnssGrade",
    "GnssReceiver",
    "GnssRecording",
    "GnssWeighting",
    "Heading",
    "HealthyMotion",
    "Identification",
    "ImuArray",
    "ImuCalibration",
    "ImuCharacterization",
    "ImuMethodComparison",
    "ImuRecording",
    "InitialState",
    "Innovations",
    "InputError",
    "LastingFaultSettings",
    "LastingFaults",
    "Magnetometer",
    "MeasurementOptions",
    "MeasurementSource",
    "MechanizationComparison",
    "MethodComparison",
    "MethodIdentification",
    "ModelError",
    "MonteCarloResult",
    "Mounting",
    "NavigationFilter",
    "NavigationSettings",
    "NavigationSolution",
    "NoiseInflation",
    "NoiseModel",
    "NoiseTuning",
    "Observability",
    "Odometer",
    "OnlineSettings",
    "OptimalGeometry",
    "OutageEvaluation",
    "OutageStatistics",
    "OutageTwin",
    "PairedStatistics",
    "PooledIdentification",
    "PreparedDetection",
    "Process",
    "ProcessSum",
    "Profile",
    "Quantization",
    "RandomWalk",
    "RateRamp",
    "ResultComparison",
    "RigidBody",
    "SampleJump",
    "Scenario",
    "SchulerError",
    "Screening",
    "Segment",
    "SensorDenoising",
    "SensorErrorModel",
    "SetPiece",
    "SimulatedDrive",
    "Sinusoid",
    "SlowAxes",
    "SpectrumCurve",
    "Synchronization",
    "SyntheticImu",
    "Track",
    "Trajectory",
    "TrajectoryEvaluation",
    "TurnOnBias",
    "WaveletVarianceCurve",
    "WhiteNoise",
    "allan_deviation",
    "arch_lm_test",
    "arma_to_gauss_markov_sum",
    "array_error_model",
    "autocorrelation",
    "autoregressive_fits",
    "averaged_volatility",
    "bias_correlation",
    "box_car",
    "box_car_gain",
    "calibrate_array",
    "calibrate_imu",
    "car_with_set_pieces",
    "characterize_imu",
    "chi_square_power",
    "chi_square_threshold",
    "clean_segments",
    "compare_error_models",
    "compare_mechanizations",
    "compare_methods",
    "compare_methods_imu",
    "compare_predictors",
    "compare_results",
    "conditional_noise",
    "cornered_hat",
    "dcm_from_euler",
    "dcm_from_rotation_vector",
    "denoise",
    "detect_faults",
    "detect_lasting_faults",
    "draw_outage_twin",
    "earth_field",
    "empirical_threshold",
    "error_model",
    "error_models",
    "euler_from_dcm",
    "evaluate_outages",
    "evaluate_trajectory",
    "ewma_variance",
    "fast_orthogonal_search",
    "figures_of_merit",
    "find_jumps",
    "fit_ar",
    "fit_ar_orders",
    "fit_arma",
    "fit_arma_garch",
    "fit_dcc",
    "fit_garch",
    "fit_gauss_markov",
    "fit_gmwm",
    "fit_gmwm_replicates",
    "fit_maximum_likelihood",
    "follow_axes",
    "garch_log_likelihood",
    "gate_thresholds",
    "height_of_pressure",
    "ideal_imu",
    "identify",
    "identify_spectrum",
    "innovation_variance_of_signal",
    "jarque_bera_test",
    "judge_window",
    "kalibr_yaml",
    "learn_healthy_motion",
    "level_for_band",
    "likelihood_statistics",
    "ljung_box_test",
    "monte_carlo",
    "motorcycle",
    "multi_step_ar",
    "navigate",
    "navigate_array",
    "ned_from_geodetic",
    "observability",
    "optimize_cone",
    "optimize_geometry",
    "outage_twin",
    "paired_statistics",
    "parity_matrix",
    "position_error_of_accel_bias",
    "position_error_of_gyro_bias",
    "position_sd_of_white_acceleration",
    "power_spectral_density",
    "prepare",
    "prepare_array",
    "prepare_detection",
    "rate_from_array",
    "read_array",
    "read_gnss",
    "read_imu",
    "read_imus",
    "read_track",
    "redundant_sensors",
    "repair",
    "robust_autocorrelation_band",
    "rotation_vector_from_dcm",
    "run_outages",
    "schuler_factor",
    "screen",
    "search_by_protocol",
    "select_ar",
    "select_arma",
    "select_garch",
    "sensor_error_model",
    "simulate_array",
    "simulate_drive",
    "simulate_garch",
    "simulate_gnss",
    "simulate_imu",
    "simulate_receiver",
    "simulate_static",
    "ski",
    "slope_method",
    "synchronize",
    "synthesize",
    "tetrahedron_mounting",
    "threshold_performance",
    "trajectory_errors",
    "tune_noise",
    "undo_jumps",
    "wahba",
    "wavelet_variance",
    "whiten_lattice",
    "write_kalibr",
    "write_report",
]
