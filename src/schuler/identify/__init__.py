"""From signals to processes, with standard errors."""

from schuler.identify.characterization import ImuCharacterization, characterize_imu
from schuler.identify.door import METHODS, identify
from schuler.identify.identification import FitDiagnostics, Identification
from schuler.identify.joint import identify_curve
from schuler.identify.replicates import Agreement, compare_runs
from schuler.identify.result import MethodIdentification, MethodResult

__all__ = [
    "METHODS",
    "Agreement",
    "FitDiagnostics",
    "Identification",
    "ImuCharacterization",
    "MethodIdentification",
    "MethodResult",
    "characterize_imu",
    "compare_runs",
    "identify",
    "identify_curve",
]
