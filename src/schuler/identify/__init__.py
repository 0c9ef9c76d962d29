"""From signals to processes, with standard errors."""

from schuler.identify.joint import FitDiagnostics, Identification, identify, identify_curve

__all__ = [
    "FitDiagnostics",
    "Identification",
    "identify",
    "identify_curve",
]
