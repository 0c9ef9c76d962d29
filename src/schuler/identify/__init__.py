"""From signals to processes, with standard errors."""

from schuler.identify.characterization import ImuCharacterization, characterize_imu
from schuler.identify.identification import FitDiagnostics, Identification
from schuler.identify.joint import identify, identify_curve
from schuler.identify.replicates import Agreement, compare_runs

__all__ = [
    "Agreement",
    "FitDiagnostics",
    "Identification",
    "ImuCharacterization",
    "characterize_imu",
    "compare_runs",
    "identify",
    "identify_curve",
]
